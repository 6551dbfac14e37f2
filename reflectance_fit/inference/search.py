"""From a model to its optimum: starts, Gauss-Newton, what nlopt adds, and what the optimum says of the data.

Cheap rungs first.  A grid, a line of dielectrics and closed forms give starts; compiled Gauss-Newton takes the
lowest to their minima.  nlopt has the last word where Gauss-Newton's sum of squares is not the whole objective or
its steps did not come to rest, and searches the whole range where no basin has converged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import batch, optimize, starts
from reflectance_fit.inference.forward import ETA, FIRST_SIGMA, K, predict_vectors
from reflectance_fit.inference.gauss_newton import descend_all
from reflectance_fit.inference.least_squares import least_squares
from reflectance_fit.inference.likelihood import deviances, evaluate
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.problem import Problem, objective, objectives, problem_of
from reflectance_fit.inference.rows import DELTA, Rows
from reflectance_fit.result import Optimum

FloatArray = NDArray[np.float64]

_STARTS, _CLOSED = 4, 2
# Where there is doubt: the lowest of all points, and one of so many of the grid.
_MORE, _EVERY = 40, 5
_RIVAL, _WEAK, _MISFIT = 1.0, 0.1, 5.0
# Minima whose objectives differ by no more may be one.
_SAME = 1e-3


# nlopt's local search in one dimension and in more.
_LOCAL = ("nlopt LN_SBPLX", "nlopt LN_BOBYQA")


def find(model: Model, rows: Rows, gains: list[str]) -> tuple[Optimum, list[optimize.Basin]]:
    """The best point of ``model``, and every basin found, best first.

    The objective is -2 log likelihood at the best gains plus the penalties of
    normal priors.  Its optimum is where the reported chi2 is taken; flat
    priors do not move it.
    """
    problem = problem_of(model, rows)
    points, values = _tried(model, rows, problem)
    ran = ["grid, closed forms, Gauss-Newton"]
    basins = _descended(rows, problem, points.values[_lowest(points, values)])
    if _doubtful(model, rows, basins):
        many = [*_lowest(points, values), *_more(points, values)]
        basins = _descended(rows, problem, points.values[many])
        ran[0] += " from many starts"
    if basins and not (problem.exact and basins[0].converged):
        basins[0] = _last_word(rows, problem, basins[0])
        ran.append(_LOCAL[len(model.names) > 1])
    if not any(basin.converged for basin in basins):
        centre = basins[0].x if basins else 0.5 * (problem.low + problem.high)
        wide = optimize.minimise(
            _scalar(rows, problem), centre, model.ranges, 0.1 * (problem.high - problem.low), "direct"
        )
        if math.isfinite(wide.objective):
            basins.append(optimize.better(wide, *_descended(rows, problem, wide.x[None].copy())))
        ran.append("nlopt GN_DIRECT_L")
    basins = [b for b in basins if math.isfinite(b.objective)]
    if not basins:
        raise ValueError(f"no finite likelihood anywhere for the model {model.name}")
    basins.sort(key=lambda b: b.objective)
    nan_count = int(np.count_nonzero(np.isinf(values))) + sum(b.nan_count for b in basins)
    if nan_count != basins[0].nan_count:
        basins[0] = replace(basins[0], nan_count=nan_count)
    return describe(model, rows, gains, basins[0], ", ".join(ran)), basins


def _tried(model: Model, rows: Rows, problem: Problem) -> tuple[starts.Points, FloatArray]:
    """Where a descent may begin, and the objective there, or what is in the same order."""
    points = starts.points(model, rows)
    # Errors of the angles and censored rows matter little for where the basins are, and cost a lot.
    coarse = rows
    if rows.errors_in_angle:
        coarse = rows._replace(theta_sigma=np.zeros_like(rows.theta_sigma), errors_in_angle=False)
    if batch.serves(coarse) and model.template.size == FIRST_SIGMA:
        # With the gains integrated out, which leaves basins where they are.
        return points, -2 * batch.blocks(coarse, model.full(points.values))
    return points, objectives(coarse, problem, points.values)


def _lowest(points: starts.Points, values: FloatArray) -> list[int]:
    """The lowest local minima of grid and line with the best closed forms."""
    first, second = points.grid, points.grid + points.line
    chosen = optimize.grid_minima(values[:first].reshape(points.shape))
    chosen += [first + i for i in optimize.grid_minima(values[first:second])]
    chosen += (second + np.argsort(values[second:])[:_CLOSED]).tolist()
    return sorted((i for i in chosen if math.isfinite(values[i])), key=values.__getitem__)[:_STARTS]


def _more(points: starts.Points, values: FloatArray) -> NDArray[np.int64]:
    lowest = np.argsort(values)[:_MORE]
    return np.union1d(lowest[np.isfinite(values[lowest])], np.arange(0, points.grid, _EVERY))


def _doubtful(model: Model, rows: Rows, basins: list[optimize.Basin]) -> bool:
    """Whether there may be a lower minimum that the first starts missed.

    So where basins rival each other, none has converged, rows are five of their sigma off in the mean, or total
    reflection by next to no k puts a corner at every angle.
    """
    if not basins or not basins[0].converged:
        return True
    if len(basins) > 1 and basins[1].objective - basins[0].objective < _RIVAL:
        return True
    vector = model.full(basins[0].x)[0]
    chi2, _, _ = evaluate(
        rows, vector, np.empty(len(rows.value)), np.empty(len(rows.value)), np.empty(rows.gains)
    )
    # Readings of many pixels are good to 1e-4: then the wrong side of Brewster's angle is a deep basin of its own.
    if chi2 > _MISFIT**2 * len(rows.value):
        return True
    return bool(vector[K] < _WEAK and vector[ETA] < rows.exterior_ior * np.abs(rows.sin_theta).max())


def _descended(rows: Rows, problem: Problem, points: FloatArray) -> list[optimize.Basin]:
    """The minima that Gauss-Newton finds, best first, each once."""
    found, rested, curvatures, nan_count = descend_all(rows, problem, points)
    values, converged = found.tolist(), rested.tolist()
    kept: list[optimize.Basin] = []
    for i in sorted(range(len(values)), key=values.__getitem__):
        if not math.isfinite(values[i]):
            break
        rivals = (other for other in kept if values[i] - other.objective <= _SAME)
        if not any(_same_minimum(problem, other, points[i]) for other in rivals):
            counted = 0 if kept else nan_count
            kept.append(optimize.Basin(points[i], values[i], counted, converged[i], 0, curvatures[i]))
    return kept


def _same_minimum(problem: Problem, basin: optimize.Basin, x: FloatArray) -> bool:
    """Whether x is within a tenth of a standard deviation of a basin's best point."""
    assert basin.curvature is not None
    deviation = 0.1 / np.sqrt(np.maximum(basin.curvature.diagonal(), 1e-300))
    reach = np.maximum(1e-6 * (problem.high - problem.low), deviation)
    return not bool((abs(x - basin.x) > reach).any())


def _scalar(rows: Rows, problem: Problem) -> optimize.Objective:
    whitened, gains = np.empty(len(rows.value)), np.empty(rows.gains)
    return lambda x: objective(rows, problem, x, whitened, gains)


def confirmed(
    model: Model, rows: Rows, gains: list[str], optimum: Optimum, basins: list[optimize.Basin]
) -> tuple[Optimum, list[optimize.Basin]]:
    """What ``find`` found, after nlopt has looked for anything lower around it; as it is where nlopt already had."""
    problem = problem_of(model, rows)
    if "nlopt" in optimum.optimizer:
        return optimum, basins
    best = optimize.better(basins[0], _around(rows, problem, basins[0]))
    ran = f"{optimum.optimizer}, {_LOCAL[len(model.names) > 1]}"
    if best.objective >= basins[0].objective:
        return replace(optimum, optimizer=ran), basins
    _, converged, curvatures, _ = descend_all(rows, problem, best.x[None].copy())
    best = replace(best, converged=bool(converged[0]), curvature=curvatures[0])
    return describe(model, rows, gains, best, ran), [best, *basins[1:]]


def _around(rows: Rows, problem: Problem, basin: optimize.Basin) -> optimize.Basin:
    """nlopt on the whole objective from a basin's best point, in steps of a standard deviation."""
    assert basin.curvature is not None
    stiff = np.maximum(basin.curvature.diagonal(), 1e-300)
    width = problem.high - problem.low
    step = np.clip(1 / np.sqrt(stiff), 1e-9 * width, 0.1 * width)
    ranges = np.stack([problem.low, problem.high], axis=1)
    return optimize.minimise(_scalar(rows, problem), basin.x, ranges, step)


def _last_word(rows: Rows, problem: Problem, basin: optimize.Basin) -> optimize.Basin:
    """nlopt from where Gauss-Newton came to, and scipy's least squares where they are the whole objective."""
    found = _around(rows, problem, basin)
    best = optimize.better(basin, found)
    if problem.exact and problem.places[-1] < FIRST_SIGMA:
        # A sum of squares: least squares by other steps than ours.
        polished = least_squares(_residuals(rows, problem), best.x, (problem.low, problem.high))
        value = _scalar(rows, problem)(polished.x)
        best = optimize.better(best, replace(polished, objective=value))
    _, _, curvatures, _ = descend_all(rows, problem, best.x[None].copy())
    return replace(best, converged=best.converged or found.converged, curvature=curvatures[0])


def _residuals(rows: Rows, problem: Problem) -> Callable[[FloatArray], FloatArray]:
    whitened, gains = np.empty(len(rows.value)), np.empty(rows.gains)

    def residuals(x: FloatArray) -> FloatArray:
        value = objective(rows, problem, x, whitened, gains)
        penalties = (x - problem.mean) * problem.weight
        return np.concatenate([whitened if math.isfinite(value) else whitened * math.nan, penalties])

    return residuals


def widths(model: Model, rows: Rows, basin: optimize.Basin) -> FloatArray:
    """Rough standard deviations at a basin, shape (P,): where the objective rises by 1 along each axis.

    Conditional widths, hence a lower bound where coordinates are correlated;
    a sampler's start needs no more.
    """
    low, high = model.ranges.T
    width = np.empty(len(basin.x))
    for j in range(len(width)):
        steps = (high[j] - low[j]) * np.geomspace(1e-7, 0.5, 60)
        x = np.tile(basin.x, (2 * len(steps), 1))
        x[:, j] += np.concatenate([steps, -steps])
        rise = deviances(rows, model.full(x)) + _penalties(model, x).sum(axis=1) - basin.objective
        near = np.where((x[:, j] >= low[j]) & (x[:, j] <= high[j]), rise, np.inf).reshape(2, -1)
        # Without a break: beyond a ridge there may be another basin.
        within = np.logical_and.accumulate(np.nan_to_num(near, nan=np.inf) < 1, axis=1).any(axis=0)
        width[j] = steps[within].max() if within.any() else steps[0]
    return width


def _penalties(model: Model, x: FloatArray) -> FloatArray:
    columns = [((x[:, j] - model.priors[j].mean) / model.priors[j].sigma) ** 2 for j in model.penalised]
    return np.stack(columns, axis=1) if columns else np.zeros((len(x), 0))


def describe(model: Model, rows: Rows, gains: list[str], basin: optimize.Basin, optimizer: str) -> Optimum:
    """What a basin says of the data; ``optimizer`` is what found it."""
    used = ~rows.censored
    n = int(np.count_nonzero(used))
    vector = model.full(basin.x)[0]
    whitened, spread, gain_values = np.empty(len(used)), np.empty(len(used)), np.empty(rows.gains)
    chi2, _, _ = evaluate(rows, vector, whitened, spread, gain_values)
    penalised = model.penalised
    if penalised:
        chi2 += float(_penalties(model, basin.x[None]).sum())
    parameters = len(model.names) + rows.gains
    predicted = predict_vectors(rows, vector[None], gain_values)[0]
    difference = rows.value - predicted
    circular = rows.code == DELTA
    if circular.any():
        difference[circular] = (difference[circular] + 180.0) % 360.0 - 180.0
    residuals = difference / spread
    if n < len(used):
        predicted, spread, residuals = predicted[used], spread[used], residuals[used]
    return Optimum(
        model=model.name,
        parameters={name: float(v) for name, v in model.in_report_units(basin.x).items()},
        eta=float(vector[ETA]),
        k=float(vector[K]),
        gains=dict(zip(gains, gain_values.tolist(), strict=True)),
        objective=basin.objective,
        chi2=chi2,
        # A normal prior is one more datum, its parameter one more parameter.
        dof=n + len(penalised) - parameters,
        bic=basin.objective + parameters * math.log(n),
        predicted=predicted,
        sigma=spread,
        residuals=residuals,
        optimizer=optimizer,
        nan_count=basin.nan_count,
    )
