"""The best point: a grid for the basins, nlopt inside each, a Gauss-Newton polish.  nlopt's only home.

nlopt reports success where the objective was NaN (stevengj/nlopt#279), so the
best finite point that was ever evaluated wins, whatever the return code, and
NaN values are counted.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

OPTIMIZER = "grid, nlopt LN_BOBYQA from each basin, Gauss-Newton polish"
_WALL = 1e30  # stands for NaN and infinity towards nlopt, which then turns away
_MAX_EVALUATIONS = 4000
_MAX_BASINS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Basin:
    """A local optimum: coordinates, objective there, and the NaN seen on the way."""

    x: FloatArray
    objective: float
    nan_count: int


def local(
    objective: Callable[[FloatArray], float], start: FloatArray, ranges: FloatArray, step: FloatArray
) -> Basin:
    """Minimise from ``start`` inside ``ranges`` (shape (P, 2)) with LN_BOBYQA.

    ``step`` is the first step in each coordinate.  Returns the best finite
    point seen; its objective is inf where there was none.
    """
    best_x, best_value, nan_count = start.copy(), np.inf, 0

    def guarded(x: FloatArray, _gradient: FloatArray) -> float:
        nonlocal best_x, best_value, nan_count
        value = objective(x)
        if not np.isfinite(value):
            nan_count += 1
            return _WALL
        if value < best_value:
            best_x, best_value = x.copy(), value
        return value

    low, high = ranges.T
    # BOBYQA needs two dimensions; Subplex is nlopt's choice for one.
    search = nlopt.opt(nlopt.LN_BOBYQA if len(start) > 1 else nlopt.LN_SBPLX, len(start))
    search.set_lower_bounds(low)
    search.set_upper_bounds(high)
    search.set_min_objective(guarded)
    search.set_initial_step(np.minimum(step, 0.49 * (high - low)))
    search.set_ftol_abs(1e-10)
    search.set_xtol_rel(1e-10)
    search.set_maxeval(_MAX_EVALUATIONS)
    # Whatever it says in the end, the best point seen so far is kept.
    with suppress(nlopt.RoundoffLimited, RuntimeError):
        search.optimize(np.clip(start, low, high))
    return Basin(best_x, float(best_value), nan_count)


def grid_minima(values: FloatArray) -> list[tuple[int, ...]]:
    """Indices of the lowest local minima of a 1-D or 2-D grid, at most six; NaN counts as high."""
    filled = np.where(np.isfinite(values), values, np.inf)
    padded = np.pad(filled, 1, constant_values=np.inf)
    lowest = np.full(values.shape, np.inf)
    for shift in np.ndindex(*(3,) * values.ndim):
        if shift != (1,) * values.ndim:
            window = tuple(slice(s, s + n) for s, n in zip(shift, values.shape, strict=True))
            lowest = np.minimum(lowest, padded[window])
    minima = np.argwhere(np.isfinite(filled) & (filled <= lowest))
    order = np.argsort([filled[tuple(m)] for m in minima], kind="stable")
    return [tuple(int(i) for i in minima[o]) for o in order[:_MAX_BASINS]]


def polish(
    residuals: Callable[[FloatArray], FloatArray],
    objective: Callable[[FloatArray], float],
    basin: Basin,
    ranges: FloatArray,
) -> Basin:
    """Gauss-Newton steps (scipy's trust region) from a basin; kept only where they improve it.

    ``residuals`` are such that the sum of their squares is the objective up to
    a constant.
    """
    from scipy.optimize import least_squares

    low, high = ranges.T
    inside = np.clip(basin.x, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    if not np.all(np.isfinite(residuals(inside))):
        return basin

    def finite(x: FloatArray) -> FloatArray:
        return np.nan_to_num(residuals(x), nan=1e15)

    result = least_squares(
        finite,
        inside,
        jac="3-point",
        bounds=(low, high),
        x_scale="jac",
        ftol=1e-15,
        xtol=1e-15,
        gtol=1e-15,
        max_nfev=100,
    )
    value = objective(result.x)
    return Basin(result.x, value, basin.nan_count) if value < basin.objective else basin
