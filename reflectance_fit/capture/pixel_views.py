"""Where and at what angle each view of a capture shows the pixels of a map, which is a picture of the first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from reflectance_fit.capture.bins import AngleBins, FloatArray, Region
from reflectance_fit.capture.bundle import carried
from reflectance_fit.capture.frames import Capture, Frame, OnBoard
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.pixel_means import Places
from reflectance_fit.capture.spread import over_cone


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Angle of incidence and direction of s (from the picture's horizontal), radians: numbers, or one a pixel.

    NaN where the sample is not seen at an angle that counts.
    """

    theta: FloatArray
    s_direction: FloatArray


def view_of(capture: Capture, frame: Frame) -> object:
    """A name alike for frames of one angle of incidence at each pixel."""
    geometry = capture.geometry
    if isinstance(geometry, OnBoard):
        return geometry.poses[frame.path].view
    return str((frame.theta_deg, frame.s_axis_deg))  # NaN of a ball is not equal to itself


def to_view(capture: Capture, first: Frame, frame: Frame) -> Places | None:
    """From positions in the view of ``first`` to those in that of ``frame``; None where they are the same."""
    geometry = capture.geometry
    if not isinstance(geometry, OnBoard) or view_of(capture, frame) == view_of(capture, first):
        return None
    one, other = (np.array(geometry.poses[f.path].board) for f in (first, frame))
    return partial(carried, geometry.camera, one, other, geometry.height_mm)


def angles(capture: Capture, first: Frame, frame: Frame, x: FloatArray, y: FloatArray) -> tuple[View, float]:
    """The view of ``frame`` at positions in that of ``first``, and what a cone of light leaves of the modulation."""
    bins = bins_of(capture, frame)
    half_angle = math.radians(capture.half_angle_deg)
    if isinstance(bins, Region):
        theta, s_direction = np.radians(frame.theta_deg), np.radians(frame.s_axis_deg)
        return _through_cone(View(np.asarray(theta), np.asarray(s_direction)), half_angle)
    places = to_view(capture, first, frame)
    return _through_cone(_local(bins, *(places(x, y) if places else (x, y))), half_angle)


def _local(bins: AngleBins, x: FloatArray, y: FloatArray) -> View:
    inside, theta, s_direction = bins.angles(x, y)
    view = View(np.full(x.shape, math.nan), np.full(x.shape, math.nan))
    view.theta[inside], view.s_direction[inside] = theta, s_direction
    return view


def _through_cone(view: View, half_angle: float) -> tuple[View, float]:
    """The mean angle over the cone that a pixel collects; how far its angles spread is left out."""
    known = view.theta[np.isfinite(view.theta)]
    if half_angle == 0.0 or not known.size:
        return view, 1.0
    # The same numbers whatever part of the picture is asked for.
    grid = np.radians(np.arange(0.0, 89.1, 1.0))
    cones = [over_cone(float(theta), half_angle) for theta in grid]
    shift = np.array([cone.theta for cone in cones]) - grid
    modulation = over_cone(float(known.flat[0]), half_angle).modulation if view.theta.ndim == 0 else 1.0
    return View(view.theta + np.interp(view.theta, grid, shift), view.s_direction), modulation
