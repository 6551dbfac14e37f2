"""Levenberg-Marquardt on a fit's normal equations, in a box, compiled: from many starts in one call.

Where the normal equations do not hold the whole gradient (errors in the angles, censored rows), it comes from
differences of the objective; the Gauss-Newton matrix then only scales the step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.likelihood import cholesky_solve
from reflectance_fit.inference.normal_equations import Problem, normal_equations, objective
from reflectance_fit.inference.rows import Rows
from reflectance_fit.physics.jit import kernel

FloatArray = NDArray[np.float64]

_ITERATIONS = 60
_TOLERANCE = 1e-11  # of the decrease that a full step promises, relative to 1 + |F|
_DAMPING, _MOST_DAMPING = 1e-3, 1e12
_STEP = 1e-3  # of the differences, in standard deviations of the coordinate alone


@kernel
def _differences(
    rows: Rows,
    problem: Problem,
    x: FloatArray,
    value: float,
    squared: bool,
    curvature: FloatArray,
    gradient: FloatArray,
    whitened: FloatArray,
    gains: FloatArray,
) -> None:
    """Half of the gradient, of second order, one-sided at a bound."""
    for j in range(len(x)):
        here = x[j]
        root = squared and j == problem.square
        y = here * here if root else here
        step = _STEP / math.sqrt(curvature[j, j]) if curvature[j, j] > 0 else 0.0
        width = (problem.high[j] ** 2 if root else problem.high[j] - problem.low[j]) or 1.0
        step = min(max(step, 1e-9 * width), 1e-3 * width)
        low = problem.low[j] ** 2 if root else problem.low[j]
        high = problem.high[j] ** 2 if root else problem.high[j]
        sign = 0.0 if low <= y - step and y + step <= high else (1.0 if y - step < low else -1.0)
        one, two = 0.0, 0.0
        for turn in range(2):
            moved = y + ((1 - 2 * turn) * step if sign == 0.0 else (1 + turn) * sign * step)
            x[j] = math.sqrt(moved) if root else moved
            one, two = two, objective(rows, problem, x, whitened, gains)
        slope = (one - two) / (2 * step) if sign == 0.0 else (4 * one - two - 3 * value) / (2 * sign * step)
        if math.isfinite(slope):
            gradient[j] = 0.5 * slope
        x[j] = here


@kernel
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
    held = np.zeros(size, dtype=np.bool_)
    step[:] = 0.0
    for j in range(size):
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
        step[:] = rhs
        worst, outside = 0.0, -1
        for j in range(size):
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


@kernel
def descend(rows: Rows, problem: Problem, x: FloatArray) -> tuple[float, bool, int]:
    """Move ``x`` to a local minimum: the objective there, whether the steps have come to rest, and NaN seen.

    By the square of k, where k itself is a coordinate, and then by k.
    """
    size, n = len(x), len(rows.value)
    whitened, gains = np.empty(n), np.empty(rows.gains)
    spare, spare_gains = np.empty(n), np.empty(rows.gains)
    gradient, curvature = np.empty(size), np.empty((size, size))
    step, y, trial = np.empty(size), np.empty(size), x.copy()
    low, high = problem.low.copy(), problem.high.copy()
    value, nan_count, converged = math.inf, 0, False
    squared = problem.square >= 0
    y[:] = x
    if squared:
        root = problem.square
        y[root], low[root], high[root] = x[root] ** 2, low[root] ** 2, high[root] ** 2
    step[:], promised, damping, iteration = 0.0, 0.0, _DAMPING, 0
    fresh = True  # whether the normal equations are still to be set up at x
    while True:
        # Every evaluation of the objective is this one: the kernel is inlined wherever it is called.
        for j in range(size):
            trial[j] = math.sqrt(y[j] + step[j]) if squared and j == problem.square else y[j] + step[j]
        there = objective(rows, problem, trial, spare, spare_gains)
        if math.isinf(there):
            nan_count += 1
            if math.isinf(value):
                return value, False, nan_count
        if there < value:
            damping = max(damping * (0.1 if value - there > 0.25 * promised else 2.0), 1e-9)
            value, x[:], fresh = there, trial, True
            y += step
            whitened[:], gains[:] = spare, spare_gains
            iteration += 1
        else:
            damping *= 8.0
        if converged or damping > _MOST_DAMPING or iteration > _ITERATIONS:
            if not squared:
                return value, converged, nan_count
            # Once more, by k itself.
            squared, fresh, converged, damping, iteration = False, True, False, _DAMPING, 0
            y[:], low[:], high[:] = x, problem.low, problem.high
        if fresh:
            normal_equations(rows, problem, x, squared, whitened, gains, gradient, curvature)
            if not problem.exact:
                _differences(rows, problem, x, value, squared, curvature, gradient, spare, spare_gains)
            promised = _step(gradient, curvature, 0.0, y, low, high, step)
            # Held at a bound, a step may promise an increase: that is no rest.
            converged = abs(promised) <= _TOLERANCE * (1 + abs(value))
            fresh = False
        if not converged:
            promised = _step(gradient, curvature, damping, y, low, high, step)
            if math.isnan(promised):
                step[:] = 0.0


@kernel
def descend_all(
    rows: Rows, problem: Problem, points: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], int]:
    """`descend` from each of the points, shape (D, P), which move to their minima."""
    values, converged = np.empty(len(points)), np.empty(len(points), dtype=np.bool_)
    total = 0
    for d in range(len(points)):
        values[d], converged[d], nan_count = descend(rows, problem, points[d])
        total += nan_count
    return values, converged, total
