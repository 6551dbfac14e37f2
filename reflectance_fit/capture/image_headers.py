"""Headers of PNG and TIFF pictures, read within bounds before a decoder sees the file.

What OpenCV would decode to something else than the sensor's values is refused
by name: it turns pictures by their orientation, scales packed 12-bit samples,
reads the first of several pages, and passes over checksums.
Sources: PNG specification (third edition), TIFF 6.0.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import BinaryIO, NamedTuple

from reflectance_fit.capture.directories import MAX_PIECES, Malformed, read_directories
from reflectance_fit.errors import Problem, ReflectanceFitError

MAX_PIXELS = 250_000_000
_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF = (b"II*\0", b"MM\0*")
_CHUNK = 1 << 20
_GREY, _PNG_KINDS = 0, {2: "RGB", 3: "a palette", 4: "grey with alpha", 6: "RGB with alpha"}
_TIFF_COMPRESSIONS = {1, 5, 8, 32946}  # none, LZW, Deflate under its two numbers
_DNG_VERSION = 50706
_BLACK_IS_ZERO, _RGB, _UNSIGNED = 1, 2, 1

_COPY = "copy it from the camera again"
_ONE_SAMPLE = (
    "only one sample a pixel is read, since demosaicing mixes neighbours; save the sensor's own mosaic"
)


class ImageHeader(NamedTuple):
    """One sample of ``bits`` bits, 8 or 16, a pixel."""

    height: int
    width: int
    bits: int


def read_image_header(path: Path) -> ImageHeader:
    """Of a PNG or TIFF with one unsigned sample a pixel.

    Raises ReflectanceFitError, naming the file, for everything else, for
    damage that shows without decoding, and above 250 megapixels.
    """
    try:
        if not path.is_file():
            missing = "there is no such file" if not path.exists() else "is no ordinary file"
            raise Malformed(f"{missing}; name a PNG or TIFF")
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(8)
            if head == _PNG:
                header = _png(file, size)
            elif head[:4] in _TIFF:
                header = _tiff(file, size)
            else:
                raise Malformed(
                    "is no PNG or TIFF, as camera.encoding says; use the camera's 16-bit pictures"
                )
        if header.height * header.width > MAX_PIXELS:
            raise Malformed(f"has {header.width} x {header.height} pixels; {MAX_PIXELS} are the most")
    except OSError as error:
        raise ReflectanceFitError(Problem(str(path), None, f"cannot be read: {error.strerror}")) from error
    except Malformed as error:
        raise ReflectanceFitError(Problem(str(path), None, str(error))) from error
    return header


def _png(file: BinaryIO, size: int) -> ImageHeader:
    """All chunks are walked and their checksums compared: a decoder may pass over damage."""
    header = None
    kind = b""
    while kind != b"IEND":
        start = file.read(8)
        if len(start) < 8:
            raise Malformed(f"is cut off at {size} bytes; {_COPY}")
        length, kind = struct.unpack(">I4s", start)
        if header is None and (kind, length) != (b"IHDR", 13):
            raise Malformed(f"its PNG header is damaged; {_COPY}")
        if file.tell() + length + 4 > size:
            raise Malformed(f"is cut off at {size} bytes; {_COPY}")
        if kind in (b"acTL", b"tRNS"):
            raise Malformed(
                f"is {'animated' if kind == b'acTL' else 'partly transparent'}; save a plain picture"
            )
        checksum, left, data = zlib.crc32(kind), length, b""
        while left:
            data = file.read(min(left, _CHUNK))
            checksum, left = zlib.crc32(data, checksum), left - len(data)
        if file.read(4) != struct.pack(">I", checksum):
            raise Malformed(f"is damaged: a checksum does not match; {_COPY}")
        if header is None:
            header = _png_header(data)
    assert header is not None
    return header


def _png_header(data: bytes) -> ImageHeader:
    width, height, bits, kind = struct.unpack(">IIBB", data[:10])
    if kind != _GREY:
        raise Malformed(f"is {_PNG_KINDS.get(kind, 'of an unknown kind')}; {_ONE_SAMPLE}")
    if bits not in (8, 16) or not (width and height):
        raise Malformed(f"has {width} x {height} pixels of {bits} bits; 8 and 16 are read")
    return ImageHeader(height, width, bits)


def _tiff(file: BinaryIO, size: int) -> ImageHeader:
    try:
        chain, nested = read_directories(file, size)
        (d, *others) = (*chain, *nested)
        dng = _DNG_VERSION in d

        def number(tag: int, default: int = 0) -> int:
            found = d.integer(tag)
            return default if found is None else found

        bits, formats, samples = d.integers(258) or (1,), d.integers(339), number(277, 1)
        height, width, orientation = number(257), number(256), number(274, 1)
        compression, photometric = number(259, 1), number(262, _BLACK_IS_ZERO)
        offsets, lengths = (d.integers(tag, MAX_PIECES) for tag in ((324, 325) if 324 in d else (273, 279)))
    except Malformed as error:
        raise Malformed(f"its tags are damaged: {error}; {_COPY}") from error
    if dng:
        raise Malformed("is a DNG, which says itself how it is encoded; remove camera.encoding")
    if others:
        raise Malformed(f"has {1 + len(others)} pages; save each as a file of its own")
    if any(f != _UNSIGNED for f in formats):
        raise Malformed("holds floating-point or signed samples; save unsigned 16-bit ones")
    if samples != 1 or photometric == _RGB:
        raise Malformed(f"has {samples} samples a pixel; {_ONE_SAMPLE}")
    if bits not in ((8,), (16,)):
        raise Malformed(f"has {bits[0]} bits a sample; 8 and 16 are read")
    if photometric != _BLACK_IS_ZERO:
        raise Malformed(f"its photometric interpretation is {photometric}; save it with 1, black is zero")
    if orientation != 1:
        raise Malformed("is stored turned or mirrored (Orientation); save it as the sensor has it")
    if compression not in _TIFF_COMPRESSIONS:
        raise Malformed(f"its compression is {compression}; save it uncompressed, or with LZW or Deflate")
    if not offsets or len(offsets) != len(lengths) or not (width and height):
        raise Malformed(f"its tags are damaged: no picture or part of one; {_COPY}")
    if any(offset + length > size for offset, length in zip(offsets, lengths, strict=True)):
        raise Malformed(f"is cut off at {size} bytes; {_COPY}")
    if compression == 1 and sum(lengths) < height * width * bits[0] // 8:
        raise Malformed(f"its pieces are too short for the picture; {_COPY}")
    return ImageHeader(height, width, bits[0])
