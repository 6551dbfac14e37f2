"""The posterior ladder: Laplace, importance sampling, emcee; what each of them starts from."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import importance, posterior, proposal, search
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.optimize import Basin
from reflectance_fit.inference.rows import Rows
from reflectance_fit.result import Posterior

FloatArray = NDArray[np.float64]

Method = Literal["emcee", "importance", "laplace"]
METHODS: tuple[Method, ...] = get_args(Method)

# Basins whose objective lies this far above the best hold less than 1e-5 of the probability.
_RIVAL = 24.0
_PRIOR_POINTS, _BASIN_POINTS = 8192, 2000

_log = logging.getLogger(__name__)


def draw(
    model: Model,
    rows: Rows,
    basins: Sequence[Basin],
    method: Method,
    seed: tuple[int, ...],
    *,
    min_ess: float,
    progress: Callable[[int, int], None] | None = None,
) -> Posterior:
    """The posterior of ``model`` by ``method``; emcee where importance sampling says that it fails.

    ``basins`` are those of the search, best first; ``seed`` starts the random
    stream, ``progress`` is emcee's.
    """
    rivals = [basin for basin in basins if basin.objective < basins[0].objective + _RIVAL]
    if method != "emcee":
        log_density = posterior.log_posterior(model, rows)
        components = _components(model, rows, log_density, rivals)
        generator = np.random.default_rng(seed)
        if method == "laplace":
            return _posterior(model, method, importance.laplace(log_density, components, generator))
        drawn = importance.importance(log_density, components, model.ranges, generator, min_ess=min_ess)
        if drawn.trusted and drawn.ess >= min_ess:
            return _posterior(model, method, drawn)
        _log.info(
            "%s: importance sampling is not to be trusted here (Pareto k %.2f, effective sample size %.0f); "
            "emcee is used",
            model.name,
            drawn.pareto_k,
            drawn.ess,
        )
    starts = candidates(model, rows, rivals, np.random.default_rng(seed))
    return posterior.sample(model, rows, starts, seed, min_ess=min_ess, progress=progress)


def candidates(
    model: Model, rows: Rows, basins: Sequence[Basin], generator: np.random.Generator
) -> FloatArray:
    """Starting points for a sampler, shape (M, P): the prior's range, and every basin that can matter.

    The range by Sobol points; each basin by normal points twice as wide as the
    objective is there.
    """
    from scipy.stats import qmc

    low, high = model.ranges.T
    sobol = qmc.Sobol(len(low), rng=generator).random(_PRIOR_POINTS)
    points = [low + (high - low) * sobol]
    for basin in basins:
        width = 2 * search.widths(model, rows, basin)
        near = basin.x + width * generator.standard_normal((_BASIN_POINTS, len(low)))
        # Reflected at the bounds: clipping would put walkers on top of one another.
        near = np.where(near < low, 2 * low - near, near)
        near = np.where(near > high, 2 * high - near, near)
        points.append(np.clip(near, low, high))
    return np.vstack(points)


def _components(
    model: Model, rows: Rows, log_density: proposal.LogDensity, basins: Sequence[Basin]
) -> list[proposal.Component]:
    found = [
        proposal.at_basin(log_density, basin.x, search.widths(model, rows, basin), model.ranges)
        for basin in basins
    ]
    return proposal.mixture([mass for mass, _ in found], [component for _, component in found])


def _posterior(model: Model, method: Method, drawn: importance.Draws) -> Posterior:
    return Posterior(
        model=model.name,
        method=method,
        names=model.names,
        samples=model.samples(drawn.x),
        log_density=drawn.log_density,
        ensemble=np.arange(len(drawn.x)),
        ess=dict.fromkeys(model.names, drawn.ess),
        # Laplace's approximation has nothing to converge to, and nothing that could tell.
        converged=True,
        pareto_k=drawn.pareto_k,
    )
