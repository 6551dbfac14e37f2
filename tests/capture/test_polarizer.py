"""An analyzer measured on a polarized lamp: exact series, honest sigmas, and what cannot be told."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.capture.polarizer import PolarizerFit, combine, fit_polarizer
from reflectance_fit.physics.mueller import polarizer

SERIES = np.radians(np.arange(0.0, 180.0, 15.0))


def malus(axes, d, error=0.0, source=0.0, source_d=1.0):
    """Power behind two polarizers, by their Mueller matrices, per unit of power of a lamp of any strength."""
    beam = polarizer(source, source_d) @ np.array([1.0, 0.0, 0.0, 0.0])
    return np.array([(polarizer(a + error, d) @ beam)[0] for a in axes])


@given(st.floats(0.1, 1.0), st.floats(-1.5, 1.5), st.floats(0.0, 3.0), st.floats(0.3, 1.0))
def test_a_series_gives_diattenuation_and_axis_back(d, error, source, source_d):
    found = fit_polarizer(malus(SERIES, d, error, source, source_d), 1e-6, SERIES - source, source_d)
    assert found.diattenuation == pytest.approx(d, abs=1e-9)
    assert math.remainder(found.axis_error - error, math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_source_of_unknown_direction_shows_as_minus_the_axis_error():
    found = fit_polarizer(malus(SERIES, 0.99, source=0.4), 1e-6, SERIES)
    assert found.axis_error == pytest.approx(-0.4)
    assert found.diattenuation == pytest.approx(0.99)


def test_a_perfect_source_is_not_assumed_away():
    """Two alike polarizers of D show D^2; stating the source's D gives D."""
    signal = malus(SERIES, 0.98, source_d=0.98)
    assert fit_polarizer(signal, 1e-6, SERIES).diattenuation == pytest.approx(0.98**2)
    assert fit_polarizer(signal, 1e-6, SERIES, 0.98).diattenuation == pytest.approx(0.98)


@pytest.mark.parametrize("extinction", [30.0, 400.0])
def test_sigma_is_the_scatter_and_crossed_frames_decide(extinction):
    d = (extinction - 1) / (extinction + 1)
    mean = 1e6 * malus(SERIES, d, error=0.01)
    generator = np.random.default_rng(3)
    found = [fit_polarizer(generator.poisson(mean), mean, SERIES) for _ in range(300)]
    ratio = np.array([f.diattenuation for f in found])
    # Half of the series scatter less than expected, which does not narrow sigma: the median is not widened.
    assert np.std(ratio) == pytest.approx(np.median([f.diattenuation_sigma for f in found]), rel=0.12)
    assert abs(np.mean(ratio) - d) < 4 * np.std(ratio) / math.sqrt(300)
    axis = np.array([f.axis_error for f in found])
    assert np.std(axis) == pytest.approx(np.median([f.axis_error_sigma for f in found]), rel=0.12)
    assert all(f.is_resolved for f in found)
    assert np.median([f.extinction_ratio for f in found]) == pytest.approx(extinction, rel=0.05)


def test_leakage_below_the_noise_is_not_resolved():
    mean = 2000 * malus(SERIES, 0.9998)
    found = fit_polarizer(np.random.default_rng(1).poisson(mean), mean + 1, SERIES)
    assert not found.is_resolved
    assert found.diattenuation <= 1.0


def test_axes_set_by_hand_widen_sigma():
    """A degree of error a frame: the scatter is far beyond shot noise, and sigma says so."""
    generator = np.random.default_rng(4)
    pulls = []
    for _ in range(200):
        axes = SERIES + np.radians(generator.normal(0.0, 1.0, len(SERIES)))
        signal = 1e6 * malus(axes, 0.95)
        found = fit_polarizer(signal, np.maximum(signal, 1.0), SERIES)
        pulls.append(found.axis_error / found.axis_error_sigma)
    assert 0.7 < np.std(pulls) < 1.5


def test_a_crossed_pair():
    found = fit_polarizer([999.0, 1.0], [9.0, 0.01], np.radians([20, 110]))
    assert found.diattenuation == pytest.approx(0.998)
    assert found.diattenuation_sigma == pytest.approx(2 * math.hypot(1 * 3, 999 * 0.1) / 1000**2)
    assert math.isnan(found.axis_error)
    assert found.extinction_ratio == pytest.approx(999.0)
    # Which of the two comes first does not matter, and repeats count.
    again = fit_polarizer([1.0, 999.0, 1.0, 999.0], [0.01, 9.0] * 2, np.radians([110, 20, 290, -160]))
    assert again.diattenuation == pytest.approx(0.998)
    assert again.diattenuation_sigma == pytest.approx(found.diattenuation_sigma / math.sqrt(2))


def test_several_are_combined_by_weight_and_across_the_wrap():
    one = PolarizerFit(0.98, 0.001, math.radians(89.0), 0.01)
    other = PolarizerFit(0.982, 0.002, math.radians(-89.0), 0.01)
    found = combine([one, other])
    assert found.diattenuation == pytest.approx((4 * 0.98 + 0.982) / 5)
    assert abs(found.axis_error) == pytest.approx(math.radians(90.0))
    # 2 degrees apart with 0.57 each: reduced chi squared 6.1 / 2.
    assert found.axis_error_sigma == pytest.approx(
        0.01 / math.sqrt(2) * math.radians(2) / 0.01 / math.sqrt(2)
    )
    assert combine([one]) == one


@pytest.mark.parametrize(
    ("angles", "dolp", "message"),
    [([0, 45], 1.0, "three"), ([0, 180, 10], 1.0, "three"), ([0, 45, 90], 0.0, "degree of polarization")],
)
def test_what_cannot_be_told_is_refused(angles, dolp, message):
    with pytest.raises(ValueError, match=message):
        fit_polarizer(np.ones(len(angles)), 1.0, np.radians(angles), dolp)
