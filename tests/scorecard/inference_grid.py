"""A posterior of up to three parameters on a dense grid: readable physics, no chance, no code of the fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from inference_captures import FloatArray, reflected

from reflectance_fit.inference.models import Model
from reflectance_fit.observations import Observations

POINTS = {1: 4001, 2: 241, 3: 81}  # an axis; a smooth density needs 5 a standard deviation for 1e-8
WIDTH = 7.0  # standard deviations to either side
GAIN_NODES = np.linspace(-7.0, 7.0, 29)
CHUNK = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Marginal:
    """One parameter's posterior on a grid of its coordinate."""

    name: str
    grid: FloatArray
    density: FloatArray

    @property
    def mean(self) -> float:
        return float(np.trapezoid(self.grid * self.density, self.grid))

    @property
    def sd(self) -> float:
        return math.sqrt(np.trapezoid((self.grid - self.mean) ** 2 * self.density, self.grid))

    def edges(self, bins: int) -> FloatArray:
        """Of ``bins`` equally probable bins, the outer ones without end."""
        steps = np.diff(self.grid) * (self.density[1:] + self.density[:-1]) / 2
        below = np.concatenate([[0.0], np.cumsum(steps)])
        return np.interp(np.arange(1, bins) / bins, below / below[-1], self.grid)


def marginals(o: Observations, model: Model, draws: FloatArray) -> list[Marginal]:
    """The posterior on a grid; ``draws`` only say over which range it has to reach.

    Each mode that a gap in the draws parts gets an axis of its own.
    """
    axes = []
    for j, prior in enumerate(model.priors):
        low, high = prior.coordinate_range
        x = np.sort(draws[:, j])
        gap = int(np.argmax(np.diff(x)))
        parts = [x[: gap + 1], x[gap + 1 :]] if x[gap + 1] - x[gap] > np.ptp(x) / 4 else [x]
        pieces = []
        for part in parts:
            reach = (WIDTH - 4.0) * part.std()  # the extreme draws are 4 standard deviations out
            ends = max(low, part[0] - reach), min(high, part[-1] + reach)
            pieces.append(np.linspace(*ends, POINTS[len(model.names)]))
        axes.append(np.concatenate(pieces))
    mesh = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points = mesh.reshape(-1, len(axes))
    log_density = np.concatenate(
        [log_posterior(o, model, points[i : i + CHUNK]) for i in range(0, len(points), CHUNK)]
    )
    density = np.exp(log_density - log_density.max()).reshape(mesh.shape[:-1])
    found = []
    for j, name in enumerate(model.names):
        one = density
        for i in reversed(range(len(axes))):
            if i != j:
                one = np.trapezoid(one, axes[i], axis=i)
        found.append(Marginal(name, axes[j], one / np.trapezoid(one, axes[j])))
    return found


def log_posterior(o: Observations, model: Model, x: FloatArray) -> FloatArray:
    """Log posterior of coordinates, shape (D, P): readable physics, the gain summed over a grid of its own."""
    units = {"eta": np.full(len(x), 1.5), "k": np.zeros(len(x))} | {
        name: prior.from_coordinate(x[:, j])
        for j, (name, prior) in enumerate(zip(model.names, model.priors, strict=True))
    }
    f = reflected(o, units["eta"], units["k"], units)
    weight = o.sigma**-2
    a, b, c = ((weight * pair).sum(axis=-1) for pair in (f * f, f * o.value, o.value**2))
    log_prior = np.zeros(len(x))
    for j, prior in enumerate(model.priors):
        if prior.kind == "normal":
            log_prior -= 0.5 * ((x[:, j] - prior.mean) / prior.sigma) ** 2
    if not o.gain_group[0]:
        return np.asarray(log_prior - 0.5 * (a - 2 * b + c))
    # exp(-chi2(g) / 2) dg / g over g = best + t / sqrt(a), t as many standard deviations.
    best = b / a
    gain = best[:, None] + GAIN_NODES / np.sqrt(a)[:, None]
    log_integral = np.log(np.sum(np.exp(-0.5 * GAIN_NODES**2) / gain, axis=1)) - 0.5 * np.log(a)
    return np.asarray(log_prior - 0.5 * (c - b * best) + log_integral)
