"""Fresnel's equations at one interface, in forms that do not cancel.

With c = cos(theta_i), s^2 = sin^2(theta_i) and w = (eta + ik) cos(theta_t) = u + iv,

    r_s = (c - w) / (c + w)                = (1 - eps) / (c + w)^2
    r_p = (eps c - w) / (eps c + w)        = -r_s (eps c^2 - s^2) / (w c + s^2)^2

where eps = (eta + ik)^2 and eps c + w = (w c + s^2)(w + c).  The right-hand
sides subtract nothing that the data do not subtract themselves, so they keep
their digits at index match and at grazing incidence; what remains is lost at
Brewster's and at the critical angle only.

Signs of docs/conventions.md: time factor exp(-i omega t), r_p = -r_s at
normal incidence (Verdet).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_cosine, checked_index
from reflectance_fit.physics.snell import normal_component

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Rung = Literal["plain"]

# Below this transmittance R is its complement: R stays at or below 1 by construction, and T keeps its digits.
_SMALL_TRANSMITTANCE = 0.3
_TINY = np.finfo(np.float64).tiny


class Reflectances(NamedTuple):
    """Power over incident power; float, shape S.

    ``mean`` and ``transmitted`` hold for unpolarized light.  Transmitted power
    is all that enters: a conductor absorbs it.
    """

    s: Floats
    p: Floats
    mean: Floats
    transmitted_s: Floats
    transmitted_p: Floats
    transmitted: Floats


def amplitudes(
    cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return r_s and r_p, the reflected over the incident field.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, measured from the normal; in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.

    Returns
    -------
    r_s, r_p : complex, shape S
        Equal and opposite at normal incidence, both -1 at grazing incidence,
        zero for eta + ik = 1, where there is no interface.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, or k is negative.

    Notes
    -----
    Born & Wolf, Principles of Optics, 7th ed., 1.5.2 (21), whose reflected p
    axis is ours; Mitsuba 3 writes eta - ik inside and gives the conjugates.

    Examples
    --------
    >>> r_s, r_p = amplitudes(1.0, 1.5)
    >>> print(f"{r_s.real:.3f} {r_p.real:.3f}")
    -0.200 0.200
    """
    c = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    s2 = (1.0 - c) * (1.0 + c)
    u, v, _ = normal_component(c, s2, eta, k)
    w = np.asarray(u + 1j * v, dtype=np.complex128)
    index = np.asarray(eta + 1j * k, dtype=np.complex128)
    # c + w vanishes only at grazing incidence on an index match, where index - 1 is 0 too.
    total = np.where(np.abs(c + w) < _TINY, 1.0 + 0.0j, c + w)
    r_s = -((index - 1.0) / total) * ((index + 1.0) / total)
    numerator, denominator = rho_parts(c, s2, eta, k, w)
    r_p = r_s * (numerator / denominator) / denominator
    return r_s[()], r_p[()]


def reflectances(
    cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0, *, rung: Rung = "plain"
) -> Reflectances:
    """Return the reflected and the entering power, over the incident power.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, measured from the normal; in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.
    rung : {"plain"}
        How much arithmetic to spend; "plain" is float64 throughout.

    Returns
    -------
    Reflectances
        Each within [0, 1], never NaN; R + T = 1 for each polarisation.  Beyond
        the critical angle of a transparent medium R is exactly 1 and T exactly
        0.  No interface (eta + ik = 1) reflects nothing, at grazing incidence
        too.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, k is negative or
        the rung is unknown.

    Examples
    --------
    >>> print(f"{reflectances(1.0, 1.5).mean:.3f}")
    0.040
    """
    if rung != "plain":
        raise ValueError(f"no rung {rung!r}; there is only 'plain'")
    c = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    s2 = (1.0 - c) * (1.0 + c)
    u, v, modulus = normal_component(c, s2, eta, k)
    # The floor acts only where c, eta - 1 and k all vanish, or their squares underflow.  e needs none: see rho_parts.
    d = np.maximum((c + u) ** 2 + v**2, _TINY)
    e = (u * c + s2) ** 2 + (v * c) ** 2
    transmitted_s = 4.0 * c * u / d
    transmitted_p = transmitted_s * (modulus + s2) / e
    direct_s = (((eta - 1.0) / d) ** 2 + (k / d) ** 2) * ((eta + 1.0) ** 2 + k**2)
    real = (eta - k) * (eta + k) * c**2 - s2
    direct_p = direct_s * ((real / e) ** 2 + (2.0 * eta * k * c**2 / e) ** 2)
    matched = (eta == 1.0) & (k == 0.0)
    s, entered_s = _complementary(direct_s, transmitted_s, matched)
    p, entered_p = _complementary(direct_p, transmitted_p, matched)
    return Reflectances(s, p, ((s + p) / 2.0)[()], entered_s, entered_p, ((entered_s + entered_p) / 2.0)[()])


def r0(eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
    """Power reflectance at normal incidence, ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2), shape S.

    Raises ValueError if eta is not positive or k is negative.

    Examples
    --------
    >>> print(f"{r0(1.5):.3f}")
    0.040
    """
    eta, k = checked_index(eta, k)
    result: Floats = ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
    return result[()]


def radiance_transmission_factor(eta: ArrayLike) -> Floats:
    """What turns transmitted power into transmitted radiance: (eta_t / eta_i)^2 = eta^2, shape S.

    Refraction squeezes the solid angle, dOmega_t cos_t eta_t^2 = dOmega_i cos_i
    eta_i^2, so L_t = T eta^2 L_i: transmission is reciprocal in power, not in
    radiance.

    Light entering glass of 1.5 at normal incidence: T = 0.96, and radiance
    grows by 0.96 * 2.25 = 2.16.  Leaving it (eta = 1 / 1.5): T = 0.96 again,
    and radiance shrinks by 0.96 / 2.25 = 0.427.  In and out leave 0.96^2.

    Notes
    -----
    Veach, Robust Monte Carlo Methods for Light Transport (1997), 5.2.
    """
    eta, _ = checked_index(eta)
    result: Floats = eta**2
    return result[()]


def rho_parts(c: Floats, s2: Floats, eta: Floats, k: Floats, w: Complexes) -> tuple[Complexes, Complexes]:
    """Numerator N and D with r_p / r_s = N / D^2.  Trusts its inputs.

    D = w c + s^2 is zero nowhere: s^2 > 0 but at normal incidence, where w = eta + ik.
    """
    real = (eta - k) * (eta + k) * c**2 - s2
    return -(real + 2j * eta * k * c**2), w * c + s2


def _complementary(
    reflected: Floats, transmitted: Floats, matched: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """The pair R, T with R + T = 1, from whichever of the two is known better."""
    small = transmitted < _SMALL_TRANSMITTANCE
    r = np.where(matched, 0.0, np.where(small, 1.0 - transmitted, reflected))
    t = np.where(matched, 1.0, np.where(small, transmitted, 1.0 - reflected))
    return r[()], t[()]
