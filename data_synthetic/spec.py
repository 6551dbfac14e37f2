"""What to photograph, and with what faults: everything that decides the files of a synthetic capture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials import library
from reflectance_fit.physics.stokes import circular, linear, unpolarized

from .sensor import Sensor

Shape = Literal["flat", "sphere"]
NoiseLevel = Literal["none", "low", "typical", "high"]

STATED_DIATTENUATION = 0.999
ANALYZER_DEG = (0.0, 45.0, 90.0, 135.0)
_QUARTER_WAVE_NM = 550.0
# From below to above Brewster's angle; metals show their index near the principal angle only.
_DIELECTRIC_DEG = (30.0, 45.0, 55.0, 60.0, 70.0)
_METAL_DEG = (45.0, 60.0, 70.0, 75.0, 80.0)
# A flat sample reaches beyond the region that is measured; shares of the frame, on each side.
_SAMPLE, _REGION = 0.02, 0.25
_RADIUS = 0.42  # of the frame's height
# Over a quarter-wave plate at 0 these two differ by S3.
_WITH_PLATE_DEG = (45.0, 135.0)
# Standard deviations of a rig's errors, and the random stream they come from.
_ANGLE_DEG, _ANALYZER_AXIS_DEG, _RIG = 0.2, 0.3, 99

SENSORS: dict[NoiseLevel, Sensor] = {
    "none": Sensor(prnu=0.0, dsnu_dn=0.0, background_e_per_s=0.0),
    "low": Sensor(read_noise_e=1.5, prnu=0.003, dsnu_dn=0.3),
    "typical": Sensor(),
    "high": Sensor(gain_e_per_dn=0.5, read_noise_e=8.0, prnu=0.015, dsnu_dn=4.0, background_e_per_s=200.0),
}
"""``none`` goes with frames without shot and read noise; what stays are falloff, black and rounding."""


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


@dataclass(frozen=True, slots=True)
class Setting:
    """Analyzer's transmission axis and, where the plate is in the beam, its fast axis; both in the picture."""

    analyzer_deg: float
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


@dataclass(frozen=True, slots=True)
class CaptureSpec:
    """One capture.

    ``angles_deg`` are those stated, of a flat sample.  ``index`` is (eta, k)
    relative to vacuum for all channels, in place of the material's own.
    ``noise`` False leaves out shot and read noise.  ``nuisances`` are what
    capture.yaml tells the fit to allow for, with their sigmas.  ``darks`` are
    frames for each exposure time in use, ``flats`` frames of a white,
    unpolarized target.
    """

    material: str
    shape: Shape = "flat"
    angles_deg: tuple[float, ...] = _DIELECTRIC_DEG
    settings: tuple[Setting, ...] = tuple(Setting(angle) for angle in ANALYZER_DEG)
    light: Light = field(default_factory=Light)
    sensor: Sensor = field(default_factory=Sensor)
    noise: bool = True
    seed: int = 0
    s_axis_deg: float = 0.0
    channels: tuple[Channel, ...] = CHANNELS
    index: tuple[float, float] | None = None
    faults: Faults = field(default_factory=Faults)
    nuisances: Mapping[str, float] = field(default_factory=dict)
    darks: int = 1
    flats: int = 1

    def __post_init__(self) -> None:
        problems = [
            (not self.settings, "there must be an analyzer angle"),
            (self.shape == "flat" and not self.angles_deg, "there must be an angle of incidence"),
            (
                not all(0.0 <= a <= 90.0 for a in self.angles_deg),
                "angles of incidence are from 0 to 90 degrees",
            ),
            (
                self.shape == "sphere" and self.light.linear_deg is not None,
                "a ball needs light that is alike from all sides: unpolarized or circular",
            ),
            (
                self.shape == "sphere" and (self.faults.angle_offset_deg or self.faults.source_dolp),
                "offsets of stated angles and a polarized source are faults of a flat sample",
            ),
        ]
        wrong = [message for failed, message in problems if failed]
        if wrong:
            raise ReflectanceFitError(wrong[0])

    @property
    def outline(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 in pixels of a flat sample, the last two exclusive."""
        return self._frame_less(_SAMPLE)

    @property
    def ball(self) -> tuple[tuple[float, float], float]:
        """Centre and radius in pixels; not in the middle, and not on a pixel."""
        sensor = self.sensor
        return (sensor.width / 2 + 7.3, sensor.height / 2 - 4.6), round(_RADIUS * sensor.height, 1)

    @property
    def region(self) -> tuple[int, int, int, int]:
        """The pixels to measure, as ``outline``: inside a flat sample, or around a ball."""
        if self.shape == "flat":
            return self._frame_less(_REGION)
        (x, y), radius = self.ball
        return int(x - radius), int(y - radius), int(x + radius) + 2, int(y + radius) + 2

    def index_of(self, channel: Channel) -> tuple[float, float]:
        """eta and k relative to vacuum.

        Raises ReflectanceFitError for unknown materials, and outside their range.
        """
        if self.index is not None:
            return self.index
        eta, k = library.get(self.material).absolute_index(channel.wavelength_nm)
        return float(eta), float(k)

    def _frame_less(self, share: float) -> tuple[int, int, int, int]:
        """Whole colour cells only."""
        width, height = self.sensor.width, self.sensor.height
        dx, dy = 2 * round(share * width / 2), 2 * round(share * height / 2)
        return dx, dy, width - dx, height - dy


def standard_spec(
    material: str,
    *,
    shape: Shape = "flat",
    angles_deg: tuple[float, ...] = (),
    analyzer_deg: tuple[float, ...] = ANALYZER_DEG,
    light: Light | None = None,
    noise: NoiseLevel = "typical",
    seed: int = 0,
) -> CaptureSpec:
    """A capture that can identify a built-in material.

    Unpolarized light shows a dielectric's eta.  It hides the phase that a
    metal's index is in: metals and semiconductors get 45 degree linear light
    if flat, circular light if a ball.  Polarized light on a flat sample is also
    seen through a quarter-wave plate, which turns S3 into what an analyzer sees.
    The rig of a flat sample is slightly off, and capture.yaml allows for it.
    """
    if shape == "sphere" and angles_deg:
        raise ReflectanceFitError("a ball shows all angles of incidence at once; leave them away")
    entry = library.entry(material)
    transparent = entry.kind == "dielectric"
    if light is None:
        light = LIGHTS["unpolarized" if transparent else "circular" if shape == "sphere" else "linear45"]
    settings = [Setting(angle) for angle in analyzer_deg]
    faults, nuisances = Faults(), dict[str, float]()
    if shape == "flat" and light != Light():
        settings += [Setting(angle, 0.0) for angle in _WITH_PLATE_DEG]
    if shape == "flat" and noise != "none":
        # Nobody sets up angles exactly: a rig is off by what a careful hand leaves.
        angle, analyzer = np.random.default_rng([seed, _RIG]).normal(0.0, (_ANGLE_DEG, _ANALYZER_AXIS_DEG))
        faults = Faults(
            angle_offset_deg=round(float(angle), 4), analyzer_offset_deg=round(float(analyzer), 4)
        )
        nuisances = {"angle_offset_deg": 0.5, "analyzer_offset_deg": 1.0}
    return CaptureSpec(
        material=entry.name,
        shape=shape,
        angles_deg=angles_deg or (_DIELECTRIC_DEG if transparent else _METAL_DEG),
        settings=tuple(settings),
        light=light,
        sensor=SENSORS[noise],
        noise=noise != "none",
        seed=seed,
        faults=faults,
        nuisances=nuisances,
    )
