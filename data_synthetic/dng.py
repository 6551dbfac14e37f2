"""Write raw sensor frames as DNG files that any RAW reader opens.

One uncompressed image in one strip: IFD0 with an Exif IFD beside it, no
preview.  Source of tags and layout: Adobe Digital Negative specification 1.4
over TIFF 6.0; the packing of 12 and 14 bits is chapter 2 of the former.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.data_synthetic.tiff_entries import (
    Entry,
    ascii_,
    byte,
    directory,
    double,
    long,
    rational,
    short,
    srational,
    undefined,
)
from reflectance_fit.files import write_whole

Pattern = Literal["RGGB", "BGGR", "GRBG", "GBRG", "MONO"]
_PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG", "MONO")
_MIN_SIDE = 22  # LibRaw refuses smaller images

# A name of no camera: readers apply their own tables to those they know.
_MAKER = "reflectance_fit"
_DATE = "2000:01:01 00:00:00"  # fixed, so that equal frames are equal files
# CIE XYZ to linear sRGB (IEC 61966-2-1): the synthetic sensor has sRGB's primaries.
_COLOR_MATRIX = (3.2406, -1.5372, -0.4986, -0.9689, 1.8758, 0.0415, 0.0557, -0.2040, 1.0570)
_D65 = 21


@dataclass(frozen=True, slots=True)
class DngMetadata:
    """What a reader needs to know of a frame.

    ``pattern`` and ``black`` describe the 2 x 2 cell at the top left, row by
    row; ``black`` and ``white`` are in DN.  ``noise_profile`` is one (S, O)
    for all planes or one for each of R, G, B: the variance at x is S x + O,
    where x and the standard deviation are 0 at black and 1 at white.
    ``exposure_s`` is in seconds and needs 32 bits a side.  Raises ValueError
    for what a DNG cannot hold.
    """

    pattern: Pattern
    bits: Literal[12, 14, 16]
    black: tuple[int, int, int, int]
    white: int
    exposure_s: Fraction
    iso: int
    noise_profile: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        if self.pattern not in _PATTERNS:
            raise ValueError(f"pattern must be one of {', '.join(_PATTERNS)}")
        if self.bits not in (12, 14, 16):
            raise ValueError("bits must be 12, 14 or 16")
        if not (len(self.black) == 4 and 0 <= min(self.black) <= max(self.black) < self.white < 2**self.bits):
            raise ValueError(f"need four black levels, 0 <= black < white < 2^{self.bits}")
        if not (self.exposure_s > 0 and max(self.exposure_s.as_integer_ratio()) < 2**32):
            raise ValueError("exposure_s must be positive and have 32-bit numerator and denominator")
        if not 1 <= self.iso <= 65535:
            raise ValueError("iso must be in [1, 65535]")
        pairs = self.noise_profile
        if pairs is not None and not (
            len(pairs) in {1, self.planes} and all(0 < s < math.inf and 0 <= o < math.inf for s, o in pairs)
        ):
            raise ValueError(f"need 1 or {self.planes} noise pairs (S, O), S > 0 and O >= 0")

    @property
    def planes(self) -> int:
        """The number of colours."""
        return 1 if self.pattern == "MONO" else 3


def write_dng(path: Path, cfa: NDArray[np.uint16], metadata: DngMetadata) -> None:
    """Write one frame; the file appears complete or not at all, and equal frames give equal bytes.

    Parameters
    ----------
    path : Path
        The folder is made where it is missing; an earlier file is replaced.
    cfa : uint16, shape (h, w)
        Raw values in DN, at most 2^bits - 1, sensor row 0 first; both sides
        even and at least 22.
    metadata : DngMetadata
        What goes into the tags.

    Raises
    ------
    ValueError
        If the frame does not fit the above.
    """
    if cfa.dtype != np.uint16 or cfa.ndim != 2:
        raise ValueError("cfa must be uint16 with two dimensions")
    if min(cfa.shape) < _MIN_SIDE or cfa.shape[0] % 2 or cfa.shape[1] % 2:
        raise ValueError(f"both sides must be even and at least {_MIN_SIDE} pixels, got {cfa.shape}")
    if cfa.max() >= 2**metadata.bits:
        raise ValueError(f"values exceed {metadata.bits} bits")
    pixels = _packed(cfa, metadata.bits)
    if pixels.nbytes > 2**31:
        raise ValueError("the frame does not fit a classic TIFF")
    header = _header(cfa.shape[0], cfa.shape[1], pixels.nbytes, metadata)

    def fill(stage: Path) -> None:
        with stage.open("wb") as file:
            file.write(header)
            file.write(pixels.data)

    write_whole(path, fill)


def _packed(cfa: NDArray[np.uint16], bits: int) -> NDArray[np.uint8]:
    """Rows of ``bits`` a pixel, most significant bit first, each padded to a whole byte."""
    if bits == 16:
        return np.ascontiguousarray(cfa, dtype="<u2").view(np.uint8)
    height, width = cfa.shape
    # The shortest run of pixels that fills whole bytes: 2 in 3 bytes, or 4 in 7.
    run, size = (2, 3) if bits == 12 else (4, 7)
    runs = -(-width // run)
    padded = np.zeros((height, runs * run), dtype=np.uint16)
    padded[:, :width] = cfa
    pixels = [padded[:, i::run] for i in range(run)]
    out = np.empty((height, runs, size), dtype=np.uint8)
    for i in range(size):
        # Byte i holds bits 8 i to 8 i + 7 of the run; at most two pixels meet in it.
        first, last = 8 * i // bits, (8 * i + 7) // bits
        below = bits * (last + 1) - (8 * i + 8)  # bits of the last pixel left for the next byte
        value = pixels[last] >> below
        if first != last:
            value = value | (pixels[first] << (bits - below))
        out[:, :, i] = value & 0xFF
    return np.ascontiguousarray(out.reshape(height, -1)[:, : -(-width * bits // 8)])


def _header(height: int, width: int, pixel_bytes: int, metadata: DngMetadata) -> bytes:
    """Everything before the pixels."""

    def laid_out(pixels_at: int, exif_at: int) -> tuple[bytes, bytes]:
        entries = _image_entries(height, width, pixel_bytes, metadata)
        entries += [long(273, pixels_at), long(34665, exif_at)]
        return directory(entries, 8), directory(_exif_entries(metadata), exif_at)

    # Lengths do not depend on the offsets written, so a first pass measures them.
    exif_at = 8 + len(laid_out(0, 0)[0])
    pixels_at = exif_at + len(laid_out(0, 0)[1])
    return b"".join((b"II*\0\x08\0\0\0", *laid_out(pixels_at, exif_at)))


def _image_entries(height: int, width: int, pixel_bytes: int, metadata: DngMetadata) -> list[Entry]:
    entries = [
        long(254, 0),  # NewSubfileType: the full image
        long(256, width),
        long(257, height),
        short(258, metadata.bits),
        short(259, 1),  # Compression: none
        ascii_(271, _MAKER),
        ascii_(272, "synthetic"),
        short(274, 1),  # Orientation: row 0 on top
        short(277, 1),  # SamplesPerPixel
        long(278, height),  # RowsPerStrip
        long(279, pixel_bytes),
        short(284, 1),  # PlanarConfiguration
        ascii_(305, _MAKER),
        ascii_(306, _DATE),
        byte(50706, 1, 4, 0, 0),  # DNGVersion
        byte(50707, 1, 1, 0, 0),  # DNGBackwardVersion
        ascii_(50708, f"{_MAKER} synthetic"),
        short(50713, 2, 2),  # BlackLevelRepeatDim
        long(50714, *metadata.black),
        long(50717, metadata.white),
    ]
    if metadata.pattern == "MONO":
        entries += [short(262, 34892)]  # PhotometricInterpretation: linear raw
    else:
        entries += [
            short(262, 32803),  # PhotometricInterpretation: colour filter array
            short(33421, 2, 2),  # CFARepeatPatternDim
            byte(33422, *("RGB".index(letter) for letter in metadata.pattern)),
            byte(50710, 0, 1, 2),  # CFAPlaneColor
            short(50711, 1),  # CFALayout: rectangular
            srational(50721, *(Fraction(round(10_000 * x), 10_000) for x in _COLOR_MATRIX)),
            rational(50728, *[Fraction(1)] * 3),  # AsShotNeutral
            short(50778, _D65),
        ]
    if metadata.noise_profile is not None:
        entries += [double(51041, *(x for pair in metadata.noise_profile for x in pair))]
    return entries


def _exif_entries(metadata: DngMetadata) -> list[Entry]:
    return [
        rational(33434, metadata.exposure_s),
        short(34855, metadata.iso),
        undefined(36864, b"0230"),  # ExifVersion
        ascii_(36867, _DATE),
    ]
