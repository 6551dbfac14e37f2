"""What one point of a surface reflects: the rendering equation for a single bounce.

    L_o(omega_o) = L_e(omega_o) + int f(omega_i, omega_o) L_i(omega_i) cos(theta_i) domega_i

Directions are unit vectors, shape (3,), in the local frame of `brdf`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.brdf import Brdf, mirrored
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.physics.quadrature import Integral, grid, integrate
from reflectance_fit.physics.radiometry import checked_direction

Floats = NDArray[np.float64]
Radiance = Callable[[Floats], Floats]

# Edges of the boxes around a lobe, over the way to the end: dense enough for 0.05 rad everywhere, and towards
# the lobe in steps through which no power of ten can slip.
_STEPS = np.array([0.0, 1e-5, 1e-3, 0.03, 0.12, 0.33, 0.66, 1.0])
_RTOL = 1e-8


def outgoing_radiance(brdf: Brdf, radiance: Radiance, outgoing: ArrayLike, emitted: float = 0.0) -> Integral:
    """Radiance that leaves a point: what it emits and what it reflects once.

    Parameters
    ----------
    brdf : function of incoming, outgoing
        See `brdf`.
    radiance : function of float, shape (..., 3), to float, shape (...)
        Incident radiance from a direction.
    outgoing : float, shape (3,)
        Direction of the reflected light, z > 0; any length.
    emitted : float
        Radiance the surface emits towards outgoing.

    Returns
    -------
    Integral
        Good to 1e-8 where ``converged``.  Lobes along the mirror direction and back towards outgoing
        are found down to a width of 1e-5 rad.  Elsewhere what is narrower than 0.05 rad may lie
        between the points and go unseen; integrate a small light over itself instead (`area_form`).

    Raises
    ------
    ValueError
        If outgoing does not point out of the surface, or the integrand is not finite.

    Notes
    -----
    J. T. Kajiya, The Rendering Equation, SIGGRAPH (1986).
    """
    towards = checked_outward(outgoing, "outgoing")
    found = _over_hemisphere(lambda w: brdf(w, towards) * radiance(w) * w[..., 2], towards)
    return Integral(found.value + emitted, found.error, found.converged)


def directional_albedo(brdf: Brdf, incoming: ArrayLike) -> Integral:
    """Fraction of the power of a beam from ``incoming`` that is reflected, int f cos(theta_o) domega_o.

    Above 1 the surface would create energy.  `outgoing_radiance` under a radiance of 1
    from everywhere (white furnace) is the same integral over the other argument, and equal to this where
    the BRDF is reciprocal.  Arguments, errors and accuracy as for that.

    Examples
    --------
    >>> from reflectance_fit.physics.brdf import lambertian
    >>> print(f"{directional_albedo(lambertian(0.8), [0.6, 0.0, 0.8]).value:.6f}")
    0.800000
    """
    beam = checked_outward(incoming, "incoming")
    return _over_hemisphere(lambda w: brdf(beam, w) * w[..., 2], beam)


def mirror_radiance(radiance: Radiance, outgoing: ArrayLike, eta: float, k: float = 0.0) -> Floats:
    """Radiance reflected by a smooth interface, F(cos theta) L_i(mirror direction), for unpolarized light.

    An ideal mirror has no BRDF; its albedo is Fresnel's F, so it conserves energy
    because F <= 1.  Arguments as for `outgoing_radiance`; eta + ik is relative to the side of the light.
    """
    towards = checked_outward(outgoing, "outgoing")
    fresnel = reflectances(min(float(towards[2]), 1.0), eta, k).mean
    return np.asarray(fresnel * radiance(mirrored(towards)))[()]


def checked_outward(direction: ArrayLike, name: str) -> Floats:
    """A unit vector, shape (3,), or ValueError unless it points out of the surface."""
    unit = checked_direction(direction, name)
    if unit.shape != (3,) or not unit[2] > 0.0:
        raise ValueError(f"{name} must be one direction out of the surface (z > 0)")
    return unit


def _over_hemisphere(f: Callable[[Floats], Floats], lobe: Floats) -> Integral:
    """Integral of f over the upper hemisphere, with boxes that shrink towards ``lobe`` and its mirror image.

    The vertical plane that separates those two halves the hemisphere.  In each half gamma in
    [0, pi] runs along the cut and beta in [0, pi/2] from the horizon up to it,
    domega = sin(gamma) dgamma dbeta, and the lobe lies at gamma = pi/2, beta = pi/2 - theta.
    """
    sine = float(np.hypot(lobe[0], lobe[1]))
    x_axis = np.array([lobe[0], lobe[1], 0.0]) / sine if sine > 0.0 else np.array([1.0, 0.0, 0.0])
    y_axis = np.array([-x_axis[1], x_axis[0], 0.0])
    beta = float(np.arctan2(lobe[2], sine))
    gamma_edges = np.pi / 2.0 * np.concatenate([1.0 - _STEPS[:0:-1], 1.0 + _STEPS])
    beta_edges = np.concatenate([beta * (1.0 - _STEPS[:0:-1]), beta + (np.pi / 2.0 - beta) * _STEPS])

    def integrand(x: Floats) -> Floats:
        gamma, rise = x[..., 0], x[..., 1]
        sin_gamma = np.sin(gamma)
        along = (np.cos(gamma))[..., None] * y_axis
        along = along + (sin_gamma * np.sin(rise))[..., None] * np.array([0.0, 0.0, 1.0])
        across = (sin_gamma * np.cos(rise))[..., None] * x_axis
        return (f(along + across) + f(along - across)) * sin_gamma

    return integrate(integrand, grid(gamma_edges, beta_edges), rtol=_RTOL)
