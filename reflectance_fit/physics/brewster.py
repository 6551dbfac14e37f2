"""The special angles of an interface, in radians from the normal.

All of them are written as tan^2(theta) = |eps| / z with eps = (eta + ik)^2.  A
transparent medium has z = 1 for Brewster's angle; absorption splits it into
three, and z = 1 + y turns each condition into one without cancellation, so a
tiny k costs no digits.  Each angle is then a root that a short argument
brackets, and thus the right one of several.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_index
from reflectance_fit.physics.principal import principal_roots

Floats = NDArray[np.float64]

# Alsamman & Azzam (2010): the second-Brewster angle is never more than 15.701 degrees above the first.
_SECOND_BREWSTER_REACH = np.radians(16.0)
_NEWTON_STEPS = 8
# Every bracket is shorter than 2: 56 halvings leave less than an ulp of 1.
_HALVINGS = 56


def brewster_angle(eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
    """Angle of the smallest R_p: Brewster's angle arctan(eta) for k = 0, else pseudo-Brewster.

    Parameters
    ----------
    eta, k : float, shape S
        Index of the far medium relative to the near one, eta + ik.

    Returns
    -------
    float, shape S
        Radians, in (0, pi/2).  45 degrees for eta + ik = 1, the limit.

    Raises
    ------
    ValueError
        If eta is not positive or k is negative.

    Notes
    -----
    Azzam & Ugbo, Appl. Opt. 28 (1989) 5222, as a cubic in u = sin^2:
    2 (|e|^2 + Re e) u^3 + |e|^2 (|e|^2 - 3) u^2 - 2 |e|^4 u + |e|^4 = 0.  Only
    moduli and Re e enter, so the sign of i does not matter.

    Examples
    --------
    >>> print(f"{np.degrees(brewster_angle(0.183, 3.43)):.2f}")
    72.63
    """
    eta, k = checked_index(eta, k)
    y = _pseudo_brewster_shift(*_scaled(eta, k))
    return _angle(eta, k, 1.0 + y)


def second_brewster_angle(eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
    """Angle of the smallest R_p / R_s; arctan(eta) for k = 0.  Arguments as for `brewster_angle`.

    Notes
    -----
    Alsamman & Azzam, J. Opt. Soc. Am. A 27 (2010) 1156.  With t = x (e (1 + x) - 1), x = cot^2(theta), the
    ratio is rho = +-(1 - z)/(1 + z), z^2 = t, and is stationary where Re[t' / (z (1 - t))] = 0.
    Between the pseudo-Brewster angle, where R_p is flat and R_s still grows, and
    16 degrees beyond it the derivative changes sign once.

    Examples
    --------
    >>> print(f"{np.degrees(second_brewster_angle(0.183, 3.43)):.2f}")
    74.73
    """
    eta, k = np.broadcast_arrays(*checked_index(eta, k))
    modulus, sin2 = _scaled(eta, k)
    start = 1.0 + _pseudo_brewster_shift(modulus, sin2)
    theta_far = np.minimum(_angle(eta, k, start) + _SECOND_BREWSTER_REACH, np.pi / 2)
    far = modulus / np.tan(theta_far) ** 2
    phase = ((eta + 1j * k) / np.hypot(eta, k)) ** 2
    scale = 1.0 / np.maximum(modulus, 1.0)

    def falls(z: Floats) -> NDArray[np.bool_]:
        # t = x (e x + e - 1); 1 - t = (1 + x)(1 - e x), and the real 1 + x > 0 drops out.
        ex = z * phase
        bracket = ex + (modulus * phase - 1.0)
        slope: Floats = ((ex + bracket) * scale * np.conj(np.sqrt(bracket) * (1.0 - ex))).real
        return slope < 0.0

    return _angle(eta, k, _bisect(falls, start, far))


def principal_angle(eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
    """Largest angle where Delta = 90 degrees: the last of `principal_angles`, whose arguments it takes.

    arctan(eta) for k = 0 and eta > 0.415; below that, total reflection has the largest.

    Examples
    --------
    >>> print(f"{np.degrees(principal_angle(0.183, 3.43)):.2f}")
    74.86
    """
    result: Floats = np.nanmax(principal_angles(eta, k), axis=-1)
    return result[()]


def principal_angles(eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
    """Every angle where Delta = 90 degrees: one, or three where |eta + ik| is small.

    Parameters
    ----------
    eta, k : float, shape S
        Index of the far medium relative to the near one, eta + ik.

    Returns
    -------
    float, shape (*S, 3)
        Radians in (0, pi/2), ascending; NaN for the two that do not exist.  A
        double root is listed twice.

    Raises
    ------
    ValueError
        If eta is not positive or k is negative.

    Notes
    -----
    Azzam, J. Opt. Soc. Am. A 25 (2008) 2858.  Three only where |eta + ik| < 0.4388.

    For k = 0 the first is Brewster's angle, where Delta jumps from 180 to 0
    degrees and r_p is 0: it is listed because every k > 0, however small, has a
    root in that place.  The other two are total reflection's own, which passes
    90 degrees twice for eta < sqrt(2) - 1 (Born & Wolf, 7th ed., 1.5.4).  So the
    angles change continuously with k, down to k = 0.  For eta + ik = 1 it is 45
    degrees, the limit.

    Examples
    --------
    >>> print(np.round(np.degrees(principal_angles(0.3)), 2))
    [16.7  18.57 41.76]
    """
    eta, k = np.broadcast_arrays(*checked_index(eta, k))
    angles: Floats = np.arctan(np.hypot(eta, k)[..., np.newaxis] / np.sqrt(principal_roots(eta, k)))
    return angles


def critical_angle(eta: ArrayLike) -> Floats:
    """Critical angle arcsin(eta) of total reflection in radians, shape S; NaN where eta >= 1 has none."""
    eta, _ = checked_index(eta)
    result: Floats = np.arcsin(np.where(eta < 1.0, eta, np.nan))
    return result[()]


def critical_glancing_angle(delta: ArrayLike) -> Floats:
    """What the critical angle lacks to 90 degrees, for the index eta = 1 - delta of a nearly matched medium.

    Parameters
    ----------
    delta : float, shape S
        1 - eta as tables of X-ray optics state it, below 1.

    Returns
    -------
    float, shape S
        Radians; arccos(1 - delta), about sqrt(2 delta), with all its digits
        however small delta is.  NaN where delta <= 0 has no total reflection.

    Raises
    ------
    ValueError
        If delta is not below 1.

    Examples
    --------
    Silicon at 8048 eV, delta = 7.58e-6 (without absorption):

    >>> print(f"{np.degrees(critical_glancing_angle(7.58e-6)):.3f}")
    0.223
    """
    delta = np.asarray(delta, dtype=np.float64)
    if not np.all(delta < 1.0):
        raise ValueError("delta must be below 1: it is 1 - eta, and eta is positive")
    # 1 - cos(a) = 2 sin^2(a / 2)
    result: Floats = 2.0 * np.arcsin(np.sqrt(np.where(delta > 0.0, delta, np.nan) / 2.0))
    return result[()]


def _scaled(eta: Floats, k: Floats) -> tuple[Floats, Floats]:
    """|eps| and sin^2(arg(eps) / 2) = k^2 / (eta^2 + k^2)."""
    index = np.hypot(eta, k)
    return index**2, (k / index) ** 2


def _pseudo_brewster_shift(modulus: Floats, sin2: Floats) -> Floats:
    """The y of z = 1 + y in Azzam's cubic, y^3 + (3 + |eps|) y^2 + 2 |eps| y = 4 sin2; in [0, 1].

    All coefficients are positive, so there is one root y >= 0.  The cubic's other
    root inside (0, 90) degrees, present for |eps - 1| < 1, has z < 1; there R_p is
    not stationary (it came in with a squaring).
    """
    # Without y^3 it is a quadratic whose root lies above; from there Newton descends to the root of the
    # convex cubic without overshooting, and quadratically: y <= 1 makes y^3 at most a third of 3 y^2.
    y = 4.0 * sin2 / (modulus + np.hypot(modulus, 2.0 * np.sqrt(sin2 * (3.0 + modulus))))
    for _ in range(_NEWTON_STEPS):
        value = ((y + 3.0 + modulus) * y + 2.0 * modulus) * y - 4.0 * sin2
        slope = (3.0 * y + 2.0 * (3.0 + modulus)) * y + 2.0 * modulus
        y = y - value / slope
    return y


def _angle(eta: Floats, k: Floats, z: Floats) -> Floats:
    """arctan sqrt(|eps| / z)."""
    result: Floats = np.arctan(np.hypot(eta, k) / np.sqrt(z))
    return result[()]


def _bisect(before: Callable[[Floats], NDArray[np.bool_]], start: Floats, end: Floats) -> Floats:
    """Where ``before`` turns from true at start to false at end, elementwise."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (start + end)
        early = before(middle)
        start, end = np.where(early, middle, start), np.where(early, end, middle)
    return 0.5 * (start + end)
