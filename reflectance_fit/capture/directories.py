"""TIFF directories (IFDs) read within bounds: any bytes give values or ``Malformed``, soon and in little memory."""

from __future__ import annotations

import struct
from fractions import Fraction
from typing import Any, BinaryIO

MAX_DIRECTORIES = 64
MAX_ENTRIES = 1024
MAX_PIECES = 100_000  # strips or tiles: more than any sensor has rows
_MAX_VALUES = 64  # of every other tag we read

_SUB_DIRECTORIES = 330
# TIFF's number of a type to its code for struct: BYTE ... DOUBLE, IFD; a rational is two integers.
_CODES = {
    1: "B",
    2: "B",
    3: "H",
    4: "I",
    5: "II",
    6: "b",
    7: "B",
    8: "h",
    9: "i",
    10: "ii",
    11: "f",
    12: "d",
    13: "I",
}
_RATIONAL, _REAL = {5, 10}, {11, 12}


class Malformed(Exception):
    """The directories contradict themselves or the file's length; the message says how."""


class Directory:
    """The entries of one IFD; values are read when asked for.  A missing tag has no values."""

    def __init__(self, file: BinaryIO, size: int, endian: str, offset: int) -> None:
        self._file, self._size, self._endian = file, size, endian
        (count,) = struct.unpack(endian + "H", self._at(offset, 2))
        if count > MAX_ENTRIES:
            raise Malformed(f"a directory has {count} entries")
        block = self._at(offset + 2, 12 * count + 4)
        self._entries: dict[int, tuple[int, int, bytes]] = {}
        for at in range(0, 12 * count, 12):
            tag, kind, number, value = struct.unpack_from(endian + "HHI4s", block, at)
            # LibRaw too takes the last of repeated tags.
            self._entries[tag] = (kind, number, value)
        (self.next_offset,) = struct.unpack_from(endian + "I", block, 12 * count)

    def __contains__(self, tag: int) -> bool:
        return tag in self._entries

    def integers(self, tag: int, most: int = _MAX_VALUES) -> tuple[int, ...]:
        """Whole numbers, at most ``most``."""
        kind, numbers = self._values(tag, most)
        if kind in _RATIONAL or kind in _REAL:
            raise Malformed(f"tag {tag} is no whole number")
        return numbers

    def integer(self, tag: int) -> int | None:
        """The first value, not negative, or None without one."""
        values = self.integers(tag)
        if values and values[0] < 0:
            raise Malformed(f"tag {tag} is negative")
        return values[0] if values else None

    def fractions(self, tag: int) -> tuple[Fraction, ...]:
        """Exact values, whole numbers included; none for a single x/0, which means unknown."""
        kind, numbers = self._values(tag, _MAX_VALUES)
        if kind in _REAL:
            raise Malformed(f"tag {tag} is a floating-point number")
        if kind not in _RATIONAL:
            return tuple(Fraction(number) for number in numbers)
        pairs = list(zip(numbers[::2], numbers[1::2], strict=True))
        if len(pairs) == 1 and pairs[0][1] == 0:
            return ()
        if any(below == 0 for _, below in pairs):
            raise Malformed(f"tag {tag} has a zero denominator")
        return tuple(Fraction(above, below) for above, below in pairs)

    def floats(self, tag: int) -> tuple[float, ...]:
        """Values of FLOAT or DOUBLE type; none when the type is another."""
        kind, numbers = self._values(tag, _MAX_VALUES)
        return numbers if kind in _REAL else ()

    def child(self, tag: int) -> Directory | None:
        """The directory that a pointer leads to."""
        offset = self.integer(tag)
        return Directory(self._file, self._size, self._endian, offset) if offset else None

    def _values(self, tag: int, most: int) -> tuple[int, tuple[Any, ...]]:
        """TIFF's number of the type, and the values: two for every rational."""
        if tag not in self._entries:
            return 0, ()
        kind, count, inline = self._entries[tag]
        if kind not in _CODES:
            raise Malformed(f"tag {tag} has the unknown type {kind}")
        code = self._endian + _CODES[kind]
        length = count * struct.calcsize(code)
        if count > most:
            raise Malformed(f"tag {tag} has {count} values")
        if length > 4:
            (offset,) = struct.unpack(self._endian + "I", inline)
            inline = self._at(offset, length)
        return kind, tuple(x for values in struct.iter_unpack(code, inline[:length]) for x in values)

    def _at(self, offset: int, length: int) -> bytes:
        if offset + length > self._size:
            raise Malformed(f"{length} bytes at {offset} lie outside the file of {self._size} bytes")
        self._file.seek(offset)
        data = self._file.read(length)
        if len(data) != length:
            raise Malformed("the file shrank while it was read")
        return data


def read_directories(file: BinaryIO, size: int) -> tuple[list[Directory], list[Directory]]:
    """The chain from IFD0, at least one long, and the sub-directories below it (DNG and NEF keep the raw image there).

    Raises Malformed for pointers outside the file, loops and more than 64 directories.
    """
    file.seek(0)
    head = file.read(8)
    if len(head) < 8:
        raise Malformed("the header is cut off")
    endian = "<" if head[:2] == b"II" else ">"
    seen: set[int] = set()

    def read(offset: int) -> Directory:
        if offset in seen or len(seen) == MAX_DIRECTORIES:
            raise Malformed("directories form a loop" if offset in seen else "too many directories")
        seen.add(offset)
        return Directory(file, size, endian, offset)

    (offset,) = struct.unpack(endian + "I", head[4:])
    chain = [read(offset)]
    while chain[-1].next_offset:
        chain.append(read(chain[-1].next_offset))
    nested = [read(offset) for directory in chain for offset in directory.integers(_SUB_DIRECTORIES)]
    return chain, nested
