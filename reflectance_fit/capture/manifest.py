"""``capture.yaml``: what its keys are.

The models state each key by itself and print as a JSON Schema that editors
complete from.  What keys say about one another is in checks.py, where each
contradiction still has its line.  docs/formats/capture.md is the same in prose.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    model_validator,
)

from reflectance_fit.manifests import (
    Block,
    Light,
    Number,
    Polarization,
    Positive,
    Subject,
    Text,
    Wavelength,
    check_schema,
)
from reflectance_fit.strict_yaml import Document, load, validate

T = TypeVar("T")


def _hexadecimal(text: str) -> str:
    if len(text) != 64 or set(text.lower()) - set("0123456789abcdef"):
        raise ValueError("must be 64 hexadecimal digits, as sha256sum prints")
    return text.lower()


def _seconds(value: Any) -> Fraction:
    """An exact number of seconds: 0.01 is 1/100, and "1/60" may be written."""
    try:
        # Of `true`, `.inf` and whatever else YAML knows, the text is no fraction.
        seconds = Fraction(str(value).replace(" ", ""))
    except (ValueError, ZeroDivisionError):
        raise ValueError("must be a number of seconds, such as 0.01 or 1/60") from None
    if not 0 < seconds < 10**6:
        raise ValueError("must be above 0 and below a million seconds")
    return seconds


def _label(value: Any) -> Any:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _spelling(value: Any) -> str:
    return "block" if isinstance(value, dict) else "plain"


# One number for all channels, or a number for each.
PerChannel = Annotated[
    Annotated[T, Tag("plain")] | Annotated[dict[Text, T], Tag("block")], Discriminator(_spelling)
]
NotNegative = Annotated[Number, Field(ge=0)]
Seconds = Annotated[Fraction, PlainValidator(_seconds, json_schema_input_type=float | str)]
Pixel = Annotated[int, Field(strict=True, ge=0)]
# `set: 1` is meant as a name too.
Label = Annotated[Text, BeforeValidator(_label, json_schema_input_type=str | int)]
Sha256 = Annotated[str, AfterValidator(_hexadecimal)]
Region = Annotated[tuple[Pixel, ...], Field(min_length=4, max_length=4)]
Registration = Literal["none", "translation", "euclidean"]
Role = Literal["sample", "dark", "flat", "reference", "polarizer", "geometry"]


class Band(Block):
    wavelength_nm: Wavelength = Field(description="Centre of the channel, vacuum nm")
    fwhm_nm: NotNegative = Field(default=0.0, description="Full width at half maximum, nm; 0: a line")


class Noise(Block):
    gain_e_per_dn: PerChannel[Positive] = Field(description="Electrons a raw count, at the ISO of the frames")
    read_noise_e: PerChannel[NotNegative] = Field(description="Read noise of a pixel, electrons")


class Camera(Block):
    sensor: Literal["bayer", "mono", "dofp", "dofp_bayer"] = Field(
        description="dofp: with polarizers on the pixels"
    )
    dofp_layout_deg: (
        Annotated[
            tuple[Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)], ...],
            Field(min_length=2, max_length=2),
        ]
        | None
    ) = Field(default=None, description="dofp: transmission axes of the 2 x 2 pixels, rows from the top")
    channels: Annotated[dict[Text, Band], Field(min_length=1)] = Field(
        description="Name to wavelength; bayer: some of R, G, B; mono: one of any name"
    )
    noise: Noise | None = Field(default=None, description="Default: the DNG's NoiseProfile, else from flats")
    focal_length_px: Positive | None = Field(
        default=None, description="Focal length in pixels: models the spread of theta over the region"
    )
    offset_map: Text | None = Field(
        default=None, description="TIFF file: DN of each pixel without light, in place of the black level"
    )
    gain_map: Text | None = Field(
        default=None,
        description="TIFF file: factor of each pixel's counts; only ratios between pixels matter",
    )
    encoding: Literal["linear", "srgb"] | None = Field(
        default=None, description="The frames are PNG or TIFF, not RAW: how their values follow light"
    )
    pattern: Literal["RGGB", "BGGR", "GRBG", "GBRG"] | None = Field(
        default=None, description="Colours of the top left 2 x 2 pixels, where the files do not tell"
    )
    black_dn: PerChannel[NotNegative] | None = Field(
        default=None, description="Black level, raw counts; default: as the file says"
    )
    white_dn: PerChannel[Positive] | None = Field(
        default=None, description="Raw counts at which the sensor clips; default: as the file says"
    )


class Polarizer(Block):
    diattenuation: PerChannel[Annotated[Number, Field(gt=0, le=1)]] = Field(
        description="(T_max - T_min) / (T_max + T_min); 1 is ideal"
    )


class Retarder(Block):
    retardance_deg: PerChannel[Annotated[Number, Field(gt=0, lt=360)]] = Field(
        description="Degrees; 90: a quarter-wave plate"
    )


class Illumination(Polarization):
    """The incident beam in the (s, p) frame of docs/conventions.md, and how large the lamp is."""

    shape: Literal["small", "surround"] = Field(
        default="small", description="small: a lamp; surround: light from all sides"
    )
    half_angle_deg: Annotated[Number, Field(ge=0, le=20)] = Field(
        default=0.0,
        description="Half-angle of the cone of light that one point of the picture collects",
    )
    uniform: bool = Field(
        default=False,
        strict=True,
        description="surround: as bright from every side, so that gains are shared",
    )


class Charuco(Block):
    squares: Annotated[
        tuple[Annotated[int, Field(strict=True, ge=2)], ...], Field(min_length=2, max_length=2)
    ] = Field(description="Squares across and down")
    square_mm: Positive = Field(description="Side of a square")
    marker_mm: Positive = Field(description="Side of a marker, less than that of a square")
    dictionary: Text = Field(description="OpenCV's name of the markers, as DICT_5X5_100")
    sample_offset_mm: Number = Field(
        default=0.0, description="Height of the sample's surface above the board"
    )

    @model_validator(mode="after")
    def _nested(self) -> Charuco:
        if self.marker_mm >= self.square_mm:
            raise ValueError("marker_mm must be less than square_mm")
        return self


class Ball(Block):
    center_px: Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)] = Field(
        description="[x, y] in raw sensor pixels; the first pixel's centre is [0, 0]"
    )
    radius_px: Positive = Field(description="Radius in raw sensor pixels")


class Geometry(Block):
    kind: Literal["stated", "charuco", "sphere"] = Field(
        description="stated: theta_deg of each frame; charuco: from a board; sphere: the sample is a ball"
    )
    s_axis_deg: Number | None = Field(
        default=None, description="stated: from the picture's horizontal to s, counter-clockwise"
    )
    charuco: Charuco | None = Field(default=None, description="charuco: the board")
    sphere: (
        Annotated[
            Annotated[Ball, Tag("block")] | Annotated[Literal["detect"], Tag("plain")],
            Discriminator(_spelling),
        ]
        | None
    ) = Field(default=None, description="sphere: where the ball is, or 'detect'")


class FrameEntry(Block):
    file: Text = Field(description="Path inside the folder of this file")
    sha256: Sha256 | None = Field(default=None, description="Of the file's bytes; checked where given")
    role: Role = Field(default="sample", description="What the photograph is for")
    theta_deg: Annotated[Number, Field(ge=0, lt=90)] | None = Field(
        default=None, description="Angle of incidence at the centre of the region, from the normal"
    )
    theta_deg_sigma: NotNegative | None = Field(
        default=None, description="One standard deviation of theta_deg; default: exact"
    )
    analyzer_deg: Number | None = Field(
        default=None, description="Transmission axis, counter-clockwise from the picture's horizontal"
    )
    retarder_deg: Number | None = Field(
        default=None, description="Fast axis of the retarder, counter-clockwise from the picture's horizontal"
    )
    exposure_s: Seconds | None = Field(
        default=None, description="Seconds, or a fraction as 1/60; default: as the file says"
    )
    iso: Positive | None = Field(default=None, description="Default: as the file says")
    light: Light | None = Field(default=None, description="Incident beam of this frame")
    region: Region | None = Field(default=None, description="[x0, y0, x1, y1] of this frame")
    s_axis_deg: Number | None = Field(default=None, description="Of this frame")
    gain_group: Text | None = Field(default=None, description="Frames of one group share one unknown gain")
    material: Text | None = Field(
        default=None, description="reference: what is seen, a built-in material or 'white'"
    )
    set: Label = Field(default="0", description="Frames taken in one go")
    channel: Label | None = Field(default=None, description="Use the frame for this channel alone")


class Manifest(Subject):
    """Photographs of one sample through a polarizer."""

    model_config = ConfigDict(title="reflectance_fit capture")

    schema_: Literal["reflectance_fit/capture/1"] = Field(alias="schema", description="Format and version")
    camera: Camera = Field(description="The sensor and its channels")
    polarizer: Polarizer | None = Field(default=None, description="Default: ideal")
    retarder: Retarder | None = Field(default=None, description="A retarder before the polarizer")
    light: Illumination = Field(
        default=Illumination(), description="Incident beam; default: a small unpolarized lamp"
    )
    geometry: Geometry = Field(description="Where the angles of incidence come from")
    region: Region | None = Field(
        default=None, description="[x0, y0, x1, y1] in raw sensor pixels, x1 and y1 exclusive; default: all"
    )
    registration: Registration | None = Field(
        default=None,
        description="How frames of one view may be shifted against each other; default: by the geometry",
    )
    frames: Annotated[tuple[FrameEntry, ...], Field(min_length=1)] = Field(
        description="One entry a photograph"
    )


def read_manifest(path: Path) -> tuple[Manifest, Document]:
    """The manifest at ``path`` and its lines; ReflectanceFitError with every key that is wrong by itself."""
    document = load(path)
    check_schema(document, "capture")
    return validate(document, Manifest), document
