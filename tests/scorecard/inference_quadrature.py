"""emcee against a dense grid, scene by scene: the same posterior, by another likelihood and without chance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from arviz_stats.base import array_stats
from card import Figure, Table
from inference_captures import (
    DEFAULT_PRIORS,
    LINEAR_45,
    S_AND_P,
    SEED,
    WITH_S3,
    Design,
    FloatArray,
    Reading,
    photographed,
    searched,
)
from inference_grid import marginals

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
        "a bent ridge of a metal",
        Design((45.0, 60.0, 75.0), S_AND_P),
        "conductor",
        {"eta": 0.9, "k": 3.0},
        300.0,
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


def compared(number: int, least_ess: float = LEAST_ESS) -> list[Comparison]:
    """Pooled emcee runs of a scene against the grid; one comparison a parameter."""
    scene = SCENES[number]
    o = scene.rows()
    model, rows, _, basins = searched(scene.model, o, DEFAULT_PRIORS, scene.nuisances)
    runs: list[Posterior] = []
    while len(runs) < MOST_RUNS and (not runs or _ess(model, runs).min() < least_ess):
        ess = min(least_ess, RUN_ESS)
        runs.append(ladder.draw(model, rows, basins, "emcee", (SEED, len(runs)), min_ess=ess))
    return against_grid(o, model, runs)


def against_grid(o: Observations, model: Model, runs: Sequence[Posterior]) -> list[Comparison]:
    """The judge: ``runs`` of one model, pooled, against the grid's marginals."""
    draws = _coordinates(model, runs)
    ess = _ess(model, runs)
    converged = all(run.converged for run in runs)
    found = []
    for j, marginal in enumerate(marginals(o, model, draws)):
        x = draws[:, j]
        counts = np.bincount(np.searchsorted(marginal.edges(BINS), x), minlength=BINS)
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
        [
            sum(float(array_stats.ess(r.samples[n], chain_axis=0, draw_axis=1)) for r in runs)
            for n in model.names
        ]
    )


def quadrature_figures(found: Sequence[Sequence[Comparison]]) -> Iterator[Figure | Table]:
    """``found`` in the order of SCENES."""
    every = [(SCENES[i].name, one) for i, comparisons in enumerate(found) for one in comparisons]
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
