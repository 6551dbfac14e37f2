"""The ladder of minimisers for any objective: nlopt local and global, and least squares.  nlopt's only home.

nlopt reports success where the objective was NaN (stevengj/nlopt#279), so the
best finite point that was ever evaluated wins, whatever the return code, NaN
values are counted, and convergence is what points around the result say.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, get_args

import nlopt
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Objective = Callable[[FloatArray], float]

Method = Literal["local", "slsqp", "direct", "crs", "mlsl"]
METHODS: tuple[Method, ...] = get_args(Method)

_HUGE = 1e15  # a residual, instead of NaN
_WALL = 1e30  # stands for NaN and infinity towards nlopt, which then turns away
_MAX_EVALUATIONS = {"local": 4000, "slsqp": 500, "direct": 1000, "crs": 5000, "mlsl": 2000}
_MAX_BASINS = 6
_RELATIVE_STEP = float(np.finfo(float).eps) ** 0.2
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
    """An objective with a memory: the best finite point, and how often there was none."""

    def __init__(
        self, objective: Objective, start: FloatArray, gradient: Callable[[FloatArray], FloatArray] | None
    ):
        self.objective, self.gradient = objective, gradient
        self.x, self.value = start.copy(), np.inf
        self.nan_count = self.evaluations = 0

    def __call__(self, x: FloatArray, slope: FloatArray) -> float:
        self.evaluations += 1
        value = float(self.objective(x))
        if slope.size and self.gradient is not None:
            slope[:] = np.nan_to_num(self.gradient(x), nan=0.0, posinf=_WALL, neginf=-_WALL)
        if not np.isfinite(value):
            self.nan_count += 1
            return _WALL
        if value < self.value:
            self.x, self.value = x.copy(), value
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
    seen = _Watched(objective, start, gradient)
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
    # Whatever it says in the end, the best point seen so far is kept.
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


def least_squares(
    residuals: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray] | None = None,
    jacobian: Callable[[FloatArray], FloatArray] | None = None,
) -> Basin:
    """Minimise the sum of squares of ``residuals`` (shape (N,)) from ``start``, to the last digits.

    Trust-region and, without ``bounds``, Levenberg-Marquardt steps in turn
    (scipy), scaled by the Jacobian, each from the best point so far.  NaN
    counts as a wall.  ``jacobian`` (N, P) comes from differences of fourth order by default.
    """
    from scipy.optimize import least_squares as solve

    low, high = bounds if bounds is not None else (np.full_like(start, -np.inf), np.full_like(start, np.inf))
    nan_count = evaluations = 0

    def finite(x: FloatArray) -> FloatArray:
        nonlocal nan_count, evaluations
        evaluations += 1
        with np.errstate(all="ignore"):
            r = residuals(x)
        bad = not np.all(np.abs(r) < _HUGE)
        nan_count += bad
        return np.full(len(r), _HUGE) if bad else r

    start = np.clip(start, low, high)
    best, value, converged = start, float(np.sum(finite(start) ** 2)), False
    for method in ("trf", "lm", "dogbox") if bounds is None else ("trf", "dogbox"):
        inside = np.clip(
            best, low + 1e-12 * np.minimum(high - low, 1), high - 1e-12 * np.minimum(high - low, 1)
        )
        with suppress(
            ValueError, np.linalg.LinAlgError
        ):  # too few residuals for a method, or a singular Jacobian
            found = solve(
                finite,
                inside,
                jac=jacobian or (lambda x: _jacobian(finite, x, low, high)),
                bounds=(low, high) if method != "lm" else (-np.inf, np.inf),
                method=method,
                x_scale="jac",
                ftol=1e-15,
                xtol=1e-15,
                gtol=1e-15,
                max_nfev=2000,
            )
            if 2 * found.cost <= value:
                best, value, converged = found.x, 2 * float(found.cost), found.status > 0
    if value < _HUGE**2:
        best = _last_digits(finite, jacobian or (lambda x: _jacobian(finite, x, low, high)), best, low, high)
        value = float(np.sum(finite(best) ** 2))
    return Basin(best, value, nan_count, converged and value < _HUGE**2, evaluations)


def _last_digits(
    residuals: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray], FloatArray],
    x: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Plain Gauss-Newton for as long as the residuals' part in the span of J falls.

    The sum of squares is flat to the last bit over half of the digits of x; that part, its gradient, is not.
    """
    part = np.inf
    best = x
    for _ in range(20):
        r, j = residuals(x), jacobian(x)
        scale = np.linalg.norm(j, axis=0)
        if not np.all(np.isfinite(j)) or not np.all(scale > 0):
            break
        q, upper = np.linalg.qr(j / scale)
        along = q.T @ r
        if not np.linalg.norm(along) < part:
            break
        best, part = x, float(np.linalg.norm(along))
        if abs(np.diag(upper)).min() < 1e-14:
            break
        x = x - np.linalg.solve(upper, along) / scale
        # A bound, or a step that is none of the last digits: the trust region knew better.
        if np.any((x <= low) | (x >= high)) or np.sum(residuals(x) ** 2) > np.sum(r**2) * (1 + 1e-10):
            break
    return best


def _jacobian(
    residuals: Callable[[FloatArray], FloatArray], x: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """dr/dx, shape (N, P): central differences of fourth order, in steps that roundoff and truncation share.

    Relative steps, so that a parameter of 1e-6 is as welcome as one of 1e6; shorter where a bound is near.
    """
    columns = []
    for j in range(len(x)):
        step = _RELATIVE_STEP * (abs(x[j]) or 1.0)
        step = min(step, max(0.4 * min(x[j] - low[j], high[j] - x[j]), 1e-14 * (abs(x[j]) or 1.0)))
        moved = np.tile(x, (4, 1))
        moved[:, j] += step * np.array([1.0, -1.0, 2.0, -2.0])
        a, b, c, d = (residuals(y) for y in moved)
        columns.append((8 * (a - b) - (c - d)) / (12 * step))
    return np.stack(columns, axis=1)


def better(first: Basin, second: Basin) -> Basin:
    """The lower of the two, with the NaN and evaluations of both."""
    best = min(first, second, key=lambda b: b.objective)
    return replace(
        best,
        nan_count=first.nan_count + second.nan_count,
        evaluations=first.evaluations + second.evaluations,
    )
