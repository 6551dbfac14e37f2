"""The posterior ladder: Laplace, importance sampling, emcee; what each of them starts from."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import batch, importance, laplace, posterior, proposal, search
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.optimize import Basin
from reflectance_fit.inference.rows import Rows
from reflectance_fit.inference.scores import Scores
from reflectance_fit.inference.shear import Shear, shear_at
from reflectance_fit.result import Posterior

FloatArray = NDArray[np.float64]

Method = Literal["emcee", "importance", "laplace"]
METHODS: tuple[Method, ...] = get_args(Method)

# Basins whose objective lies this far above the best hold less than 1e-5 of the probability.
_RIVAL = 24.0
_FAR = 3.0  # scores
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
        try:
            return _proposed(model, rows, rivals, method, seed, min_ess=min_ess)
        except Untrusted as reason:
            _log.info("%s: %s; emcee is used", model.name, reason)
    starts = candidates(model, rows, rivals, np.random.default_rng(seed))
    return posterior.sample(model, rows, starts, seed, min_ess=min_ess, progress=progress)


class Untrusted(Exception):
    """A posterior that no mixture of t distributions resembles."""


def _proposed(
    model: Model,
    rows: Rows,
    basins: Sequence[Basin],
    method: Method,
    seed: tuple[int, ...],
    *,
    min_ess: float,
) -> Posterior:
    """The posterior from a proposal; Untrusted where that fails, as at the corners that a wrong model is driven into."""
    scores = Scores(model)
    log_density = _log_density_of_scores(scores, rows)
    components = _components(scores, log_density, basins)
    if not components:
        raise Untrusted("no basin has a curvature to stand on")
    shear = shear_at(scores, log_density, max(components, key=lambda c: c.share))
    try:
        components = [shear.carried(c) for c in components]
    except np.linalg.LinAlgError as error:
        raise Untrusted("a ridge is too steep to be straightened") from error

    def sheared(y: FloatArray) -> FloatArray:
        return log_density(shear.plain(y))

    generator = np.random.default_rng(seed)
    try:
        if method == "laplace":
            count = math.ceil(importance.KEPT * min_ess)
            drawn = importance.laplace(sheared, components, generator, count=count)
        else:
            drawn = importance.importance(sheared, components, scores.ranges, generator, min_ess=min_ess)
    except importance.NothingDrawn as error:
        raise Untrusted(str(error)) from error
    if method == "importance" and not (drawn.trusted and drawn.ess >= min_ess):
        raise Untrusted(
            f"importance sampling is not to be trusted here (Pareto k {drawn.pareto_k:.2f}, "
            f"effective sample size {drawn.ess:.0f})"
        )
    return _posterior(shear, method, drawn)


def candidates(
    model: Model, rows: Rows, basins: Sequence[Basin], generator: np.random.Generator
) -> posterior.Starts:
    """Starting points for a sampler: over the prior's range, and in every basin that can matter.

    The range by Sobol points; each basin by normal points twice as wide as the
    objective is there.
    """
    from scipy.special import logsumexp
    from scipy.stats import qmc

    low, high = model.ranges.T
    sobol = qmc.Sobol(len(low), rng=generator).random(_PRIOR_POINTS)
    points = [low + (high - low) * sobol]
    widths = np.array([2 * search.widths(model, rows, basin) for basin in basins])
    for basin, width in zip(basins, widths, strict=True):
        near = basin.x + width * generator.standard_normal((_BASIN_POINTS, len(low)))
        # Reflected at the bounds: clipping would put walkers on top of one another.
        near = np.where(near < low, 2 * low - near, near)
        near = np.where(near > high, 2 * high - near, near)
        points.append(np.clip(near, low, high))
    x = np.vstack(points)
    # Squared distances from each basin, shape (basin, point), in units of its widths.
    distance = np.array([np.sum(((x - b.x) / w) ** 2, axis=1) for b, w in zip(basins, widths, strict=True)])
    volume = np.sum(np.log(widths * np.sqrt(2 * np.pi)), axis=1)
    normal = np.log(_BASIN_POINTS) - volume[:, None] - 0.5 * distance
    uniform = np.full(len(x), np.log(_PRIOR_POINTS) - np.sum(np.log(high - low)))
    return posterior.Starts(x, logsumexp(np.vstack([uniform, normal]), axis=0), np.argmin(distance, axis=0))


def _log_density_of_scores(scores: Scores, rows: Rows) -> proposal.LogDensity:
    """Log posterior density of scores, shape (D, P), up to a constant."""
    model = scores.model
    likelihood = batch.log_likelihood(model, rows)

    def log_density(z: FloatArray) -> FloatArray:
        prior = scores.log_prior(z)
        inside = np.isfinite(prior)
        if inside.all():
            prior += likelihood(model.full(scores.to_model(z)))
        else:
            prior[inside] += likelihood(model.full(scores.to_model(z[inside])))
        return prior

    return log_density


def _components(
    scores: Scores, log_density: proposal.LogDensity, basins: Sequence[Basin]
) -> list[proposal.Component]:
    masses: list[float] = []
    found: list[proposal.Component] = []
    for basin in basins:
        z = scores.from_model(basin.x[None])[0]
        # A bound is at infinity, and what is likely not far from what was likely before.
        z[scores.scored] = np.clip(np.nan_to_num(z[scores.scored]), -_FAR, _FAR)
        if any(_same_material(scores, c, z) for c in found):
            continue
        mass, component = _best_mode(scores, log_density, basin, z)
        # At a corner, deep in a misfit, the density falls faster than a normal law's width can tell.
        if not (math.isfinite(mass) and np.isfinite(component.inverse).all()):
            continue
        if not any(_same_material(scores, c, component.centre) for c in found):
            masses.append(mass)
            found.append(component)
    return proposal.mixture(masses, found)


def _best_mode(
    scores: Scores, log_density: proposal.LogDensity, basin: Basin, z: FloatArray
) -> tuple[float, proposal.Component]:
    """The mode near ``z`` that holds most.

    The best point may have nuisances at bounds, far out in their scores, along
    a ridge that Newton's steps do not follow back; so they start from their
    priors' middle, too.
    """
    known = _factor(scores, basin)
    starts = [z]
    if len(scores.bent) and np.any(np.abs(z[scores.scored]) > 1):
        starts += [np.where(scores.scored, np.clip(z, -most, most), z) for most in (1.0, 0.0)]
    found = []
    for start in starts:
        width = laplace.first_widths(log_density, start, scores.ranges) if known is None else known
        found.append(laplace.at_basin(log_density, start, width, scores.ranges))
    return max(found, key=lambda each: each[0] if math.isfinite(each[0]) else -math.inf)


def _factor(scores: Scores, basin: Basin) -> FloatArray | None:
    """A factor of the covariance of scores, shape (P, P), from the curvature that the search left, if it did."""
    if basin.curvature is None or len(scores.bent):
        return None
    sigma = np.array(
        [p.sigma if own else 1.0 for p, own in zip(scores.model.priors, scores.scored, strict=True)]
    )
    try:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(basin.curvature * np.outer(sigma, sigma))).T)
    except np.linalg.LinAlgError:
        return None


def _same_material(scores: Scores, component: proposal.Component, z: FloatArray) -> bool:
    """Whether z is within two standard deviations of a component in eta, k and sigmas.

    Nuisances have mirror images in the model's coordinates, none in scores.
    """
    free = ~scores.scored
    apart = (z - component.centre)[free]
    return bool(apart @ np.linalg.solve(component.covariance[np.ix_(free, free)], apart) < 4.0)


def _posterior(shear: Shear, method: Method, drawn: importance.Draws) -> Posterior:
    scores, model = shear.scores, shear.scores.model
    z = shear.plain(drawn.x.reshape(-1, drawn.x.shape[-1]))
    x = scores.to_model(z)
    log_density = drawn.log_density
    if len(scores.bent):
        # From the density of z to that of x: the likelihood is the same, the prior is not.
        log_density = log_density + (model.log_prior(x) - scores.log_prior(z)).reshape(log_density.shape)
    return Posterior(
        model=model.name,
        method=method,
        names=model.names,
        samples=model.samples(x.reshape(drawn.x.shape)),
        log_density=log_density,
        ensemble=np.arange(len(drawn.x)),
        ess=dict.fromkeys(model.names, drawn.ess),
        # Laplace's approximation has nothing to converge to, and nothing that could tell.
        converged=True,
        pareto_k=drawn.pareto_k,
    )
