"""Light, colours, optics' settings, and what is wrong with a rig: the parts of a capture's description."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.stokes import circular, linear, unpolarized

STATED_DIATTENUATION = 0.999
_QUARTER_WAVE_NM = 550.0


@dataclass(frozen=True, slots=True)
class Light:
    """The incident light: linear at an angle from s towards p, circular, or else unpolarized."""

    linear_deg: float | None = None
    circular: Literal["right", "left"] | None = None

    def __post_init__(self) -> None:
        if self.linear_deg is not None and self.circular is not None:
            raise ValueError("light is linear or circular, not both")

    def stokes(self) -> NDArray[np.float64]:
        """Of power 1, in the (s, p) frame, shape (4,)."""
        if self.linear_deg is not None:
            return linear(np.radians(self.linear_deg))
        return unpolarized() if self.circular is None else circular(self.circular)


LIGHTS = {"unpolarized": Light(), "linear45": Light(linear_deg=45.0), "circular": Light(circular="right")}


@dataclass(frozen=True, slots=True)
class Channel:
    """A colour of the sensor; the sample has its index at the nominal wavelength over all of the band."""

    name: str
    wavelength_nm: float
    fwhm_nm: float

    @property
    def retardance_deg(self) -> float:
        """Of the plate: a quarter wave at 550 nm, the same path difference elsewhere."""
        return round(90.0 * _QUARTER_WAVE_NM / self.wavelength_nm, 4)


CHANNELS = (Channel("R", 600.0, 90.0), Channel("G", 550.0, 90.0), Channel("B", 450.0, 80.0))
MONO_CHANNELS = (Channel("550", 550.0, 10.0),)
"""Of a sensor without colour filters, behind a band-pass filter."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Analyzer's transmission axis and, where the plate is in the beam, its fast axis; both in the picture.

    ``analyzer_deg`` is None where the pixels have polarizers of their own.
    """

    analyzer_deg: float | None
    retarder_deg: float | None = None


@dataclass(frozen=True, slots=True)
class Faults:
    """What capture.yaml does not tell, by the names and units of the fit's nuisances.

    ``angle_offset_deg`` and ``analyzer_offset_deg`` are added to the stated
    angles.  ``diffuse`` is unpolarized light, as a fraction of the largest
    signal at the same angle and in the same colour.  ``source_dolp`` is the
    part of the unpolarized light that is linear at ``source_azimuth_deg`` from
    s.  ``diattenuation`` is the analyzer's, stated as 0.999.
    """

    angle_offset_deg: float = 0.0
    analyzer_offset_deg: float = 0.0
    diffuse: float = 0.0
    source_dolp: float = 0.0
    source_azimuth_deg: float = 0.0
    diattenuation: float = STATED_DIATTENUATION

    def __post_init__(self) -> None:
        if not 0.0 <= self.diffuse < 1.0 or not 0.0 <= self.source_dolp <= 1.0:
            raise ValueError("diffuse must be in [0, 1), source_dolp in [0, 1]")

    def as_dict(self) -> dict[str, float]:
        return asdict(self)

    def source(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        """The Stokes vector that arrives instead of ``light``, shape (4,)."""
        polarized = self.source_dolp * (light[0] - np.sqrt(np.sum(light[1:] ** 2)))
        extra = linear(np.radians(self.source_azimuth_deg)) * polarized
        extra[0] = 0.0
        return np.asarray(light + extra)
