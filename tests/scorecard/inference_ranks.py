"""Are ranks uniform?  Simultaneous bands for their ECDF, exact, and what they can detect."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, norm, poisson

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

DRAWS = 99  # of the posterior, for each rank
BINS = DRAWS + 1
BAND = 0.99


@dataclass(frozen=True, slots=True)
class Effect:
    """A posterior that is wrong by ``shift`` of its standard deviation, or ``scale`` times as wide as it should be."""

    name: str
    scale: float = 1.0
    shift: float = 0.0


EFFECTS = (Effect("10 % too wide", 1.1), Effect("10 % too narrow", 0.9), Effect("off by 0.1 sd", 1.0, 0.1))


def sidak(tests: int) -> float:
    """The level of each of ``tests`` that hold together with probability BAND."""
    return float(BAND ** (1 / tests))


def rank(truth: float, draws: FloatArray, generator: np.random.Generator) -> int:
    """How many of the draws are below the truth; equal ones, as at a bound, by lot."""
    ties = int(np.sum(draws == truth))
    return int(np.sum(draws < truth)) + int(generator.integers(ties + 1))


def tightest(ranks: IntArray) -> float:
    """The smallest two-sided binomial tail of the ECDF of ``ranks`` at 1/BINS, 2/BINS, ..."""
    counts = np.cumsum(np.bincount(ranks, minlength=BINS))[:-1]
    lower, upper = _tails(len(ranks))
    places = np.arange(BINS - 1)
    return float(2 * np.minimum(lower[places, counts], upper[places, counts]).min())


def p_value(ranks: IntArray) -> float:
    """Probability that the ECDF of as many uniform ranks is as far from uniform somewhere.

    Notes
    -----
    Saeilynoja, Buerkner, Vehtari, Stat. Comput. 32 (2022) 32, whose recursion
    over binomial steps is done here over Poisson ones: given their sum, Poisson
    counts are multinomial.
    """
    return max(1.0 - _stays_inside(len(ranks), tightest(ranks)), 0.0)


def power(n: int, level: float, repeats: int = 1000) -> dict[str, float]:
    """Effect to the share of ``repeats`` experiments of ``n`` ranks that a band of ``level`` catches."""
    limit = critical(n, level)
    generator = np.random.default_rng(0)
    found = {}
    for effect in EFFECTS:
        truth = generator.standard_normal((repeats, n))
        below = norm.cdf((truth - effect.shift) / effect.scale)
        ranks = generator.binomial(DRAWS, below)
        found[effect.name] = float(np.mean([tightest(one) < limit for one in ranks]))
    return found


@cache
def critical(n: int, level: float) -> float:
    """The tail that n uniform ranks stay above everywhere with probability ``level``."""
    low, high = 1e-12, 1.0
    for _ in range(50):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if _stays_inside(n, middle) >= level else (low, middle)
    return float(low)


@cache
def _tails(n: int) -> tuple[FloatArray, FloatArray]:
    """P(count <= c) and P(count >= c) of the ECDF at each place, shape (BINS - 1, n + 1)."""
    at = (np.arange(1, BINS) / BINS)[:, None]
    counts = np.arange(n + 1)
    return binom.cdf(counts, n, at), binom.sf(counts - 1, n, at)


def _stays_inside(n: int, tail: float) -> float:
    """Probability that n uniform ranks have two-sided tails above ``tail`` at every place."""
    lower, upper = _tails(n)
    inside = 2 * np.minimum(lower, upper) > tail
    step = poisson.pmf(np.arange(n + 1), n / BINS)
    step = step[: int(np.flatnonzero(step > 1e-18).max()) + 1]
    state = np.zeros(n + 1)
    state[0] = 1.0
    for place in range(BINS - 1):
        state = np.convolve(state, step)[: n + 1] * inside[place]
    return float(np.convolve(state, step)[n] / poisson.pmf(n, n))
