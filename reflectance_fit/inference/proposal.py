"""A proposal that resembles the posterior: Student-t laws, one or more a basin, folded at the bounds.

Laplace's approximation gives centre and spread of each basin.  Coordinates
with a bound nearby, such as k at 0, are folded there: a density in k^2 is
even in k, so its mirror image continues it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
LogDensity = Callable[[FloatArray], FloatArray]

DEGREES_OF_FREEDOM = 5  # tails heavier than a posterior's, so that no weight grows without limit
_FOLD_WITHIN = 8.0  # standard deviations from the centre to the bound
_LEAST_SHARE = 0.05  # of a basin: its Laplace mass may be far off


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """A t distribution of ``centre``, shape (P,), and covariance factor factor^T, folded at ``bounds``.

    ``factor`` is lower triangular, ``inverse`` its inverse.  ``bounds`` has a
    value for each coordinate that is folded, NaN for the others; ``sides`` is 1
    where the range is above the bound, -1 below.
    """

    share: float
    centre: FloatArray
    factor: FloatArray
    inverse: FloatArray
    bounds: FloatArray
    sides: FloatArray

    @property
    def covariance(self) -> FloatArray:
        return np.asarray(self.factor @ self.factor.T)

    def images(self, x: FloatArray) -> list[FloatArray]:
        """``x``, shape (N, P), and its mirror images in every subset of the bounds."""
        folded = np.flatnonzero(np.isfinite(self.bounds))
        found = [x]
        for size in range(1, len(folded) + 1):
            for columns in map(list, itertools.combinations(folded, size)):
                image = x.copy()
                image[:, columns] = 2 * self.bounds[columns] - x[:, columns]
                found.append(image)
        return found

    def fold(self, x: FloatArray) -> FloatArray:
        """Points beyond a bound mirrored back into the range, in place."""
        for j in np.flatnonzero(np.isfinite(self.bounds)).tolist():
            # |distance| on the side of the range.
            x[:, j] = self.bounds[j] + self.sides[j] * np.abs(x[:, j] - self.bounds[j])
        return x


def component(share: float, centre: FloatArray, covariance: FloatArray, ranges: FloatArray) -> Component:
    """A component folded at whichever of ``ranges``, shape (P, 2), lie within its reach."""
    sd = np.sqrt(np.diag(covariance))
    # Factored and inverted for the correlations, whose scale is 1.
    root = np.linalg.cholesky(covariance / np.outer(sd, sd))
    distance = np.abs(ranges - centre[:, None])
    nearer = np.argmin(distance, axis=1)
    rows = np.arange(len(centre))
    bounds = np.where(distance[rows, nearer] < _FOLD_WITHIN * sd, ranges[rows, nearer], np.nan)
    inverse = np.linalg.inv(root) / sd
    return Component(share, centre, sd[:, None] * root, inverse, bounds, np.where(nearer == 0, 1.0, -1.0))


def mixture(masses: Sequence[float], components: Sequence[Component]) -> list[Component]:
    """Components with shares by their Laplace masses."""
    share = np.exp(np.array(masses) - max(masses))
    share = np.maximum(share / share.sum(), _LEAST_SHARE)
    share /= share.sum()
    return [replace(c, share=float(s)) for s, c in zip(share, components, strict=True)]


def draw(components: Sequence[Component], count: int, generator: np.random.Generator) -> FloatArray:
    """``count`` points of the mixture, shape (count, P), in random order."""
    size = len(components[0].centre)
    normal = generator.standard_normal((count, size))
    normal /= np.sqrt(generator.chisquare(DEGREES_OF_FREEDOM, size=(count, 1)) / DEGREES_OF_FREEDOM)
    if len(components) == 1:
        return components[0].fold(components[0].centre + normal @ components[0].factor.T)
    picks = generator.choice(len(components), size=count, p=[c.share for c in components])
    out = np.empty((count, size))
    for number, c in enumerate(components):
        mine = picks == number
        out[mine] = c.fold(c.centre + normal[mine] @ c.factor.T)
    return out


def log_pdf(components: Sequence[Component], x: FloatArray) -> FloatArray:
    """Log density of each component at ``x`` times its share, shape (C, N)."""
    size, df = x.shape[1], DEGREES_OF_FREEDOM
    constant = math.lgamma((df + size) / 2) - math.lgamma(df / 2) - size / 2 * math.log(df * math.pi)
    found = np.empty((len(components), len(x)))
    for c, out in zip(components, found, strict=True):
        kernels = []
        for image in c.images(x):
            z = (image - c.centre) @ c.inverse.T
            kernels.append(1 + np.einsum("ij,ij->i", z, z) / df)
        if len(kernels) == 1:
            out[:] = -(df + size) / 2 * np.log(kernels[0])
        else:
            out[:] = np.log(np.sum(np.power(kernels, -(df + size) / 2), axis=0))
        out += math.log(c.share) + constant - np.log(c.factor.diagonal()).sum()
    return found


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
    for old, w in zip(components, shares, strict=True):
        mass = w.sum()
        if mass < _LEAST_SHARE / 10 or mass**2 < 4 * x.shape[1] * np.sum(w**2):
            found.append(old)  # too few draws speak for it
            continue
        w = w / mass
        centre = np.where(np.isfinite(old.bounds), old.centre, w @ x)
        deviation = x - centre
        covariance = (deviation * w[:, None]).T @ deviation
        # A t of this shape has a covariance of df / (df - 2) times it: a little wide is safe.
        found.append(component(max(float(mass), _LEAST_SHARE), centre, covariance, ranges))
    total = sum(c.share for c in found)
    return [replace(c, share=c.share / total) for c in found]
