"""The header of a JPEG stream inside a raw file: lossless or not, and how many samples it holds."""

from __future__ import annotations

from typing import BinaryIO, NamedTuple

_LOSSLESS = 0xC3
# SOF0 to SOF15 but DHT, JPG and DAC, which share the range.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN = 0xDA
_MAX_SEGMENTS = 64


class JpegHeader(NamedTuple):
    """What the start-of-frame segment says; ``samples`` are columns times rows times components."""

    lossless: bool
    bits: int
    samples: int


def read_jpeg_header(file: BinaryIO, offset: int, size: int) -> JpegHeader | None:
    """Of the stream at ``offset``, ``size`` bytes long; None where there is none.

    Source: ITU-T T.81, annex B: after the start, segments of marker and
    length up to the start of frame; SOF3 is sequential lossless.
    """
    at, end = offset, offset + size

    def take(length: int) -> bytes:
        nonlocal at
        file.seek(at)
        at += length
        return file.read(length) if at <= end else b""

    if take(2) != b"\xff\xd8":
        return None
    for _ in range(_MAX_SEGMENTS):
        head = take(4)
        if len(head) < 4 or head[0] != 0xFF or head[1] == _START_OF_SCAN:
            return None
        length = int.from_bytes(head[2:], "big") - 2
        if head[1] in _FRAMES:
            body = take(6)
            if len(body) < 6:
                return None
            rows, columns = int.from_bytes(body[1:3], "big"), int.from_bytes(body[3:5], "big")
            return JpegHeader(head[1] == _LOSSLESS, body[0], rows * columns * body[5])
        at += max(length, 0)
    return None
