"""The area form over a sphere: the cap that the receiver sees, down to the horizon."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.area_lights import SphereLight, Weight
from reflectance_fit.physics.quadrature import Integral, integrate_pieces
from reflectance_fit.physics.radiometry import checked_direction

Floats = NDArray[np.float64]


def sphere_by_area(light: SphereLight, position: Floats, normal: Floats, weight: Weight | None) -> Integral:
    """`area_form.irradiance_by_area` for a sphere, by angle from its axis to the receiver and azimuth.

    Trusts its inputs but for the receiver inside the sphere, a ValueError; unit normal.
    """
    towards, distance = light.checked_distance(position)
    d, radius = float(distance), light.radius
    axis = -towards / d
    n1 = float(normal @ axis)
    sideways = normal - n1 * axis
    n2 = float(np.linalg.norm(sideways))
    sideways = checked_direction(
        sideways if n2 > 0.0 else np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]), "side"
    )
    other = np.cross(axis, sideways)
    limb = np.arctan2(np.sqrt((d - radius) * (d + radius)), radius)

    def middle(omega: Floats) -> Floats:
        """Height above the horizon at azimuth 90 degrees; swing(omega) cos(azimuth) is added to it."""
        return np.asarray(-n1 * ((d - radius) + 2.0 * radius * np.sin(omega / 2.0) ** 2))

    def swing(omega: Floats) -> Floats:
        return np.asarray(n2 * radius * np.sin(omega))

    def reach(omega: Floats) -> Floats:
        """Azimuth at which the circle of omega sets."""
        m, w = middle(omega), swing(omega)
        setting = np.arctan2(np.sqrt(np.maximum((w - m) * (w + m), 0.0)), -m)
        return np.where(m >= w, np.pi, np.where(m <= -w, 0.0, setting))

    def integrand(x: Floats, lo: float, hi: float) -> Floats:
        # sin^2 flattens the square roots with which reach begins and ends.
        omega = lo + (hi - lo) * np.sin(np.pi / 2.0 * x[..., 0]) ** 2
        step = (hi - lo) * np.pi / 2.0 * np.sin(np.pi * x[..., 0])
        limit = reach(omega)
        azimuth = limit * (2.0 * x[..., 1] - 1.0)
        full = limit == np.pi
        height = swing(omega) * np.where(
            full, np.cos(azimuth), 2.0 * np.sin((limit + azimuth) / 2.0) * np.sin((limit - azimuth) / 2.0)
        ) + np.where(full, middle(omega), 0.0)
        r2 = (d - radius) ** 2 + 4.0 * d * radius * np.sin(omega / 2.0) ** 2
        outwards = 2.0 * d * np.sin((limb + omega) / 2.0) * np.sin((limb - omega) / 2.0)
        value = np.maximum(height, 0.0) * outwards / r2 * radius**2 / r2 * np.sin(omega) * step * 2.0 * limit
        if weight is None:
            return np.asarray(value)
        around = np.cos(azimuth)[..., None] * sideways + np.sin(azimuth)[..., None] * other
        point = np.cos(omega)[..., None] * axis + np.sin(omega)[..., None] * around
        seen = towards + radius * point
        return np.asarray(value * weight(seen / np.linalg.norm(seen, axis=-1, keepdims=True)))

    # The horizon's plane touches a circle of omega where n1 cos(omega) -+ n2 sin(omega) = n1 d / R.
    edges = [0.0, float(limb)]
    if abs(n1) * d <= radius:
        for sign in (-1.0, 1.0):
            for branch in (-1.0, 1.0):
                angle = sign * np.arctan2(n2, n1) + branch * np.arccos(n1 * d / radius)
                edges.append(float(angle % (2.0 * np.pi)))
    edges = sorted({edge for edge in edges if 0.0 <= edge <= limb})
    pieces = [lambda x, lo=lo, hi=hi: integrand(x, lo, hi) for lo, hi in pairwise(edges)]
    return integrate_pieces(pieces, 2).times(light.radiance)
