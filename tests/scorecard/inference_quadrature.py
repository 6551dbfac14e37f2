"""emcee against a dense grid, scene by scene: the same posterior, by another likelihood and without chance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from arviz_stats.base import array_stats
from card import Figure, Table
from inference_scenes import (
    DEFAULT_PRIORS,
    LINEAR_45,
    S_AND_P,
    SEED,
    WITH_S3,
    Design,
    FloatArray,
    Reading,
    photographed,
    reflected,
    searched,
)

from reflectance_fit.inference import ladder
from reflectance_fit.inference.models import Model
from reflectance_fit.observations import Observations
from reflectance_fit.result import Posterior

LEAST_ESS = 30_000.0
RUN_ESS = 8_000.0  # of one run: looking at a longer one for convergence costs more than another run
MOST_RUNS = 12
# The most that chance may do: total variation of n draws in B equal bins is 0.4 sqrt(B / n) on average, 0.007 here.
BINS = 10
MOST_MEAN, MOST_SD, MOST_VARIATION = 4.0, 0.02, 0.02  # of the error of a mean; relative; absolute
POINTS = {1: 4001, 2: 241, 3: 81}  # an axis; a smooth density needs 5 a standard deviation for 1e-8
WIDTH = 7.0  # standard deviations to either side
GAIN_NODES = np.linspace(-7.0, 7.0, 29)
CHUNK = 4000


@dataclass(frozen=True, slots=True)
class Scene:
    """A capture of one truth whose posterior has a shape worth testing."""

    name: str
    design: Design
    model: str
    truth: Mapping[str, float]
    gain: float = 1000.0
    nuisances: Mapping[str, float] = field(default_factory=dict)

    def rows(self) -> Observations:
        return photographed(self.design.rows(), self.truth, self.gain, np.random.default_rng(SEED))


SCENES = (
    Scene(
        "dielectric and an angle offset",
        Design((30.0, 45.0, 55.0, 60.0, 70.0), S_AND_P),
        "dielectric",
        {"eta": 1.52, "k": 0.0, "angle_offset_deg": 0.3},
        nuisances={"angle_offset_deg": 0.5},
    ),
    Scene(
        "k at 0", Design((30.0, 50.0, 60.0, 70.0, 80.0), S_AND_P), "conductor", {"eta": 1.5, "k": 0.0}, 200.0
    ),
    Scene(
        "a bent ridge of a metal", Design((45.0, 60.0, 75.0), S_AND_P), "conductor", {"eta": 0.9, "k": 3.0}, 300.0
    ),
    Scene(
        "near Brewster's angle, with S3",
        Design((52.0, 54.0, 56.0, 58.0, 60.0), WITH_S3, LINEAR_45),
        "conductor",
        {"eta": 1.5, "k": 0.03},
    ),
    Scene(
        "two modes",
        Design((10.0, 20.0, 35.0), (Reading("reflectance"),), gain="", sigma=0.004),
        "dielectric",
        {"eta": 1.5, "k": 0.0},
        1.0,
    ),
    Scene(
        "eta, k and an angle offset",
        Design((40.0, 55.0, 65.0, 75.0, 82.0), S_AND_P),
        "conductor",
        {"eta": 1.8, "k": 0.6, "angle_offset_deg": -0.3},
        nuisances={"angle_offset_deg": 0.5},
    ),
)


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

    def edges(self) -> FloatArray:
        """Of BINS equally probable bins, the outer ones without end."""
        steps = np.diff(self.grid) * (self.density[1:] + self.density[:-1]) / 2
        below = np.concatenate([[0.0], np.cumsum(steps)])
        return np.interp(np.arange(1, BINS) / BINS, below / below[-1], self.grid)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Draws against one marginal: mean in standard errors, relative sd, total variation."""

    parameter: str
    ess: float
    mean: float
    sd: float
    variation: float
    converged: bool

    @property
    def good(self) -> bool:
        return (
            self.converged
            and abs(self.mean) <= MOST_MEAN
            and abs(self.sd) <= MOST_SD
            and self.variation < MOST_VARIATION
        )


def compared(scene: Scene, least_ess: float = LEAST_ESS) -> list[Comparison]:
    """Pooled emcee runs against the grid; one comparison a parameter."""
    o = scene.rows()
    model, rows, _, basins = searched(scene.model, o, DEFAULT_PRIORS, scene.nuisances)
    runs: list[Posterior] = []
    while len(runs) < MOST_RUNS and (not runs or _ess(model, runs).min() < least_ess):
        ess = min(least_ess, RUN_ESS)
        runs.append(ladder.draw(model, rows, basins, "emcee", (SEED, len(runs)), min_ess=ess))
    return against_grid(scene, o, model, runs)


def against_grid(scene: Scene, o: Observations, model: Model, runs: Sequence[Posterior]) -> list[Comparison]:
    """The judge: ``runs`` of one model, pooled, against the grid's marginals."""
    draws = _coordinates(model, runs)
    ess = _ess(model, runs)
    converged = all(run.converged for run in runs)
    found = []
    for j, marginal in enumerate(marginals(scene, o, model, draws)):
        x = draws[:, j]
        counts = np.bincount(np.searchsorted(marginal.edges(), x), minlength=BINS)
        found.append(
            Comparison(
                marginal.name,
                float(ess[j]),
                float((x.mean() - marginal.mean) / (marginal.sd / math.sqrt(ess[j]))),
                float(x.std() / marginal.sd - 1),
                float(np.abs(counts / len(x) - 1 / BINS).sum() / 2),
                converged,
            )
        )
    return found


def _coordinates(model: Model, runs: Sequence[Posterior]) -> FloatArray:
    columns = [
        prior.to_coordinate(np.concatenate([run.flat(name) for run in runs]))
        for name, prior in zip(model.names, model.priors, strict=True)
    ]
    return np.column_stack(columns)


def _ess(model: Model, runs: Sequence[Posterior]) -> FloatArray:
    """Of the draws that were kept, summed over runs; shape (P,)."""
    return np.array(
        [sum(float(array_stats.ess(r.samples[n], chain_axis=0, draw_axis=1)) for r in runs) for n in model.names]
    )


def marginals(scene: Scene, o: Observations, model: Model, draws: FloatArray) -> list[Marginal]:
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


def quadrature_figures(found: Mapping[str, Sequence[Comparison]]) -> Iterator[Figure | Table]:
    every = [(scene, one) for scene, comparisons in found.items() for one in comparisons]
    scene, least = min(every, key=lambda pair: pair[1].ess)
    yield Figure.judged(
        "emcee against a grid: effective sample size",
        f"{least.ess:,.0f} at least, {scene}, {len(found)} scenes",
        f"{LEAST_ESS:,.0f} and converged",
        least.ess >= LEAST_ESS and all(one.converged for _, one in every),
    )
    for name, target, unit, most in (
        ("mean", f"within {MOST_MEAN:g} standard errors", " standard errors", MOST_MEAN),
        ("sd", f"within {MOST_SD:.0%}", "", MOST_SD),
        ("variation", f"below {MOST_VARIATION:g}", "", MOST_VARIATION),
    ):
        scene, worst = max(every, key=lambda pair: abs(getattr(pair[1], name)))
        value = getattr(worst, name)
        text = f"{value:+.2%}" if name == "sd" else f"{value:+.2f}" if name == "mean" else f"{value:.4f}"
        label = "total variation" if name == "variation" else name
        yield Figure.judged(
            f"emcee against a grid: {label}",
            f"{text}{unit}, {worst.parameter} of {scene}",
            target,
            abs(value) <= most,
        )
    rows = tuple(
        (scene, c.parameter, f"{c.ess:,.0f}", f"{c.mean:+.2f}", f"{c.sd:+.2%}", f"{c.variation:.4f}")
        for scene, c in every
    )
    header = ("scene", "parameter", "ESS", "mean, standard errors", "sd", "total variation")
    yield Table("emcee against a grid", header, rows)
