"""Irradiance and solid angle of area lights in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.area_form import irradiance_by_area
from reflectance_fit.physics.area_lights import Light, RectangleLight, SphereLight
from reflectance_fit.physics.cones import clipped_cone
from reflectance_fit.physics.disk_light import disk_contour, disk_solid_angle
from reflectance_fit.physics.radiometry import checked_direction, checked_point
from reflectance_fit.physics.rectangle_light import rectangle_contour, rectangle_solid_angle

Floats = NDArray[np.float64]

# A contour sum this much smaller than its terms has lost three digits of sixteen.
_CANCELLED = 1e-3


def irradiance(light: Light, position: ArrayLike, normal: ArrayLike) -> Floats:
    """Irradiance of an area light on receivers with position and normal, above their horizon; shape S.

    Parameters
    ----------
    light : RectangleLight, DiskLight or SphereLight
    position, normal : float, shape (..., 3)
        The receivers'; normals of any length.  S is their common shape without the last axis.

    Returns
    -------
    float, shape S
        In the unit of the light's radiance times sr; 0 behind the light, in its plane and below the horizon.
        Good to about 1e-12 of itself, however small, far, near or grazing, but for what no formula
        can help: it acts as if coordinates were moved by an ulp of the largest distance and the
        normal tilted by an ulp, which matters where a light is just setting or seen edge-on.

    Raises
    ------
    ValueError
        If an argument is not finite, a normal zero or a receiver inside a sphere light.

    Notes
    -----
    A sphere is exact by `cones.clipped_cone`, a whole disk by `disk_light`.  Lambert's contour sums for
    rectangles and cut disks cancel for a small or far light; those receivers, one by one
    and some milliseconds each, get `area_form.irradiance_by_area`, whose integrand never changes sign.

    Examples
    --------
    >>> sun = SphereLight([0, 0, 149.6e9], radius=6.957e8, radiance=2.0e7)
    >>> print(f"{irradiance(sun, [0, 0, 0], [0, 0, 1]):.0f}")
    1359
    """
    position, normal = np.broadcast_arrays(
        checked_point(position, "position"), checked_direction(normal, "normal")
    )
    if isinstance(light, SphereLight):
        return _sphere(light, position, normal)
    contour = rectangle_contour if isinstance(light, RectangleLight) else disk_contour
    value, size = contour(light, position, normal)  # type: ignore[arg-type]
    value = np.array(light.radiance * value + 0.0)  # no -0.0
    for i in map(tuple, np.argwhere(value < _CANCELLED * light.radiance * size)):
        value[i] = irradiance_by_area(light, position[i], normal[i]).value
    return value[()]


def solid_angle(light: Light, position: ArrayLike) -> Floats:
    """Solid angle of an area light's bright side, in sr, with no horizon; shape S.

    Parameters
    ----------
    light : RectangleLight, DiskLight or SphereLight
    position : float, shape (..., 3)

    Returns
    -------
    float, shape S
        Good to some ulps however far the light is, and to what moving the receiver by an ulp does.
        0 behind a flat light and in its plane.

    Raises
    ------
    ValueError
        If the position is not finite or inside a sphere light.
    """
    position = checked_point(position, "position")
    if isinstance(light, RectangleLight):
        return rectangle_solid_angle(light, position)[()]
    if isinstance(light, SphereLight):
        _, distance = light.checked_distance(position)
        sine, cosine = _cone(light, distance)
        # 2 pi (1 - cos), which would cancel.
        return np.asarray(2.0 * np.pi * sine**2 / (1.0 + cosine))[()]
    return disk_solid_angle(light, position)[()]


def _sphere(light: SphereLight, position: Floats, normal: Floats) -> Floats:
    towards, distance = light.checked_distance(position)
    cos_theta = np.sum(normal * towards, axis=-1) / distance
    sine, cosine = _cone(light, distance)
    return np.asarray(light.radiance * clipped_cone(sine, cosine, cos_theta))[()]


def _cone(light: SphereLight, distance: Floats) -> tuple[Floats, Floats]:
    """Sine and cosine of half the angle under which the sphere is seen."""
    cosine = np.sqrt((distance - light.radius) * (distance + light.radius)) / distance
    return light.radius / distance, cosine
