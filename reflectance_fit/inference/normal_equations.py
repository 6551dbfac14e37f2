"""The objective of a fit and its normal equations, compiled: what a Newton step is made of.

The objective is F(x) = chi2 + log det S + sum of ((x_j - mean_j) / sigma_j)^2, the deviance of `likelihood`
and the penalties of normal priors.  In whitened residuals r and their derivatives D = dr/dx,

    grad F / 2 = D^T r          Hess F / 2 ~ D^T S^-1 D - C^T N^-1 C,   C = A^T S^-1 D,  N = A^T S^-1 A

with A the columns of the gains: eliminating them is variable projection in Kaufman's form (BIT 15 (1975) 49).
S^-1 has a term of rank one for each goniometer setting whose angle has an error.

The objective is even in k, but for phases, and its Newton steps in k never arrive at k = 0.  So k may be taken
by its square; in total reflection and for phases k itself is the better coordinate.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.derivatives import gradient_at_angle
from reflectance_fit.inference.forward import FIRST_NUISANCE, FIRST_SIGMA, K, incidence, turns_of
from reflectance_fit.inference.likelihood import (
    cholesky_solve,
    deviances,
    evaluate_normal,
    stated_log_det,
    whitened_residuals,
)
from reflectance_fit.inference.models import Model, search_ranges
from reflectance_fit.inference.rows import LAST_POWER, Rows
from reflectance_fit.physics.jit import inlined, shared
from reflectance_fit.priors import NUISANCES, Prior

FloatArray = NDArray[np.float64]

_OFFSET, _DARK, _DIFFUSE = (
    FIRST_NUISANCE + NUISANCES[name].index for name in ("angle_offset_deg", "dark_offset", "diffuse")
)
# Below it slopes by k^2 are those of this k: at k = 0 itself they are 0 / 0.
_SMALL_K = 1e-4


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
        optics=bool(np.any((at > _DIFFUSE) & (at < FIRST_SIGMA))),
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


@inlined
def normal_equations(
    rows: Rows,
    problem: Problem,
    x: FloatArray,
    squared: bool,
    whitened: FloatArray,
    gains: FloatArray,
    gradient: FloatArray,
    curvature: FloatArray,
) -> None:
    """Half of F's gradient and of its Hessian (Gauss-Newton) at ``x``.

    ``whitened`` and ``gains`` are what `objective` left there.  With
    ``squared``, k is taken by its square.  Where the problem is not exact the
    gradient lacks what log det S and the angles' errors add.
    """
    # Taken out of their tuples once: in a loop each time costs two atomic counts, more than all the arithmetic.
    places, logarithmic, weight = problem.places, problem.logarithmic, problem.weight
    code, censored, setting, theta_sigma = rows.code, rows.censored, rows.setting, rows.theta_sigma
    gain_of, estimated, sigma, largest = rows.gain, rows.estimated, rows.sigma, rows.largest
    size = len(x)
    p = np.empty(len(problem.template))
    fill_vector(problem, x, p)
    rate = np.empty(size)  # dp / dx
    for j in range(size):
        rate[j], gradient[j] = 1.0, 0.0
        if logarithmic[j]:
            rate[j] = p[places[j]]
        if squared and j == problem.square:
            p[K] = max(p[K], _SMALL_K)
            rate[j] = 0.5 / p[K]
    turns = turns_of(p)
    n = len(whitened)
    by_p, jacobian = np.empty(FIRST_SIGMA), np.zeros((size, n))
    settings = rows.settings if rows.errors_in_angle else 0
    normal = np.zeros((rows.gains, rows.gains))
    mixed = np.zeros((rows.gains, size))
    pull, coupling = np.zeros((settings, size)), np.zeros((settings, rows.gains))
    steepness, error = np.zeros(settings), np.zeros(settings)
    for i in range(n):
        if censored[i]:
            continue
        c, s = incidence(rows, i, turns)
        c = max(c, 0.0)
        value = gradient_at_angle(rows, i, c, s, p, turns, problem.optics, by_p)
        g = gain_of[i]
        gain = gains[g] if g >= 0 else 1.0
        e = estimated[i]
        inverse = 1 / (sigma[i] if e < 0 else math.exp(p[FIRST_SIGMA + e]))
        scale = gain * inverse
        if code[i] <= LAST_POWER:
            by_p[_DARK], by_p[_DIFFUSE] = 1 / gain, largest[i] / gain
        for j in range(size):
            place = places[j]
            if place < FIRST_SIGMA:
                jacobian[j, i] = -scale * by_p[place] * rate[j]
            elif place == FIRST_SIGMA + e:
                # d^2/dx^2 of e^(-2x) r^2 + 2x is 4 r^2 where it is 0 on average, not the 2 r^2 of a sum of squares.
                jacobian[j, i] = -math.sqrt(2.0) * whitened[i]
        column = value * inverse if g >= 0 else 0.0
        if g >= 0:
            normal[g, g] += column * column
            for j in range(size):
                mixed[g, j] += column * jacobian[j, i]
        if rows.errors_in_angle and theta_sigma[i] > 0:
            a = setting[i]
            slope = scale * math.degrees(by_p[_OFFSET])
            error[a] = theta_sigma[i] ** 2
            steepness[a] += slope * slope
            for j in range(size):
                pull[a, j] += slope * jacobian[j, i]
            if g >= 0:
                coupling[a, g] += slope * column
    # Row by row within each sum, not sum by sum within each row: sums stay in registers.
    for j in range(size):
        which = places[j] - FIRST_SIGMA
        for i in range(n):
            if which < 0:
                gradient[j] += jacobian[j, i] * whitened[i]
            elif which == estimated[i] and not censored[i]:
                gradient[j] += 1 - whitened[i] ** 2
        for m in range(j + 1):
            total = 0.0
            for i in range(n):
                total += jacobian[j, i] * jacobian[m, i]
            curvature[j, m] = total
    if rows.errors_in_angle:
        for a in range(settings):
            share = error[a] / (1 + error[a] * steepness[a])
            for j in range(size):
                for m in range(j + 1):
                    curvature[j, m] -= share * pull[a, j] * pull[a, m]
            for g in range(rows.gains):
                for j in range(size):
                    mixed[g, j] -= share * coupling[a, g] * pull[a, j]
                for h in range(rows.gains):
                    normal[g, h] -= share * coupling[a, g] * coupling[a, h]
    solved, factor, rhs = (
        np.empty((rows.gains, size)),
        np.empty((rows.gains, rows.gains)),
        np.empty(rows.gains),
    )
    for j in range(size if rows.gains > 0 else 0):
        for g in range(rows.gains):
            rhs[g] = mixed[g, j]
            for h in range(rows.gains):
                factor[g, h] = normal[g, h]
        cholesky_solve(factor, rhs)
        for g in range(rows.gains):
            solved[g, j] = rhs[g]
    for j in range(size):
        for m in range(j + 1):
            for g in range(rows.gains):
                curvature[j, m] -= mixed[g, j] * solved[g, m]
            curvature[m, j] = curvature[j, m]
        scaled = weight[j] * (rate[j] if squared and j == problem.square else 1.0)
        curvature[j, j] += scaled * scaled
        gradient[j] += (x[j] - problem.mean[j]) * weight[j] * scaled
