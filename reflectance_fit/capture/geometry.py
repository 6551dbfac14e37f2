"""Where in the picture which angle of incidence is seen."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.capture.bins import Bins, FloatArray, Region, SphereBins
from reflectance_fit.capture.frames import Ball, Capture, Frame, OnBoard, Sphere
from reflectance_fit.capture.ray_bins import BallBins, PlaneBins

# The model averages over a ring to the third moment of its angles; what is left is the
# fourth derivative times (2 deg)^4 / 4000, below 1e-6.  Beyond 76 degrees a pixel spans
# too much; near the centre the plane of incidence has no direction.
RING_EDGES_DEG = tuple(np.arange(8.0, 77.0, 2.0))
SECTORS = 6


def bins_of(capture: Capture, frame: Frame) -> Bins:
    """The bins that a frame is averaged over; the geometry is one that ``locate`` has found.

    The lamp of a polarizer frame fills its region.
    """
    geometry = capture.geometry
    region = Region() if frame.region is None else Region(*frame.region)
    if frame.role == "polarizer":
        return region
    analyzer = None if math.isnan(frame.analyzer_deg) else math.radians(frame.analyzer_deg)
    edges = tuple(float(np.radians(edge)) for edge in RING_EDGES_DEG)
    if isinstance(geometry, OnBoard):
        pose = geometry.poses[frame.path]
        return PlaneBins(geometry.camera, pose.normal, region, analyzer, pose.edges)
    if isinstance(geometry, Ball):
        return BallBins(geometry.camera, geometry.axis, geometry.half_angle, analyzer, edges, SECTORS)
    if isinstance(geometry, Sphere):
        return SphereBins(*geometry.center_px, geometry.radius_px, analyzer, edges, SECTORS)
    return region


def theta_sigma(capture: Capture, theta: FloatArray) -> FloatArray:
    """One standard deviation of the angles of a ball's rings (radians), by how well its radius is known.

    sin(theta) is a distance over the radius.  An error of the centre is of
    opposite signs on opposite sides of a ring, which are averaged.
    """
    geometry = capture.geometry
    if isinstance(geometry, Ball):
        return np.asarray(np.tan(theta) * geometry.half_angle_sigma / math.tan(geometry.half_angle))
    if isinstance(geometry, Sphere):
        return np.asarray(np.tan(theta) * geometry.radius_sigma_px / geometry.radius_px)
    return np.zeros_like(theta)
