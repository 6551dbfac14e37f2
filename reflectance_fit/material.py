"""A material as renderers and plots need it: eta and k at a few wavelengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """Optical constants relative to vacuum, one entry a channel, with where they come from.

    ``wavelength_nm`` is NaN where an index was given without one.
    ``exterior_ior`` is the index around the sample.
    """

    name: str
    source: str
    channels: tuple[str, ...]
    wavelength_nm: FloatArray
    eta: FloatArray
    k: FloatArray
    exterior_ior: float = 1.0

    def __post_init__(self) -> None:
        shape = (len(self.channels),)
        if not self.wavelength_nm.shape == self.eta.shape == self.k.shape == shape:
            raise ValueError("wavelength_nm, eta and k need one entry a channel")
        if not (np.all(self.eta > 0) and np.all(self.k >= 0)):
            raise ValueError("need eta > 0 and k >= 0 (the index is eta + ik)")

    @property
    def relative(self) -> tuple[FloatArray, FloatArray]:
        """eta and k relative to the exterior, as the physics functions take them."""
        return self.eta / self.exterior_ior, self.k / self.exterior_ior
