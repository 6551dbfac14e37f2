"""From one reflectance back to the index: the closed forms, each with its validity.

One power at one angle gives one equation: eta with k known, or k with eta
known.  The complex ratio rho gives both.

What is returned is right to about an ulp for the reflectance as given, also
where a change of its last digit would change the answer a lot: near r0 = 1, and
where the two solutions of a circle meet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import (
    LARGEST_INDEX,
    checked_angle,
    checked_index,
    checked_reflectance,
)
from reflectance_fit.physics.exact import Pair, pair, square

Floats = NDArray[np.float64]

# A reflectance rounded to float64 may miss the edge of what is possible by this much, relative to the terms.
_ROUNDING = 8.0 * np.finfo(np.float64).eps


class EtaRoots(NamedTuple):
    """Both indices with the same R0 and k; shape S.  NaN where not valid."""

    low: Floats
    high: Floats
    valid: NDArray[np.bool_]


class ExtinctionRoot(NamedTuple):
    """The extinction with this R0 and eta; shape S.  NaN where not valid."""

    k: Floats
    valid: NDArray[np.bool_]


def eta_from_r0(r0: ArrayLike) -> Floats:
    """Index eta >= 1 of a transparent medium with reflectance r0 at normal incidence; shape S.

    The other index with this r0 is 1 / eta.  Raises ValueError if r0 is outside
    [0, 1).

    Examples
    --------
    >>> print(f"{eta_from_r0(0.04):.3f}")
    1.500
    """
    r0 = checked_reflectance(r0)
    root = 1.0 + pair(r0).sqrt()
    # (1 + s) / (1 - s) with s = sqrt(r0), but 1 - r0 is exact near 1 where 1 - s is not.
    return (root * root / (1.0 - pair(r0))).high[()]


def eta_minus_one_from_r0(r0: ArrayLike) -> Floats:
    """eta - 1 for `eta_from_r0`, with all its digits when r0 is tiny: 2 s / (1 - s), s = sqrt(r0).

    The other index with this r0 has 1 / eta - 1 = -(eta - 1) / eta.
    """
    r0 = checked_reflectance(r0)
    s = pair(r0).sqrt()
    return (2.0 * s * (1.0 + s) / (1.0 - pair(r0))).high[()]


def eta_from_r0_given_k(r0: ArrayLike, k: ArrayLike) -> EtaRoots:
    """Both eta that give r0 at normal incidence with this k.

    Parameters
    ----------
    r0 : float, shape S
        Power reflectance at normal incidence, in [0, 1).
    k : float, broadcastable to S
        Extinction of the far medium relative to the near one, k >= 0.

    Returns
    -------
    EtaRoots
        ``low <= high``; ``valid`` where k <= 2 sqrt(r0) / (1 - r0), the top of
        the circle (eta - (1 + r0)/(1 - r0))^2 + k^2 = 4 r0 / (1 - r0)^2.

    Raises
    ------
    ValueError
        If r0 is outside [0, 1) or k is negative.
    """
    r0 = checked_reflectance(r0)
    _, k = checked_index(1.0, k)
    rest = 1.0 - pair(r0)
    # (radius^2 - k^2) (1 - r0)^2, where k^2 meets radius^2 at the top of the circle
    k2 = square(k)
    within, valid = _possible(4.0 * pair(r0) - k2 * rest * rest, 4.0 * r0)
    high = (1.0 + pair(r0) + within.sqrt()) / rest
    # The roots multiply to 1 + k^2, which never cancels.
    low = (1.0 + k2) / high
    return EtaRoots(np.where(valid, low.high, np.nan)[()], np.where(valid, high.high, np.nan)[()], valid[()])


def k_from_r0_given_eta(r0: ArrayLike, eta: ArrayLike) -> ExtinctionRoot:
    """The k that gives r0 at normal incidence with this eta.

    Parameters
    ----------
    r0 : float, shape S
        Power reflectance at normal incidence, in [0, 1).
    eta : float, broadcastable to S
        Index of the far medium relative to the near one.

    Returns
    -------
    ExtinctionRoot
        ``valid`` where (1 - s)/(1 + s) <= eta <= (1 + s)/(1 - s), s = sqrt(r0):
        outside, even k = 0 reflects more than r0.

    Raises
    ------
    ValueError
        If r0 is outside [0, 1) or eta is not positive.
    """
    r0 = checked_reflectance(r0)
    eta, _ = checked_index(eta)
    sum_, difference = 1.0 + pair(eta), pair(eta) - 1.0
    largest = pair(r0) * sum_ * sum_
    within, valid = _possible(largest - difference * difference, largest.high)
    k = (within / (1.0 - pair(r0))).sqrt()
    return ExtinctionRoot(np.where(valid, k.high, np.nan)[()], valid[()])


def index_from_rho(rho: ArrayLike, theta_i: ArrayLike) -> tuple[Floats, Floats]:
    """eta and k from the complex ratio rho = r_p / r_s at one angle.

    Parameters
    ----------
    rho : complex, shape S
        r_p / r_s = tan(Psi) exp(-i Delta); -1 at normal incidence.
    theta_i : float, broadcastable to S
        Angle of incidence in radians, inside (0, pi/2).

    Returns
    -------
    eta, k : float, shape S
        Relative index, each right to what the last digits of rho and theta_i
        decide.  A negative k is returned as it comes: it means noise on a
        transparent sample, or a Delta of the other sense.

    Raises
    ------
    ValueError
        If theta_i is outside (0, pi/2), where s and p can be told apart, or
        rho is not finite (to 1e100) or -1.

    Notes
    -----
    Azzam & Bashara, Ellipsometry and Polarized Light (1977), 4.2: eps = sin^2
    (1 + tan^2 ((1 - rho)/(1 + rho))^2).  Their r_p is ours, their time factor
    the conjugate one: rho and eps are both conjugated, so the formula stands.

    Every interface has |rho| <= 1; rho and 1 / rho give the same eps, so a
    |rho| above 1 is answered as if its inverse had been given.  Near normal
    incidence 1 + rho is of the order of theta_i^2, near grazing incidence 1 - rho
    is of the order of pi/2 - theta_i, and an error of rho is magnified by the
    inverse; at Brewster's angle nothing is magnified.
    """
    theta = checked_angle(theta_i)
    rho = np.asarray(rho, dtype=np.complex128)
    if not np.all((theta > 0.0) & (theta < np.pi / 2)):
        raise ValueError("theta_i must be inside (0, pi/2): s and p are alike at 0 and at pi/2")
    if not np.all((np.abs(rho) <= LARGEST_INDEX) & (rho != -1.0)):
        raise ValueError("rho must be finite (to 1e100) and not -1, which is normal incidence")
    # (1 - rho)/(1 + rho) = (1 - |rho|^2 - 2i Im rho) / |1 + rho|^2 keeps a tiny Im rho, which is all of k.
    real, imag = rho.real, rho.imag
    difference = (1.0 - square(real) - square(imag)).high
    scale = np.tan(theta) / np.hypot(1.0 + real, imag) ** 2
    u, v = scale * difference, -2.0 * scale * imag
    # numpy's principal root has Re >= 0, and the sign of Im eps becomes that of k.
    index = np.sin(theta) * np.sqrt((1.0 + (u - v) * (u + v)) + 2j * (u * v))
    return index.real[()], index.imag[()]


def _possible(square_: Pair, scale: Floats) -> tuple[Pair, NDArray[np.bool_]]:
    """A square that must not be negative, clipped to 0, and where it is not negative by more than rounding."""
    valid = square_.high >= -_ROUNDING * scale
    inside = square_.high > 0.0
    return Pair(np.where(inside, square_.high, 0.0), np.where(inside, square_.low, 0.0)), valid
