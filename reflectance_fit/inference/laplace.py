"""Laplace's approximation of a basin: its mode, and the curvature over the width that it gives itself."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.proposal import Component, LogDensity, component

FloatArray = NDArray[np.float64]

_ROUNDS = 12
_ONE_ROUND = 1e-3, 1e3  # how far one may trust a curvature that was measured over another length
# Settled: the curvature over one standard deviation is 1 within a quarter, the mode within a quarter of one.
_SETTLED_CURVATURE, _SETTLED_STEP = 0.25, 0.25
_LONGEST_STEP = 3.0
_STEPS = 0.4 ** np.arange(6)
_SCALES = np.geomspace(1e-8, 0.5, 28)  # of a range, for the first guess of a width


def at_basin(
    log_density: LogDensity, x: FloatArray, width: FloatArray, ranges: FloatArray
) -> tuple[float, Component]:
    """Log of the mass that Laplace's approximation gives a basin, and its component of share 1.

    ``x``, shape (P,), is near the mode; ``width`` (P,) the distance along each
    axis over which the density falls noticeably, or a factor (P, P) of the
    covariance as far as it is known.  Damped Newton steps, whose differences
    are taken over the standard deviations that they give.
    """
    low, high = ranges.T
    size = len(x)

    def value(points: FloatArray) -> FloatArray:
        points = np.where(points < low, 2 * low - points, points)
        return log_density(np.where(points > high, 2 * high - points, points))

    # x + factor z has z of unit covariance once the curvature in z is the identity.
    factor: FloatArray = np.diag(width) if width.ndim == 1 else width
    stencil = _stencil(size)
    for _ in range(_ROUNDS):
        around = value(x + stencil @ factor.T)
        here = float(around[0])
        slope, curvature = _derivatives(around, size)
        values, vectors = np.linalg.eigh(curvature)
        values = np.clip(values, *_ONE_ROUND)
        along = (slope @ vectors) / np.sqrt(values)
        length = math.sqrt(along @ along)
        factor = _limited(factor @ (vectors / np.sqrt(values)), ranges)
        near = np.abs(np.log(values)).max() < _SETTLED_CURVATURE
        if near and length < _SETTLED_STEP:
            break
        if length > _SETTLED_STEP / 10:
            tried = x + (min(1.0, _LONGEST_STEP / length) * _STEPS)[:, None] * (factor @ along)
            tried = np.clip(np.vstack([x, tried]), low, high)
            along_it = value(tried)
            best = np.argmax(along_it)
            x, here = tried[best], float(along_it[best])
    found = component(1.0, x, factor @ factor.T, ranges)
    return here + float(np.log(found.factor.diagonal()).sum()), found


def _limited(factor: FloatArray, ranges: FloatArray) -> FloatArray:
    """A parameter that hardly anything feels is as wide as a uniform law over its range, a score as its prior."""
    extent = ranges[:, 1] - ranges[:, 0]
    bounded = np.isfinite(extent)
    sd = np.sqrt(np.sum(factor**2, axis=1))
    wide = sd > np.where(bounded, 0.25 * extent, 1.2)
    if not wide.any():
        return factor
    scaled = factor[wide] / np.where(bounded, extent / math.sqrt(12.0), 1.0)[wide, None]
    # The inverse of a matrix of eigenvalues from 1 up.
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    return np.asarray(factor @ (vectors / np.sqrt(1 + np.maximum(values, 0.0))))


def first_widths(log_density: LogDensity, x: FloatArray, ranges: FloatArray) -> FloatArray:
    """Rough widths at ``x``, shape (P,): where the log density has fallen by a half, along each axis."""
    size = len(x)
    extent = ranges[:, 1] - ranges[:, 0]
    steps = np.where(np.isfinite(extent), extent, 2.0)[:, None] * _SCALES
    points = np.tile(x, (size, 2, len(_SCALES), 1))
    each = np.arange(size)
    points[each, 0, :, each] += steps
    points[each, 1, :, each] -= steps
    density = log_density(np.vstack([x, points.reshape(-1, size)]))
    fall = (density[0] - density[1:]).reshape(size, 2, -1)
    within = fall.min(axis=1) < 0.5
    return np.asarray(np.max(np.where(within, steps, steps[:, :1]), axis=1))


@lru_cache(maxsize=16)
def _stencil(size: int) -> FloatArray:
    """The centre, a step to either side along each axis, and the same along each pair of axes."""
    unit = np.eye(size)
    pairs = [unit[i] + unit[j] for i, j in itertools.combinations(range(size), 2)]
    return np.array([0 * unit[0], *unit, *-unit, *pairs, *(-pair for pair in pairs)])


@lru_cache(maxsize=16)
def _pairs(size: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of each pair of axes, in the order of `_stencil`."""
    return np.triu_indices(size, 1)


def _derivatives(found: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Slope, shape (P,), and minus the second differences, shape (P, P), from values on the stencil.

    Where a neighbour is outside of the model's domain the step is long enough as it is.
    """
    plus, minus = found[1 : size + 1], found[size + 1 : 2 * size + 1]
    with np.errstate(invalid="ignore"):
        slope = 0.5 * (plus - minus)
        diagonal = 2 * found[0] - plus - minus
        along, against = found[2 * size + 1 :].reshape(2, -1)
        rows, columns = _pairs(size)
        mixed = found[0] - 0.5 * (along + against + diagonal[rows] + diagonal[columns])
    slope = np.where(np.isfinite(slope), slope, 0.0)
    curvature = np.diag(np.where(np.isfinite(diagonal), diagonal, 1.0))
    curvature[rows, columns] = curvature[columns, rows] = np.where(np.isfinite(mixed), mixed, 0.0)
    return slope, curvature
