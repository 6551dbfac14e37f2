"""Psi and Delta, the two numbers of ellipsometry: rho = r_p / r_s = tan(Psi) exp(-i Delta).

Radians inside; Delta in [0, 2 pi).  For glass Delta is pi below Brewster's
angle and 0 above.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_cosine, checked_index
from reflectance_fit.physics.exact import Pair, pair, square

Floats = NDArray[np.float64]


def amplitude_ratio(cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0) -> NDArray[np.complex128]:
    """rho = r_p / r_s without the division: -1 at normal, 1 at grazing incidence, at an index match too.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, or k is negative.

    Notes
    -----
    rho = (s^2 - wc) / (s^2 + wc), w^2 = eps - s^2: Azzam & Bashara, Ellipsometry and Polarized Light (1977),
    4.2, in our signs (see `index_from_rho`).  Real and imaginary part each to a few ulp, at every angle.
    """
    c = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    c2 = square(c)
    s2 = 1.0 - c2
    # w^2 = (eta + ik)^2 - s^2, whose real part vanishes at the critical angle.
    real, imag = square(eta) - square(k) - s2, 2.0 * pair(eta) * k
    w = np.sqrt(real.high + 1j * imag.high)
    modulus = np.hypot(real.high, imag.high)
    # |s^2 + wc|^2: zero nowhere, because Re w >= 0, and at normal incidence w = eta + ik.
    denominator = (s2.high + w.real * c) ** 2 + (w.imag * c) ** 2
    # s^4 - |w|^2 c^2 vanishes at Brewster's and at the principal angles; near them it comes from s^8 - |w|^4 c^4.
    s4 = s2 * s2
    total, difference = s4.high + modulus * c2.high, s4.high - modulus * c2.high
    near = np.abs(difference) < 0.5 * s4.high
    real, imag = (Pair(*(np.where(near, x, 0.0) for x in (y.high, y.low))) for y in (real * c2, imag * c2))
    exact = (s4 * s4 - real * real - imag * imag).high
    difference = np.where(near, exact / np.where(near, total, 1.0), difference)
    rho = (difference - 2j * s2.high * w.imag * c) / denominator
    return np.asarray(rho, dtype=np.complex128)[()]


def rho_from_psi_delta(psi: ArrayLike, delta: ArrayLike) -> NDArray[np.complex128]:
    """tan(psi) exp(-i delta) of angles in radians, psi in [0, pi/2]; broadcast shape."""
    psi = np.asarray(psi, dtype=np.float64)
    delta = np.asarray(delta, dtype=np.float64)
    if not np.all((psi >= 0.0) & (psi <= np.pi / 2) & np.isfinite(delta)):
        raise ValueError("psi must be in [0, pi/2] radians and delta finite; are they in degrees?")
    rho: NDArray[np.complex128] = np.tan(psi) * np.exp(-1j * delta)
    return rho[()]


def psi_delta_from_rho(rho: ArrayLike) -> tuple[Floats, Floats]:
    """(psi, delta) in radians of rho = r_p / r_s, shape S; psi in [0, pi/2], delta in [0, 2 pi).

    Delta is 0 where rho is 0 and has no phase.

    Examples
    --------
    >>> psi, delta = psi_delta_from_rho(-1.0)
    >>> print(f"{np.degrees(psi):.0f} {np.degrees(delta):.0f}")
    45 180
    """
    rho = np.asarray(rho, dtype=np.complex128)
    if np.any(np.isnan(rho)):
        raise ValueError("rho must not be NaN")
    delta = np.mod(-np.angle(rho), 2.0 * np.pi)
    # The remainder of a tiny negative angle rounds up to 2 pi itself; a zero of either sign has no angle.
    delta = np.where((delta >= 2.0 * np.pi) | (rho == 0.0), 0.0, delta)
    return np.arctan(np.abs(rho))[()], delta[()]


def psi_delta(cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0) -> tuple[Floats, Floats]:
    """(psi, delta) in radians of an interface; arguments and errors as for `amplitude_ratio`.

    Examples
    --------
    Gold at 633 nm, 60 degrees, the value that fixes the sign of i:

    >>> _, delta = psi_delta(0.5, 0.183, 3.43)
    >>> print(f"{np.degrees(delta):.3f}")
    134.129
    """
    return psi_delta_from_rho(amplitude_ratio(cos_theta_i, eta, k))
