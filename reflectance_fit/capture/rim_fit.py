"""A closed smooth curve, fitted to the rim of a ball in all sectors together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize, minimize_scalar

from reflectance_fit.capture.rim import (
    INSIDE,
    OUTSIDE,
    PLACES,
    SEARCH,
    SHIFTS,
    misfits,
    profiles,
    smooth_misfit,
)
from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NOT_SEEN = (
    "does not show the outline of a ball all around; photograph it (role: geometry) before a "
    "darker or brighter ground, or state center_px and radius_px"
)
_SECTORS = 96
_MIDDLES = (np.arange(_SECTORS) + 0.5) * 2 * math.pi / _SECTORS
_LOG_BLURS = (math.log(0.15), math.log(4.0))
_HARMONICS = 3  # an outline in perspective is an ellipse: shift and stretch
_LEAST_GAIN = 25.0  # by how many variances an edge must explain more than a smooth curve does
_LEAST_SHARE = 0.5  # of the sectors
# By how much chi2 of a profile must fall for a step at the rim, on average.  A ball in an even surround, where there is
# none, comes to 2, behind a very sharp lens to 6, at a cost of 0.04 px; one before a ground brighter by a third to 8.
_STEP_SEEN = 4.0
_LEAST_OFF = 0.4  # pixels, that an edge lies from the others' curve without being another edge


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Pixels ``step`` apart, the first one centred at (``x``, ``y``); values of shape (h, w)."""

    values: FloatArray
    x: float = 0.0
    y: float = 0.0
    step: int = 1


class Round:
    """A closed curve: its distance from (x, y) as a Fourier series of the direction."""

    def __init__(self, x: float, y: float, series: FloatArray) -> None:
        self.x, self.y, self.series = x, y, series

    def radius(self, direction: FloatArray) -> FloatArray:
        return np.asarray(_waves(direction) @ self.series)

    def scaled(self, factor: float) -> Round:
        """On a picture ``factor`` times finer: there the first pixel's middle is at (factor - 1) / 2."""
        first = (factor - 1) / 2
        return Round(self.x * factor + first, self.y * factor + first, self.series * factor)


def circle_of(x: float, y: float, radius: float) -> Round:
    """A circle as such a curve."""
    return Round(x, y, np.array([radius] + [0.0] * (2 * _HARMONICS)))


def _waves(direction: FloatArray) -> FloatArray:
    turns = direction[..., None] * np.arange(1, _HARMONICS + 1)
    return np.concatenate([np.ones((*direction.shape, 1)), np.cos(turns), np.sin(turns)], axis=-1)


def refined(
    planes: Sequence[Sequence[Lattice]], outline: Round, *, melting: bool = False
) -> tuple[FloatArray, float, Round]:
    """Points on the outline near ``outline``, shape (N, 2), how far they may be off together, and the curve through them.

    Pixels of each of ``planes`` are alike in what they see, those of two are
    not: each has profiles of its own.  With ``melting`` the ball may melt into
    its surround: where no step is seen, none is fitted.
    Raises ReflectanceFitError where less than half of the outline is seen.
    """
    parts = [_profiles(lattices, outline) for lattices in planes]
    means, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    middles, radius = np.tile(_MIDDLES, len(planes)), float(outline.series[0])
    waves = _waves(middles)
    seen = _seen(means, weights, waves, radius)

    def best(step: bool) -> tuple[float, FloatArray, float]:
        def at(log_blur: float) -> tuple[float, FloatArray, float]:
            left = misfits(means[seen], weights[seen], math.exp(log_blur), radius, step=step)
            return _joint(left, weights[seen], waves[seen])

        return at(_minimum(lambda log_blur: at(log_blur)[0], 0.03))

    loss, change, sigma = best(step=True)
    if melting:
        without = best(step=False)
        if 2 * (without[0] - loss) < _STEP_SEEN * np.count_nonzero(seen):
            _, change, sigma = without
    moved = Round(outline.x, outline.y, outline.series + change)
    at = np.unique(middles[seen])
    far = moved.radius(at)
    return np.stack([outline.x + far * np.cos(at), outline.y + far * np.sin(at)], axis=-1), sigma, moved


def _minimum(loss: Callable[[float], float], precision: float) -> float:
    """The logarithm of the blur where ``loss`` is least."""
    found = minimize_scalar(loss, bounds=_LOG_BLURS, method="bounded", options={"xatol": precision})
    return float(found.x)


def _seen(means: FloatArray, weights: FloatArray, waves: FloatArray, radius: float) -> BoolArray:
    """Profiles with an edge, and one that lies with the others'."""

    def of(log_blur: float) -> FloatArray:
        return misfits(means, weights, math.exp(log_blur), radius, step=True)

    left = of(_minimum(lambda log_blur: float(np.log(of(log_blur).min(axis=1)).sum()), 0.1))
    k = np.argmin(left, axis=1)
    gain = weights.sum(axis=1) * (smooth_misfit(means, weights) / left.min(axis=1) - 1)
    full = np.count_nonzero(weights, axis=1) > len(PLACES) // 2
    seen = (gain > _LEAST_GAIN) & full & (k > 0) & (k < len(SHIFTS) - 1)
    for _ in range(10):
        if seen.sum() < _LEAST_SHARE * len(seen):
            raise ReflectanceFitError(NOT_SEEN)
        off = SHIFTS[k] - waves @ np.linalg.lstsq(waves[seen], SHIFTS[k][seen])[0]
        near = np.abs(off) <= max(4 * 1.4826 * float(np.median(np.abs(off[seen]))), _LEAST_OFF)
        if np.array_equal(seen & near, seen):
            break
        seen &= near
    return np.asarray(seen)


def _joint(left: FloatArray, weights: FloatArray, waves: FloatArray) -> tuple[float, FloatArray, float]:
    """The smooth change of the outline that all profiles together prefer: minus log likelihood, change, sigma of its mean.

    Each profile's noise is its own, so its misfit counts by its logarithm.
    """
    pixels = weights.sum(axis=1)
    # Cubics between the shifts, highest power first, shape (4, shifts - 1, rows).
    cubics = CubicSpline(SHIFTS, 0.5 * pixels[:, None] * np.log(left), axis=1).c
    rows = np.arange(len(pixels))

    def at(change: FloatArray, order: int) -> FloatArray:
        places = np.clip(waves @ change, -SEARCH, SEARCH)
        piece = np.minimum(np.searchsorted(SHIFTS, places, side="right"), len(SHIFTS) - 1) - 1
        u, (a, b, c, d) = places - SHIFTS[piece], cubics[:, piece, rows]
        return np.asarray(
            (((a * u + b) * u + c) * u + d, (3 * a * u + 2 * b) * u + c, 6 * a * u + 2 * b)[order]
        )

    change: FloatArray = np.asarray(
        np.linalg.lstsq(waves, SHIFTS[np.argmin(left, axis=1)])[0], dtype=np.float64
    )

    def loss(moved: FloatArray) -> tuple[float, FloatArray]:
        return float(at(moved, 0).sum()), np.asarray(waves.T @ at(moved, 1))

    found: Any = minimize(loss, change, jac=True, method="BFGS")
    bend = np.maximum(at(found.x, 2), 0.0)
    covariance = np.linalg.pinv(waves.T @ (bend[:, None] * waves))
    return float(found.fun), np.asarray(found.x), math.sqrt(covariance[0, 0])


def _profiles(lattices: Sequence[Lattice], outline: Round) -> tuple[FloatArray, FloatArray]:
    """Profiles across ``outline`` by sectors, of all pixels near it."""
    near = [_near(lattice, outline) for lattice in lattices]
    direction, distance, value = (np.concatenate(part) for part in zip(*near, strict=True))
    sector = np.minimum((direction / (2 * math.pi) * _SECTORS).astype(np.int64), _SECTORS - 1)
    return profiles(sector, _SECTORS, distance, value)


def _near(lattice: Lattice, outline: Round) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Direction from the middle, distance outwards from the outline, and value of the pixels about it."""
    reach = float(outline.series[0] + np.abs(outline.series[1:]).sum()) + OUTSIDE + 2
    rows, columns = (
        slice(
            max(0, math.floor((middle - reach - first) / lattice.step)),
            max(0, math.ceil((middle + reach - first) / lattice.step) + 1),
        )
        for middle, first in ((outline.y, lattice.y), (outline.x, lattice.x))
    )
    values: FloatArray = lattice.values[rows, columns]
    y, x = (np.arange(length, dtype=np.float64) for length in values.shape)
    across = lattice.x + lattice.step * (x + columns.start) - outline.x
    down = (lattice.y + lattice.step * (y + rows.start) - outline.y)[:, None]
    far = np.hypot(across, down)
    across, down = np.broadcast_arrays(across, down)
    ring = np.abs(far - outline.series[0]) < reach - outline.series[0] + INSIDE - OUTSIDE
    direction = np.arctan2(down[ring], across[ring]) % (2 * math.pi)
    distance = far[ring] - outline.radius(direction)
    close = (distance > -INSIDE) & (distance < OUTSIDE)
    return direction[close], distance[close], values[ring][close]
