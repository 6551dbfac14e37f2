"""Radiometric integrals over directions in spherical coordinates, for any radiance L(theta, phi).

theta is measured from the surface normal, which is the z axis, and phi from
the x axis towards y, both in radians; domega = sin(theta) dtheta dphi.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.quadrature import RTOL, Integral, grid, integrate

Floats = NDArray[np.float64]
Radiance = Callable[[Floats, Floats], Floats]

# The octants, halved along theta: 21 points each, so at most 0.03 rad from one to the next in theta,
# and 0.12 in phi.
_THETA = np.linspace(0.0, np.pi, 9)
_PHI = np.linspace(0.0, 2.0 * np.pi, 5)


def hemispherical_irradiance(radiance: Radiance) -> Integral:
    """Irradiance E = int int L cos(theta) sin(theta) dtheta dphi over the upper hemisphere.

    Parameters
    ----------
    radiance : function of theta, phi, float of any equal shapes, to float of that shape
        Radiance arriving from a direction; theta in [0, pi/2], phi in [0, 2 pi].

    Returns
    -------
    Integral
        Good to 1e-12 where ``converged``.  What is narrower than 0.1 rad may lie between the
        points and go unseen: give a light's own integral (`light_integrals`) for such.

    Raises
    ------
    ValueError
        If the radiance is not finite everywhere.

    Examples
    --------
    >>> print(f"{hemispherical_irradiance(lambda theta, phi: np.cos(theta)).value:.6f}")
    2.094395
    """
    return _over(radiance, _THETA[:5], np.cos)


def scalar_irradiance(radiance: Radiance) -> Integral:
    """Power on a small ball over its cross-section, int L domega over all directions (fluence rate).

    Arguments as for `hemispherical_irradiance`, with theta up to pi.
    """
    return _over(radiance, _THETA, np.ones_like)


def vector_irradiance(radiance: Radiance) -> tuple[Integral, Integral, Integral]:
    """The x, y and z components of int L omega domega over all directions.

    Its product with a unit vector n is the irradiance of a surface facing n less
    that of one facing -n: the net power through a window.  Each component is good
    to 1e-12 of `scalar_irradiance`, which bounds it.  Arguments as for that.
    """
    atol = RTOL * abs(scalar_irradiance(radiance).value)

    def towards(axis: int) -> Integral:
        def integrand(x: Floats) -> Floats:
            theta, phi = x[..., 0], x[..., 1]
            return radiance(theta, phi) * direction(theta, phi)[..., axis] * np.sin(theta)

        return integrate(integrand, grid(_THETA, _PHI), rtol=0.0, atol=atol)

    return towards(0), towards(1), towards(2)


def lobe_irradiance(exponent: ArrayLike) -> Floats:
    """`hemispherical_irradiance` of L = cos(theta)^exponent, 2 pi / (exponent + 2); 0 is a uniform sky.

    Float, shape S; ValueError for a negative exponent.
    """
    result: Floats = 2.0 * np.pi / (_checked_exponent(exponent) + 2.0)
    return result[()]


def lobe_scalar_irradiance(exponent: ArrayLike) -> Floats:
    """`scalar_irradiance` of L = cos(theta)^exponent above the horizon alone, 2 pi / (exponent + 1)."""
    result: Floats = 2.0 * np.pi / (_checked_exponent(exponent) + 1.0)
    return result[()]


def direction(theta: ArrayLike, phi: ArrayLike) -> Floats:
    """Unit vector, shape (..., 3), of spherical coordinates in radians."""
    theta, phi = np.broadcast_arrays(np.asarray(theta, dtype=np.float64), np.asarray(phi, dtype=np.float64))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def _over(radiance: Radiance, theta_edges: Floats, weight: Callable[[Floats], Floats]) -> Integral:
    def integrand(x: Floats) -> Floats:
        theta, phi = x[..., 0], x[..., 1]
        return radiance(theta, phi) * weight(theta) * np.sin(theta)

    return integrate(integrand, grid(theta_edges, _PHI))


def _checked_exponent(exponent: ArrayLike) -> Floats:
    value = np.asarray(exponent, dtype=np.float64)
    if not np.all((value >= 0.0) & (value < np.inf)):
        raise ValueError("the exponent of a lobe must be finite and not negative")
    return value
