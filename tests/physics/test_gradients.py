"""Derivatives against a complex step, which a wrong sign, a lost factor or a cancellation cannot survive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.physics.gradients import reflectance_gradients

RNG = np.random.default_rng(20250407)
N = 40
UNIFORM = RNG.uniform(0.0, 1.0, N)


def spread(low, high):
    return 10.0 ** RNG.uniform(low, high, N)


BREWSTER, CRITICAL = spread(-1.0, 1.0), spread(-2.0, -0.1)
REGIMES = {
    "dielectric": (UNIFORM, spread(-1.3, 1.3), np.zeros(N)),
    "conductor": (UNIFORM, spread(-1.3, 1.3), spread(-12, 1.3)),
    "grazing, huge index": (spread(-12, -4), spread(0, 8), spread(0, 8)),
    "near normal, small index": (1.0 - spread(-16, -6), spread(-4, 0), spread(-4, 0)),
    "near matched": (UNIFORM, 1.0 + spread(-15, -2), spread(-12, -2)),
    "lossless metal": (UNIFORM, spread(-8, -3), spread(-1, 1)),
    "beyond the critical angle": (RNG.uniform(0.0, 0.5, N), RNG.uniform(0.05, 0.8, N), np.zeros(N)),
    # Here R_p and its derivatives by theta and eta are next to nothing, but not nothing: cos is rounded.
    "Brewster's angle": (np.cos(np.arctan(BREWSTER)), BREWSTER, np.zeros(N)),
    # Here the derivatives are large, and k decides between the two sides.
    "critical angle, weak k": (np.sqrt((1.0 - CRITICAL) * (1.0 + CRITICAL)), CRITICAL, spread(-20, -6)),
}


@pytest.mark.parametrize("regime", REGIMES)
def test_against_a_complex_step(regime, oracle):
    cosine, eta, k = REGIMES[regime]
    ours = np.stack(reflectance_gradients(cosine, eta, k)[:6], axis=-1)
    exact = np.array(
        [[float(x) for x in oracle.stepped(*point)] for point in zip(cosine, eta, k, strict=True)]
    )
    # The absolute term is for what is 0 exactly and rounding in the reference.
    assert ours == pytest.approx(exact, rel=1e-11, abs=1e-45)


@given(cosine=st.floats(0.05, 0.95), eta=st.floats(0.1, 10.0), k=st.floats(0.1, 10.0))
def test_against_differences_of_the_reflectances(cosine, eta, k):
    step, theta = 1e-5, np.arccos(cosine)
    found = reflectance_gradients(cosine, eta, k)._asdict()
    for name, change in {"theta": (step, 0, 0), "eta": (0, step, 0), "k": (0, 0, step)}.items():
        up, down = (
            reflectances(np.cos(theta + sign * change[0]), eta + sign * change[1], k + sign * change[2])
            for sign in (1, -1)
        )
        for power in ("s", "p", "mean"):
            difference = (getattr(up, power) - getattr(down, power)) / (2 * step)
            assert found[f"d_{power}_d_{name}"] == pytest.approx(difference, rel=1e-5, abs=1e-6)


@given(eta=st.floats(0.05, 20.0), k=st.floats(0.0, 20.0))
def test_r_p_is_flat_at_the_pseudo_brewster_angle(eta, k):
    """Two derivations that share nothing: a cubic, and the derivative it is the zero of."""
    theta = brewster_angle(eta, k)
    steps = reflectance_gradients(np.cos(theta + np.array([-1e-6, 0.0, 1e-6])), eta, k).d_p_d_theta
    assert steps[0] < 0 < steps[2]
    assert abs(steps[1]) < 1e-7 * (steps[2] - steps[0])


def test_r0_of_a_dielectric():
    """R = ((eta - 1)/(eta + 1))^2, so dR/d eta = 4 (eta - 1)/(eta + 1)^3 for s and p."""
    eta = np.array([0.2, 0.9, 1.0, 1.5, 4.0])
    found = reflectance_gradients(1.0, eta)
    for derivative in (found.d_s_d_eta, found.d_p_d_eta, found.d_mean_d_eta):
        assert derivative == pytest.approx(4 * (eta - 1) / (eta + 1) ** 3, rel=1e-14, abs=1e-16)
    assert np.all(np.array([found.d_s_d_theta, found.d_p_d_theta]) == 0.0)


def test_k_from_zero_on_does_nothing_below_the_critical_angle_and_absorbs_beyond():
    below = reflectance_gradients(0.9, 0.7)
    assert (below.d_s_d_k, below.d_p_d_k) == (0.0, 0.0)
    beyond = reflectance_gradients(0.3, 0.7)
    step = 1e-7
    one_sided = reflectances(0.3, 0.7, step)
    assert beyond.d_s_d_k == pytest.approx(-one_sided.transmitted_s / step, rel=1e-5)
    assert beyond.d_p_d_k == pytest.approx(-one_sided.transmitted_p / step, rel=1e-5)
    assert beyond.d_s_d_k < 0
    flat = (beyond.d_s_d_theta, beyond.d_p_d_theta, beyond.d_s_d_eta, beyond.d_p_d_eta)
    assert flat == (0.0, 0.0, 0.0, 0.0)


def test_finite_over_the_whole_domain():
    index = np.array([1e-100, 1e-8, 0.5, 1.0, np.nextafter(1.0, 2.0), 1.5, 1e8, 1e100])
    extinction = np.array([0.0, 1e-300, 1e-100, 1e-8, 1.0, 1e100])
    cosine = np.array([0.0, 1e-300, 1e-160, 1e-8, 0.5, 0.6, 0.8, 1.0 - 2.0**-53, 1.0])
    grid = np.meshgrid(cosine, index, extinction)
    assert np.all(np.isfinite(reflectance_gradients(*grid)))


def test_shapes_and_errors():
    assert isinstance(reflectance_gradients(0.5, 1.5).d_s_d_eta, float)
    assert reflectance_gradients([[0.5], [0.6]], [1.5, 1.6, 1.7], 0.1).d_mean_d_k.shape == (2, 3)
    with pytest.raises(ValueError, match="degrees"):
        reflectance_gradients(60.0, 1.5)
    with pytest.raises(ValueError, match="n - ik"):
        reflectance_gradients(0.5, 1.5, -0.1)
