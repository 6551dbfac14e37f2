"""Levenberg-Marquardt on a fit's normal equations, in a box, compiled: from many starts in one call.

Where the normal equations do not hold the whole gradient (errors in the angles, censored rows), it comes from
differences of the objective; the Gauss-Newton matrix then only scales the step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.cholesky import cholesky_solve
from reflectance_fit.inference.normal_equations import normal_equations
from reflectance_fit.inference.problem import Problem, objective
from reflectance_fit.inference.rows import Rows
from reflectance_fit.physics.jit import kernel, shared

FloatArray = NDArray[np.float64]

_ITERATIONS = 60
_TOLERANCE = 1e-9  # of the decrease that the last full step promises, relative to 1 + |F|
_DAMPING, _MOST_DAMPING = 1e-3, 1e12
_STEP = 1e-3  # of the differences, in standard deviations of the coordinate alone
# From here on steps by k and by its square come to rest together.
_PLAIN_K = 1e-3
# A descent that is as near to an earlier one's end, and as high above it as that one's curvature says, ends there too.
_NEAR, _AS_FORETOLD = 9.0, 0.1
# That far above an earlier end a minimum matters to no posterior: its last digits are left open.
_HIGH, _LITTLE = 100.0, 1e-2
_SAME_FLAT = 0.02  # of the ranges: where nothing changes, only what is close by is the same


@shared
def _probe(
    problem: Problem, j: int, turn: int, squared: bool, curvature: FloatArray, x: FloatArray
) -> tuple[float, float, float]:
    """Where to go along coordinate j for its slope, the step's length, and the way it has to go at a bound, or 0."""
    root = squared and j == problem.square
    y = x[j] * x[j] if root else x[j]
    low = problem.low[j] ** 2 if root else problem.low[j]
    high = problem.high[j] ** 2 if root else problem.high[j]
    step = _STEP / math.sqrt(curvature[j, j]) if curvature[j, j] > 0 else 0.0
    width = (high - low) or 1.0
    step = min(max(step, 1e-9 * width), 1e-3 * width)
    sign = 0.0 if low <= y - step and y + step <= high else (1.0 if y - step < low else -1.0)
    moved = y + ((1 - 2 * turn) * step if sign == 0.0 else (1 + turn) * sign * step)
    return (math.sqrt(moved) if root else moved), step, sign


@shared
def _step(
    gradient: FloatArray,
    curvature: FloatArray,
    damping: float,
    y: FloatArray,
    low: FloatArray,
    high: FloatArray,
    step: FloatArray,
) -> float:
    """The damped Newton step inside the box; returns the decrease that the quadratic model promises.

    What would leave the box is put onto its bound and the rest solved again.
    """
    size = len(y)
    held = np.empty(size, dtype=np.bool_)
    for j in range(size):
        step[j] = 0.0
        held[j] = (y[j] <= low[j] and gradient[j] > 0) or (y[j] >= high[j] and gradient[j] < 0)
    matrix, rhs = np.empty((size, size)), np.empty(size)
    for _ in range(size):
        for j in range(size):
            rhs[j] = step[j] if held[j] else -gradient[j]
            for m in range(size):
                free = not (held[j] or held[m])
                matrix[j, m] = curvature[j, m] if free else 0.0
                if held[m] and not held[j]:
                    rhs[j] -= curvature[j, m] * step[m]
            floor = 1e-12 / (high[j] - low[j]) ** 2 if high[j] > low[j] else 1.0
            matrix[j, j] = 1.0 if held[j] else curvature[j, j] * (1 + damping) + floor
        if not math.isfinite(cholesky_solve(matrix, rhs)):
            return math.nan
        worst, outside = 0.0, -1
        for j in range(size):
            step[j] = rhs[j]
            beyond = max(low[j] - y[j] - step[j], y[j] + step[j] - high[j]) / (high[j] - low[j] + 1e-300)
            if not held[j] and beyond > worst:
                worst, outside = beyond, j
        if outside < 0:
            break
        held[outside] = True
        step[outside] = (low[outside] if step[outside] < 0 else high[outside]) - y[outside]
    promised = 0.0
    for j in range(size):
        step[j] = min(max(step[j], low[j] - y[j]), high[j] - y[j])
    for j in range(size):
        promised -= 2 * gradient[j] * step[j]
        for m in range(size):
            promised -= step[j] * curvature[j, m] * step[m]
    return promised


@shared
def _joins(
    problem: Problem, x: FloatArray, value: float, end: FloatArray, lowest: float, curvature: FloatArray
) -> bool:
    """Whether ``x`` lies in the well around ``end``, and not deep in a narrower one."""
    rise = 0.0
    for j in range(len(x)):
        if abs(x[j] - end[j]) > _SAME_FLAT * (problem.high[j] - problem.low[j]):
            return False
        for m in range(len(x)):
            rise += (x[j] - end[j]) * curvature[j, m] * (x[m] - end[m])
    return rise < _NEAR and abs(value - lowest - rise) <= _AS_FORETOLD * rise + _TOLERANCE * (1 + abs(value))


@kernel
def descend_all(
    rows: Rows, problem: Problem, points: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray, int]:
    """Move each of the points, shape (D, P), to a local minimum.

    The objectives there, whether the steps have come to rest, half of the
    Hessians, shape (D, P, P), and how many NaN were seen.  The objective is inf
    of a point outside of the model's domain, and of one on its way to where an
    earlier one has arrived.  By the square of k, where k itself is a
    coordinate, and where that says nothing then by k.
    """
    size, n = points.shape[1], len(rows.value)
    values, rested = np.empty(len(points)), np.zeros(len(points), dtype=np.bool_)
    curvatures = np.zeros((len(points), size, size))
    nan_count, best = 0, math.inf
    whitened, gains = np.empty(n), np.empty(rows.gains)
    spare, spare_gains = np.empty(n), np.empty(rows.gains)
    gradient, step, y, trial = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    low, high = np.empty(size), np.empty(size)
    root = problem.square
    for d in range(len(points)):
        x, curvature = points[d], curvatures[d]
        value, converged, joined = math.inf, False, False
        squared = root >= 0
        for j in range(size):
            y[j], low[j], high[j], step[j] = x[j], problem.low[j], problem.high[j], 0.0
            if squared and j == root:
                y[j], low[j], high[j] = y[j] ** 2, low[j] ** 2, high[j] ** 2
        promised, damping, iteration = 0.0, _DAMPING, 0
        fresh = True  # whether the normal equations are still to be set up at x
        probe, ahead = -1, 0.0  # which difference comes next, and the first of its two values
        while True:
            # Every evaluation of the objective is this one: a second call would be compiled for seconds.
            for j in range(size):
                if probe >= 0:
                    trial[j] = x[j]
                else:
                    trial[j] = math.sqrt(y[j] + step[j]) if squared and j == root else y[j] + step[j]
            if probe >= 0:
                trial[probe // 2] = _probe(problem, probe // 2, probe % 2, squared, curvature, x)[0]
            there = objective(rows, problem, trial, spare, spare_gains)
            renewed = False
            if probe >= 0:
                if probe % 2 == 0:
                    ahead = there
                else:
                    _, length, sign = _probe(problem, probe // 2, 1, squared, curvature, x)
                    slope = ahead - there if sign == 0.0 else (4 * ahead - there - 3 * value) * sign
                    if math.isfinite(slope):
                        gradient[probe // 2] = 0.25 * slope / length
                probe += 1
                if probe < 2 * size:
                    continue
                probe, renewed = -1, True
            else:
                if math.isinf(there):
                    nan_count += 1
                    if math.isinf(value):
                        break
                if there < value:
                    damping = max(damping * (0.1 if value - there > 0.25 * promised else 2.0), 1e-9)
                    value, fresh = there, True
                    for j in range(size):
                        x[j] = trial[j]
                        y[j] += step[j]
                    for i in range(n):
                        whitened[i] = spare[i]
                    for g in range(rows.gains):
                        gains[g] = spare_gains[g]
                    iteration += 1
                    for e in range(d):
                        if rested[e] and not joined:
                            joined = _joins(problem, x, value, points[e], values[e], curvatures[e])
                    if joined:
                        value = math.inf
                        break
                else:
                    damping *= 8.0
                if converged or damping > _MOST_DAMPING or iteration > _ITERATIONS:
                    if not squared:
                        break
                    if converged and x[root] > _PLAIN_K:
                        for j in range(size):
                            curvature[root, j] *= 2 * x[root]
                        for j in range(size):
                            curvature[j, root] *= 2 * x[root]
                        break
                    # Once more, by k itself.
                    squared, fresh, converged, damping, iteration = False, True, False, _DAMPING, 0
                    y[root], low[root], high[root] = x[root], problem.low[root], problem.high[root]
                if fresh:
                    normal_equations(rows, problem, x, squared, whitened, gains, gradient, curvature)
                    fresh = False
                    if not problem.exact:
                        probe = 0
                        continue
                    renewed = True
            # First the full step, to see what it promises, then the damped one.
            for turn in range(0 if renewed else 1, 2):
                if turn == 1 and converged:
                    break
                promised = _step(gradient, curvature, turn * damping, y, low, high, step)
                if turn == 0:
                    # Held at a bound, a step may promise an increase: that is no rest.
                    little = max(_TOLERANCE * (1 + abs(value)), _LITTLE * (value - best - _HIGH))
                    converged = abs(promised) <= little
                elif math.isnan(promised):
                    for j in range(size):
                        step[j] = 0.0
        values[d], rested[d] = value, converged and not joined
        if rested[d]:
            best = min(best, value)
    return values, rested, curvatures, nan_count
