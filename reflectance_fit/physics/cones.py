"""Cones of directions (caps of the unit sphere): solid angle, and projected solid angle with a horizon.

The projected solid angle int cos(theta) domega is the irradiance of unit
radiance from the cone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_angle

Floats = NDArray[np.float64]


def cone_solid_angle(half_angle: ArrayLike) -> Floats:
    """Solid angle 4 pi sin^2(sigma / 2), in sr, of a cone; half_angle sigma in [0, pi], shape S."""
    result: Floats = 4.0 * np.pi * np.sin(_checked_to_pi(half_angle, "half_angle") / 2.0) ** 2
    return result[()]


def cone_projected_solid_angle(half_angle: ArrayLike, tilt: ArrayLike) -> Floats:
    """The integral of cos(theta) over the part of a cone above the horizon, in sr; shape S.

    Parameters
    ----------
    half_angle : float, shape S
        sigma, from the cone's axis to its edge; radians in [0, pi].
    tilt : float, broadcastable to S
        theta, from the receiver's normal to the cone's axis; radians in [0, pi].

    Returns
    -------
    float, shape S
        Exact but for rounding, which does what tilting the receiver by an ulp does: within some ulps
        well above the horizon, more only where the cone is about to set.  pi sin^2(sigma) cos(theta)
        above the horizon, 0 below.

    Raises
    ------
    ValueError
        If an angle is outside [0, pi].

    Examples
    --------
    >>> print(f"{cone_projected_solid_angle(np.pi / 2, np.pi / 2) / np.pi:.3f}")
    0.500
    """
    sigma, theta = _checked_to_pi(half_angle, "half_angle"), _checked_to_pi(tilt, "tilt")
    # What a cone wider than the hemisphere leaves out is a cone about the opposite direction.
    wide = sigma > np.pi / 2
    narrow, sign = np.where(wide, np.pi - sigma, sigma), np.where(wide, -1.0, 1.0)
    cosine = np.where(wide, np.pi, 0.0) + sign * clipped_cone(
        np.sin(narrow), np.sin(np.pi / 2 - narrow), sign * np.sin(np.pi / 2 - theta)
    )
    result: Floats = np.asarray(cosine)
    return result[()]


def ring_projected_solid_angle(theta_1: ArrayLike, theta_2: ArrayLike) -> Floats:
    """The integral of cos(theta) over the ring theta_1 <= theta <= theta_2 about the normal, in sr; shape S.

    Angles in radians in [0, pi/2], else ValueError.  pi (sin^2 theta_2 - sin^2 theta_1), by a product
    that keeps its digits for a narrow ring.
    """
    first, second = checked_angle(theta_1), checked_angle(theta_2)
    result: Floats = np.pi * np.sin(second - first) * np.sin(second + first)
    return result[()]


def clipped_cone(sin_sigma: Floats, cos_sigma: Floats, cos_theta: Floats) -> Floats:
    """`cone_projected_solid_angle` for sigma up to pi/2, from sines and cosines.  Trusts its inputs.

    Where edge and horizon cross, let 2A be the angle of the visible arc of the edge about the cone's axis,
    and 2B that of the visible part of the horizon about the receiver.  Lambert's contour integral is then

        B - sin(B) cos(B) + sin^2(sigma) cos(theta) (A - sin(A) cos(A)),

    of which both parts are positive while the axis is above the horizon.

    Notes
    -----
    J. M. Snyder, Area Light Sources for Real-Time Graphics (1996), states the same with acos and atan;
    cos(sigma) = |sin(theta)| cos(B) and tan(A) = tan(B) / |cos(theta)| of the right spherical triangle
    of axis, crossing and horizon turn it into this form, which does not cancel for a small sigma.
    """
    above, below = cos_theta >= sin_sigma, cos_theta <= -sin_sigma
    half_chord = np.sqrt(np.maximum((sin_sigma - cos_theta) * (sin_sigma + cos_theta), 0.0))
    a = np.arctan2(half_chord, -cos_theta * cos_sigma)
    b = np.arctan2(half_chord, cos_sigma)
    crossing = _segment(b) + sin_sigma**2 * cos_theta * _segment(a)
    whole = np.pi * sin_sigma**2 * cos_theta
    # Rounding may leave a setting cone below 0.
    result: Floats = np.where(above, whole, np.where(below, 0.0, np.maximum(crossing, 0.0)))
    return result


def _segment(x: Floats) -> Floats:
    """x - sin(x) cos(x), twice the area of a circle's segment, to some ulps for 0 <= x <= pi."""
    y = 2.0 * x
    # y - sin(y) by Taylor's series: for y < 1.6 the tenth term is below 1e-17 of the first.
    term = y**3 / 6.0
    series = np.zeros_like(term)
    for n in range(2, 12):
        series = series + term
        term = -term * y**2 / ((2.0 * n) * (2.0 * n + 1.0))
    result: Floats = np.where(y < 1.6, series, y - np.sin(y)) / 2.0
    return result


def _checked_to_pi(angle: ArrayLike, name: str) -> Floats:
    value = np.asarray(angle, dtype=np.float64)
    if not np.all((value >= 0.0) & (value <= np.pi)):
        raise ValueError(f"{name} must be in [0, pi] radians; is it in degrees?")
    return value
