"""Raw sensor values by LibRaw, as recorded: no scaling, no white balance, no demosaicing.

The only module that imports rawpy.  Photographs of unknown origin are decoded
through ``workers``, never in the process of the command.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rawpy
from numpy.typing import NDArray

from reflectance_fit.capture.optical_black import measured_black
from reflectance_fit.capture.pixel_maps import PixelMaps
from reflectance_fit.capture.structure import check_structure
from reflectance_fit.capture.tiff import RawTags, read_tags
from reflectance_fit.errors import Problem, ReflectanceFitError

# The first without the memory errors published in 2026 (CVE-2026-21413 and others).
_OLDEST_LIBRAW = (0, 22, 2)
# LibRaw's white level is nominal; real sensors clip a little below it.
CLIP_SHARE = 0.98


class Plane(NamedTuple):
    """What a pixel sees: its channel ("mono" without colour filters), and the axis of the polarizer on it.

    ``axis_deg`` is counter-clockwise from the picture's horizontal, None without one.
    """

    channel: str
    axis_deg: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RawFrame:
    """One frame of a sensor: the visible area, row 0 on top as the sensor has it (no EXIF rotation).

    Attributes
    ----------
    cfa : uint16, shape (h, w)
        Raw values in DN, black not subtracted.
    channels : str, shape (n, n)
        Channel of each pixel of the top left cell: "R", "G", "B" (both greens
        "G"), or "mono" throughout.  n is 2, or 4 where groups of 2 x 2 pixels
        with a polarizer each share a colour.
    axes_deg : float, shape (n, n)
        Transmission axis of the polarizer on each pixel of the cell; NaN: none.
    black, white : float, shape (n, n)
        Black level and nominal saturation of the same cell, DN; a sensor may
        clip below the latter.
    exposure_s : Fraction or None
        Seconds, where the file says so.
    iso : float or None
    noise_profile : dict of plane to (S, O), or None
        DNG's model: variance S x + O, normalised to black 0 and white 1.
    measured_white : float, shape (n, n), or None
        Where the pixels of this frame show that the sensor clips, at most ``white``.
    maps : PixelMaps or None
        Offset and gain of every pixel, where the camera has been measured.
    unused_bits : int
        How many low bits the file left empty; ``cfa`` is without them.
    """

    cfa: NDArray[np.uint16]
    channels: NDArray[np.str_]
    axes_deg: NDArray[np.float64]
    black: NDArray[np.float64]
    white: NDArray[np.float64]
    exposure_s: Fraction | None
    iso: float | None
    noise_profile: dict[str, tuple[float, float]] | None
    measured_white: NDArray[np.float64] | None = None
    maps: PixelMaps | None = None
    unused_bits: int = 0

    @property
    def clip(self) -> NDArray[np.float64]:
        """DN from which a pixel counts as clipped, of each pixel of the cell, shape (n, n)."""
        white = self.white if self.measured_white is None else self.measured_white
        return self.black + CLIP_SHARE * (white - self.black)

    def plane(self, row: int, column: int) -> Plane:
        """What the pixels at this position of the cell see."""
        axis = float(self.axes_deg[row, column])
        return Plane(str(self.channels[row, column]), None if math.isnan(axis) else axis)

    def planes(self) -> tuple[Plane, ...]:
        """What there is to see, in the order of the cell."""
        n = len(self.channels)
        return tuple(dict.fromkeys(self.plane(y, x) for y in range(n) for x in range(n)))

    def sites(self, plane: Plane) -> list[tuple[int, int]]:
        """The positions (row, column) of the cell that see ``plane``."""
        n = len(self.channels)
        return [(y, x) for y in range(n) for x in range(n) if self.plane(y, x) == plane]


def decode(path: Path) -> RawFrame:
    """Read one frame in this process, as it stands in the file.

    Raises ReflectanceFitError, naming the file, for what is no raw file of a
    Bayer or monochrome sensor, cannot be decoded, or holds one value only.
    """
    if rawpy.libraw_version < _OLDEST_LIBRAW:
        version = ".".join(map(str, rawpy.libraw_version))
        raise ReflectanceFitError(f"LibRaw {version} has known security holes; install rawpy 0.28 or later")
    tags = read_tags(path)
    check_structure(tags, str(path))
    with _errors_of_libraw(path), rawpy.RawPy() as raw:
        raw.open_file(str(path))
        raw.unpack()
        if raw.raw_type != rawpy.RawType.Flat:
            raise _refused(
                path,
                "holds several colours a pixel: linear RGB, sRAW, Foveon or a scan; photograph in full Bayer RAW",
            )
        frame = _frame(raw, tags, path)
    # A hopelessly overexposed frame is alike everywhere too, and counts as saturated.
    if frame.cfa.min() == frame.cfa.max() < frame.clip.max():
        reason = f"every pixel is {frame.cfa.max()}: there is no picture"
        raise _refused(path, f"{reason}; copy it from the camera again, or expose it less")
    return frame


def _frame(raw: rawpy.RawPy, tags: RawTags, path: Path) -> RawFrame:
    """The frame of an unpacked file."""
    sizes = raw.sizes
    origin = (sizes.top_margin, sizes.left_margin)
    planes, names = _cell(raw, origin, path)
    # LibRaw cuts off fractions of a DNG's levels, and replaces them where the file lists masked pixels.
    image = tags.image if tags.dng else None
    black = image.black_cell(origin) if image else None
    white = image.white if image else None
    if image and not image.states_black:
        black = measured_black(raw.raw_image, image.masked, origin, float(white or raw.white_level))
    exposure_s, iso = (tags.exposure_s, tags.iso) if tags.container == "tiff" else _shot(raw)
    return RawFrame(
        # The view is LibRaw's memory, freed on closing.
        cfa=raw.raw_image_visible.copy(),
        channels=names,
        axes_deg=np.full((2, 2), np.nan),
        black=np.array(raw.black_level_per_channel, dtype=float)[planes] if black is None else black,
        white=np.full((2, 2), float(raw.white_level if white is None else white)),
        exposure_s=exposure_s,
        iso=iso,
        noise_profile=_noise(image.noise_profile if image else None, names),
    )


def _cell(raw: rawpy.RawPy, origin: tuple[int, int], path: Path) -> tuple[NDArray[np.intp], NDArray[np.str_]]:
    """LibRaw's planes and their names of the 2 x 2 cell at ``origin``, the top left of the visible area."""
    if raw.num_colors == 1:
        # LibRaw's pattern of a sensor without filters is [[6]], which is no plane.
        return np.zeros((2, 2), dtype=np.intp), np.full((2, 2), "mono")
    pattern = raw.raw_pattern
    if pattern is None or pattern.shape != (2, 2):
        shape = () if pattern is None else pattern.shape
        size, sensor = " x ".join(map(str, shape)) or "unknown", "X-Trans" if shape == (6, 6) else ""
        raise _refused(
            path,
            f"is of a {f'{sensor} ' if sensor else ''}sensor whose colour filters repeat over {size} pixels; "
            "only Bayer and monochrome are read",
        )
    planes = np.roll(pattern, (-origin[0], -origin[1]), axis=(0, 1)).astype(np.intp)
    names = np.array(list(raw.color_desc.decode("ascii")))[planes]
    if sorted(names.flat) != ["B", "G", "G", "R"]:
        raise _refused(
            path, f"its colour filters are {''.join(names.flat)}; only Bayer and monochrome are read"
        )
    return planes, names


def _shot(raw: rawpy.RawPy) -> tuple[Fraction | None, float | None]:
    """Exposure time and ISO where we read no tags; LibRaw has them as 32-bit floats, 0 for unknown."""
    try:
        other = raw.other
    except ValueError:  # a date that is none
        return None, None
    return _rational(other.shutter_speed), other.iso_speed or None


def _rational(single: float) -> Fraction | None:
    """The simplest fraction that a 32-bit float stands for: 1/60 for 0.016666668; None for 0."""
    if not 0 < single < math.inf:
        return None
    exact, half_step = Fraction(single), Fraction(1, 2**24)
    low, high = exact * (1 - half_step), exact * (1 + half_step)
    whole: list[int] = []
    # The continued fractions of both ends agree up to the simplest number between them.
    while (floor := low.numerator // low.denominator) + 1 > high and floor != low:
        whole.append(floor)
        low, high = 1 / (high - floor), 1 / (low - floor)
    found = Fraction(floor if floor == low else floor + 1)
    for term in reversed(whole):
        found = term + 1 / found
    return found


def _noise(
    pairs: tuple[tuple[float, float], ...] | None, names: NDArray[np.str_]
) -> dict[str, tuple[float, float]] | None:
    """The pairs by plane; None where their number is not that of the planes."""
    planes = ["mono"] if names[0, 0] == "mono" else ["R", "G", "B"]
    if pairs is None or len(pairs) not in (1, len(planes)):
        return None
    return dict(zip(planes, pairs * len(planes) if len(pairs) == 1 else pairs, strict=True))


@contextmanager
def _errors_of_libraw(path: Path) -> Iterator[None]:
    """Whatever rawpy raises over a file's bytes, as an error that names the file.

    Beside its own exceptions it has raised NotImplementedError, ValueError,
    UnicodeError and MemoryError.
    """
    try:
        yield
    except ReflectanceFitError:
        raise
    except Exception as error:
        detail = error.args[0] if error.args else type(error).__name__
        text = detail.decode("ascii", "replace") if isinstance(detail, bytes) else str(detail)
        reason = f"LibRaw cannot decode it ({text}); it may be damaged or of a camera not known"
        raise _refused(path, reason) from error


def _refused(path: Path, reason: str) -> ReflectanceFitError:
    return ReflectanceFitError(Problem(str(path), None, reason))
