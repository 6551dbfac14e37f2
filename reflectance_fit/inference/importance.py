"""The posterior by importance sampling, which judges itself, and by Laplace's approximation, which cannot.

Draws of a t mixture (``proposal``) are weighted by posterior over proposal.
The weights' Pareto k-hat (Vehtari et al., JMLR 25 (2024) 72, by arviz-stats)
says whether they can be trusted; where they cannot, emcee can.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import proposal
from reflectance_fit.inference.proposal import Component, LogDensity

FloatArray = NDArray[np.float64]

MAX_PARETO_K = 0.7
CHAINS = 4  # independent ones, so that later readers can compare them
KEPT = 2.0  # draws of equal weight, times the effective size asked for
_FIRST = 1.6  # draws of the first batch, times the effective size asked for
_ROUNDS = 6  # of adapting the proposal
_MOST = 400_000
_TEMPERING = 0.7  # a power
_DRAWS_A_DIMENSION = 8
_ENOUGH = 0.3  # effective draws a draw: adapting further gains less than it costs


class NothingDrawn(ValueError):
    """No draw of the proposal lies where there is any probability."""


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """Coordinates of equal weight, shape (chain, draw, P), and how far to trust them.

    ``log_density`` has shape (chain, draw).  ``ess`` is the effective number of
    independent draws; ``pareto_k`` the tail index of the weights, None where
    there were none.
    """

    x: FloatArray
    log_density: FloatArray
    ess: float
    pareto_k: float | None

    @property
    def trusted(self) -> bool:
        return self.pareto_k is not None and self.pareto_k <= MAX_PARETO_K


def importance(
    log_density: LogDensity,
    components: Sequence[Component],
    ranges: FloatArray,
    generator: np.random.Generator,
    *,
    min_ess: float,
) -> Draws:
    """Draws by importance sampling from ``components``, adapted to the posterior where that is needed.

    Batches grow until ``min_ess`` is reached, or until _MOST draws: then
    ``pareto_k`` or ``ess`` say so.  Only the last batch is used, whose proposal
    does not depend on it.
    """
    kept = math.ceil(KEPT * min_ess / CHAINS)
    count, rounds = math.ceil(_FIRST * min_ess / CHAINS) * CHAINS, 0
    while True:
        batch = _batch(log_density, components, count, generator)
        ess = batch.resampled_ess(kept)
        if ess >= min_ess and batch.pareto_k <= MAX_PARETO_K:
            break
        poor = batch.pareto_k > MAX_PARETO_K or ess < _ENOUGH * count
        if poor and rounds < _ROUNDS:
            components = proposal.adapted(components, batch.x, _tempered(batch), ranges)
            rounds += 1
        elif count >= _MOST:
            break
        else:
            count = min(_MOST, CHAINS * math.ceil(count * max(1.5, 1.2 * min_ess / ess) / CHAINS))
    x, density = batch.equal(kept, generator)
    return Draws(x, density, ess, batch.pareto_k)


def laplace(
    log_density: LogDensity, components: Sequence[Component], generator: np.random.Generator, *, count: int
) -> Draws:
    """About ``count`` draws of the normal approximation around the best basin, folded at its bounds."""
    best = max(components, key=lambda c: c.share)
    each = math.ceil(count / CHAINS)
    normal = generator.standard_normal((CHAINS * each, len(best.centre))) @ best.factor.T
    x = best.fold(best.centre + normal)
    density = log_density(x)
    # Beyond the far end of a range, or outside of the model's domain, there is no probability.
    possible = np.flatnonzero(np.isfinite(density))
    picks = possible[generator.integers(len(possible), size=CHAINS * each)] if len(possible) < len(x) else ...
    shape = (CHAINS, each)
    return Draws(x[picks].reshape(*shape, -1), density[picks].reshape(shape), float(CHAINS * each), None)


@dataclass(frozen=True, slots=True, eq=False)
class _Batch:
    """Points, shape (N, P), their log density, smoothed weights of sum 1, and k-hat."""

    x: FloatArray
    log_density: FloatArray
    weights: FloatArray
    pareto_k: float

    @property
    def by_chain(self) -> FloatArray:
        """The weights, each chain's of sum 1, shape (CHAINS, N / CHAINS)."""
        weights = self.weights.reshape(CHAINS, -1)
        # A chain without any probability keeps its zeros.
        return np.asarray(weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300))

    def resampled_ess(self, kept: int) -> float:
        """Effective size of all chains, after ``kept`` draws of equal weight are taken of each.

        Kish's, 1 / sum w^2, less what resampling adds to the variance: a draw
        that is worth ``kept`` w draws is taken a whole number of times.
        """
        expected = kept * self.by_chain
        rest = expected - np.floor(expected)
        variance = np.sum(expected**2 + rest * (1 - rest), axis=1) / kept**2
        return float(np.sum(1 / variance[variance > 0]))

    def equal(self, count: int, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """``count`` draws a chain by systematic resampling, in random order."""
        # How many of the places u, u + 1, ... lie below the end of each draw's share.
        below = np.ceil(count * np.cumsum(self.by_chain, axis=1) - generator.random((CHAINS, 1)))
        below[:, -1] = count
        times = np.clip(below, 0, count).astype(np.int64)
        times[:, 1:] = times[:, 1:] - times[:, :-1]
        picks = np.repeat(np.arange(times.size), times.ravel()).reshape(CHAINS, count)
        generator.permuted(picks, axis=1, out=picks)
        return self.x.take(picks, axis=0), self.log_density.take(picks)


def _tempered(batch: _Batch) -> FloatArray:
    """The weights to the highest power at which enough draws speak for a covariance matrix."""
    weights = batch.weights
    while 1 / np.sum(weights**2) < _DRAWS_A_DIMENSION * batch.x.shape[1]:
        weights = weights**_TEMPERING
        weights /= weights.sum()
    return weights


def _batch(
    log_density: LogDensity, components: Sequence[Component], count: int, generator: np.random.Generator
) -> _Batch:
    from arviz_stats.base import array_stats

    x = proposal.draw(components, count, generator)
    density = log_density(x)
    proposed = proposal.log_pdf(components, x)
    ratio = density - (np.logaddexp.reduce(proposed, axis=0) if len(proposed) > 1 else proposed[0])
    possible = np.isfinite(ratio)
    if not possible.any():
        raise NothingDrawn("no draw of the proposal has a finite posterior")
    # Draws of no probability weigh nothing; the smoothing is of the others' tail.
    log_weights = np.full(count, -np.inf)
    with np.errstate(all="ignore"):  # where nearly all weights are 0 it divides by them
        smoothed, k = array_stats.psislw(-ratio[possible])  # it is made for the weights of leaving one out
    if not np.isfinite(smoothed).any():
        raise NothingDrawn("hardly any draw of the proposal has a posterior worth counting")
    log_weights[possible] = np.where(np.isfinite(smoothed), smoothed, -np.inf)
    weights = np.exp(log_weights - log_weights.max())
    # No power of so few speaks for a covariance matrix.
    if np.count_nonzero(weights) <= _DRAWS_A_DIMENSION * x.shape[1]:
        raise NothingDrawn("hardly any draw of the proposal has a posterior worth counting")
    # An infinite k-hat stands for weights of which only one counts.
    return _Batch(x, density, weights / weights.sum(), float(k) if math.isfinite(k) else math.inf)
