"""A proposal that resembles the posterior: one Student-t a basin, folded at the bounds.

Laplace's approximation gives centre and spread of each basin.  Coordinates
with a bound nearby, such as k at 0, are folded there: a density in k^2 is
even in k, so its mirror image continues it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
LogDensity = Callable[[FloatArray], FloatArray]

DEGREES_OF_FREEDOM = 5  # tails heavier than a posterior's, so that no weight grows without limit
_FOLD_WITHIN = 8.0  # standard deviations from the centre to the bound
_LEAST_SHARE = 0.05  # of a basin: its Laplace mass may be far off
_WHITENINGS = 6
_ONE_WHITENING = 1e-3, 1e3  # how far one may trust a curvature that was measured over another length


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """A t distribution of ``centre``, shape (P,), and ``covariance``, shape (P, P), folded at ``bounds``.

    ``bounds`` has a value for each coordinate that is folded, NaN for the
    others; ``sides`` is 1 where the range is above the bound, -1 below.
    """

    share: float
    centre: FloatArray
    covariance: FloatArray
    bounds: FloatArray
    sides: FloatArray

    @property
    def factor(self) -> FloatArray:
        """Lower triangle L with L L^T = covariance, found for the correlations, whose scale is 1."""
        sd = np.sqrt(np.diag(self.covariance))
        return np.asarray(sd[:, None] * np.linalg.cholesky(self.covariance / np.outer(sd, sd)))

    def images(self, x: FloatArray) -> list[FloatArray]:
        """``x``, shape (N, P), and its mirror images in every subset of the bounds."""
        folded = np.flatnonzero(np.isfinite(self.bounds))
        found = []
        for mirrored in itertools.product([False, True], repeat=len(folded)):
            columns = folded[np.array(mirrored, dtype=bool)]
            image = x.copy()
            image[:, columns] = 2 * self.bounds[columns] - x[:, columns]
            found.append(image)
        return found

    def fold(self, x: FloatArray) -> FloatArray:
        """Points beyond a bound, mirrored back into the range."""
        beyond = (x - self.bounds) * self.sides < 0
        return np.where(beyond, 2 * self.bounds - x, x)


def at_basin(
    log_density: LogDensity, x: FloatArray, width: FloatArray, ranges: FloatArray
) -> tuple[float, Component]:
    """Log of the mass that Laplace's approximation gives a basin, and its component of share 1.

    ``width`` (P,) is the distance along each axis over which the density
    falls noticeably.  Differences are taken over it, then over the standard
    deviations that they give, so the curvature is that of the bulk.
    """
    low, high = ranges.T

    def value(points: FloatArray) -> FloatArray:
        points = np.where(points < low, 2 * low - points, points)
        return log_density(np.where(points > high, 2 * high - points, points))

    # x + factor z has z of unit covariance once the curvature in z is the identity.
    factor: FloatArray = np.diag(width)
    for _ in range(_WHITENINGS):
        values, vectors = np.linalg.eigh(_curvature(value, x, factor))
        factor = factor @ (vectors / np.sqrt(np.clip(values, *_ONE_WHITENING)))
    # A parameter that hardly anything feels is as wide as a uniform law over its range.
    sd = np.sqrt(np.sum(factor**2, axis=1))
    widest = np.where(sd > 0.25 * (high - low), (high - low) / np.sqrt(12.0), np.inf)
    scaled = factor / widest[:, None]
    inside = np.linalg.inv(np.eye(len(x)) + scaled.T @ scaled)
    covariance = factor @ inside @ factor.T
    component = Component(1.0, x, covariance, *_bounds(x, covariance, ranges))
    log_mass = log_density(x[None])[0] + np.sum(np.log(np.diag(component.factor)))
    return float(log_mass), component


def _curvature(value: LogDensity, x: FloatArray, factor: FloatArray) -> FloatArray:
    """Minus the second differences of ``value`` around x along the columns of ``factor``, shape (P, P)."""
    size = len(x)
    pairs = list(itertools.combinations(range(size), 2))
    unit = np.eye(size)
    corners = [a * unit[i] + b * unit[j] for i, j in pairs for a in (1, -1) for b in (1, -1)]
    found = value(x + np.array([0 * unit[0], *unit, *-unit, *corners]) @ factor.T)
    centre, plus, minus = found[0], found[1 : size + 1], found[size + 1 : 2 * size + 1]
    curvature: FloatArray = np.diag(2 * centre - plus - minus)
    with np.errstate(invalid="ignore"):
        for (i, j), (pp, pm, mp, mm) in zip(pairs, found[2 * size + 1 :].reshape(-1, 4), strict=True):
            curvature[i, j] = curvature[j, i] = (pm + mp - pp - mm) / 4
    # Where a neighbour is outside of the model's domain the step is long enough as it is.
    return np.where(np.isfinite(curvature), curvature, unit)


def mixture(masses: Sequence[float], components: Sequence[Component]) -> list[Component]:
    """Components with shares by their Laplace masses."""
    share = np.exp(np.array(masses) - max(masses))
    share = np.maximum(share / share.sum(), _LEAST_SHARE)
    share /= share.sum()
    return [replace(c, share=float(s)) for s, c in zip(share, components, strict=True)]


def draw(components: Sequence[Component], count: int, generator: np.random.Generator) -> FloatArray:
    """``count`` points of the mixture, shape (count, P)."""
    picks = generator.choice(len(components), size=count, p=[c.share for c in components])
    size = len(components[0].centre)
    out = np.empty((count, size))
    for number, component in enumerate(components):
        mine = picks == number
        normal = generator.standard_normal((int(mine.sum()), size)) @ component.factor.T
        chi2 = generator.chisquare(DEGREES_OF_FREEDOM, size=(len(normal), 1)) / DEGREES_OF_FREEDOM
        out[mine] = component.fold(component.centre + normal / np.sqrt(chi2))
    return out


def log_pdf(components: Sequence[Component], x: FloatArray) -> FloatArray:
    """Log density of each component at ``x`` times its share, shape (C, N)."""
    from scipy.linalg import solve_triangular
    from scipy.special import gammaln, logsumexp

    size, df = x.shape[1], DEGREES_OF_FREEDOM
    constant = gammaln((df + size) / 2) - gammaln(df / 2) - size / 2 * np.log(df * np.pi)
    found = []
    for c in components:
        # scipy's multivariate_t takes a ridge between a tiny and a large coordinate for singular.
        each = []
        for image in c.images(x):
            z = solve_triangular(c.factor, (image - c.centre).T, lower=True)
            each.append(-(df + size) / 2 * np.log1p(np.sum(z**2, axis=0) / df))
        volume = np.sum(np.log(np.diag(c.factor)))
        found.append(np.log(c.share) + constant - volume + logsumexp(each, axis=0))
    return np.stack(found)


def adapted(
    components: Sequence[Component], x: FloatArray, weights: FloatArray, ranges: FloatArray
) -> list[Component]:
    """Components moved to the weighted draws that each is responsible for (one step of EM).

    A folded coordinate keeps its centre: its mirror images balance around the bound.
    """
    shares = log_pdf(components, x)
    shares = np.exp(shares - shares.max(axis=0))
    shares *= weights / shares.sum(axis=0)
    found = []
    for component, w in zip(components, shares, strict=True):
        mass = w.sum()
        if mass < _LEAST_SHARE / 10 or mass**2 < 4 * x.shape[1] * np.sum(w**2):
            found.append(component)  # too few draws speak for it
            continue
        w = w / mass
        centre = np.where(np.isfinite(component.bounds), component.centre, w @ x)
        deviation = x - centre
        covariance = (deviation * w[:, None]).T @ deviation
        # A t of this shape has a covariance of df / (df - 2) times it: a little wide is safe.
        share = max(float(mass), _LEAST_SHARE)
        found.append(Component(share, centre, covariance, *_bounds(centre, covariance, ranges)))
    total = sum(c.share for c in found)
    return [replace(c, share=c.share / total) for c in found]


def _bounds(centre: FloatArray, covariance: FloatArray, ranges: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The bound of each coordinate that lies within reach, the nearer of two, and its side."""
    sd = np.sqrt(np.diag(covariance))
    distance = np.abs(ranges - centre[:, None])
    nearer = np.argmin(distance, axis=1)
    rows = np.arange(len(centre))
    bounds = np.where(distance[rows, nearer] < _FOLD_WITHIN * sd, ranges[rows, nearer], np.nan)
    return bounds, np.where(nearer == 0, 1.0, -1.0)
