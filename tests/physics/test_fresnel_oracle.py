"""Against a slow, literal evaluation of the textbook formulas in 60 digits, at the exact float inputs.

The invariants of test_fresnel_invariants.py hold for many wrong functions; this one does not.  How many digits
each rung keeps is the subject of test_fresnel_rungs.py.
"""

import math

import mpmath
import numpy as np
import pytest

from reflectance_fit.physics.fresnel import amplitudes, r0, reflectances
from reflectance_fit.physics.snell import refraction_angle

RNG = np.random.default_rng(20240611)
N = 150
UNIFORM = RNG.uniform(0.02, 1.0, N)
GRAZING = 10.0 ** RNG.uniform(-15, -2, N)
REGIMES = {
    "glass": (UNIFORM, RNG.uniform(1.1, 4.0, N), np.zeros(N)),
    "metal": (UNIFORM, RNG.uniform(0.05, 4.0, N), RNG.uniform(0.5, 9.0, N)),
    "weakly absorbing": (UNIFORM, RNG.uniform(1.1, 4.0, N), 10.0 ** RNG.uniform(-12, -1, N)),
    "near index match": (UNIFORM, 1 + 10.0 ** RNG.uniform(-14, -3, N), np.zeros(N)),
    "near index match, absorbing": (
        UNIFORM,
        1 + 10.0 ** RNG.uniform(-14, -3, N),
        10.0 ** RNG.uniform(-14, -3, N),
    ),
    "grazing": (GRAZING, RNG.uniform(1.1, 4.0, N), 10.0 ** RNG.uniform(-12, 1, N)),
    "near normal": (1 - 10.0 ** RNG.uniform(-16, -3, N), RNG.uniform(0.1, 4.0, N), RNG.uniform(0.0, 3.0, N)),
    "huge": (UNIFORM, 10.0 ** RNG.uniform(1, 8, N), 10.0 ** RNG.uniform(-3, 8, N)),
    "near zero": (UNIFORM, 10.0 ** RNG.uniform(-8, -2, N), 10.0 ** RNG.uniform(-8, -2, N)),
    "near zero, near normal": (
        1 - 10.0 ** RNG.uniform(-16, -3, N),
        10.0 ** RNG.uniform(-8, -2, N),
        np.zeros(N),
    ),
    "total": (RNG.uniform(0.01, 0.6, N), RNG.uniform(0.05, 0.75, N), np.zeros(N)),
}


def textbook(c, eta, k):
    """r_s and r_p by Snell's law with complex cos(theta_t), 60 digits."""
    with mpmath.workdps(60):
        c, index = mpmath.mpf(float(c)), mpmath.mpc(float(eta), float(k))
        w = mpmath.sqrt(index**2 - (1 - c**2))
        # index^2 rounds, so k = 0 beyond the critical angle may land on either side of the branch cut.
        w = w if w.imag >= 0 else -w
        return (c - w) / (c + w), (index**2 * c - w) / (index**2 * c + w)


@pytest.mark.parametrize("regime", REGIMES)
def test_against_60_digits(regime):
    c, eta, k = REGIMES[regime]
    power, field = reflectances(c, eta, k), amplitudes(c, eta, k)
    for i in range(N):
        for exact, r, t, amplitude in zip(
            textbook(c[i], eta[i], k[i]),
            (power.s[i], power.p[i]),
            (power.transmitted_s[i], power.transmitted_p[i]),
            (field[0][i], field[1][i]),
            strict=True,
        ):
            with mpmath.workdps(60):
                assert abs(amplitude - exact) <= 1e-14 * abs(exact)
                expected = float(abs(exact) ** 2)
                assert r == pytest.approx(expected, rel=1e-14, abs=1e-300)
                if abs(1 - expected) > 1e-12:
                    assert t == pytest.approx(float(1 - abs(exact) ** 2), rel=1e-12, abs=1e-300)


def test_transmittance_keeps_its_digits_at_grazing_incidence():
    """T ~ c is far below the rounding of R ~ 1, so 1 - R would give nothing."""
    c = 1e-14
    with mpmath.workdps(60):
        expected = [float(1 - abs(r) ** 2) for r in textbook(c, 1.5, 0.3)]
    t = reflectances(c, 1.5, 0.3)
    assert [t.transmitted_s, t.transmitted_p] == pytest.approx(expected, rel=1e-14, abs=0)


@pytest.mark.parametrize("function", [amplitudes, reflectances])
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((math.nan, 1.5), "cosine"),
        ((56.3, 1.5), "degrees"),
        ((-0.1, 1.5), "cosine"),
        ((0.5, math.nan), "eta"),
        ((0.5, 0.0), "eta"),
        ((0.5, -1.5), "eta"),
        ((0.5, math.inf), "eta"),
        ((0.5, 1.5, -0.1), "n - ik"),
        ((0.5, 1.5, math.nan), "k must"),
        (([0.5, math.nan], 1.5), "cosine"),
    ],
)
def test_what_is_outside_the_domain_is_refused(function, arguments, says):
    with pytest.raises(ValueError, match=says):
        function(*arguments)


def test_an_angle_in_degrees_is_refused():
    with pytest.raises(ValueError, match="degrees"):
        refraction_angle(45.0, 1.5)


def test_r0_of_glass_and_gold():
    assert r0(1.5) == pytest.approx(0.04, rel=1e-15)
    assert r0(0.183, 3.43) == pytest.approx(
        ((0.183 - 1) ** 2 + 3.43**2) / ((1.183) ** 2 + 3.43**2), rel=1e-15
    )
