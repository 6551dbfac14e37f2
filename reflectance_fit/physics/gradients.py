"""How the reflectances change with the angle and the index: analytic derivatives.

With c = cos(theta_i), n = eta + ik, eps = n^2, w^2 = eps - s^2, w = u + iv, D = |c + w|^2 and E = |wc + s^2|^2,

    dr_s/dtheta = 2 s r_s / w             dr_p/dtheta = 2 s eps (1 - eps) / (w (eps c + w)^2)
    dr_s/dn     = -2 c n / (w (c + w)^2)  dr_p/dn     = 2 c n (eps - 2 s^2) / (w (eps c + w)^2)

follow from Fresnel's equations with eps c + w = (wc + s^2)(c + w).  A power changes by
dR = 2 Re(conj(r) dr), with dn = d eta + i dk.  As it stands that product cancels where R is near 1 or k
is tiny.  So it is multiplied out, |..|^2 aside, with (c - w)(c + w) = 1 - eps and (eps c - w)(eps c + w) =
(eps - 1)(eps c^2 - s^2), and with

    n conj(w) = eta u + k v - i 2 s^2 eta v / (|w|^2 + |n|^2 + s^2)

whose imaginary part k u - eta v would cancel for a large index.  Then only differences are left that vanish
where the derivative itself does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_cosine, checked_index
from reflectance_fit.physics.exact import square

Floats = NDArray[np.float64]

_TINY = np.finfo(np.float64).tiny


class ReflectanceGradients(NamedTuple):
    """Derivatives of R_s, R_p and their mean, float, shape S; the angle in radians."""

    d_s_d_theta: Floats
    d_s_d_eta: Floats
    d_s_d_k: Floats
    d_p_d_theta: Floats
    d_p_d_eta: Floats
    d_p_d_k: Floats
    d_mean_d_theta: Floats
    d_mean_d_eta: Floats
    d_mean_d_k: Floats


def reflectance_gradients(cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0) -> ReflectanceGradients:
    """Derivatives of the power reflectances with respect to theta_i, eta and k.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, measured from the normal; in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.

    Returns
    -------
    ReflectanceGradients
        Per radian, and per unit of eta and k.  Always finite.  By the cosine,
        dR/dcos = -dR/dtheta / sin(theta).

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, or k is negative.

    Notes
    -----
    Differentiated from Born & Wolf, Principles of Optics, 7th ed., 1.5.2 (21),
    with the signs of `amplitudes`; a power does not see the sign of i.

    At k = 0 the derivative by k is one-sided, towards k > 0.  Below the critical
    angle it is 0, because R depends on k^2.  In total reflection it is negative:
    R is 1 there for k = 0, and every k absorbs.  Towards the critical angle of a
    transparent medium derivatives grow without bound: that by k from beyond it,
    the others from below it.

    Examples
    --------
    Glass at normal incidence, R = (eta - 1)^2 / (eta + 1)^2:

    >>> print(f"{reflectance_gradients(1.0, 1.5).d_s_d_eta:.3f}")
    0.128
    """
    c = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    # Each of these differences can lose all digits: at an index match, the critical angle, Brewster's angle.
    c2, eta2, k2 = square(c), square(eta), square(k)
    s2, modulus = 1.0 - c2, eta2 + k2
    real, imag = eta2 - k2, 2.0 * eta * k
    q, brewster, twice = real - s2, real * c2 - s2, real - 2.0 * s2
    matched, halfway = (1.0 - real).high, (1.0 - 2.0 * c2).high
    stationary = modulus * c2 - s2 * (real / modulus)

    w = np.sqrt(q.high + 1j * imag)
    u, v = w.real, w.imag
    # h and d vanish, or underflow, only at grazing incidence on an index match, where every numerator is 0: for
    # k = 0 h is eta^2 + c^2 - 1, and a sum of two squares of binary fractions is 1 only if one of them is 0.
    modulus_w = np.hypot(q.high, imag)
    h, d = (np.where(x > _TINY, x, 1.0) for x in (modulus_w, (c + u) ** 2 + v**2))
    e = (u * c + s2.high) ** 2 + (v * c) ** 2

    # Divided step by step, because with an index of 1e100 the products are out of range.
    across = 2.0 * s2.high * eta * v / (modulus_w + modulus.high + s2.high)
    common = 4.0 * c * ((eta * u + k * v) / h - 1j * (across / h))
    by_n_s = common * ((matched + 1j * imag) / d) / d
    # (eps - 2 s^2)(conj(eps) - 1)(conj(eps) c^2 - s^2); the imaginary part is a sum of squares.
    t_real = (imag / e * (imag / d) - twice.high / e * (matched / d)) * (brewster.high / e)
    t_real += imag / e * (halfway / d) * (imag * c2.high / e)
    third = c * (modulus - 2.0 * s2).high
    squares = third / d * (third / e) + s2.high * (
        8.0 * (c * k / d) * (c * k / e) + halfway / d * (halfway / e)
    )
    by_n_p = common * (t_real - 1j * (imag / e * squares)) / d

    reflectance_s = (((eta - 1.0) / d) ** 2 + (k / d) ** 2) * ((eta + 1.0) ** 2 + k**2)
    scale = 4.0 * np.sqrt(s2.high) * reflectance_s
    slope = (stationary.high / e) * u - s2.high * (imag / modulus.high / e) * v
    by_s = scale * u / h, -by_n_s.real, by_n_s.imag
    by_p = -scale * (slope * (modulus.high / h) / e), by_n_p.real, -by_n_p.imag
    by_mean = ((s + p) / 2.0 for s, p in zip(by_s, by_p, strict=True))
    return ReflectanceGradients(*(x[()] for x in (*by_s, *by_p, *by_mean)))
