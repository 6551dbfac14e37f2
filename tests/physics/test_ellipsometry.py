"""The sign of i, which no reflectance can show, and round trips that a doubled quadrant correction breaks."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.brewster import brewster_angle, principal_angle
from reflectance_fit.physics.ellipsometry import (
    amplitude_ratio,
    psi_delta,
    psi_delta_from_rho,
    rho_from_psi_delta,
)
from reflectance_fit.physics.fresnel import amplitudes


def test_gold_at_60_degrees_pins_the_sign_of_i():
    _, delta = psi_delta(0.5, 0.183, 3.43)
    assert np.degrees(delta) == pytest.approx(134.129, abs=5e-4)


def test_glass_has_delta_180_below_brewster_and_0_above():
    psi, delta = psi_delta(np.cos(np.radians([1.0, 30.0, 56.0, 57.0, 80.0, 89.0])), 1.5)
    assert list(np.degrees(delta)) == [180, 180, 180, 0, 0, 0]
    assert np.all((psi > 0) & (psi < np.pi / 4))


@given(psi=st.floats(0.001, 1.57), delta=st.floats(0.0, 6.283))
def test_angles_survive_the_round_trip(psi, delta):
    back = psi_delta_from_rho(rho_from_psi_delta(psi, delta))
    assert back[0] == pytest.approx(psi, abs=1e-13)
    assert back[1] == pytest.approx(delta, abs=1e-13)


@given(modulus=st.floats(1e-6, 1e6), phase=st.floats(-np.pi, np.pi))
def test_rho_survives_the_round_trip(modulus, phase):
    rho = modulus * np.exp(1j * phase)
    psi, delta = psi_delta_from_rho(rho)
    assert 0 <= delta < 2 * np.pi
    assert rho_from_psi_delta(psi, delta) == pytest.approx(rho, rel=1e-9)


@pytest.mark.parametrize(
    "rho", [1.0 + 1e-17j, complex(1.0, 0.0), complex(1.0, -0.0), 0j, complex(-0.0, -0.0)]
)
def test_delta_of_a_real_positive_ratio_is_0_and_not_360(rho):
    assert psi_delta_from_rho(rho)[1] == pytest.approx(0.0, abs=1e-16)


@given(theta=st.floats(0.0, np.pi / 2), eta=st.floats(0.05, 20.0), k=st.floats(0.0, 20.0))
def test_the_ratio_is_that_of_the_amplitudes(theta, eta, k):
    r_s, r_p = amplitudes(np.cos(theta), eta, k)
    assert amplitude_ratio(np.cos(theta), eta, k) * r_s == pytest.approx(r_p, abs=1e-13)


N = 60
RNG = np.random.default_rng(20250318)
COSINE, ETA, K = RNG.uniform(0, 1, N), 10.0 ** RNG.uniform(-1.3, 1.3, N), 10.0 ** RNG.uniform(-6, 1.3, N)
SMALL, TINY = 10.0 ** RNG.uniform(-3, -0.01, N), 10.0 ** RNG.uniform(-20, -8, N)
REGIMES = {
    "ordinary": (COSINE, ETA, K),
    "weak k": (COSINE, ETA, 10.0 ** RNG.uniform(-100, -6, N)),
    "Brewster": (np.cos(brewster_angle(ETA)), ETA, np.zeros(N)),
    "principal": (np.cos(principal_angle(ETA, K) * (1 + 1e-9)), ETA, K),
    "critical": (np.sqrt((1 - SMALL) * (1 + SMALL)), SMALL, np.zeros(N)),
    "critical, weak k": (np.sqrt((1 - SMALL) * (1 + SMALL)), SMALL, TINY),
    "near normal": (1 - 10.0 ** RNG.uniform(-16, -2, N), ETA, K),
    "near grazing": (10.0 ** RNG.uniform(-60, -2, N), ETA, K),
    "near matched": (COSINE, 1 + 10.0 ** RNG.uniform(-15, -2, N), TINY),
    "extremes": (COSINE, 10.0 ** RNG.uniform(-99, 99, N), 10.0 ** RNG.uniform(-99, 99, N)),
}


@pytest.mark.parametrize("regime", REGIMES)
def test_each_part_of_the_ratio_keeps_its_digits(regime):
    c, eta, k = REGIMES[regime]
    rho = amplitude_ratio(c, eta, k)
    with mpmath.workdps(450):
        for i in range(N):
            cosine, index = mpmath.mpf(float(c[i])), mpmath.mpc(float(eta[i]), float(k[i]))
            w = mpmath.sqrt(index**2 - 1 + cosine**2)
            r_s, r_p = (cosine - w) / (cosine + w), (index**2 * cosine - w) / (index**2 * cosine + w)
            exact = r_p / r_s
            # Of a real part the reference itself leaves 1e-440 where it is 0.
            assert rho[i].real == pytest.approx(float(exact.real), rel=4e-15, abs=1e-300), (
                c[i],
                eta[i],
                k[i],
            )
            assert rho[i].imag == pytest.approx(float(exact.imag), rel=4e-15, abs=1e-300), (
                c[i],
                eta[i],
                k[i],
            )


def test_the_ratio_has_a_limit_at_an_index_match():
    assert amplitude_ratio([1.0, np.sqrt(0.5), 0.0], 1.0) == pytest.approx([-1.0, 0.0, 1.0], abs=1e-15)


def test_absorption_puts_delta_between_0_and_180():
    _, delta = psi_delta(np.cos(np.linspace(0.01, 1.55, 50)), 1.5, 0.3)
    assert np.all(np.diff(delta) < 0)
    assert np.all((delta > 0) & (delta < np.pi))


def test_degrees_and_nan_are_refused():
    with pytest.raises(ValueError, match="degrees"):
        rho_from_psi_delta(45.0, 1.0)
    with pytest.raises(ValueError, match="NaN"):
        psi_delta_from_rho(complex(np.nan, 0))
