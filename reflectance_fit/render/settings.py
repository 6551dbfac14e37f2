"""How a scene is rendered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Mode = Literal["scalar", "rgb", "spectral", "polarized", "spectral_polarized"]
Fresnel = Literal["exact", "constant", "schlick", "schlick_f82", "lazanyi", "large_index"]


@dataclass(frozen=True, slots=True)
class Settings:
    """One render's choices.

    Parameters
    ----------
    mode : Mode
        ``polarized`` carries Stokes vectors of R, G and B.
    samples : int
        Paths a pixel; with ``error``, at most.
    error : float or None
        Stop when the standard error of the picture, RMS over its pixels, is below this share of its mean.
    """

    mode: Mode
    samples: int = 64
    seed: int = 0
    sampler: Literal["independent", "sobol"] = "sobol"
    fresnel: Fresnel = "exact"
    precision: Literal["single", "double"] = "single"
    error: float | None = None
