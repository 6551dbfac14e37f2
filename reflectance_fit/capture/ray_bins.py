"""Bins of angles along the rays of a camera: a plane whose normal is known, and a ball in perspective."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from reflectance_fit.capture.bins import BoolArray, Box, FloatArray, Region, Ringed
from reflectance_fit.capture.camera import Camera, Vector, ball_incidence, incidence

_RIM = 64  # rays around a ball, to find the box that holds it


@dataclass(frozen=True, slots=True)
class PlaneBins(Ringed):
    """A flat sample in a region of the picture, one normal (towards the camera) for all of it."""

    camera: Camera
    normal: Vector
    region: Region
    analyzer: float | None
    edges: tuple[float, ...]
    sectors: int = 1

    @property
    def curvature(self) -> float:
        return 0.0

    def box(self) -> Box:
        return self.region.box()

    def angles(self, x: FloatArray, y: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
        inside = self.region.holds(x, y)
        theta, s_direction = incidence(self.camera.rays(x[inside], y[inside]), np.array(self.normal))
        ringed = (theta >= self.edges[0]) & (theta < self.edges[-1])
        inside[inside] = ringed
        return inside, theta[ringed], s_direction[ringed]


@dataclass(frozen=True, slots=True)
class BallBins(Ringed):
    """An opaque ball that fills the cone of ``half_angle`` (radians) about ``axis`` (a unit vector)."""

    camera: Camera
    axis: Vector
    half_angle: float
    analyzer: float | None
    edges: tuple[float, ...]
    sectors: int

    @property
    def curvature(self) -> float:
        return 1.0 / (self.camera.focal_px * math.tan(self.half_angle))

    def box(self) -> Box:
        around = self.camera.pixels(rim(np.array(self.axis), self.half_angle, _RIM))
        # Between rays of the rim the outline bulges by less than a pixel.
        low = np.maximum(np.floor(around.min(axis=0)).astype(int) - 1, 0)
        high = np.maximum(np.ceil(around.max(axis=0)).astype(int) + 2, 0)
        return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))

    def angles(self, x: FloatArray, y: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
        theta, s_direction, inside = ball_incidence(
            self.camera.rays(x, y), np.array(self.axis), self.half_angle
        )
        inside &= (theta >= self.edges[0]) & (theta < self.edges[-1])
        return inside, theta[inside], s_direction[inside]


def rim(axis: FloatArray, half_angle: float, count: int) -> FloatArray:
    """Unit vectors around a cone, shape (count, 3)."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    turn = np.linspace(0.0, 2 * math.pi, count, endpoint=False)[:, None]
    across = np.cos(turn) * side + np.sin(turn) * np.cross(axis, side)
    return np.asarray(math.cos(half_angle) * axis + math.sin(half_angle) * across)
