"""Pixels as the estimators take them, corrected by what all pixels together tell of the set-up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.pixel_signals import PixelSignals
from reflectance_fit.pixels.estimate import Model
from reflectance_fit.pixels.rows import PixelRows
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Together:
    """What a fit of all pixels together tells of a channel.

    ``eta`` decides between two that fit a pixel equally.  ``nuisances`` maps
    those of the fit to their best values: errors of the set-up, which every
    pixel shares and none could tell alone.  ``largest`` is the largest signal
    of each gain group, DN a second.
    """

    model: Model
    eta: float
    eta_sigma: float
    k: float
    k_sigma: float
    nuisances: Mapping[str, float]
    largest: Mapping[str, float]

    @classmethod
    def of(cls, fit: Fit) -> Together:
        """From the fit of one channel."""
        optimum, drawn, rows = fit.optimum, fit.posterior.samples, fit.observations
        groups = np.unique(rows.gain_group)
        return cls(
            model="dielectric" if optimum.model == "dielectric" else "conductor",
            eta=optimum.eta,
            eta_sigma=float(np.std(drawn["eta"])),
            k=optimum.k,
            k_sigma=float(np.std(drawn["k"])),
            nuisances={n: v for n, v in optimum.parameters.items() if n not in ("eta", "k")},
            largest={str(g): float(np.max(np.abs(rows.value[rows.gain_group == g]))) for g in groups},
        )

    def background(self, group: str) -> float:
        """What every pixel of a gain group sees beside the sample: dark offset and diffuse light, DN a second."""
        # Rings of a ball have gains of their own, its pixels one.
        largest = self.largest.get(group, max(self.largest.values()))
        return self.nuisances.get("dark_offset", 0.0) + self.nuisances.get("diffuse", 0.0) * largest

    def polarized(self, light: FloatArray) -> FloatArray:
        """Stokes vectors, shape (..., 4), of a source whose unpolarized part is slightly polarized."""
        degree = self.nuisances.get("source_dolp", 0.0)
        twice = 2 * math.radians(self.nuisances.get("source_azimuth_deg", 0.0))
        unpolarized = light[..., 0] - np.linalg.norm(light[..., 1:], axis=-1)
        added = np.multiply.outer(unpolarized * degree, [0.0, math.cos(twice), math.sin(twice), 0.0])
        return np.asarray(light + added)


def pixel_rows(signals: PixelSignals, together: Together, exterior_ior: float) -> PixelRows:
    """The rows of a channel, its shared errors taken out: what is left to each pixel is its index and its gains."""
    groups = {group: i for i, group in enumerate(dict.fromkeys(row.gain_group for row in signals.rows))}
    known = together.nuisances

    def column(name: str) -> FloatArray:
        return np.array([getattr(row, name) for row in signals.rows], dtype=np.float64)

    theta, s = (
        np.stack([np.atleast_1d(getattr(view, name)) for view in signals.views])
        for name in ("theta", "s_direction")
    )
    background = np.array([together.background(row.gain_group) for row in signals.rows], dtype=np.float32)
    return PixelRows(
        values=signals.value - background[:, None] if background.any() else signals.value,
        variance=signals.variance,
        view=np.array([row.view for row in signals.rows], dtype=np.int64),
        gain=np.array([groups[row.gain_group] for row in signals.rows], dtype=np.int64),
        light=together.polarized(column("light")),
        diattenuation=column("diattenuation") * known.get("diattenuation", 1.0),
        analyzer=column("analyzer") + math.radians(known.get("analyzer_offset_deg", 0.0)),
        retarder=column("retarder"),
        retardance=column("retardance"),
        theta=(theta + math.radians(known.get("angle_offset_deg", 0.0))).astype(np.float32),
        cos_2s=np.cos(2 * s).astype(np.float32),
        sin_2s=np.sin(2 * s).astype(np.float32),
        exterior_ior=exterior_ior,
    )
