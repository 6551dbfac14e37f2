"""From a model to its optimum: objective, starts, polish, and what the optimum says of the data."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import optimize
from reflectance_fit.inference.forward import ETA, FIRST_SIGMA, K, predict_vectors
from reflectance_fit.inference.likelihood import deviances, evaluate
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.rows import CODES, Rows
from reflectance_fit.observations import Quantity
from reflectance_fit.result import Optimum

FloatArray = NDArray[np.float64]

_ETA_POINTS, _K_POINTS = 40, 25


def find(model: Model, rows: Rows, gains: list[str]) -> tuple[Optimum, list[optimize.Basin]]:
    """The best point of ``model``, and every basin found, best first.

    The objective is -2 log likelihood at the best gains plus the penalties of
    normal priors.  Its optimum is where the reported chi2 is taken; flat
    priors do not move it.
    """
    ranges = model.ranges

    def objectives(x: FloatArray) -> FloatArray:
        x = np.atleast_2d(x)
        return np.asarray(deviances(rows, model.full(x)) + _penalties(model, x).sum(axis=1))

    def objective(x: FloatArray) -> float:
        return float(objectives(x)[0])

    step = np.array([_first_step(model, j) for j in range(len(model.names))])
    basins = []
    for start in _starts(model, objectives):
        basin = optimize.local(objective, start, ranges, step)
        if math.isfinite(basin.objective):
            # Once more from where it stopped: the first call's trust region may have shrunk too early.
            again = optimize.local(objective, basin.x, ranges, 0.1 * step)
            best = min(basin, again, key=lambda b: b.objective)
            best = optimize.Basin(best.x, best.objective, basin.nan_count + again.nan_count)
            basins.append(_polished(model, rows, objective, best))
    basins.sort(key=lambda b: b.objective)
    if not basins:
        raise ValueError(f"no finite likelihood anywhere for the model {model.name}")
    return describe(model, rows, gains, basins[0]), basins


def _penalties(model: Model, x: FloatArray) -> FloatArray:
    columns = [((x[:, j] - model.priors[j].mean) / model.priors[j].sigma) ** 2 for j in model.penalised]
    return np.stack(columns, axis=1) if columns else np.zeros((len(x), 0))


def _first_step(model: Model, j: int) -> float:
    prior = model.priors[j]
    return prior.sigma if prior.kind == "normal" else {"eta": 0.1, "k": 0.3}.get(model.names[j], 0.5)


def _starts(model: Model, objectives: Callable[[FloatArray], FloatArray]) -> list[FloatArray]:
    """The local minima of a grid over (log eta, k) or whichever of them is free, nuisances neutral."""
    free = [j for j, name in enumerate(model.names) if name in ("eta", "k")]
    axes = []
    for j in free:
        low, high = model.ranges[j]
        points = {"eta": _ETA_POINTS, "k": _K_POINTS}[model.names[j]] * (4 if len(free) == 1 else 1)
        # Denser towards k = 0, where R depends on k^2 and weak absorbers live.
        steps = np.linspace(0, 1, points) ** (2 if model.names[j] == "k" else 1)
        axes.append(low + (high - low) * steps)
    x = np.tile(np.array([prior.centre for prior in model.priors]), (*map(len, axes), 1))
    x[..., free] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = objectives(x.reshape(-1, x.shape[-1])).reshape(x.shape[:-1])
    return [x[i] for i in optimize.grid_minima(values)]


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
        within = np.nan_to_num(near, nan=np.inf).min(axis=0) < 1
        width[j] = steps[within].max() if within.any() else steps[0]
    return width


def _polished(
    model: Model, rows: Rows, objective: Callable[[FloatArray], float], basin: optimize.Basin
) -> optimize.Basin:
    """Gauss-Newton in all coordinates but the estimated sigmas, which are no sum of squares."""
    free = model.places < FIRST_SIGMA
    whitened, spread, gains = np.empty(len(rows.value)), np.empty(len(rows.value)), np.empty(rows.gains)
    stated = 2 * np.sum(np.log(rows.sigma[~rows.censored]))

    def whole(part: FloatArray) -> FloatArray:
        x = basin.x.copy()
        x[free] = part
        return x

    def residuals(part: FloatArray) -> FloatArray:
        x = whole(part)
        vector = model.full(x)[0]
        chi2, log_det, _ = evaluate(rows, vector, whitened, spread, gains)
        if math.isnan(chi2):
            return np.full(len(whitened) + 1 + len(model.penalised), np.nan)
        free_sigma = (rows.estimated >= 0) & ~rows.censored
        estimated = 2 * np.sum(vector[FIRST_SIGMA + rows.estimated[free_sigma]])
        # What angle errors and censored rows add to log det S is never negative: a sum of squares of one term.
        share = math.sqrt(max(log_det - stated - estimated, 0.0))
        return np.concatenate([whitened, [share], np.sqrt(_penalties(model, x[None]))[0]])

    part = optimize.Basin(basin.x[free], basin.objective, basin.nan_count)
    best = optimize.polish(residuals, lambda x: objective(whole(x)), part, model.ranges[free])
    return optimize.Basin(whole(best.x), best.objective, best.nan_count)


def describe(model: Model, rows: Rows, gains: list[str], basin: optimize.Basin) -> Optimum:
    """What a basin says of the data."""
    used = ~rows.censored
    n = int(used.sum())
    vector = model.full(basin.x)[0]
    whitened, spread, gain_values = np.empty(len(used)), np.empty(len(used)), np.empty(rows.gains)
    chi2, _, _ = evaluate(rows, vector, whitened, spread, gain_values)
    chi2 += float(_penalties(model, basin.x[None]).sum())
    parameters = len(model.names) + rows.gains
    predicted = predict_vectors(rows, vector[None], gain_values)[0]
    difference = rows.value - predicted
    circular = rows.code == CODES[Quantity.DELTA_DEG]
    difference[circular] = (difference[circular] + 180.0) % 360.0 - 180.0
    return Optimum(
        model=model.name,
        parameters={name: float(v) for name, v in model.in_report_units(basin.x).items()},
        eta=float(vector[ETA]),
        k=float(vector[K]),
        gains=dict(zip(gains, map(float, gain_values), strict=True)),
        objective=basin.objective,
        chi2=chi2,
        # A normal prior is one more datum, its parameter one more parameter.
        dof=n + len(model.penalised) - parameters,
        bic=basin.objective + parameters * math.log(n),
        predicted=predicted[used],
        sigma=spread[used],
        residuals=(difference / spread)[used],
        optimizer=optimize.OPTIMIZER,
        nan_count=basin.nan_count,
    )
