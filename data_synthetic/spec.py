"""What to photograph, and with what faults: everything that decides the files of a synthetic capture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials import library

from .picture import Optics
from .rig import CHANNELS, LIGHTS, MONO_CHANNELS, STATED_DIATTENUATION, Channel, Faults, Light, Setting
from .sensor import MONO, Layout, Sensor
from .target import Board

Shape = Literal["flat", "sphere", "board"]
NoiseLevel = Literal["none", "low", "typical", "high"]
Surroundings = Literal["even", "room"]
SensorKind = Literal["bayer", "mono", "dofp", "dofp_bayer"]
FileKind = Literal["dng", "tiff"]

ANALYZER_DEG = (0.0, 45.0, 90.0, 135.0)
IMX250: Layout = ((90.0, 45.0), (135.0, 0.0))
"""Transmission axes of Sony's IMX250MZR and its like, rows from the top."""
# From below to above Brewster's angle; metals show their index near the principal angle only.
_DIELECTRIC_DEG = (30.0, 45.0, 55.0, 60.0, 70.0)
_METAL_DEG = (45.0, 60.0, 70.0, 75.0, 80.0)
_BOARD_DEG = (30.0, 45.0, 55.0, 60.0, 65.0)  # markers grow too narrow beyond
# Of a lens that shows a board from three times its width: pixels of focal length a pixel of the frame's width.
_FOCAL, _BLUR_PX, _GEOMETRY_VIEWS = 2.1, 0.7, 12
# Over a quarter-wave plate at 0 these two differ by S3.
_WITH_PLATE_DEG = (45.0, 135.0)
# Standard deviations of a rig's errors, and the random stream they come from.
_ANGLE_DEG, _ANALYZER_AXIS_DEG, _PRINT_SCALE, _RIG = 0.2, 0.3, 0.0005, 99

SENSORS: dict[NoiseLevel, Sensor] = {
    "none": Sensor(prnu=0.0, dsnu_dn=0.0, background_e_per_s=0.0),
    "low": Sensor(read_noise_e=1.5, prnu=0.003, dsnu_dn=0.3),
    "typical": Sensor(),
    "high": Sensor(gain_e_per_dn=0.5, read_noise_e=8.0, prnu=0.015, dsnu_dn=4.0, background_e_per_s=200.0),
}
"""``none`` goes with frames without shot and read noise; what stays are falloff, black and rounding."""


@dataclass(frozen=True, slots=True)
class CaptureSpec:
    """One capture.

    ``angles_deg`` are those stated, of a flat sample, or a board's tilts.
    ``index`` is (eta, k) relative to vacuum for all channels, in place of the
    material's own.  ``noise`` False leaves out shot and read noise.
    ``nuisances`` are what capture.yaml tells the fit to allow for, with their
    sigmas.  ``bracket`` are the stops by which each sample frame is repeated
    longer or shorter.  ``darks`` are frames for each exposure time in use,
    ``flats`` frames of a white, unpolarized target, taken anew at each of
    ``flat_stops`` shorter.  ``geometry_views`` show the board alone in other
    poses; without any, capture.yaml states the focal length.  ``noise_profile`` False keeps the noise out of the files.
    ``stated_diattenuation`` is what capture.yaml says of the analyzer.
    ``surroundings`` are "even" where light comes as closed forms have it, or a
    "room": a ball lies on a table, a board under a softbox.
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
    flat_stops: tuple[int, ...] = (0,)
    bracket: tuple[int, ...] = (0,)
    optics: Optics = field(default_factory=Optics)
    board: Board = field(default_factory=Board)
    geometry_views: int = 0
    noise_profile: bool = True
    stated_diattenuation: float = STATED_DIATTENUATION
    files: FileKind = "dng"
    surroundings: Surroundings = "even"

    def __post_init__(self) -> None:
        own = self.sensor.layout_deg is not None
        problems = [
            (not self.settings, "there must be an analyzer angle"),
            (
                any((setting.analyzer_deg is None) != own for setting in self.settings),
                "analyzer angles are for sensors without polarizers on their pixels",
            ),
            (self.shape != "sphere" and not self.angles_deg, "there must be an angle of incidence"),
            (
                not all(0.0 <= a <= 90.0 for a in self.angles_deg),
                "angles of incidence are from 0 to 90 degrees",
            ),
            (
                self.shape == "sphere" and self.light.linear_deg is not None,
                "a ball needs light that is alike from all sides: unpolarized or circular",
            ),
            (
                self.shape == "sphere" and bool(self.faults.source_dolp),
                "a polarized source is a fault of a flat sample",
            ),
            (
                self.shape != "flat" and bool(self.faults.angle_offset_deg),
                "offsets of stated angles are faults of a flat sample",
            ),
            (
                (self.shape == "board" or self.surroundings == "room") and self.optics.focal_px is None,
                "a board or a room is seen in perspective",
            ),
            (
                self.surroundings == "room" and self.shape == "flat",
                "a room is for balls and boards; a flat sample fills the picture",
            ),
            (self.shape == "board" and max(self.angles_deg) > 80.0, "a board is seen up to 80 degrees"),
            (
                self.sensor.kind == "bayer" and self.files == "tiff",
                "colour filters are for DNG files: a TIFF does not name them",
            ),
        ]
        wrong = [message for failed, message in problems if failed]
        if wrong:
            raise ReflectanceFitError(wrong[0])

    def channel_of(self, colour: str) -> Channel:
        """The channel of a sensor's colour; the only one without colour filters."""
        if colour == MONO:
            return self.channels[0]
        return next(channel for channel in self.channels if channel.name == colour)

    def index_of(self, channel: Channel) -> tuple[float, float]:
        """eta and k relative to vacuum.

        Raises ReflectanceFitError for unknown materials, and outside their range.
        """
        if self.index is not None:
            return self.index
        eta, k = library.get(self.material).absolute_index(channel.wavelength_nm)
        return float(eta), float(k)


def standard_spec(
    material: str,
    *,
    shape: Shape = "flat",
    angles_deg: tuple[float, ...] = (),
    analyzer_deg: tuple[float, ...] = (),
    light: Light | None = None,
    noise: NoiseLevel = "typical",
    seed: int = 0,
    sensor: SensorKind = "bayer",
    surroundings: Surroundings = "even",
) -> CaptureSpec:
    """A capture that can identify a built-in material.

    Unpolarized light shows a dielectric's eta.  It hides the phase that a
    metal's index is in: metals and semiconductors get 45 degree linear light
    if flat, circular light if a ball.  Polarized light on a flat sample is also
    seen through a quarter-wave plate, which turns S3 into what an analyzer sees.
    The rig of a flat sample is slightly off, and capture.yaml allows for it; a
    board is not printed quite to scale.  A sensor with polarizers on its pixels
    is like Sony's and needs no ``analyzer_deg``.
    """
    if shape == "sphere" and angles_deg:
        raise ReflectanceFitError("a ball shows all angles of incidence at once; leave them away")
    entry = library.entry(material)
    transparent = entry.kind == "dielectric"
    if light is None:
        light = LIGHTS["unpolarized" if transparent else "circular" if shape == "sphere" else "linear45"]
    camera = _with_filters(SENSORS[noise], sensor)
    if surroundings == "room":
        # A quarter of the pixels: each costs hundreds of paths.
        camera = replace(camera, width=camera.width // 2, height=camera.height // 2)
    own = camera.layout_deg is not None
    if own and analyzer_deg:
        raise ReflectanceFitError("the sensor has polarizers on its pixels; leave the analyzer away")
    settings = [Setting(None)] if own else [Setting(angle) for angle in analyzer_deg or ANALYZER_DEG]
    faults, nuisances, board = Faults(), dict[str, float](), Board()
    if shape != "sphere" and light != Light():
        settings += [Setting(None, 0.0)] if own else [Setting(angle, 0.0) for angle in _WITH_PLATE_DEG]
    if shape != "sphere" and noise != "none":
        # Nobody sets up angles exactly: a rig is off by what a careful hand leaves.
        generator = np.random.default_rng([seed, _RIG])
        angle, analyzer = generator.normal(0.0, (_ANGLE_DEG, _ANALYZER_AXIS_DEG))
        faults = Faults(analyzer_offset_deg=round(float(analyzer), 4))
        nuisances = {"analyzer_offset_deg": 1.0}
        if shape == "flat":
            faults = replace(faults, angle_offset_deg=round(float(angle), 4))
            nuisances = {"angle_offset_deg": 0.5} | nuisances
        else:
            across, down = (round(1.0 + float(x), 6) for x in generator.normal(0.0, _PRINT_SCALE, 2))
            board = Board(print_scale=(across, down))
    is_near = shape == "board" or surroundings == "room"
    default_deg = _BOARD_DEG if shape == "board" else _DIELECTRIC_DEG if transparent else _METAL_DEG
    return CaptureSpec(
        material=entry.name,
        shape=shape,
        angles_deg=angles_deg or default_deg,
        settings=tuple(settings),
        light=light,
        sensor=camera,
        noise=noise != "none",
        seed=seed,
        channels=MONO_CHANNELS if camera.pattern == "MONO" else CHANNELS,
        faults=faults,
        nuisances=nuisances,
        optics=Optics(round(_FOCAL * camera.width, 1), _BLUR_PX) if is_near else Optics(),
        board=board,
        geometry_views=_GEOMETRY_VIEWS if shape == "board" else 0,
        surroundings=surroundings,
    )


def _with_filters(sensor: Sensor, kind: SensorKind) -> Sensor:
    """The same silicon under other filters."""
    pattern = "MONO" if kind in ("mono", "dofp") else sensor.pattern
    return replace(sensor, pattern=pattern, layout_deg=IMX250 if kind.startswith("dofp") else None)
