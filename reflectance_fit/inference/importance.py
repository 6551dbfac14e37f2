"""The posterior by importance sampling, which judges itself, and by Laplace's approximation, which cannot.

Draws of a t mixture (``proposal``) are weighted by posterior over proposal.
The weights' Pareto k-hat (Vehtari et al., JMLR 25 (2024) 72, by arviz-stats)
says whether they can be trusted; where they cannot, emcee can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import proposal
from reflectance_fit.inference.proposal import Component, LogDensity

FloatArray = NDArray[np.float64]

MAX_PARETO_K = 0.7
CHAINS = 4  # independent ones, so that later readers can compare them
KEPT = 5000  # draws a chain, of equal weight
_FIRST = 2048
_ROUNDS = 3  # of adapting the proposal
_MOST = 400_000


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """Coordinates of equal weight, shape (chain, draw, P), and how far to trust them.

    ``ess`` is the effective number of independent draws; ``pareto_k`` the
    tail index of the weights, None where there were none.
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
    """Draws by importance sampling from ``components``, adapted to the posterior on the way.

    Batches grow until ``min_ess`` is reached, or until _MOST draws: then
    ``pareto_k`` or ``ess`` say so.
    """
    for _ in range(_ROUNDS):
        points, _, weights, _ = _batch(log_density, components, _FIRST, generator)
        components = proposal.adapted(components, points, weights, ranges)
    count = 4 * _FIRST
    while True:
        parts = [_batch(log_density, components, count // CHAINS, generator) for _ in range(CHAINS)]
        # An infinite k-hat stands for weights of which only one counts.
        ess = sum(1 / float(np.sum(weights**2)) for _, _, weights, _ in parts)
        pareto_k = max(k for *_, k in parts)
        if ess >= min_ess or count >= _MOST:
            break
        count = min(_MOST, int(count * max(2.0, 1.2 * min_ess / ess)))
    equal = [_equal(part, KEPT, generator) for part in parts]
    x, density = (np.stack(column) for column in zip(*equal, strict=True))
    return Draws(x, density, min(ess, float(CHAINS * KEPT)), pareto_k)


def laplace(
    log_density: LogDensity, components: Sequence[Component], generator: np.random.Generator
) -> Draws:
    """Draws of the normal approximation around the best basin, folded at its bounds."""
    best = max(components, key=lambda c: c.share)
    factor = best.factor.T
    normal = generator.standard_normal((CHAINS * KEPT, len(best.centre))) @ factor
    x = best.fold(best.centre + normal)
    density = log_density(x)
    # Beyond the far end of a range, or outside of the model's domain, there is no probability.
    x = x[np.isfinite(density)][generator.integers(int(np.isfinite(density).sum()), size=CHAINS * KEPT)]
    shape = (CHAINS, KEPT)
    return Draws(x.reshape(*shape, -1), log_density(x).reshape(shape), float(CHAINS * KEPT), None)


_Batch = tuple[FloatArray, FloatArray, FloatArray, float]


def _batch(
    log_density: LogDensity, components: Sequence[Component], count: int, generator: np.random.Generator
) -> _Batch:
    """Points, their log density, normalised smoothed weights and k-hat."""
    from arviz_stats.base import array_stats

    x = proposal.draw(components, count, generator)
    density = log_density(x)
    ratio = density - np.logaddexp.reduce(proposal.log_pdf(components, x), axis=0)
    if not np.isfinite(ratio).any():
        raise ValueError("no draw of the proposal has a finite posterior")
    # Draws of no probability weigh nothing; the smoothing is of the others' tail.
    possible = np.isfinite(ratio)
    log_weights = np.full(count, -np.inf)
    smoothed, k = array_stats.psislw(-ratio[possible])  # it is made for the weights of leaving one out
    log_weights[possible] = smoothed
    weights = np.exp(log_weights - log_weights.max())
    return x, density, weights / weights.sum(), float(k)


def _equal(part: _Batch, count: int, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """``count`` draws of equal weight by systematic resampling, in random order."""
    x, density, weights, _ = part
    places = (np.arange(count) + generator.random()) / count
    picks = np.minimum(np.searchsorted(np.cumsum(weights), places), len(x) - 1)
    generator.shuffle(picks)
    return x[picks], density[picks]
