"""Round trips index -> reflectance -> index, at the edges where textbook forms lose their digits."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.brewster import brewster_angle, principal_angle
from reflectance_fit.physics.ellipsometry import amplitude_ratio
from reflectance_fit.physics.fresnel import r0
from reflectance_fit.physics.inversion import (
    eta_from_r0,
    eta_from_r0_given_k,
    eta_minus_one_from_r0,
    index_from_rho,
    k_from_r0_given_eta,
)

ETA = st.floats(0.05, 20.0)
K = st.floats(0.0, 10.0)


@pytest.mark.parametrize("exponent", [-30, -16, -8, -4])
def test_eta_minus_one_keeps_its_digits_for_a_tiny_reflectance(exponent):
    s = 10.0 ** (exponent // 2)
    assert eta_minus_one_from_r0(10.0**exponent) == pytest.approx(2 * s / (1 - s), rel=4e-16, abs=0)


def test_eta_keeps_its_digits_near_total_reflection():
    """1 - R0 = 2^-40 exactly, so eta = (1 + s)^2 2^40 to rounding; (1 + s) / (1 - s) has 4 digits left."""
    one_less = 2.0**-40
    assert eta_from_r0(1 - one_less) == pytest.approx((1 + np.sqrt(1 - one_less)) ** 2 * 2.0**40, rel=1e-15)
    assert eta_minus_one_from_r0(1 - one_less) == pytest.approx(eta_from_r0(1 - one_less) - 1, rel=1e-15)


def ulps(found, exact):
    """Error in units of the last place of the exact value."""
    return abs(float((mpmath.mpf(float(found)) - exact) / mpmath.mpf(float(np.spacing(abs(float(exact)))))))


@given(r0=st.floats(1e-30, 1 - 1e-15) | st.floats(-30, 0).map(lambda e: min(10.0**e, 1 - 1e-15)))
def test_eta_is_right_to_an_ulp(r0):
    """The nearest float64, but for the rare tie: 0.51 leaves no room for a lost digit."""
    with mpmath.workdps(60):
        s = mpmath.sqrt(mpmath.mpf(r0))
        assert ulps(eta_from_r0(r0), (1 + s) / (1 - s)) <= 0.51
        assert ulps(eta_minus_one_from_r0(r0), 2 * s / (1 - s)) <= 0.51
        assert ulps(1 / eta_from_r0(r0), (1 - s) / (1 + s)) <= 2
        assert ulps(-eta_minus_one_from_r0(r0) / eta_from_r0(r0), -2 * s / (1 + s)) <= 2


@given(one_less=st.floats(-15, -0.3))
def test_eta_is_right_to_an_ulp_near_total_reflection(one_less):
    test_eta_is_right_to_an_ulp.hypothesis.inner_test(1 - 10.0**one_less)


def test_nothing_and_next_to_nothing_reflected():
    assert eta_from_r0(0.0) == 1.0
    assert eta_minus_one_from_r0([0.0, 5e-324, 1e-300]) == pytest.approx(
        [0.0, 2 * np.sqrt(5e-324), 2e-150], rel=1e-15
    )


@given(k=st.floats(1e-6, 1e2), distance=st.floats(-15, -0.01))
def test_eta_given_k_is_right_to_an_ulp_down_to_the_top_of_the_circle(k, distance):
    top = (k / (1 + np.hypot(1, k))) ** 2
    r0 = top + (1 - top) * top * 10.0**distance
    found = eta_from_r0_given_k(r0, k)
    with mpmath.workdps(60):
        r, x = mpmath.mpf(float(r0)), mpmath.mpf(k)
        square = 4 * r - (x * (1 - r)) ** 2
        if square < 1e-15 * r:
            return
        high = (1 + r + mpmath.sqrt(square)) / (1 - r)
        assert ulps(found.high, high) <= 0.51
        assert ulps(found.low, (1 + x**2) / high) <= 0.51


@given(eta=st.floats(1e-3, 1e3), distance=st.floats(-15, -0.01))
def test_k_given_eta_is_right_to_an_ulp_down_to_the_transparent_medium(eta, distance):
    least = ((eta - 1) / (eta + 1)) ** 2
    r0 = least + (1 - least) * least * 10.0**distance
    with mpmath.workdps(60):
        r, x = mpmath.mpf(float(r0)), mpmath.mpf(eta)
        largest = r * (1 + x) ** 2
        square = largest - (1 - x) ** 2
        if square > 1e-15 * largest:
            # Pairs leave a few 2^-106 of the terms, of which the difference is ever less.
            lost = float(2 * mpmath.mpf(2) ** -53 * largest / square)
            found = ulps(k_from_r0_given_eta(r0, eta).k, mpmath.sqrt(square / (1 - r)))
            assert found <= 0.51 + lost


@given(eta=st.floats(1.0, 1e4))
def test_eta_round_trip(eta):
    assert eta_from_r0(r0(eta)) == pytest.approx(eta, rel=1e-11)
    assert 1 + eta_minus_one_from_r0(r0(eta)) == pytest.approx(eta, rel=1e-11)


@given(eta=ETA, k=K)
def test_one_of_the_two_roots_is_the_index(eta, k):
    low, high, valid = eta_from_r0_given_k(r0(eta, k), k)
    # d(eta)/d(R0) diverges at the top of the circle, so compare what the roots reflect.
    assert valid
    assert low <= high
    assert r0([low, high], k) == pytest.approx(np.full(2, r0(eta, k)), rel=1e-9)
    if abs(eta**2 - 1 - k**2) > 1e-2 * (1 + k**2):
        assert min(abs(low - eta), abs(high - eta)) < 1e-9 * max(eta, 1 / eta) * (1 + k**2)


@given(eta=ETA, k=K)
def test_k_round_trip(eta, k):
    found, valid = k_from_r0_given_eta(r0(eta, k), eta)
    assert valid
    assert found**2 == pytest.approx(k**2, abs=1e-10 * (1 + eta + k) ** 2)


def test_what_no_index_can_do_is_marked():
    eta = k_from_r0_given_eta(0.04, [1.4, 1.5, 1.6, 0.7, 0.6])
    assert list(eta.valid) == [True, True, False, True, False]
    assert np.isnan(eta.k[2])
    roots = eta_from_r0_given_k(0.04, [0.0, 0.4, 0.42])  # the top of the circle is at k = 0.41667
    assert list(roots.valid) == [True, True, False]
    assert roots.low[0] == pytest.approx(1 / 1.5)
    assert roots.high[0] == pytest.approx(1.5)
    assert np.isnan(roots.high[2])


@given(theta=st.floats(0.05, 1.5), eta=st.floats(0.1, 10.0), k=K)
def test_rho_round_trip(theta, eta, k):
    found_eta, found_k = index_from_rho(amplitude_ratio(np.cos(theta), eta, k), theta)
    scale = 1e-9 * (1 + 1 / eta) * (1 + eta + k) ** 2
    assert abs((found_eta + 1j * found_k) ** 2 - (eta + 1j * k) ** 2) < scale * 10


RHO_REGIMES = {
    "ordinary": (lambda eta, k, u: 0.01 + 1.55 * u, (-1.3, 1.3), (-6, 1.3)),
    "near normal incidence": (lambda eta, k, u: 10.0 ** (-7 + 5 * u), (-1.3, 1.3), (-6, 1.3)),
    "near grazing incidence": (lambda eta, k, u: np.pi / 2 - 10.0 ** (-14 + 12 * u), (-1.3, 1.3), (-6, 1.3)),
    "at the pseudo-Brewster angle": (lambda eta, k, u: brewster_angle(eta, k), (-1.3, 1.3), (-6, 1.3)),
    "at the principal angle": (lambda eta, k, u: principal_angle(eta, k), (-1.3, 1.3), (-6, 1.3)),
    "weak k": (lambda eta, k, u: 0.01 + 1.55 * u, (-1.3, 1.3), (-200, -10)),
    "epsilon near zero": (lambda eta, k, u: 0.01 + 1.55 * u, (-8, -2), (-8, -2)),
    "lossless metal": (lambda eta, k, u: 0.01 + 1.55 * u, (-12, -3), (-2, 1)),
}


def exact_index(real, imag, theta):
    rho = mpmath.mpc(real, imag)
    return mpmath.sin(theta) * mpmath.sqrt(1 + (mpmath.tan(theta) * (1 - rho) / (1 + rho)) ** 2)


@pytest.mark.parametrize("regime", RHO_REGIMES)
def test_index_from_rho_is_as_good_as_its_arguments(regime):
    """No further from the exact answer than a few roundings of rho and theta move it, eta and k each."""
    angle, exponents_eta, exponents_k = RHO_REGIMES[regime]
    rng = np.random.default_rng(7)
    for _ in range(60):
        eta, k = 10.0 ** rng.uniform(*exponents_eta), 10.0 ** rng.uniform(*exponents_k)
        theta = float(angle(eta, k, rng.uniform()))
        rho = amplitude_ratio(np.cos(theta), eta, k)
        if rho == -1.0:
            continue
        found = index_from_rho(rho, theta)
        with mpmath.workdps(60):
            given = [mpmath.mpf(float(x)) for x in (rho.real, rho.imag, theta)]
            index, step = exact_index(*given), mpmath.mpf(10) ** -25
            moved = [
                (exact_index(*(x * (1 + step * (i == j)) for j, x in enumerate(given))) - index) / step
                for i in range(3)
            ]
            for ours, part in zip(found, (lambda z: z.real, lambda z: z.imag), strict=True):
                moves = abs(part(index)) + sum(abs(part(move)) for move in moved)
                assert abs(mpmath.mpf(float(ours)) - part(index)) <= 5 * 2.0**-53 * moves, (eta, k, theta)


def test_rho_and_its_inverse_belong_to_one_index():
    rho = amplitude_ratio(0.5, 0.183, 3.43)
    assert index_from_rho(1 / rho, np.pi / 3) == pytest.approx((0.183, 3.43), rel=1e-12)


def test_rho_of_the_other_sense_gives_a_negative_k():
    rho = amplitude_ratio(0.5, 0.183, 3.43)
    assert index_from_rho(rho, np.pi / 3) == pytest.approx((0.183, 3.43))
    assert index_from_rho(np.conj(rho), np.pi / 3) == pytest.approx((0.183, -3.43))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: eta_from_r0(4.0), "percent"),
        (lambda: eta_from_r0(np.nan), "r0"),
        (lambda: eta_minus_one_from_r0(1.0), "r0"),
        (lambda: eta_from_r0_given_k(0.04, -1.0), "k must"),
        (lambda: k_from_r0_given_eta(0.04, 0.0), "eta"),
        (lambda: index_from_rho(-0.5, 60.0), "degrees"),
        (lambda: index_from_rho(-0.5, 0.0), "alike"),
        (lambda: index_from_rho(-1.0, 0.5), "normal"),
        (lambda: index_from_rho(np.inf, 0.5), "finite"),
        (lambda: index_from_rho(np.nan, 0.5), "finite"),
        (lambda: index_from_rho(1e200, 0.5), "finite"),
    ],
)
def test_outside_the_domain(call, says):
    with pytest.raises(ValueError, match=says):
        call()
