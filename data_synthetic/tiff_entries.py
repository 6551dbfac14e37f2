"""Directories of a little-endian classic TIFF as bytes (TIFF 6.0, section 2)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple


class Entry(NamedTuple):
    """A tag with its values, encoded; ``type`` is TIFF's number of the type, ``values`` how many."""

    tag: int
    type: int
    values: int
    data: bytes


def byte(tag: int, *values: int) -> Entry:
    return Entry(tag, 1, len(values), bytes(values))


def ascii_(tag: int, text: str) -> Entry:
    return Entry(tag, 2, len(text) + 1, text.encode("ascii") + b"\0")


def short(tag: int, *values: int) -> Entry:
    return Entry(tag, 3, len(values), struct.pack(f"<{len(values)}H", *values))


def long(tag: int, *values: int) -> Entry:
    return Entry(tag, 4, len(values), struct.pack(f"<{len(values)}I", *values))


def rational(tag: int, *values: Fraction) -> Entry:
    parts = [part for value in values for part in value.as_integer_ratio()]
    return Entry(tag, 5, len(values), struct.pack(f"<{len(parts)}I", *parts))


def undefined(tag: int, data: bytes) -> Entry:
    return Entry(tag, 7, len(data), data)


def srational(tag: int, *values: Fraction) -> Entry:
    parts = [part for value in values for part in value.as_integer_ratio()]
    return Entry(tag, 10, len(values), struct.pack(f"<{len(parts)}i", *parts))


def double(tag: int, *values: float) -> Entry:
    return Entry(tag, 12, len(values), struct.pack(f"<{len(values)}d", *values))


def directory(entries: Iterable[Entry], at: int) -> bytes:
    """The only directory of its chain and its values, to stand at offset ``at``; a multiple of 16 bytes long."""
    entries = sorted(entries)
    fixed = struct.pack("<H", len(entries))
    values = b""
    values_at = at + 2 + 12 * len(entries) + 4
    for entry in entries:
        fixed += struct.pack("<HHI", entry.tag, entry.type, entry.values)
        if len(entry.data) <= 4:
            fixed += entry.data.ljust(4, b"\0")
        else:
            values += b"\0" * ((values_at + len(values)) % 2)  # values start on word boundaries
            fixed += struct.pack("<I", values_at + len(values))
            values += entry.data
    whole = fixed + b"\0\0\0\0" + values
    return whole + b"\0" * (-len(whole) % 16)
