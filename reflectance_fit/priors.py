"""Priors, and what a fit may vary.  Bounds are priors: there are no others.

Everything is in report units (eta and k relative to vacuum, angles in
degrees).  Samplers and optimisers work in coordinates where every prior is
uniform or normal: log(eta) and log of an estimated sigma, the rest as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

ETA_PRIOR = (0.05, 10.0)
K_PRIOR = (0.0, 20.0)


@dataclass(frozen=True, slots=True)
class Prior:
    """uniform or log_uniform on [low, high]; normal(mean, sigma) clipped to [low, high]; or fixed at low = high."""

    kind: Literal["uniform", "log_uniform", "normal", "fixed"]
    low: float = -math.inf
    high: float = math.inf
    mean: float = 0.0
    sigma: float = math.inf

    def to_coordinate(self, value: ArrayLike) -> FloatArray:
        """Value in report units -> the coordinate in which this prior has no Jacobian."""
        x = np.asarray(value, dtype=float)
        return np.log(x) if self.kind == "log_uniform" else x

    def from_coordinate(self, x: ArrayLike) -> FloatArray:
        """Inverse of ``to_coordinate``."""
        x = np.asarray(x, dtype=float)
        return np.exp(x) if self.kind == "log_uniform" else x

    def log_density(self, x: FloatArray) -> FloatArray:
        """Log prior density at a coordinate, up to a constant; -inf outside the range."""
        low, high = self.coordinate_range
        inside = (x >= low) & (x <= high)
        shape = -0.5 * ((x - self.mean) / self.sigma) ** 2 if self.kind == "normal" else np.zeros_like(x)
        return np.where(inside, shape, -np.inf)

    @property
    def coordinate_range(self) -> tuple[float, float]:
        if self.kind != "log_uniform":
            return self.low, self.high
        return (math.log(self.low) if self.low > 0 else -math.inf), math.log(self.high)

    @property
    def centre(self) -> float:
        """The coordinate a search starts from: the mean, or the middle of the range."""
        low, high = self.coordinate_range
        return self.mean if self.kind == "normal" else 0.5 * (low + high)

    def density(self, value: FloatArray) -> FloatArray:
        """Normalised density in report units, for plots; 0 outside the range."""
        inside = (value >= self.low) & (value <= self.high)
        if self.kind == "uniform":
            shape = np.full_like(value, 1 / (self.high - self.low))
        elif self.kind == "log_uniform":
            shape = 1 / (np.where(inside, value, 1.0) * math.log(self.high / self.low))
        else:
            from scipy.special import ndtr

            mass = ndtr((self.high - self.mean) / self.sigma) - ndtr((self.low - self.mean) / self.sigma)
            z = (value - self.mean) / self.sigma
            shape = np.exp(-0.5 * z**2) / (self.sigma * math.sqrt(2 * math.pi) * mass)
        return np.where(inside, shape, 0.0)

    def as_yaml(self) -> dict[str, object]:
        """The form the report and the ``priors:`` block of input files use."""
        if self.kind == "normal":
            return {"normal": {"mean": self.mean, "sigma": self.sigma}}
        if self.kind == "fixed":
            return {"fixed": self.low}
        return {self.kind: [self.low, self.high]}


@dataclass(frozen=True, slots=True)
class Nuisance:
    """A disturbance that a fit may include; ``index`` is its place in the kernel's vector."""

    name: str
    index: int
    default_sigma: float | None  # None: depends on the data, or flat
    neutral: float  # the value that changes nothing
    low: float
    high: float

    def prior(self, sigma: float) -> Prior:
        if math.isinf(sigma):
            return Prior("uniform", self.low, self.high)
        return Prior("normal", self.low, self.high, self.neutral, sigma)


# Contract, "Priors and nuisances".  dark_offset is in the unit of the signal
# (default: 1 % of the largest); diffuse is a fraction of the largest signal;
# diattenuation multiplies the stated one.
NUISANCES: Mapping[str, Nuisance] = {
    n.name: n
    for n in (
        Nuisance("angle_offset_deg", 0, 0.5, 0.0, -45.0, 45.0),
        Nuisance("dark_offset", 1, None, 0.0, -math.inf, math.inf),
        Nuisance("diffuse", 2, 0.01, 0.0, 0.0, 1.0),
        Nuisance("source_dolp", 3, 0.02, 0.0, 0.0, 1.0),
        Nuisance("source_azimuth_deg", 4, math.inf, 0.0, -90.0, 90.0),
        Nuisance("analyzer_offset_deg", 5, 1.0, 0.0, -90.0, 90.0),
        Nuisance("diattenuation", 6, 0.005, 1.0, 0.0, 1.0),
    )
}
