"""What a row's mean hides: the angles that a region and a cone of light span, as mean, width and modulation.

The signal behind an analyzer is linear in cos 2 phi and sin 2 phi, phi being
its angle from s, so directions of s that spread make the analyzer a weaker
one: ``modulation`` is the length of the mean of (cos 2 phi, sin 2 phi).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.camera import Camera, incidence, tilted_normals

FloatArray = NDArray[np.float64]

_GRID = 64  # midpoints across; their variance is short of that of all pixels by 1 / 64^2
_RADII, _AROUND = 32, 24


class Spread(NamedTuple):
    """Mean and standard deviation of the angle of incidence (radians), modulation, and by how much s turned."""

    theta: float
    width: float
    modulation: float
    turn: float = 0.0


def over_region(
    box: tuple[float, float, float, float], camera: Camera, theta: float, s_direction: float
) -> Spread:
    """A flat sample in the pixels x0, y0, x1, y1 (the last exclusive), at ``theta`` in the middle; radians.

    Which way the plane leans along its s axis the manifest does not say; the
    mean is over both, so that what depends on it cancels.
    """
    x0, y0, x1, y1 = box
    middle = camera.rays(np.array((x0 + x1 - 1) / 2), np.array((y0 + y1 - 1) / 2))
    steps = (np.arange(_GRID) + 0.5) / _GRID
    rays = camera.rays(*np.meshgrid(x0 - 0.5 + (x1 - x0) * steps, y0 - 0.5 + (y1 - y0) * steps))
    leaning = [incidence(rays, normal) for normal in tilted_normals(middle, theta, s_direction)]
    return _spread(np.array([t for t, _ in leaning]), np.array([s for _, s in leaning]) - s_direction)


def over_cone(theta: float, half_angle: float) -> Spread:
    """A cone of rays of ``half_angle`` around one at the incidence ``theta``, all equally bright; radians."""
    radius, around = _disc()
    tilt = half_angle * radius
    rays = np.stack([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)], axis=-1)
    normal, _ = tilted_normals(np.array([0.0, 0.0, 1.0]), theta, 0.0)
    angles, directions = incidence(rays, normal)
    before = angles < math.pi / 2
    return _spread(angles[before], directions[before])


def _spread(theta: FloatArray, turned: FloatArray) -> Spread:
    # Complex numbers, as s has no sense.
    mean = complex(np.mean(np.exp(2j * turned)))
    return Spread(float(theta.mean()), float(theta.std()), abs(mean), 0.5 * math.atan2(mean.imag, mean.real))


@lru_cache(1)
def _disc() -> tuple[FloatArray, FloatArray]:
    """Points of the unit disc that stand for equal areas of it: radius and direction."""
    radius = np.sqrt((np.arange(_RADII) + 0.5) / _RADII)
    around = np.arange(_AROUND) * 2 * math.pi / _AROUND
    r, a = np.meshgrid(radius, around)
    return r.ravel(), a.ravel()
