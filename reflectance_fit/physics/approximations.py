"""What renderers use instead of Fresnel's equations for the reflectance of unpolarized light.

An approximation comes as a function of the material, eta + ik, that returns
a `Curve`, a function of cos_theta_i: what is computed once for a material is
apart from what every angle costs.  This module has the closed forms,
`fitted_approximations` those fitted to a material, `approximation_ladder` all
of them by name, `approximation_error` how far each is off.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import SMALLEST_ETA, checked_cosine, checked_index
from reflectance_fit.physics.fresnel import r0, reflectances

Floats = NDArray[np.float64]
# From cosines of shape (N,) to reflectances of shape (N,), or (M, N) where it stands for M materials.
Curve = Callable[[ArrayLike], Floats]

F82_COSINE = 1.0 / 7.0  # 81.8 degrees, where mu (1 - mu)^6 is largest


class ConductorApproximation(NamedTuple):
    """Approximate power reflectance of a conductor; float, shape S.  ``mean`` is for unpolarized light."""

    s: Floats
    p: Floats
    mean: Floats


def schlick(cos_theta_i: ArrayLike, r0: ArrayLike) -> Floats:
    """Schlick's approximation R0 + (1 - R0) (1 - cos_theta_i)^5 of the unpolarized reflectance.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    r0 : float, broadcastable to S
        Power reflectance at normal incidence, in [0, 1].

    Raises
    ------
    ValueError
        If either is outside its range.

    Notes
    -----
    Schlick, Computer Graphics Forum 13 (1994) 233, eq. 15.

    Examples
    --------
    >>> print(f"{schlick(0.5, 0.04):.2f}")
    0.07
    """
    c = checked_cosine(cos_theta_i)
    r0 = np.asarray(r0, dtype=np.float64)
    if not np.all((r0 >= 0.0) & (r0 <= 1.0)):
        raise ValueError("r0 must be a power reflectance in [0, 1]; is it in percent?")
    # Products, as in a shader: numpy's power takes several times as long.
    rest = 1.0 - c
    square = rest * rest
    result: Floats = r0 + (1.0 - r0) * (square * square * rest)
    return result[()]


def conductor_approximation(cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike) -> ConductorApproximation:
    """The textbook approximation of a conductor's reflectance, which drops sin^2(theta_i) beside eps.

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
    Pharr & Humphreys, Physically Based Rendering, 2nd ed., 8.2.1, r_parallel
    and r_perpendicular: ((eta^2 + k^2) c^2 -+ 2 eta c + 1) and
    ((eta^2 + k^2) -+ 2 eta c + c^2), here as sums of squares.
    """
    c = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    s: Floats = ((eta - c) ** 2 + k**2) / ((eta + c) ** 2 + k**2)
    p: Floats = ((eta * c - 1.0) ** 2 + (k * c) ** 2) / ((eta * c + 1.0) ** 2 + (k * c) ** 2)
    return ConductorApproximation(s[()], p[()], ((s + p) / 2.0)[()])


def materials(eta: ArrayLike, k: ArrayLike) -> tuple[Floats, Floats]:
    """The index of one material, or of M in shape (M, 1), checked and of equal shapes.

    Raises ValueError if eta is not positive, k is negative, or the last axis
    is longer than 1: it is the angles'.
    """
    eta, k = np.broadcast_arrays(*checked_index(eta, k))
    if eta.ndim and eta.shape[-1] != 1:
        raise ValueError("eta and k must be scalars or have the shape (M, 1): a curve is one material's")
    return eta, k


def constant(eta: ArrayLike, k: ArrayLike) -> Curve:
    """R0 at every angle: a mirror that does not know where it is seen from.  Arguments as for `materials`."""
    normal = np.asarray(r0(*materials(eta, k)))
    return lambda cos_theta_i: normal + np.zeros_like(checked_cosine(cos_theta_i))


def schlick_exact_r0(eta: ArrayLike, k: ArrayLike) -> Curve:
    """Schlick's approximation with the R0 of eta + ik.  Arguments as for `materials`.

    Notes
    -----
    Also the base form of Lazanyi & Szirmay-Kalos, ((eta - 1)^2 + 4 eta (1 - c)^5 + k^2) / ((eta + 1)^2 + k^2),
    since 1 - R0 = 4 eta / ((eta + 1)^2 + k^2).
    """
    normal = r0(*materials(eta, k))
    return lambda cos_theta_i: schlick(cos_theta_i, normal)


def schlick_real_r0(eta: ArrayLike, k: ArrayLike) -> Curve:
    """Schlick's approximation with the R0 of eta alone: what a shader that knows no k makes of a metal.

    Arguments as for `materials`; k is not used.
    """
    normal = r0(materials(eta, k)[0])
    return lambda cos_theta_i: schlick(cos_theta_i, normal)


def f82(eta: ArrayLike, k: ArrayLike) -> Curve:
    """Schlick - b mu (1 - mu)^6 with mu = cos_theta_i, exact at mu = 1/7.  Arguments as for `materials`.

    Notes
    -----
    Hoffman, Fresnel equations considered harmful (2019); Kutz, Hasan & Edmondson, Novel aspects of the
    Adobe Standard Material (2021), "F82-tint"; OpenPBR 1.1, "Metal".  There the
    edge is a tint of at most 1 of Schlick's value, so b is never negative; that is kept here, as it is what a renderer
    does with the material, and where it acts (total reflection) the form is no use anyway.  Near an
    index match b is so large that reflectances become negative; as in OpenPBR they are not clipped.
    """
    eta, k = materials(eta, k)
    normal = r0(eta, k)
    plain = schlick(F82_COSINE, normal)
    edge = np.minimum(reflectances(F82_COSINE, eta, k).mean, plain)
    b = (plain - edge) / (F82_COSINE * (1.0 - F82_COSINE) ** 6)

    def curve(cos_theta_i: ArrayLike) -> Floats:
        mu = checked_cosine(cos_theta_i)
        rest = 1.0 - mu
        fifth = rest * rest
        fifth = fifth * fifth * rest
        result: Floats = normal + fifth * ((1.0 - normal) - b * (mu * rest))
        return result

    return curve


def lecture_conductor(eta: ArrayLike, k: ArrayLike) -> Curve:
    """The mean of `conductor_approximation`.  Arguments as for `materials`."""
    eta, k = materials(eta, k)
    return lambda cos_theta_i: conductor_approximation(cos_theta_i, eta, k).mean


def gulbrandsen(eta: ArrayLike, k: ArrayLike) -> Curve:
    """The conductor approximation of the nearest material that has a reflectivity r and an edge tint g.

    Arguments as for `materials`.

    Notes
    -----
    Gulbrandsen, J. Comput. Graph. Tech. 3 (2014) no. 4, 64: r = R0 and eta = g eta_min + (1 - g) eta_max, with
    eta_min = (1 - r) / (1 + r), eta_max = (1 + sqrt(r)) / (1 - sqrt(r)), both r and g in [0, 1]; reflectance by
    the large-index form, which is `conductor_approximation`.  No index has eta > eta_max (k^2 < 0 there).
    At eta_min the modulus is 1, and it grows with eta at fixed r.  So an index of modulus 1 or more is kept as it
    is and this is `lecture_conductor`; a smaller one becomes g = 1: eta_min, of modulus 1.
    """
    eta, k = materials(eta, k)
    normal = r0(eta, k)
    small = np.hypot(eta, k) < 1.0
    # k^2 = 1 - eta_min^2 = 4 r / (1 + r)^2.  An eta below 1e-17 has r = 1 in float64; its floor is the domain's.
    eta = np.where(small, np.maximum((1.0 - normal) / (1.0 + normal), SMALLEST_ETA), eta)
    k = np.where(small, 2.0 * np.sqrt(normal) / (1.0 + normal), k)
    return lambda cos_theta_i: conductor_approximation(cos_theta_i, eta, k).mean


def exact(eta: ArrayLike, k: ArrayLike) -> Curve:
    """Fresnel's equations, by `fresnel.reflectances`.  Arguments as for `materials`."""
    eta, k = materials(eta, k)
    return lambda cos_theta_i: reflectances(cos_theta_i, eta, k).mean
