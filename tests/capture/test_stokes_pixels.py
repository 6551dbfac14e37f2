"""Stokes vectors of pixels: against the forward model, their own scatter, and other people's formulas."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.capture.stokes_pixels import crossed_pairs, fit_stokes, redundancy
from reflectance_fit.physics import stokes as physics

FOUR = np.radians([90.0, 45.0, 135.0, 0.0])
angles = st.lists(st.floats(0.0, math.pi), min_size=3, max_size=8)
shares = st.floats(0.0, 1.0)


def signals(vector, axes, diattenuation=1.0):
    """By the forward model of the fit."""
    return physics.analyzer_signal(np.append(vector, 0.0), axes, diattenuation)


@given(angles, shares, st.floats(-math.pi, math.pi), st.floats(0.1, 1.0), st.integers(0, 1000))
def test_noiseless_signals_give_their_vector_back_whatever_the_weights(axes, dolp, aolp, d, seed):
    axes = np.array(axes)
    spread = np.sort(np.mod(axes, math.pi))
    if np.min(np.diff(np.append(spread, spread[0] + math.pi))) < 0.05:
        return
    vector = 3.0 * np.array([1.0, dolp * math.cos(2 * aolp), dolp * math.sin(2 * aolp)])
    variance = np.random.default_rng(seed).uniform(0.1, 10.0, len(axes))
    found = fit_stokes(signals(vector, axes, d), variance, axes, d)
    np.testing.assert_allclose(found.stokes, vector, atol=1e-8)
    assert found.chi2 < 1e-12
    assert found.dof == len(axes) - 3


def test_four_axes_alike_in_noise_are_the_textbook_formula():
    """S0 = (I0 + I45 + I90 + I135) / 2, S1 = I0 - I90, S2 = I45 - I135 (Collett 2005), for one variance."""
    values = np.random.default_rng(1).uniform(0.0, 1.0, (4, 5, 7))
    found = fit_stokes(values, 0.01, FOUR)
    i90, i45, i135, i0 = values
    expected = np.stack([values.sum(axis=0) / 2, i0 - i90, i45 - i135], axis=-1)
    np.testing.assert_allclose(found.stokes, expected, atol=1e-12)
    expected = np.broadcast_to(np.diag([1, 2, 2]) * 0.01, (5, 7, 3, 3))
    np.testing.assert_allclose(found.covariance, expected, atol=1e-15)
    # The one redundancy is all that is left to chi squared.
    np.testing.assert_allclose(found.chi2, redundancy(values, 0.01, FOUR).z ** 2)


def test_scatter_is_what_the_covariance_says():
    """200 000 pixels with noise that differs from axis to axis."""
    axes, d = np.radians([10.0, 47.0, 80.0, 112.0, 170.0]), 0.9
    vector = np.array([100.0, 30.0, -42.0])
    sigma = np.array([0.5, 1.0, 2.0, 0.7, 1.3])
    generator = np.random.default_rng(7)
    noise = sigma[:, None] * generator.standard_normal((5, 200_000))
    found = fit_stokes(signals(vector, axes, d)[:, None] + noise, (sigma**2)[:, None], axes, d)
    scatter = np.cov(found.stokes.T)
    np.testing.assert_allclose(scatter, found.covariance[0], rtol=0.02, atol=0.02 * np.abs(scatter).max())
    truth = math.hypot(30, 42) / 100
    assert np.mean(found.dolp) == pytest.approx(truth, abs=2e-4)
    assert np.std((found.dolp - truth) / found.dolp_sigma) == pytest.approx(1.0, abs=0.01)
    direction = 0.5 * math.atan2(-42, 30)
    assert np.std((found.aolp - direction) / found.aolp_sigma) == pytest.approx(1.0, abs=0.01)
    assert np.mean(found.chi2) == pytest.approx(2.0, abs=0.03)


@given(st.floats(0.0, math.pi), shares, st.permutations(range(4)))
def test_both_pairs_see_the_whole_power_in_any_light(aolp, dolp, order):
    axes = FOUR[list(order)]
    vector = np.array([2.0, 2 * dolp * math.cos(2 * aolp), 2 * dolp * math.sin(2 * aolp)])
    found = redundancy(signals(vector, axes), 1e-4, axes)
    assert abs(found.difference) < 1e-12
    assert abs(found.imbalance) < 1e-12


def test_redundancy_has_the_sign_of_the_pair_with_the_horizontal():
    found = redundancy([0.0, 0.5, 0.5, 1.1], [1, 2, 3, 3], FOUR)
    assert found.difference == pytest.approx(0.1)
    assert found.z == pytest.approx(0.1 / 3)
    assert found.imbalance == pytest.approx(0.1)
    assert crossed_pairs(np.radians([100.0, 55.0, 145.0, 190.0])) == ([3, 0], [1, 2])


def test_z_is_standard_normal_for_noise_alone():
    generator = np.random.default_rng(5)
    mean = signals(np.array([400.0, 120.0, 60.0]), FOUR)[:, None]
    counts = generator.poisson(np.broadcast_to(mean, (4, 100_000))).astype(float)
    z = redundancy(counts, mean, FOUR).z
    assert np.std(z) == pytest.approx(1.0, abs=0.01)
    assert abs(np.mean(z)) < 0.01


def test_a_pixel_without_a_signal_is_nan_alone():
    values = np.ones((4, 3))
    values[2, 1] = np.nan
    found = fit_stokes(values, np.where(np.isnan(values), np.nan, 1.0), FOUR)
    assert np.isnan(found.stokes[1]).all()
    assert np.isfinite(found.stokes[[0, 2]]).all()


@pytest.mark.parametrize(
    ("axes", "variance", "message"),
    [
        ([0.0, 1.0], 1.0, "three axes"),
        ([0.0, math.pi, 1.0], 1.0, "three axes"),
        ([0.0, 1.0, 2.0], 0.0, "above 0"),
    ],
)
def test_what_cannot_be_solved_is_refused(axes, variance, message):
    with pytest.raises(ValueError, match=message):
        fit_stokes(np.ones(len(axes)), variance, axes)


@pytest.mark.parametrize("axes", [[0, 45, 90], [0, 45, 90, 130], [0, 0, 90, 90, 45]])
def test_only_crossed_pairs_are_redundant(axes):
    with pytest.raises(ValueError, match="two pairs"):
        redundancy(np.ones(len(axes)), 1.0, np.radians(axes))
