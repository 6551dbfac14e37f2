"""Rectangle light: Lambert's contour formula for the irradiance, and the solid angle.

Vectors from the receiver to the corners are v_i, shape (..., 4, 3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.area_lights import RectangleLight

Floats = NDArray[np.float64]

_TINY = np.finfo(np.float64).tiny


def rectangle_contour(light: RectangleLight, position: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Irradiance over radiance of the part above the horizon, and half the contour's length.

    E / L = 1/2 sum_i angle_i n . (v_i x v_i+1) / |v_i x v_i+1|

    over the edges of the clipped light, the piece of the horizon among them.  The
    error is some ulps of half the sum of the angles, the second value.  Unit normal.

    Notes
    -----
    Lambert, Photometria (1760); proof by Stokes' theorem: Arvo, Analytic Methods for Simulated Light
    Transport (1995), 2.3.
    """
    a = light.corners - position[..., None, :]
    edge = light.edges
    front = np.sum(light.normal * a[..., 0, :], axis=-1) < 0.0
    height_a = np.sum(normal[..., None, :] * a, axis=-1)
    height_b = np.roll(height_a, -1, axis=-1)
    up_a, up_b = height_a >= 0.0, height_b >= 0.0
    leaves, returns = up_a & ~up_b, ~up_a & up_b
    # Where an edge meets the horizon, as a fraction of its length.
    crosses = height_a / np.where(up_a == up_b, 1.0, height_a - height_b)
    start = np.where(up_a, 0.0, np.where(up_b, crosses, 0.0))
    stop = np.where(up_a, np.where(up_b, 1.0, crosses), np.where(up_b, 1.0, 0.0))
    meeting = a + crosses[..., None] * edge
    # A plane cuts a convex contour at most twice, so each sum has one term or none.
    exit_, entry = (np.sum(np.where(side[..., None], meeting, 0.0), axis=-2) for side in (leaves, returns))
    first = np.concatenate([a + start[..., None] * edge, exit_[..., None, :]], axis=-2)
    along = np.concatenate([(stop - start)[..., None] * edge, (entry - exit_)[..., None, :]], axis=-2)
    # v_i x v_i+1 by way of the edge keeps the digits of a short one.
    cross = np.cross(first, along)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, np.sum(first * (first + along), axis=-1))
    slope = np.sum(normal[..., None, :] * cross, axis=-1) / np.maximum(length, _TINY)
    # Corners run counter-clockwise for the receiver in front, which turns the cross products away from it.
    value = np.where(front, -0.5 * np.sum(angle * slope, axis=-1), 0.0)
    return value, np.where(front, 0.5 * np.sum(angle, axis=-1), 0.0)


def rectangle_solid_angle(light: RectangleLight, position: Floats) -> Floats:
    """Of both triangles, tan(omega / 2) = v_1 . (v_2 x v_3) / (r_1 r_2 r_3 + (v_1 . v_2) r_3 + ...).

    The triple product is twice a triangle's area times the receiver's height above it, so nothing cancels
    however far the light is.  0 from behind.

    Notes
    -----
    A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    v = light.corners - position[..., None, :]
    r = np.linalg.norm(v, axis=-1)
    height = -np.sum(light.normal * v[..., 0, :], axis=-1)
    area = np.linalg.norm(light.edges[0]) * np.linalg.norm(light.edges[1])

    def triangle(i: int, j: int, k: int) -> Floats:
        def dot(m: int, n: int) -> Floats:
            return np.asarray(np.sum(v[..., m, :] * v[..., n, :], axis=-1))

        base = r[..., i] * r[..., j] * r[..., k]
        base = base + dot(i, j) * r[..., k] + dot(j, k) * r[..., i] + dot(k, i) * r[..., j]
        return np.asarray(2.0 * np.arctan2(height * area, base))

    return np.where(height > 0.0, triangle(0, 1, 2) + triangle(0, 2, 3), 0.0)
