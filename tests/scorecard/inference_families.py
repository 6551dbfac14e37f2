"""Families of scenes for calibration: captures, models and priors, and truths drawn from them.

The prior of a gain is 1/g, from which nothing can be drawn.  Truths have gains of 1/g over
a wide range, at whose lower end they are still known to a few per cent: the share
of truths near enough to an end to feel it is below a hundredth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from inference_captures import FOUR_ANALYZERS, LINEAR_45, S_AND_P, WITH_S3, Design
from scipy.stats import truncnorm

from reflectance_fit.priors import NUISANCES, Prior

QUANTITIES = ("eta", "k", "brewster_deg", "log-likelihood")


@dataclass(frozen=True, slots=True)
class Family:
    """A kind of scene: its capture, its model with priors, and the range of gains in units of sigma."""

    name: str
    design: Design
    model: str
    priors: Mapping[str, Prior]
    nuisances: Mapping[str, float] = field(default_factory=dict)
    gains: tuple[float, float] = (300.0, 30_000.0)

    @property
    def quantities(self) -> tuple[str, ...]:
        return tuple(name for name in QUANTITIES if name != "k" or self.model != "dielectric")

    def truth(self, generator: np.random.Generator) -> tuple[dict[str, float], float]:
        """eta, k and nuisances from their priors, and a gain."""
        truth = {"eta": 1.5, "k": 0.0}
        free = self.priors if self.model != "dielectric" else {"eta": self.priors["eta"]}
        for name, prior in free.items():
            truth[name] = float(prior.from_coordinate(generator.uniform(*prior.coordinate_range)))
        for name, sigma in self.nuisances.items():
            prior = NUISANCES[name].prior(sigma)
            low, high = ((bound - prior.mean) / sigma for bound in (prior.low, prior.high))
            truth[name] = prior.mean + sigma * float(truncnorm.rvs(low, high, random_state=generator))
        low, high = self.gains
        return truth, math.exp(generator.uniform(math.log(low), math.log(high)))


def _prior(eta: tuple[float, float], k: tuple[float, float] = (0.0, 20.0)) -> dict[str, Prior]:
    return {"eta": Prior("log_uniform", *eta), "k": Prior("uniform", *k)}


def _angles(low: float, high: float, step: float) -> tuple[float, ...]:
    return tuple(np.arange(low, high + step / 2, step).tolist())


OFFSETS = {"angle_offset_deg": 0.5, "analyzer_offset_deg": 1.0}
FAMILIES = (
    Family(
        "dielectric",
        Design(_angles(20, 80, 5), S_AND_P, theta_sigma_deg=0.05),
        "dielectric",
        _prior((1.3, 2.4)),
        {"angle_offset_deg": 0.5},
    ),
    Family(
        "absorbing plastic",
        Design(_angles(30, 75, 5), FOUR_ANALYZERS, LINEAR_45),
        "conductor",
        _prior((1.4, 1.7), (0.0, 0.3)),
        OFFSETS,
    ),
    Family(
        "metal",
        Design(_angles(50, 85, 5), FOUR_ANALYZERS, LINEAR_45),
        "conductor",
        _prior((0.15, 3.0), (1.5, 7.0)),
        OFFSETS,
    ),
    Family(
        "sparse angles",
        Design((40.0, 60.0, 75.0), S_AND_P),
        "conductor",
        _prior((1.2, 3.0), (0.0, 3.0)),
        gains=(100.0, 10_000.0),
    ),
    Family(
        "near Brewster",
        Design(_angles(52, 60, 1), WITH_S3, LINEAR_45),
        "conductor",
        _prior((1.4, 1.6), (0.0, 0.05)),
        {"angle_offset_deg": 0.5, "diffuse": 0.01},
    ),
)
