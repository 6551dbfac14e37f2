"""The ladder of minimisers for any objective: nlopt, local and global.  nlopt's only home.

nlopt reports success where the objective was NaN (stevengj/nlopt#279), so the
best finite point that was ever evaluated wins, whatever the return code, NaN
values are counted, and convergence is what points around the result say.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, get_args

import nlopt
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.jit import kernel

FloatArray = NDArray[np.float64]
Objective = Callable[[FloatArray], float]

Method = Literal["local", "slsqp", "direct", "crs", "mlsl"]
METHODS: tuple[Method, ...] = get_args(Method)

_WALL = 1e30  # stands for NaN and infinity towards nlopt, which then turns away
_MAX_EVALUATIONS = {"local": 4000, "slsqp": 500, "direct": 1000, "crs": 5000, "mlsl": 2000}
_MAX_BASINS = 6
_PROBES = (1e-2, 1e-4, 1e-6)  # of the first step
_NO_LOWER = 1e-7  # how much lower, relative to 1 + |objective|, a probe may lie


@dataclass(frozen=True, slots=True, eq=False)
class Basin:
    """The best finite point found: coordinates, objective there, and the NaN seen on the way.

    ``converged`` says that nothing around it is lower; ``curvature``, shape
    (P, P), is half of the objective's Hessian there, where it is known.
    """

    x: FloatArray
    objective: float
    nan_count: int
    converged: bool = False
    evaluations: int = 0
    curvature: FloatArray | None = None


class _Watched:
    """An objective with a memory: the best finite point inside ``ranges``, and how often there was none."""

    def __init__(
        self,
        objective: Objective,
        start: FloatArray,
        ranges: FloatArray,
        gradient: Callable[[FloatArray], FloatArray] | None,
    ):
        self.objective, self.gradient = objective, gradient
        self.low, self.high = ranges.T
        self.x, self.value = start.copy(), np.inf
        self.nan_count = self.evaluations = 0

    def __call__(self, x: FloatArray, slope: FloatArray) -> float:
        self.evaluations += 1
        # BOBYQA searches in units of the steps and, coming back from them, ends an ulp beyond a bound: no point of the
        # model, and one that nlopt itself refuses as a start.  What comes of it can also be written, unlike
        # nlopt's vector: that is another type, for which kernels would be compiled once more.
        x = np.minimum(np.maximum(x, self.low), self.high)
        value = float(self.objective(x))
        if slope.size and self.gradient is not None:
            slope[:] = np.nan_to_num(self.gradient(x), nan=0.0, posinf=_WALL, neginf=-_WALL)
        if not np.isfinite(value):
            self.nan_count += 1
            return _WALL
        if value < self.value:
            self.x, self.value = x, value
        return value


def minimise(
    objective: Objective,
    start: FloatArray,
    ranges: FloatArray,
    step: FloatArray,
    method: Method = "local",
    gradient: Callable[[FloatArray], FloatArray] | None = None,
) -> Basin:
    """Minimise inside ``ranges`` (shape (P, 2)); the best finite point, its objective inf where there was none.

    ``local`` is LN_BOBYQA (Subplex in one dimension) from ``start`` with first
    steps ``step``, ``slsqp`` LD_SLSQP, which needs the ``gradient``.  ``direct``
    (GN_DIRECT_L), ``crs`` (GN_CRS2_LM) and ``mlsl`` (G_MLSL_LDS about BOBYQA)
    search the whole range.  Each is followed by ``local`` from its best point.
    """
    if method == "slsqp" and gradient is None:
        raise ValueError("slsqp needs the gradient of the objective; give it, or choose 'local'")
    low, high = ranges.T
    start = np.clip(start, low, high)
    step = np.minimum(step, 0.49 * (high - low))
    seen = _Watched(objective, start, ranges, gradient)
    if method != "local":
        _run(method, seen, start, ranges, step)
    # Twice: the first call's trust region may have shrunk too early.
    _run("local", seen, seen.x, ranges, step)
    _run("local", seen, seen.x, ranges, 0.1 * step)
    converged = np.isfinite(seen.value) and _nothing_lower(seen, ranges, step)
    return Basin(seen.x, float(seen.value), seen.nan_count, converged, seen.evaluations)


def _run(method: Method, seen: _Watched, start: FloatArray, ranges: FloatArray, step: FloatArray) -> None:
    # BOBYQA needs two dimensions; Subplex is nlopt's choice for one.
    local = nlopt.LN_BOBYQA if len(start) > 1 else nlopt.LN_SBPLX
    algorithm = {
        "local": local,
        "slsqp": nlopt.LD_SLSQP,
        "direct": nlopt.GN_DIRECT_L,
        "crs": nlopt.GN_CRS2_LM,
        "mlsl": nlopt.G_MLSL_LDS,
    }[method]
    search = nlopt.opt(algorithm, len(start))
    if method == "mlsl":
        inner = nlopt.opt(local, len(start))
        inner.set_ftol_abs(1e-6)
        search.set_local_optimizer(inner)
    nlopt.srand(0)
    search.set_lower_bounds(ranges[:, 0])
    search.set_upper_bounds(ranges[:, 1])
    search.set_min_objective(seen)
    search.set_initial_step(step)
    search.set_ftol_abs(1e-10)
    search.set_xtol_rel(1e-10)
    search.set_maxeval(_MAX_EVALUATIONS[method])
    # Where a step wins less than rounding loses, BOBYQA stops by the first exception and SLSQP, whose line search
    # then fails, by the second; the best point seen is kept.  Nothing else that nlopt raises is expected.
    with suppress(nlopt.RoundoffLimited, nlopt.runtime_error):
        search.optimize(start.copy())


def _nothing_lower(seen: _Watched, ranges: FloatArray, step: FloatArray) -> bool:
    """Whether the points around the best one, along axes and pairs of axes, are finite and no lower.

    A point beside a NaN wall is never taken for a minimum.
    """
    x, value, size = seen.x, seen.value, len(seen.x)
    axes = [sign * row for row in np.eye(size) for sign in (1.0, -1.0)]
    pairs = [a + b for a, b in itertools.combinations(axes, 2) if np.any(a + b)]
    for share in _PROBES:
        for direction in axes + pairs:
            there = np.clip(x + share * step * direction, *ranges.T)
            around = seen(there, np.empty(0))
            if around >= _WALL or around < value - _NO_LOWER * (1 + abs(value)):
                return False
    return True


def grid_minima(values: FloatArray) -> list[int]:
    """Places in the flat array of the lowest local minima of a 1-D or 2-D grid, at most six; NaN counts as high."""
    found: list[int] = _minima(np.atleast_2d(values)).tolist()
    return sorted(found, key=values.ravel().__getitem__)[:_MAX_BASINS]


@kernel
def _minima(values: FloatArray) -> NDArray[np.int64]:
    """Where no neighbour is lower, of finite values of shape (M, N), as places in the flat array."""
    rows, columns = values.shape
    found, count = np.empty(values.size, dtype=np.int64), 0
    for i in range(rows):
        for j in range(columns):
            lowest = math.isfinite(values[i, j])
            for m in range(max(i - 1, 0), min(i + 2, rows)):
                for n in range(max(j - 1, 0), min(j + 2, columns)):
                    lowest = lowest and not (values[m, n] < values[i, j] and values[m, n] > -math.inf)
            if lowest:
                found[count] = i * columns + j
                count += 1
    return found[:count]


def better(first: Basin, second: Basin) -> Basin:
    """The lower of the two, with the NaN and evaluations of both."""
    best = min(first, second, key=lambda b: b.objective)
    return replace(
        best,
        nan_count=first.nan_count + second.nan_count,
        evaluations=first.evaluations + second.evaluations,
    )
