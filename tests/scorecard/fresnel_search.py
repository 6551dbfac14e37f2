"""Searching the worst input: random points of a unit cube, then hill-climbing on every error at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Errors = Callable[[Floats, Ints], Floats]

RANDOM = 0.4  # of the evaluations
BATCH = 500
KEPT, CHILDREN = 3, 3  # the best points an objective, and what each of them is turned into at a time
OCTAVES = 50.0  # of steps in the cube


class Points(NamedTuple):
    """Places in the cube, shape (axes, n), ulps added to their images, (inputs, n), and errors (n, objectives)."""

    u: Floats
    ulps: Ints
    errors: Floats


def search(
    errors: Errors, axes: int, inputs: int, evaluations: int, rng: np.random.Generator, reach: int
) -> None:
    """Call ``errors`` on ``evaluations`` points, ever more of them where an error was large.

    A point is a place u in the unit cube, shape (axes, n), and a number of ulps to add to each of its
    images, shape (inputs, n), at most 2^reach.  ``errors`` returns one column an objective, shape
    (n, objectives), and remembers what the caller wants to know.  Each objective has its own climbers:
    the best KEPT points of all, moved in the cube by steps of all sizes, by ulps, or by both.
    """
    best: Points | None = None
    left = evaluations
    while left > 0:
        n = min(BATCH, left)
        if best is None or left > (1 - RANDOM) * evaluations:
            u, ulps = rng.random((axes, n)), np.zeros((inputs, n), dtype=np.int64)
        else:
            u, ulps = (moves[:, :n] for moves in _children(best, rng, reach))
        best = _best(best, Points(u, ulps, errors(u, ulps)))
        left -= u.shape[1]


def moved(x: NDArray[Any], ulps: Ints) -> NDArray[Any]:
    """The float that is so many floats further from zero, shape (n,); stops at zero and at the largest."""
    integer = f"i{x.itemsize}"
    largest = int(np.array(np.finfo(x.dtype).max).view(integer))
    bits = np.clip(np.abs(x).view(integer).astype(np.int64) + ulps, 0, largest)
    return np.copysign(bits.astype(integer).view(x.dtype), x)


def _leaders(errors: Floats) -> Ints:
    """Indices of the KEPT largest of each column, shape (KEPT, objectives)."""
    return np.argsort(-errors, axis=0, kind="stable")[:KEPT]


def _best(before: Points | None, now: Points) -> Points:
    if before is not None:
        u, ulps = (np.concatenate(pair, axis=1) for pair in ((before.u, now.u), (before.ulps, now.ulps)))
        now = Points(u, ulps, np.concatenate((before.errors, now.errors)))
    kept = np.unique(_leaders(now.errors))
    return Points(now.u[:, kept], now.ulps[:, kept], now.errors[kept])


def _children(best: Points, rng: np.random.Generator, reach: int) -> tuple[Floats, Ints]:
    leaders = _leaders(best.errors)
    parents = np.repeat(leaders.ravel(), CHILDREN)
    u, ulps, far, n = best.u[:, parents], best.ulps[:, parents], 2**reach, len(parents)
    steps = _steps(rng, u.shape, OCTAVES)
    jumps = _steps(rng, ulps.shape, float(reach)) * far
    # Half of the steps are as large as what separates two leaders, so that they shrink as these meet.
    others = np.repeat(np.roll(leaders, 1, axis=0).ravel(), CHILDREN)
    shares = np.where(rng.random(n) < 0.5, rng.uniform(-2.0, 2.0, n), np.nan)
    steps = np.where(np.isnan(shares), steps, shares * (best.u[:, others] - u))
    jumps = np.where(np.isnan(shares), jumps, shares * (best.ulps[:, others] - ulps))
    how = rng.random(n)
    steps, jumps = steps * (how < 0.6), np.rint(jumps * (how > 0.4))
    return np.clip(u + steps, 0.0, 1.0), np.clip(ulps + jumps.astype(np.int64), -far, far)


def _steps(rng: np.random.Generator, shape: tuple[int, int], octaves: float) -> Floats:
    """Of sizes from 2^-octaves to 1, evenly in the logarithm, and either sign; along some of the axes."""
    sizes = rng.choice([-1.0, 1.0], shape) * 2.0 ** (-octaves * rng.random(shape))
    moving = rng.random(shape) < 0.5
    moving[rng.integers(shape[0], size=shape[1]), np.arange(shape[1])] = True
    return np.where(moving, sizes, 0.0)
