"""The objective of a fit, compiled: what a model's coordinates stand for, and F there.

F(x) = chi2 + log det S + sum of ((x_j - mean_j) / sigma_j)^2, the deviance of `likelihood` and the penalties of
normal priors.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import DIFFUSE, FIRST_SIGMA, K
from reflectance_fit.inference.likelihood import (
    deviances,
    evaluate_normal,
    stated_log_det,
    whitened_residuals,
)
from reflectance_fit.inference.models import Model, search_ranges
from reflectance_fit.inference.rows import Rows
from reflectance_fit.physics.jit import inlined, shared
from reflectance_fit.priors import Prior

FloatArray = NDArray[np.float64]


class Problem(NamedTuple):
    """A model as the kernels read it: P coordinates x and what they stand for.

    ``places`` are their indices in the full vector of `forward`, whose other
    parts ``template`` holds; ``logarithmic`` marks those that are logarithms
    of it.  ``weight`` is 1 / sigma of a normal prior about ``mean``, else 0.
    ``stated`` is log det of the stated sigmas, ``square`` the coordinate that
    is k itself (-1: none), ``exact`` whether D^T r is the whole gradient,
    ``optics`` whether source, analyzer or diattenuation are free.
    """

    template: FloatArray
    places: NDArray[np.int64]
    logarithmic: NDArray[np.bool_]
    mean: FloatArray
    weight: FloatArray
    low: FloatArray
    high: FloatArray
    stated: float
    square: int
    exact: bool
    optics: bool


def problem_of(model: Model, rows: Rows) -> Problem:
    """The kernels' view of ``model`` fitted to ``rows``."""
    return _of_model(model.priors, tuple(model.places.tolist()))._replace(
        template=model.template,
        stated=stated_log_det(rows),
        exact=not (rows.errors_in_angle or rows.heavy_tailed or bool(rows.censored.any())),
    )


@lru_cache(maxsize=64)
def _of_model(priors: tuple[Prior, ...], places: tuple[int, ...]) -> Problem:
    """What a problem has of its model alone; many channels are fitted with one."""
    at = np.array(places)
    normal = np.array([prior.kind == "normal" for prior in priors])
    logarithmic = np.array([prior.kind == "log_uniform" for prior in priors])
    plain_k = np.flatnonzero((at == K) & ~logarithmic)
    low, high = np.ascontiguousarray(search_ranges(priors).T)
    return Problem(
        template=np.empty(0),
        places=at,
        logarithmic=logarithmic & (at < FIRST_SIGMA),
        mean=np.array([prior.mean for prior in priors]),
        weight=np.array([1 / p.sigma if n else 0.0 for p, n in zip(priors, normal, strict=True)]),
        low=low,
        high=high,
        stated=0.0,
        square=int(plain_k[0]) if len(plain_k) else -1,
        exact=True,
        optics=bool(np.any((at > DIFFUSE) & (at < FIRST_SIGMA))),
    )


@shared
def fill_vector(problem: Problem, x: FloatArray, p: FloatArray) -> None:
    """The full vector of coordinates ``x``."""
    template, places, logarithmic = problem.template, problem.places, problem.logarithmic
    for j in range(len(p)):
        p[j] = template[j]
    for j in range(len(x)):
        p[places[j]] = math.exp(x[j]) if logarithmic[j] else x[j]


@inlined
def objective(rows: Rows, problem: Problem, x: FloatArray, whitened: FloatArray, gains: FloatArray) -> float:
    """F at ``x``, inf outside of the model's domain; fills the whitened residuals and the gains."""
    p, spread = np.empty(len(problem.template)), np.empty(len(whitened))
    fill_vector(problem, x, p)
    chi2, log_det, _ = evaluate_normal(rows, p, whitened, spread, gains)
    value = chi2 + log_det - problem.stated
    mean, weight = problem.mean, problem.weight
    for j in range(len(x)):
        value += ((x[j] - mean[j]) * weight[j]) ** 2
    return value if math.isfinite(value) else math.inf


def objectives(rows: Rows, problem: Problem, points: FloatArray) -> FloatArray:
    """F at each of D points, shape (D, P); the sigmas to be estimated are first set to what the residuals say.

    numpy around the kernel of the likelihood: a kernel of its own would be compiled for seconds.
    """
    used = ~rows.censored
    estimated = np.flatnonzero(problem.places >= FIRST_SIGMA)
    # Each by its closed form; gains and residuals change with the sigmas' ratios, hence twice.
    for _ in range(2 if len(estimated) else 0):
        whitened = whitened_residuals(rows, _vectors(problem, points))
        for j in estimated:
            mine = used & (rows.estimated == problem.places[j] - FIRST_SIGMA)
            square = np.mean(whitened[:, mine] ** 2, axis=1)
            told = np.flatnonzero(square > 0)
            moved = points[told, j] + 0.5 * np.log(square[told])
            points[told, j] = np.clip(moved, problem.low[j], problem.high[j])
    values = deviances(rows, _vectors(problem, points))
    values += np.sum(((points - problem.mean) * problem.weight) ** 2, axis=1)
    return np.where(np.isfinite(values), values, np.inf)


def _vectors(problem: Problem, points: FloatArray) -> FloatArray:
    """`fill_vector` of each of ``points``: shape (D, M)."""
    vectors = np.repeat(problem.template[None], len(points), axis=0)
    vectors[:, problem.places] = np.exp(points, out=points.copy(), where=problem.logarithmic)
    return vectors
