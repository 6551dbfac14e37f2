"""A camera as a map from pixels to rays, and the angles at which rays meet a surface.

Camera coordinates: x to the right and y down as pixels run, z along the
optical axis into the scene; pixel centres have integer coordinates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Vector = tuple[float, float, float]

# The step shrinks at least tenfold where distortion moves a point by less than a tenth.
_STEPS = 20


@dataclass(frozen=True, slots=True)
class Camera:
    """Square pixels, radial distortion: OpenCV's model with fx = fy and k1, k2 alone.

    ``focal_px`` and the principal point ``cx``, ``cy`` are in raw sensor pixels.
    """

    focal_px: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture whose middle the principal point is."""
        return round(2 * self.cy + 1), round(2 * self.cx + 1)

    def rays(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Unit vectors from the camera through pixels, shape S + (3,) for x and y of shape S."""
        seen_x, seen_y = (x - self.cx) / self.focal_px, (y - self.cy) / self.focal_px
        u, v = seen_x, seen_y
        if self.k1 or self.k2:
            for _ in range(_STEPS):
                square = u * u + v * v
                stretch = 1.0 + square * (self.k1 + square * self.k2)
                u, v = seen_x / stretch, seen_y / stretch
        length = np.sqrt(u * u + v * v + 1.0)
        return np.stack([u / length, v / length, 1.0 / length], axis=-1)

    def pixels(self, rays: FloatArray) -> FloatArray:
        """``rays`` backwards: where directions before the camera are seen, shape (..., 3) to (..., 2)."""
        at = rays[..., :2] / rays[..., 2:]
        square = np.sum(at**2, axis=-1, keepdims=True)
        stretched = at * (1.0 + square * (self.k1 + square * self.k2))
        return np.asarray(self.focal_px * stretched + np.array([self.cx, self.cy]))


def incidence(rays: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angle of incidence of what is mirrored into each ray, and the direction of s in the picture.

    Parameters
    ----------
    rays : float, shape S + (3,)
        Unit vectors from the camera to the surface.
    normals : float, broadcastable to S + (3,)
        Unit normals of the surface, towards the camera.

    Returns
    -------
    theta, s_direction : radians, shape S
        theta is that between normal and ray, as a mirror has it for light and
        camera alike; above pi / 2 the camera sees the back.  s is across the
        plane of both, counter-clockwise from the picture's horizontal and
        without a sense, carried along its ray to the optical axis as lenses
        do: by the shortest turn of the ray.
    """
    s = np.cross(normals, rays)
    cosine = -np.sum(normals * rays, axis=-1)
    return np.arctan2(np.linalg.norm(s, axis=-1), cosine), _in_picture(s, rays)


def ball_incidence(
    rays: FloatArray, axis: FloatArray, half_angle: float
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """``incidence`` on a ball that fills a cone of rays.

    Parameters
    ----------
    rays : float, shape S + (3,)
        Unit vectors from the camera.
    axis : float, shape (3,)
        Unit vector to the centre of the ball.
    half_angle : float in (0, pi / 2)
        Between it and the rays that touch the ball, radians.

    Returns
    -------
    theta, s_direction, inside : shape S
        theta is NaN where ``inside`` is false, beside the ball.

    Notes
    -----
    The law of sines in the triangle of camera, centre and point: the sine of
    the incidence is to that of the angle from the axis as the centre's
    distance is to the radius, and the sine of half_angle is the radius over that distance.
    """
    s = np.cross(axis, rays)
    sine = np.linalg.norm(s, axis=-1) / math.sin(half_angle)
    inside = (sine < 1.0) & (rays @ axis > 0)
    # A normal leans away from the axis as its ray does, and further.
    return np.arcsin(np.where(inside, sine, np.nan)), _in_picture(s, rays), inside


def _in_picture(s: FloatArray, rays: FloatArray) -> FloatArray:
    """Direction of a vector across its ray, after the shortest turn that brings the ray to the z axis."""
    share = s[..., 2] / (1.0 + rays[..., 2])
    across, down = s[..., 0] - share * rays[..., 0], s[..., 1] - share * rays[..., 1]
    return np.asarray(np.arctan2(-down, across))


def tilted_normals(ray: FloatArray, theta: float, s_direction: float) -> tuple[FloatArray, FloatArray]:
    """The two unit normals of a plane that ``ray`` meets at ``theta`` with s along ``s_direction``; ``incidence`` backwards.

    A direction of s has no sense, so the plane may lean to either side.
    """
    s = np.array([math.cos(s_direction), -math.sin(s_direction), 0.0])
    # From the optical axis out to the ray: the reflection in incidence() backwards.
    half = ray + np.array([0.0, 0.0, 1.0])
    s = s - half * (s @ ray) / (1.0 + ray[2])
    p = np.cross(s, ray)
    return -math.cos(theta) * ray + math.sin(theta) * p, -math.cos(theta) * ray - math.sin(theta) * p
