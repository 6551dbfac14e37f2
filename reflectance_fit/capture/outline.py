"""From the outline of a ball to the ball: a circle seen from afar, a cone of rays in perspective."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.frames import Ball, Sphere

FloatArray = NDArray[np.float64]

# What sectors err by together: the rim's profile is not quite the model's.
_COMMON_PX = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Points of an outline in raw sensor pixels, shape (N, 2), their scatter, and the picture's (h, w)."""

    points: FloatArray
    noise_px: float
    shape: tuple[int, int]

    def ball(self, camera: Camera | None) -> Sphere | Ball:
        """A circle without a camera, the cone of rays with one."""
        return self._circle() if camera is None else self._cone(camera)

    def _circle(self) -> Sphere:
        # x^2 + y^2 = 2 cx x + 2 cy y + c about the mean, which keeps the digits.
        middle = self.points.mean(axis=0)
        x, y = (self.points - middle).T
        design = np.stack([2 * x, 2 * y, np.ones_like(x)], axis=-1)
        cx, cy, c = np.linalg.lstsq(design, x**2 + y**2)[0]
        radius = math.sqrt(c + cx**2 + cy**2)
        sigma = math.hypot(self.noise_px / math.sqrt(len(x)), _COMMON_PX)
        return Sphere((float(cx + middle[0]), float(cy + middle[1])), radius, sigma)

    def _cone(self, camera: Camera) -> Ball:
        """Rays d that touch a ball around C satisfy d . m = 1 with m = C / sqrt(|C|^2 - R^2), which is linear in m."""
        rays = camera.rays(self.points[:, 0], self.points[:, 1])
        m = np.linalg.lstsq(rays, np.ones(len(rays)))[0]
        length = float(np.linalg.norm(m))
        sigma = math.hypot(self.noise_px / math.sqrt(len(rays)), _COMMON_PX)
        axis = m / length
        return Ball(
            camera,
            (float(axis[0]), float(axis[1]), float(axis[2])),
            math.acos(1 / length),
            # Across the ray a pixel is this much of an angle; along the picture's radius a little less.
            sigma * float(axis[2]) / camera.focal_px,
        )


def joined(outlines: Sequence[Outline]) -> Outline:
    """One outline of several photographs of the same ball: all their points."""
    points = np.concatenate([outline.points for outline in outlines])
    return Outline(points, float(np.median([o.noise_px for o in outlines])), outlines[0].shape)


def ball_of_outline(stated: Sphere, camera: Camera) -> Ball:
    """The ball whose outline has its middle and its smaller half-axis where ``stated`` has centre and radius.

    In perspective the outline is an ellipse that points to the principal point.
    With the axis at an angle a from the optical axis and the half-angle b,
    its middle is at f sin(a) cos(a) / D and its smaller half-axis f sin(b) / sqrt(D), D = cos(a)^2 - sin(b)^2.
    """
    right, down = stated.center_px[0] - camera.cx, stated.center_px[1] - camera.cy
    away, smaller = math.hypot(right, down) / camera.focal_px, stated.radius_px / camera.focal_px
    k = 1 + smaller**2
    d = k / (away**2 + k**2)
    sine, cosine = math.sqrt(max(0.0, 1 - d * k)), math.sqrt(d * k)
    direction = math.atan2(down, right)
    return Ball(
        camera,
        (sine * math.cos(direction), sine * math.sin(direction), cosine),
        math.asin(smaller * math.sqrt(d)),
        stated.radius_sigma_px * cosine / camera.focal_px,
    )
