"""The special angles: published values, brute force, and the limits where roots meet.

The cubics behind them have other roots in range (eta = 1.1 has two), so a
solver that takes the wrong one is caught only by looking for the minimum itself.
"""

import time

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.brewster import (
    brewster_angle,
    critical_angle,
    critical_glancing_angle,
    principal_angle,
    principal_angles,
    second_brewster_angle,
)
from reflectance_fit.physics.ellipsometry import amplitude_ratio
from reflectance_fit.physics.fresnel import reflectances

ANGLES = (brewster_angle, second_brewster_angle, principal_angle)


@pytest.mark.parametrize(
    ("eta", "k", "expected_deg"),
    [
        pytest.param(0.183, 3.43, (72.63, 74.73, 74.86), id="gold 633 nm"),
        pytest.param(1.515, 0.0, (56.57, 56.57, 56.57), id="BK7"),
        # k chosen to give the first of the three published angles; the other two then check.
        pytest.param(1.4715, 1.8129, (64.94, 68.25, 68.68), id="gold 450 nm"),
        pytest.param(0.4245, 2.4582, (65.77, 70.05, 70.48), id="gold 550 nm"),
        pytest.param(0.1835, 3.6015, (73.50, 75.36, 75.47), id="gold 650 nm"),
        pytest.param(0.9657, 6.4268, (81.06, 81.44, 81.44), id="aluminium 550 nm"),
        pytest.param(3.0415, 4.1971, (78.83, 79.31, 79.33), id="chromium 550 nm"),
    ],
)
def test_published_values(eta, k, expected_deg):
    assert np.degrees([f(eta, k) for f in ANGLES]) == pytest.approx(expected_deg, abs=0.0105)


def smallest_principal_angle(eta, k=0.0):
    return principal_angles(eta, k)[..., 0]


@pytest.mark.parametrize("angle", [brewster_angle, second_brewster_angle, smallest_principal_angle])
@given(eta=st.floats(1e-3, 1e3))
def test_transparent_media_have_one_brewster_angle(angle, eta):
    assert angle(eta) == pytest.approx(np.arctan(eta), rel=1e-15)
    assert angle(1.0) == pytest.approx(np.pi / 4, rel=1e-15)


def indices_to_search():
    rng = np.random.default_rng(11)
    for exponents_eta, exponents_k in [
        ((-8, 8), (-300, -8)), ((-8, 8), (-8, 8)), ((-1.3, 1), (-4, 1)), ((-1, -0.35), (-5, -1)),
    ]:  # fmt: skip
        for _ in range(4):
            yield 10.0 ** rng.uniform(*exponents_eta), 10.0 ** rng.uniform(*exponents_k)
    yield from [
        (1e-8, 0.0),
        (1e8, 0.0),
        (1e-8, 1e-300),
        (1e8, 1e8),
        (1e-8, 1e8),
        (1.0, 1e-9),
        (1 - 1e-12, 1e-14),
    ]


def test_against_a_search_in_70_digits(oracle):
    for eta, k in indices_to_search():
        search = oracle.Search(eta, k)
        principal = [float(x) for x in search.zeros(oracle.real_ratio)]
        padded = principal + [np.nan] * (3 - len(principal))
        expected = [float(search.minimum(f)) for f in (oracle.power_p, oracle.power_ratio)]
        found = [brewster_angle(eta, k), second_brewster_angle(eta, k)]
        assert found == pytest.approx(expected, rel=0, abs=1e-14), (eta, k)
        assert principal_angles(eta, k) == pytest.approx(padded, rel=0, abs=1e-14, nan_ok=True), (eta, k)


def test_over_the_whole_domain():
    index, extinction = np.meshgrid(
        [1e-100, 1e-30, 0.3, 1.0, 1e30, 1e100], [0.0, 1e-300, 1e-30, 1.0, 1e30, 1e100]
    )
    for angle in ANGLES:
        assert np.all((angle(index, extinction) > 0.0) & (angle(index, extinction) <= np.pi / 2))


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("eta", [0.6, 0.9, 1.0, 1.1, 1.5, 4.0])
def test_a_tiny_k_moves_nothing(angle, eta):
    assert angle(eta, [1e-200, 1e-12, 1e-9]) == pytest.approx(np.full(3, np.arctan(eta)), abs=1e-12)


def random_indices(n, seed=5):
    rng = np.random.default_rng(seed)
    return 10.0 ** rng.uniform(-1.3, 1.3, n), 10.0 ** rng.uniform(-4, 1.3, n)


def brute_force_minimum(quantity):
    """Smallest value on a dense grid of theta, sharpened by a second grid."""
    theta = np.linspace(1e-4, np.pi / 2 - 1e-4, 8001)
    for _ in range(2):
        best = np.argmin(quantity(theta))
        step = theta[1] - theta[0]
        theta = np.linspace(max(theta[best] - step, 1e-6), min(theta[best] + step, np.pi / 2 - 1e-9), 401)
    return theta[np.argmin(quantity(theta))], quantity(theta).min()


@pytest.mark.parametrize(
    ("angle", "quantity"),
    [
        (brewster_angle, lambda r: r.p),
        (second_brewster_angle, lambda r: r.p / r.s),
    ],
)
def test_the_angle_is_where_brute_force_finds_the_minimum(angle, quantity):
    for eta, k in [(1.1, 1e-3), (1.1, 0.05), (1.2, 0.3), *zip(*random_indices(300), strict=True)]:
        at, least = brute_force_minimum(lambda t, eta=eta, k=k: quantity(reflectances(np.cos(t), eta, k)))
        found = angle(eta, k)
        assert quantity(reflectances(np.cos(found), eta, k)) <= least * (1 + 1e-9) + 1e-15, (eta, k)
        # The bottom of a parabola: a value equal to 1e-15 leaves the angle open to about 1e-6.
        assert found == pytest.approx(at, abs=3e-6), (eta, k)


def test_delta_is_90_degrees_at_the_principal_angle_and_never_beyond():
    for eta, k in zip(*random_indices(300, seed=6), strict=True):
        found = principal_angle(eta, k)
        rho = amplitude_ratio(np.cos(found), eta, k)
        assert abs(rho.real) < 1e-9 * abs(rho), (eta, k)
        beyond = np.cos(np.linspace(found, np.pi / 2, 500)[1:])
        assert np.all(amplitude_ratio(beyond, eta, k).real > 0.0), (eta, k)


@pytest.mark.parametrize("eta", [1e-8, 1e-4, 0.01, 0.3])
@pytest.mark.parametrize("k", [1e-9, 1e-5])
def test_principal_angle_of_a_small_index(eta, k):
    """1 - y keeps no digits there; cot^2 of the angle is 1 in the limit eps -> 0."""
    rho = amplitude_ratio(np.cos(principal_angle(eta, k)), eta, k)
    assert abs(rho.real) < 1e-9 * abs(rho)


def test_azzam_bound_between_the_two_pseudo_brewster_angles():
    """Azzam (2010): at most 15.701 degrees, reached at a pseudo-Brewster angle of 28.195 degrees."""
    eta, k = (x.ravel() for x in np.meshgrid(np.geomspace(1e-3, 30, 300), np.geomspace(1e-3, 30, 300)))
    first, second = np.degrees(brewster_angle(eta, k)), np.degrees(second_brewster_angle(eta, k))
    gap = second - first
    assert gap.min() > -1e-9
    assert 15.6 < gap.max() <= 15.701
    assert first[np.argmax(gap)] == pytest.approx(28.195, abs=0.5)


@given(eta=st.floats(0.05, 20.0), k=st.floats(0.0, 20.0))
def test_the_three_angles_are_in_order(eta, k):
    first, second, third = (f(eta, k) for f in ANGLES)
    assert first <= second + 1e-12
    assert second <= third + 1e-12
    assert first <= np.arctan(abs(eta + 1j * k)) + 1e-12


def test_critical_glancing_angle_keeps_its_digits():
    delta = np.array([1e-30, 1e-16, 7.58e-6, 0.1, 0.999])
    with mpmath.workdps(50):
        exact = [float(mpmath.acos(1 - mpmath.mpf(float(d)))) for d in delta]
    assert critical_glancing_angle(delta) == pytest.approx(exact, rel=5e-16)
    assert critical_glancing_angle(0.25) == pytest.approx(np.pi / 2 - critical_angle(0.75), rel=1e-15)
    assert np.all(np.isnan(critical_glancing_angle([0.0, -0.5])))
    with pytest.raises(ValueError, match="1 - eta"):
        critical_glancing_angle([0.5, 1.0])
    with pytest.raises(ValueError, match="1 - eta"):
        critical_glancing_angle(np.nan)


def test_critical_angle_exists_only_from_the_denser_side():
    angles = critical_angle([0.5, 1.0, 1.5])
    assert angles[0] == pytest.approx(np.pi / 6)
    assert np.all(np.isnan(angles[1:]))


@pytest.mark.parametrize("angle", ANGLES)
def test_a_hundred_thousand_at_once(angle):
    eta, k = random_indices(100_000)
    start = time.perf_counter()
    angles = angle(eta, k)
    assert time.perf_counter() - start < 5.0  # measured 0.01 to 0.5 s; a loop over elements takes minutes
    assert np.all((angles > 0) & (angles < np.pi / 2))
    assert isinstance(angle(1.5, 0.1), float)


@pytest.mark.parametrize("angle", ANGLES)
def test_outside_the_domain(angle):
    with pytest.raises(ValueError, match="eta"):
        angle(np.nan)
    with pytest.raises(ValueError, match="n - ik"):
        angle(1.5, -0.1)
