"""Scores sheared so that ridges are straight.

Readings depend on a nuisance x about linearly, on its score z not: where two
nuisances act alike, such as dark offset and diffuse light, the posterior in
scores follows a bent ridge.  Along it the coordinates that are linear move in
proportion to the others' x.  Subtracting that leaves a straight one.  Near k = 0,
where readings depend on k^2, the same is done with k^2.  A shear has
determinant 1: densities stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.proposal import Component, LogDensity, component
from reflectance_fit.inference.scores import Scores

FloatArray = NDArray[np.float64]

_STEP = 1e-4  # of a score, for central differences


@dataclass(frozen=True, slots=True, eq=False)
class Shear:
    """y = z - slopes (f(z) - f0) for the coordinates ``moved``, shape (M,), f the features of ``bent``, shape (F,).

    ``squared`` is the place of k, where that is folded at 0 and its square is the last feature.
    """

    scores: Scores
    moved: NDArray[np.int64]
    bent: NDArray[np.int64]
    squared: int | None
    slopes: FloatArray
    origin: FloatArray

    def features(self, z: FloatArray) -> FloatArray:
        """What the ridges follow, shape (D, F)."""
        found = self.scores.features(z)
        return found if self.squared is None else np.column_stack([found, z[:, self.squared] ** 2])

    def plain(self, y: FloatArray) -> FloatArray:
        """Scores z of sheared scores y, both of shape (D, P)."""
        if not self.slopes.size:
            return y
        z = y.copy()
        z[:, self.moved] += (self.features(y) - self.origin) @ self.slopes.T
        return z

    def carried(self, c: Component) -> Component:
        """The component in y that is ``c`` in z, to first order."""
        if not self.slopes.size:
            return c
        centre = c.centre.copy()
        centre[self.moved] -= self.slopes @ (self.features(c.centre[None])[0] - self.origin)
        matrix = np.eye(len(centre))
        matrix[np.ix_(self.moved, self.bent)] = -self.slopes @ self.rates(c.centre)
        factor = matrix @ c.factor
        return component(c.share, centre, factor @ factor.T, self.scores.ranges)

    def rates(self, z: FloatArray) -> FloatArray:
        """df / dz of the features at z (P,): shape (F, F)."""
        step = np.zeros((len(self.bent), len(z)))
        step[np.arange(len(self.bent)), self.bent] = _STEP
        return np.asarray((self.features(z + step) - self.features(z - step)).T / (2 * _STEP))


def shear_at(scores: Scores, log_density: LogDensity, c: Component) -> Shear:
    """The shear that straightens the ridges through ``c``, the Laplace approximation of a basin in z."""
    names = scores.model.names
    k = names.index("k") if "k" in names else None
    squared = k if k is not None and c.bounds[k] == 0.0 else None
    bent = scores.bent if squared is None else np.append(scores.bent, squared)
    moved = np.setdiff1d(np.flatnonzero(np.isnan(c.bounds)), bent)
    origin = np.zeros(len(bent))
    found = Shear(scores, moved, bent, squared, np.empty((0, 0)), origin)
    if not len(bent) or not len(moved):
        return found
    origin = found.features(c.centre[None])[0]
    # Given the bent scores, the others move by -H_mm^-1 H_mb of the precision H.
    precision = c.inverse.T @ c.inverse
    inside = precision[np.ix_(moved, moved)]
    along = -np.linalg.solve(inside, precision[np.ix_(moved, scores.bent)])
    own = found.rates(c.centre)[: len(scores.bent), : len(scores.bent)]
    slopes: FloatArray = np.asarray(np.linalg.solve(own.T, along.T).T, dtype=float)
    if squared is not None:
        # A standard deviation up in k the slope is no longer 0: what makes it so again, over the change of k^2.
        higher = c.centre.copy()
        higher[squared] += float(np.linalg.norm(c.factor[squared]))
        width = 0.1 / np.sqrt(np.diag(inside))
        step = np.zeros((len(moved), len(higher)))
        step[np.arange(len(moved)), moved] = width
        rise = log_density(np.vstack([higher + step, higher - step]))
        gradient = (rise[: len(moved)] - rise[len(moved) :]) / (2 * width)
        change = higher[squared] ** 2 - c.centre[squared] ** 2
        slopes = np.column_stack([slopes, np.linalg.solve(inside, gradient) / change])
    if not np.isfinite(slopes).all():
        return found
    return Shear(scores, moved, bent, squared, slopes, origin)
