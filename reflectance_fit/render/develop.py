"""From the sums of a render to its film."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render.film import Film
from reflectance_fit.render.pack import Packed
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Settings

Floats = NDArray[np.float64]


def standard_error(total: Floats, squares: Floats, groups: int) -> Floats:
    """Of the mean over groups, from the sums of their values and of the squares; NaN for a single group."""
    if groups < 2:
        return np.full_like(total, np.nan)
    variance = np.maximum(squares - total**2 / groups, 0.0) / (groups - 1)
    return np.sqrt(variance / groups)


def develop(
    scene: Scene,
    settings: Settings,
    packed: Packed,
    total: Floats,
    squares: Floats,
    groups: int,
    size: int,
    discarded: int,
) -> Film:
    """Means and errors by channel and Stokes component; what stands for three channels is repeated."""
    rows = max(len(packed.has.rows), 1)
    mean, error = total / groups, standard_error(total, squares, groups)
    shape = (*total.shape[:2], -1, rows)
    mean, error = mean.reshape(shape), error.reshape(shape)
    if packed.has.rows and scene.camera.analyzer_deg is not None:
        # Behind an analyzer all light is polarized along it.
        double = 2.0 * math.radians(scene.camera.analyzer_deg)
        state = np.array([1.0, math.cos(double), math.sin(double), 0.0])
        mean, error = mean * state, error * np.abs(state)
    mean, error = (np.repeat(picture, packed.repeat, axis=2) for picture in (mean, error))
    return Film(settings.mode, mean, error, groups * size, discarded)
