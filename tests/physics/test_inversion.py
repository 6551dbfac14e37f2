"""Round trips index -> reflectance -> index, at the edges where textbook forms lose their digits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
    ],
)
def test_outside_the_domain(call, says):
    with pytest.raises(ValueError, match=says):
        call()
