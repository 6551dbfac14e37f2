"""What a capture.yaml comes to: every frame with all it needs to be read, and which frames go together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.camera import Camera, Vector
from reflectance_fit.capture.manifest import Registration, Role
from reflectance_fit.capture.photon_transfer import PhotonTransfer
from reflectance_fit.capture.reading import Reading
from reflectance_fit.priors import Prior
from reflectance_fit.strict_yaml import Document

# A file's 1/60 s and a manifest's 0.0167 s are the same; neighbouring settings of a camera differ by 12 % or more.
_SAME_SETTING = 0.005
_SAME_AXIS_DEG = 0.01
WHITE = "white"
"""A reference without polarization, whatever lights it."""


@dataclass(frozen=True, slots=True)
class Channel:
    wavelength_nm: float
    fwhm_nm: float


@dataclass(frozen=True, slots=True)
class Noise:
    """Variance of a pixel in DN^2: signal_dn / gain_e_per_dn + (read_noise_e / gain_e_per_dn)^2."""

    gain_e_per_dn: float
    read_noise_e: float


@dataclass(frozen=True, slots=True)
class Stated:
    """Every frame states its angle; ``s_axis_deg`` is NaN where only frames state it."""

    s_axis_deg: float
    camera: Camera | None = None


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball, in raw sensor pixels; the first pixel's centre is (0, 0)."""

    center_px: tuple[float, float]
    radius_px: float
    radius_sigma_px: float = 0.0


@dataclass(frozen=True, slots=True)
class SphereSought:
    """A ball that is still to be found in the photographs."""


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball in perspective: the cone of rays that it fills, and its half-angle's standard deviation; radians."""

    camera: Camera
    axis: Vector
    half_angle: float
    half_angle_sigma: float


@dataclass(frozen=True, slots=True)
class BoardSought:
    """A flat sample on a board whose poses are still to be found, ``height_mm`` above it."""

    board: Board
    height_mm: float


@dataclass(frozen=True, slots=True)
class Pose:
    """What one photograph on a board shows of its sample.

    ``view`` is a number alike for photographs of one pose, ``normal`` that of
    the sample, towards the camera; ``board`` the board's rotation vector and
    translation (mm) into the camera's frame; ``edges`` are the rings of the
    angle of incidence that the region spans, radians.
    """

    view: int
    normal: Vector
    board: tuple[float, ...]
    edges: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class OnBoard:
    """A flat sample on a board: the camera, and the pose of every sample frame that shows it.

    ``common_sigma_deg`` is one standard deviation of what all angles are off by together,
    ``height_mm`` that of the sample's surface above the board.
    """

    camera: Camera
    poses: Mapping[Path, Pose]
    common_sigma_deg: float
    height_mm: float


Geometry = Stated | Sphere | SphereSought | Ball | BoardSought | OnBoard


class Exposure(NamedTuple):
    """Settings of a photograph; None where neither the file nor the manifest has them."""

    seconds: Fraction | None
    iso: float | None


@dataclass(frozen=True, slots=True)
class Frame:
    """One photograph, defaults of the manifest applied.

    ``file`` is the path as written, ``path`` where it is, ``line`` its line in
    the manifest.  Angles are in degrees as files have them, NaN where there is
    none: ``theta_deg`` and ``s_axis_deg`` of a sphere, ``retarder_deg`` without
    a retarder, ``analyzer_deg`` of a dark.  ``exposure`` has only what the
    manifest states.  ``light`` is the incident Stokes vector in the (s, p)
    frame.  ``region`` is (x0, y0, x1, y1), x1 and y1 exclusive; None: all.
    ``gain_group`` is None where each bin of angles has a gain of its own.
    ``channels`` are those the frame is used for.  ``material`` is that of a
    reference.  The light of a polarizer frame is in the picture's frame, NaN
    but for its power where it is not stated.
    """

    file: str
    path: Path
    line: int
    sha256: str | None
    role: Role
    theta_deg: float
    theta_deg_sigma: float
    analyzer_deg: float
    retarder_deg: float
    exposure: Exposure
    light: tuple[float, float, float, float]
    region: tuple[int, int, int, int] | None
    s_axis_deg: float
    set: str
    gain_group: str | None
    channels: tuple[str, ...]
    material: str | None = None

    def box(self, shape: tuple[int, int]) -> tuple[int, int, int, int]:
        """The region as far as a picture of (h, w) goes, one pixel at least."""
        x0, y0, x1, y1 = self.region or (0, 0, shape[1], shape[0])
        return x0, y0, max(min(x1, shape[1]), x0 + 1), max(min(y1, shape[0]), y0 + 1)

    def settings(self, found: Exposure) -> Exposure:
        """What the manifest states, else what was ``found`` in the file."""
        stated = self.exposure
        return Exposure(
            found.seconds if stated.seconds is None else stated.seconds,
            found.iso if stated.iso is None else stated.iso,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """Photographs of one sample, and what their manifest says about reading and fitting them.

    ``noise``, ``diattenuation`` and ``retardance_deg`` have a value for each
    channel; ``noise`` is None where the manifest states none, a retardance
    NaN; ``polarizer_stated`` is False where diattenuation 1 is a guess.
    ``transfer`` is noise measured on pairs of frames, by channel.
    ``nuisances`` maps name to stated sigma, None for the documented default
    (``nuisances.nuisance_sigmas`` fills it in when the data are known); it is
    None where the choice is left to the fit, empty where all are forbidden.
    ``common_sigmas`` are the sigmas of nuisances that photographs have told, by
    channel.  ``priors`` holds eta and k.  ``inputs`` are (file as written, sha256): the
    manifest and the maps of the camera, until the frames are read.
    ``document`` has the lines for messages.
    """

    path: Path
    sample_name: str
    sample_note: str | None
    exterior_ior: float
    reading: Reading
    channels: dict[str, Channel]
    noise: dict[str, Noise] | None
    transfer: dict[str, PhotonTransfer]
    focal_length_px: float | None
    diattenuation: dict[str, float]
    polarizer_stated: bool
    retardance_deg: dict[str, float]
    geometry: Geometry
    light_shape: str
    light_uniform: bool
    registration: Registration
    half_angle_deg: float
    frames: tuple[Frame, ...]
    nuisances: dict[str, float | None] | None
    common_sigmas: dict[str, dict[str, float]]
    priors: dict[str, Prior]
    inputs: tuple[tuple[str, str], ...]
    document: Document = field(repr=False)

    def role(self, role: Role) -> tuple[Frame, ...]:
        """The frames of a role, in the order of the manifest."""
        return tuple(frame for frame in self.frames if frame.role == role)


def darks_for(
    frame: Frame, frames: Iterable[Frame], found: Mapping[Path, Exposure] | None = None
) -> tuple[Frame, ...]:
    """The darks of equal exposure and ISO.

    ``found`` is what each file says of itself, by ``Frame.path``; what the
    manifest states goes before.  A setting that is unknown of both counts as
    equal, one that is unknown of either does not.
    """
    found = found or {}

    def settings(one: Frame) -> Exposure:
        return one.settings(found.get(one.path, Exposure(None, None)))

    wanted = settings(frame)
    return tuple(
        dark for dark in frames if dark.role == "dark" and all(map(same_setting, settings(dark), wanted))
    )


def flats_for(frame: Frame, frames: Iterable[Frame]) -> tuple[Frame, ...]:
    """The flats of the frame's set and channel: those that name its analyzer angle, else those that name none."""
    flats = [
        flat
        for flat in frames
        if flat.role == "flat" and flat.set == frame.set and set(flat.channels) & set(frame.channels)
    ]
    named = tuple(flat for flat in flats if same_axis(flat.analyzer_deg, frame.analyzer_deg))
    return named or tuple(flat for flat in flats if math.isnan(flat.analyzer_deg))


def same_setting(one: Fraction | float | None, other: Fraction | float | None) -> bool:
    """Whether two exposures or ISO speeds are one setting of a camera."""
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=_SAME_SETTING)


def same_axis(one: float, other: float) -> bool:
    """Whether two transmission axes agree: an axis has no direction, so 0 and 180 degrees are one."""
    return abs(math.remainder(one - other, 180.0)) <= _SAME_AXIS_DEG
