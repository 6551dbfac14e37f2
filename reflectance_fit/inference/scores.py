"""Coordinates for a proposal: every nuisance as the normal score of its prior.

With x = F^-1(Phi(z)), F the prior's distribution function, z is standard normal
a priori.  Where the data say little the posterior stays so, and no bound is
left to be met: a half-normal prior, which has its greatest density at its
bound, becomes smooth.  A likelihood that depends on z smoothly bends the
normal law only as far as the data do.

Degree and azimuth of the source's polarization are a pair: twice the azimuth is
the direction of a point in the plane, and its distance from the origin is such
that the point, too, is standard normal a priori.  The plane has neither the
azimuth's seam nor the crossing ridges that azimuth and degree make where one
of them is near 0.

eta, k and estimated sigmas stay in the model's coordinates.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.models import Model
from reflectance_fit.priors import NUISANCES, Prior

FloatArray = NDArray[np.float64]

_CERTAIN = 8.0  # sigma to a bound beyond which a normal prior does not feel it


class Scores:
    """The way between the coordinates x of ``model`` and the scores z, both of shape (D, P)."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.scored = np.array([name in NUISANCES for name in model.names])
        #: Of each score, shape (P, 2).
        self.ranges = np.where(self.scored[:, None], [-np.inf, np.inf], model.ranges)
        self._flat = [(j, *self.ranges[j].tolist()) for j in np.flatnonzero(~self.scored).tolist()]
        assert all(model.priors[j].kind != "normal" for j, _, _ in self._flat)
        self._pair = _pair(model)
        self._single = [
            (j, model.priors[j]) for j in np.flatnonzero(self.scored).tolist() if j not in (self._pair or ())
        ]

        bent = [j for j, prior in self._single if not _linear(prior)]
        #: Indices of the scores that are no linear function of the nuisance.
        self.bent = np.array([*bent, *(self._pair or ())], dtype=np.int64)

    def to_model(self, z: FloatArray) -> FloatArray:
        x = z.copy()
        for j, prior in self._single:
            x[:, j] = _from_score(prior, z[:, j])
        if self._pair is not None:
            degree, azimuth = self._pair
            x[:, degree] = _degree(self.model.priors[degree], np.hypot(z[:, degree], z[:, azimuth]))
            x[:, azimuth] = np.degrees(np.arctan2(z[:, azimuth], z[:, degree])) / 2
        return x

    def from_model(self, x: FloatArray) -> FloatArray:
        """Inverse of ``to_model``; a bound becomes infinite."""
        z = x.copy()
        for j, prior in self._single:
            z[:, j] = _to_score(prior, x[:, j])
        if self._pair is not None:
            degree, azimuth = self._pair
            _, beyond = _tails(self.model.priors[degree], x[:, degree])
            with np.errstate(divide="ignore"):
                radius = np.sqrt(np.maximum(-2 * np.log(beyond), 0.0))
            direction = np.radians(2 * x[:, azimuth])
            z[:, degree], z[:, azimuth] = radius * np.cos(direction), radius * np.sin(direction)
        return z

    def features(self, z: FloatArray) -> FloatArray:
        """What readings feel of the bent scores, about linearly: shape (D, F), F the number of bent scores.

        The nuisance itself; of the source's polarization degree times cosine and sine of twice the azimuth.
        """
        columns = [_from_score(prior, z[:, j]) for j, prior in self._single if not _linear(prior)]
        if self._pair is not None:
            u, v = z[:, self._pair[0]], z[:, self._pair[1]]
            radius = np.hypot(u, v)
            scale = _degree(self.model.priors[self._pair[0]], radius) / np.maximum(radius, 1e-300)
            columns += [scale * u, scale * v]
        return np.stack(columns, axis=1) if columns else np.empty((len(z), 0))

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log prior density of z, up to a constant; -inf outside of the ranges of eta and k."""
        density = np.square(z) @ np.where(self.scored, -0.5, 0.0)
        # A column at a time: numpy is slow along short axes.
        for j, low, high in self._flat:
            density[~((z[:, j] >= low) & (z[:, j] <= high))] = -np.inf
        return density


def _pair(model: Model) -> tuple[int, int] | None:
    """Indices of the source's degree and azimuth, where both are free and the azimuth is anything."""
    names = ("source_dolp", "source_azimuth_deg")
    if not set(names) <= set(model.names):
        return None
    degree, azimuth = (model.names.index(name) for name in names)
    full_circle = model.priors[azimuth].kind == "uniform"
    return (degree, azimuth) if full_circle else None


def _linear(prior: Prior) -> bool:
    margin = min(prior.mean - prior.low, prior.high - prior.mean)
    return prior.kind == "normal" and margin > _CERTAIN * prior.sigma


def _from_score(prior: Prior, z: FloatArray) -> FloatArray:
    from scipy.special import ndtr

    if _linear(prior):
        return prior.mean + prior.sigma * z
    return _quantile(prior, ndtr(z), ndtr(-z))


def _to_score(prior: Prior, x: FloatArray) -> FloatArray:
    from scipy.special import ndtri

    if _linear(prior):
        return np.asarray((x - prior.mean) / prior.sigma)
    below, beyond = _tails(prior, x)
    return np.where(below < beyond, ndtri(below), -ndtri(beyond))


def _normal_bounds(prior: Prior) -> tuple[float, float, float]:
    """Phi of the lower bound, Phi and 1 - Phi of the upper one."""
    low, high = ((bound - prior.mean) / prior.sigma / math.sqrt(2.0) for bound in (prior.low, prior.high))
    return 0.5 * math.erfc(-low), 0.5 * math.erfc(-high), 0.5 * math.erfc(high)


def _quantile(prior: Prior, below: FloatArray, beyond: FloatArray) -> FloatArray:
    """The value with probability ``below`` on its lower side and ``beyond`` = 1 - below on the other.

    From the smaller of the two, which keeps its digits.
    """
    from scipy.special import ndtri

    upper = below > 0.5
    if prior.kind == "uniform":
        width = prior.high - prior.low
        return np.where(upper, prior.high - width * beyond, prior.low + width * below)
    low_in, high_in, high_out = _normal_bounds(prior)
    mass = high_in - low_in
    share = np.where(upper, high_out + mass * beyond, low_in + mass * below)
    x = prior.mean + np.where(upper, -prior.sigma, prior.sigma) * ndtri(share)
    return np.clip(x, prior.low, prior.high)


def _degree(prior: Prior, radius: FloatArray) -> FloatArray:
    """The source's degree of polarization at a distance from the plane's origin."""
    square = radius**2 / 2
    return _quantile(prior, -np.expm1(-square), np.exp(-square))


def _tails(prior: Prior, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Probability below and beyond x."""
    from scipy.special import ndtr

    if prior.kind == "uniform":
        width = prior.high - prior.low
        return (x - prior.low) / width, (prior.high - x) / width
    low_in, high_in, high_out = _normal_bounds(prior)
    u, mass = (x - prior.mean) / prior.sigma, high_in - low_in
    return np.maximum(ndtr(u) - low_in, 0.0) / mass, np.maximum(ndtr(-u) - high_out, 0.0) / mass
