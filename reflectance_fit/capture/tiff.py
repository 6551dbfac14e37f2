"""Tags of raw files by a bounded reader of our own, from the directories to the facts we use.

LibRaw decodes the pixels but truncates fractional black levels, rounds
exposure times and passes over noise profiles; this reader supplies them, and
``structure`` refuses by them what LibRaw would misread.  No pixel is read.
Source: TIFF 6.0, DNG specification 1.4 to 1.7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.directories import MAX_PIECES, Directory, Malformed, read_directories
from reflectance_fit.capture.jpeg_header import JpegHeader, read_jpeg_header
from reflectance_fit.errors import Problem, ReflectanceFitError

CFA, LINEAR_RAW = 32803, 34892
JPEG = 7  # Compression
_MAX_JPEGS = 512  # headers read: of all tiles of a photograph, not of a file made to keep us busy
_SMALL_RAW = 4  # Canon's SRawType

Area = tuple[int, int, int, int]

# The first bytes of formats that are no TIFF of the classic kind.
_CONTAINERS = (
    (0, b"\xff\xd8", "jpeg"),
    (0, b"\x89PNG", "png"),
    (0, b"II+\0", "bigtiff"),
    (0, b"MM\0+", "bigtiff"),
    (0, b"FOVb", "foveon"),
    (4, b"ftypcrx ", "raw"),  # CR3
    (0, b"FUJIFILMCCD-RAW", "raw"),
    (0, b"IIU\0", "raw"),  # RW2
    (0, b"IIRO", "raw"),  # ORF, and the next two
    (0, b"IIRS", "raw"),
    (0, b"MMOR", "raw"),
    (6, b"HEAPCCDR", "raw"),  # CRW
)


@dataclass(frozen=True, slots=True)
class RawImage:
    """The directory that holds the sensor's pixels.

    ``black`` is row-major over ``black_repeat`` (rows, columns), in DN, from
    the top left of the active area at ``active_origin`` (row, column); None
    where the file states none, or adds row and column deltas to it.
    ``cfa_repeat`` is (rows, columns).  ``noise_profile`` has one (S, O) for
    all planes or one a plane, normalised to black 0 and white 1.  ``extents``
    are (offset, bytes) of strips or tiles, ``jpegs`` the headers of the first
    512 of them where a DNG is compressed so, None for what is no JPEG.
    ``masked`` are areas that no light reaches, (top, left, bottom, right) in
    sensor pixels.  ``small_raw``: Canon's sRAW or mRAW.
    """

    width: int
    height: int
    compression: int
    photometric: int | None
    bits: tuple[int, ...]
    sample_format: int
    samples: int
    tile: tuple[int, int] | None  # (rows, columns)
    rows_per_strip: int
    extents: tuple[tuple[int, int], ...]
    jpegs: tuple[JpegHeader | None, ...]
    cfa_repeat: tuple[int, ...]
    cfa_pattern: tuple[int, ...]
    cfa_layout: int
    states_black: bool
    black: tuple[Fraction, ...] | None
    black_repeat: tuple[int, ...]
    white: int | None
    active_origin: tuple[int, int]
    masked: tuple[Area, ...]
    small_raw: bool
    noise_profile: tuple[tuple[float, float], ...] | None

    def black_cell(self, origin: tuple[int, int]) -> NDArray[np.float64] | None:
        """Black levels of the 2 x 2 cell at sensor pixel ``origin`` (row, column), shape (2, 2), or None.

        For images that ``check_structure`` has passed.
        """
        if self.black is None:
            return None
        cell = np.array([float(b) for b in self.black]).reshape(self.black_repeat)
        rows, columns = np.indices((2, 2))
        rows = rows + origin[0] - self.active_origin[0]
        columns = columns + origin[1] - self.active_origin[1]
        return np.asarray(cell[rows % cell.shape[0], columns % cell.shape[1]])


@dataclass(frozen=True, slots=True)
class RawTags:
    """What a file says of itself.

    ``container`` is ``tiff``, ``raw`` (a raw format of another build),
    ``foveon``, ``jpeg``, ``png``, ``bigtiff``, ``empty`` or ``unknown``.  ``image`` is the raw image of a TIFF-like
    file, None without one.  ``exposure_s`` is exact; a zero counts as missing.
    """

    container: str
    size: int
    dng: bool = False
    image: RawImage | None = None
    exposure_s: Fraction | None = None
    iso: int | None = None
    orientation: int | None = None


def read_tags(path: Path) -> RawTags:
    """Read the tags of a file, whatever its bytes are.

    Raises ReflectanceFitError for what is no readable file and for
    directories that contradict themselves or point outside the file.
    """
    try:
        if not path.is_file():
            missing = "there is no such file" if not path.exists() else "is no ordinary file"
            raise ReflectanceFitError(Problem(str(path), None, f"{missing}; name a raw file"))
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(16)
            if head[:4] not in (b"II*\0", b"MM\0*"):
                return RawTags(_container(head), size)
            chain, nested = read_directories(file, size)
            return _tags(file, chain, nested, size, cr2=head[8:10] == b"CR")
    except OSError as error:
        raise ReflectanceFitError(Problem(str(path), None, f"cannot be read: {error.strerror}")) from error
    except Malformed as error:
        message = f"its tags are damaged: {error}; copy the file from the camera again"
        raise ReflectanceFitError(Problem(str(path), None, message)) from error


def _container(head: bytes) -> str:
    if not head:
        return "empty"
    return next((name for at, magic, name in _CONTAINERS if head.startswith(magic, at)), "unknown")


def _tags(
    file: BinaryIO, chain: list[Directory], nested: list[Directory], size: int, *, cr2: bool
) -> RawTags:
    first = chain[0]
    # DNG 1.4, 50706: IFD0 alone carries the version.
    dng = 50706 in first
    # In a DNG previews and masks have a NewSubfileType of their own; NEF, ARW and PEF mark by photometry alone.
    found = [
        d for d in (*chain, *nested) if d.integer(262) in (CFA, LINEAR_RAW) and not (d.integer(254) or 0)
    ]
    # The raw directory of a CR2 says no photometry; it is the one with slices.
    found = found or [d for d in chain if cr2 and 50752 in d]
    # A CR2 states no size there; it has one such directory.
    largest = max(found, key=lambda d: (d.integer(256) or 0) * (d.integer(257) or 0), default=None)
    image = None if largest is None else _image(file, largest, first, stated=dng)
    exif = first.child(34665) or first
    exposures = [e for e in (*exif.fractions(33434), *first.fractions(33434)) if e]
    iso = exif.integer(34855) or first.integer(34855)
    return RawTags("tiff", size, dng, image, next(iter(exposures), None), iso or None, first.integer(274))


def _image(file: BinaryIO, d: Directory, first: Directory, *, stated: bool) -> RawImage:
    tiled = 324 in d
    offsets, sizes = (d.integers(tag, MAX_PIECES) for tag in ((324, 325) if tiled else (273, 279)))
    if len(offsets) != len(sizes):
        raise Malformed("strips or tiles have different numbers of offsets and lengths")
    width, height = d.integer(256) or 0, d.integer(257) or 0
    tile = ((d.integer(323) or 0, d.integer(322) or 0)) if tiled else None
    rows = d.integer(278)
    # Only a DNG must state its size and strips here; other formats keep them in their maker's notes.
    if stated and (min(width, height, *(tile or ())) < 1 or rows == 0):
        raise Malformed("the image or a piece of it has no width or height")
    black, repeat = d.fractions(50714), d.integers(50713) or (1, 1)
    if black and (len(repeat) != 2 or len(black) != repeat[0] * repeat[1] * (d.integer(277) or 1)):
        raise Malformed("BlackLevel does not fill BlackLevelRepeatDim")
    deltas = any(d.fractions(50715)) or any(d.fractions(50716))
    whites = d.integers(50717)
    active, masked = d.integers(50829), d.integers(50830)
    compression = d.integer(259) or 1
    headed = zip(offsets, sizes, strict=True) if stated and compression == JPEG else ()
    return RawImage(
        width,
        height,
        compression=compression,
        photometric=d.integer(262),
        bits=tuple(d.integers(258)) or (1,),
        sample_format=next((f for f in d.integers(339) if f != 1), 1),
        samples=d.integer(277) or 1,
        tile=tile,
        rows_per_strip=min(rows or height, height),
        extents=tuple(zip(offsets, sizes, strict=True)),
        jpegs=tuple(read_jpeg_header(file, *piece) for piece in islice(headed, _MAX_JPEGS)),
        cfa_repeat=tuple(d.integers(33421)),
        cfa_pattern=tuple(d.integers(33422)),
        cfa_layout=d.integer(50711) or 1,
        states_black=deltas or bool(black),
        black=None if deltas or not black else tuple(black),
        black_repeat=tuple(repeat),
        white=whites[0] if whites else None,
        active_origin=(active[0], active[1]) if len(active) == 4 else (0, 0),
        masked=tuple(zip(*(masked[i::4] for i in range(4)), strict=False)),
        small_raw=d.integer(50885) == _SMALL_RAW,
        noise_profile=_noise_profile(d.floats(51041) or first.floats(51041)),
    )


def _noise_profile(values: tuple[float, ...]) -> tuple[tuple[float, float], ...] | None:
    """(S, O) pairs, or None for what cannot be a noise model: Adobe's SDK asks the same of it."""
    pairs = tuple(zip(values[::2], values[1::2], strict=False))
    valid = len(values) in (2, 6) and all(0 < s < math.inf and 0 <= o < math.inf for s, o in pairs)
    return pairs if valid else None
