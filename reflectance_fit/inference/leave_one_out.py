"""How well a model foretells each row from all the others: PSIS-LOO (Vehtari, Gelman and Gabry 2017).

Rows share gains and angle errors, so they do not factorise.  Following
Bürkner, Gabry and Vehtari (Comput. Stat. 36 (2021) 1243), the predictive
density of row i given the others and one draw of the parameters is that of
the joint normal law, with the gains integrated out under a flat prior:

    P = S^-1 - S^-1 F (F^T S^-1 F)^-1 F^T S^-1,
    log p(y_i | y_-i) = 1/2 log(P_ii / 2 pi) - 1/2 (P r)_i^2 / P_ii,

S and F as in ``likelihood``, r the residuals.  A row that alone tells its
gain has P_ii = 0 and foretells nothing: it is left out, like saturated rows,
whose share of a draw's weight is kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import ladder, posterior
from reflectance_fit.inference.cholesky import cholesky_solve
from reflectance_fit.inference.likelihood import design, terms
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.optimize import Basin
from reflectance_fit.inference.rows import Rows
from reflectance_fit.inference.student import foretold_heavy_tailed
from reflectance_fit.physics.jit import kernel
from reflectance_fit.result import LeaveOneOut

FloatArray = NDArray[np.float64]

DRAWS = 4000  # before those outside of the priors' range are dropped
_WIDER, _DF = 1.5, 5


@dataclass(frozen=True, slots=True, eq=False)
class Foretold:
    """Expected log predictive density of each row, shape (N,), NaN where left out, and the worst Pareto k."""

    elpd: FloatArray
    pareto_k: float

    @property
    def total(self) -> float:
        return float(np.nansum(self.elpd))


def compare(chosen: Foretold, rival: Foretold, name: str) -> LeaveOneOut:
    """``chosen`` against ``rival``, which is to be called ``name``, on the rows that both foretell."""
    each = (chosen.elpd - rival.elpd)[np.isfinite(chosen.elpd) & np.isfinite(rival.elpd)]
    se = math.sqrt(len(each)) * float(np.std(each, ddof=1)) if len(each) > 1 else 0.0
    return LeaveOneOut(name, float(each.sum()), se, max(chosen.pareto_k, rival.pareto_k))


def foretell(model: Model, rows: Rows, basins: Sequence[Basin], seed: tuple[int, ...]) -> Foretold:
    """Leave every row of a model out in turn, by weighted draws.

    Without a row that says much the posterior is wider than with it.  So the
    draws are of a t law half as wide again as Laplace's approximation, and
    weights are those of the posterior over it, then of leaving the row out.
    """
    from arviz_stats.base import array_stats
    from scipy.special import logsumexp

    drawn = ladder.draw(model, rows, basins, "laplace", seed, min_ess=DRAWS)
    near = [p.to_coordinate(drawn.flat(n)) for n, p in zip(model.names, model.priors, strict=True)]
    x, log_weights = _wider(np.stack(near), np.random.default_rng(seed))
    log_weights += posterior.log_posterior(model, rows)(x)
    possible = np.isfinite(log_weights)
    x, log_weights = x[possible], log_weights[possible]
    given_others = pointwise(rows, model.full(x))
    elpd, worst = np.full(len(rows.value), np.nan), -math.inf
    for i in np.flatnonzero(np.all(np.isfinite(given_others), axis=0)):
        # psislw smooths the weights of 1 / likelihood.
        with np.errstate(
            divide="ignore", invalid="ignore", over="ignore"
        ):  # k is infinite where one weight is all
            smoothed, k = array_stats.psislw(given_others[:, i] - log_weights)
        elpd[i] = logsumexp(smoothed + given_others[:, i]) - logsumexp(smoothed)
        worst = max(worst, float(k))
    return Foretold(elpd, worst)


def _wider(near: FloatArray, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Points of a t law around ``near``, shape (P, D), and minus their log density: shapes (DRAWS, P), (DRAWS,)."""
    size = len(near)
    sd = near.std(axis=1)
    # Two coordinates may be one to rounding: the diagonal keeps the factor real.
    correlation = np.atleast_2d(np.corrcoef(near)) + 1e-9 * np.eye(size)
    z = generator.standard_normal((DRAWS, size))
    z /= np.sqrt(generator.chisquare(_DF, (DRAWS, 1)) / _DF)
    x = near.mean(axis=1) + _WIDER * sd * (z @ np.linalg.cholesky(correlation).T)
    return x, 0.5 * (_DF + size) * np.log1p(np.sum(z**2, axis=1) / _DF)


def pointwise(rows: Rows, vectors: FloatArray) -> FloatArray:
    """log p(y_i | the other rows) for each full parameter vector: shape (D, N), NaN where left out."""
    found, gains = terms(rows, vectors)
    kind = _heavy_tailed if rows.heavy_tailed else _normal
    return kind(rows, vectors, gains, np.isfinite(found[:, 0]))


@kernel
def _heavy_tailed(
    rows: Rows, vectors: FloatArray, gains: FloatArray, inside: NDArray[np.bool_]
) -> FloatArray:
    n = len(rows.value)
    out = np.full((len(vectors), n), np.nan)
    f, slope, target, sigma = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for d in range(len(vectors)):
        if inside[d]:
            design(rows, vectors[d], f, slope, target, sigma)
            foretold_heavy_tailed(rows, f, target, sigma, gains[d], out[d])
    return out


@kernel
def _normal(rows: Rows, vectors: FloatArray, best: FloatArray, inside: NDArray[np.bool_]) -> FloatArray:
    n, g_count = len(rows.value), rows.gains
    out = np.full((len(vectors), n), np.nan)
    f, slope, target, sigma = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    share = np.empty(rows.settings)
    pull = np.empty(rows.settings)
    a = np.empty((n, g_count))  # S^-1 F
    normal = np.empty((g_count, g_count))
    z = np.empty(g_count)
    for d in range(len(vectors)):
        if not inside[d]:
            continue
        gains = best[d]
        design(rows, vectors[d], f, slope, target, sigma)
        share[:], pull[:] = 0.0, 0.0
        steepness = np.zeros(rows.settings)
        coupling = np.zeros((rows.settings, g_count))
        for i in range(n):
            g, s = rows.gain[i], rows.setting[i]
            slope[i] *= gains[g] if g >= 0 else 1.0
            if rows.censored[i]:
                continue
            w = 1 / sigma[i] ** 2
            residual = target[i] - (gains[g] * f[i] if g >= 0 else 0.0)
            pull[s] += w * slope[i] * residual
            steepness[s] += w * slope[i] ** 2
            if g >= 0:
                coupling[s, g] += w * slope[i] * f[i]
        normal[:] = 0.0
        for i in range(n):
            s = rows.setting[i]
            variance = rows.theta_sigma[i] ** 2
            share[s] = variance / (1 + variance * steepness[s])
            a[i] = 0.0
            if rows.censored[i]:
                continue
            w = 1 / sigma[i] ** 2
            for g in range(g_count):
                a[i, g] = -share[s] * w * slope[i] * coupling[s, g]
            if rows.gain[i] >= 0:
                a[i, rows.gain[i]] += w * f[i]
                for g in range(g_count):
                    normal[rows.gain[i], g] += f[i] * a[i, g]
        z[:] = 0.0
        cholesky_solve(normal, z)  # normal becomes its factor
        for i in range(n):
            if rows.censored[i]:
                continue
            w, s = 1 / sigma[i] ** 2, rows.setting[i]
            precision = w - share[s] * (w * slope[i]) ** 2
            alone = precision
            for g in range(g_count):
                z[g] = a[i, g]
                for m in range(g):
                    z[g] -= normal[g, m] * z[m]
                z[g] /= normal[g, g]
                precision -= z[g] * z[g]
            if precision > 1e-9 * alone:
                residual = target[i] - (gains[rows.gain[i]] * f[i] if rows.gain[i] >= 0 else 0.0)
                pulled = w * residual - share[s] * w * slope[i] * pull[s]
                out[d, i] = 0.5 * math.log(precision / (2 * math.pi)) - 0.5 * pulled**2 / precision
    return out
