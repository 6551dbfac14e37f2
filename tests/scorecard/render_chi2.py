"""Pearson's chi-square of a sampler against the density it claims, over cells of a rectangle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

Floats = NDArray[np.float64]

ALPHA = 0.01
# Of the mass of a box, and absolute: 1e6 samples miss that of a cell by far more.  Every cell is quartered
# twice at least, because a lobe in its corner may lie between the nodes.
_RELATIVE, _ABSOLUTE, _FIRST, _LAST = 1e-4, 1e-9, 2, 12
_FEW, _MANY = (np.polynomial.legendre.leggauss(n) for n in (5, 8))


@dataclass(frozen=True, slots=True)
class Sampler:
    """Points (N, 2) of a rectangle, and their density over it.

    ``sample(n, rng)`` gives NaN for what ended elsewhere (below the horizon,
    say): its share is what the density lacks to 1.  ``bounds`` is x0, x1, y0, y1.
    """

    name: str
    sample: Callable[[int, np.random.Generator], Floats]
    density: Callable[[Floats, Floats], Floats]
    bounds: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Outcome:
    """``mass`` is the density's integral; ``p_value`` of the hypothesis that sample and density agree."""

    name: str
    mass: float
    p_value: float
    cells: int


def significance(tests: int) -> float:
    """Below which one of so many p-values fails, so that all of them pass with 1 - ALPHA (Sidak)."""
    return float(1.0 - (1.0 - ALPHA) ** (1.0 / tests))


def examine(sampler: Sampler, n: int, seed: int, cells: int = 24) -> Outcome:
    """Draw n and compare.  The cells come from quantiles of other samples, so that none is nearly empty."""
    pilot = sampler.sample(100_000, np.random.default_rng([seed, 0]))
    pilot = pilot[np.isfinite(pilot[:, 0])]
    x0, x1, y0, y1 = sampler.bounds
    x_edges, y_edges = _edges(pilot[:, 0], x0, x1, cells), _edges(pilot[:, 1], y0, y1, cells)
    expected = integrate(sampler.density, x_edges, y_edges)
    points = sampler.sample(n, np.random.default_rng([seed, 1]))
    points = points[np.isfinite(points[:, 0])]
    found = np.histogram2d(points[:, 0], points[:, 1], bins=(x_edges, y_edges))[0]
    mass = float(expected.sum())
    # A missing share that is all rounding is no cell.
    elsewhere = max(1.0 - mass, 0.0) * n
    counts, hopes = np.append(found, n - found.sum()), np.append(expected * n, elsewhere)
    order = np.argsort(hopes)
    pooled = np.searchsorted(np.cumsum(hopes[order]), 5.0) + 1  # rare cells together expect at least 5
    low, high = order[:pooled], order[pooled:]
    counts = np.append(counts[high], counts[low].sum())
    hopes = np.append(hopes[high], hopes[low].sum())
    statistic = float(np.sum((counts - hopes) ** 2 / hopes))
    return Outcome(sampler.name, mass, float(chi2.sf(statistic, counts.size - 1)), counts.size)


def _edges(values: Floats, low: float, high: float, cells: int) -> Floats:
    """Quantiles, and a little beyond the extremes: quadrature would not find a lobe at the end of a wide cell."""
    inner = np.quantile(values, np.concatenate([[0.0, 0.001], np.arange(1, cells) / cells, [0.999, 1.0]]))
    margin = 0.02 * (inner[-1] - inner[0])
    inner = np.concatenate([[inner[0] - margin], inner[1:-1], [inner[-1] + margin]])
    return np.unique(np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]]))


def integrate(density: Callable[[Floats, Floats], Floats], x_edges: Floats, y_edges: Floats) -> Floats:
    """Mass of each cell: Gauss-Legendre of two orders, quartering where they disagree."""
    x0, y0 = (e.reshape(-1) for e in np.meshgrid(x_edges[:-1], y_edges[:-1], indexing="ij"))
    x1, y1 = (e.reshape(-1) for e in np.meshgrid(x_edges[1:], y_edges[1:], indexing="ij"))
    shape = (x_edges.size - 1, y_edges.size - 1)
    cell, mass = np.arange(x0.size), np.zeros(x0.size)
    for split in range(_LAST + 1):
        few, many = (_gauss(density, x0, x1, y0, y1, *rule) for rule in (_FEW, _MANY))
        poor = np.abs(many - few) > _RELATIVE * np.abs(many) + _ABSOLUTE
        poor = (poor | (split < _FIRST)) & (split < _LAST)
        np.add.at(mass, cell[~poor], many[~poor])
        x0, x1, y0, y1, cell = (a[poor] for a in (x0, x1, y0, y1, cell))
        xm, ym = (x0 + x1) / 2, (y0 + y1) / 2
        x0, x1 = np.concatenate([x0, xm, x0, xm]), np.concatenate([xm, x1, xm, x1])
        y0, y1 = np.concatenate([y0, y0, ym, ym]), np.concatenate([ym, ym, y1, y1])
        cell = np.tile(cell, 4)
        if not cell.size:
            break
    return mass.reshape(shape)


def _gauss(
    density: Callable[[Floats, Floats], Floats],
    x0: Floats,
    x1: Floats,
    y0: Floats,
    y1: Floats,
    nodes: Floats,
    weights: Floats,
) -> Floats:
    hx, hy = (x1 - x0) / 2, (y1 - y0) / 2
    x = ((x0 + x1) / 2)[:, None, None] + hx[:, None, None] * nodes[:, None]
    y = ((y0 + y1) / 2)[:, None, None] + hy[:, None, None] * nodes
    x, y = np.broadcast_arrays(x, y)
    values = density(x.reshape(-1), y.reshape(-1)).reshape(x.shape)
    return np.asarray(np.einsum("nij,i,j->n", values, weights, weights) * hx * hy)
