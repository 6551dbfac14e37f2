"""Chains kept on disk while they grow, so that a killed run continues where it was.

Each chain has one file, written at its end only.  A record is its length, a
checksum and the bytes; the first says which job the file is of, each further
one holds a block of steps and the state of the random numbers after it.  A
record torn by a crash or a full disk fails its checksum; what stands before it
counts.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import shutil
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError

FloatArray = NDArray[np.float64]

FOLDER = ".checkpoint"
_RECORD = struct.Struct("<QI")  # length and CRC-32 of what follows
_LONGEST = 1 << 32  # bytes; a longer record is a torn one

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Steps of all walkers, and where the random numbers stand after them.

    ``chain`` (step, walker, P), ``log_density`` (step, walker), ``accepted``
    (walker,) the number of accepted steps; ``key``, ``position``, ``has_gauss``
    and ``gauss`` the state of a Mersenne twister.
    """

    chain: FloatArray
    log_density: FloatArray
    accepted: NDArray[np.int64]
    key: NDArray[np.uint32]
    position: NDArray[np.int64]
    has_gauss: NDArray[np.int64]
    gauss: FloatArray

    def to_bytes(self) -> bytes:
        out = io.BytesIO()
        for field in fields(self):
            np.lib.format.write_array(out, np.asarray(getattr(self, field.name)), allow_pickle=False)
        return out.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> Block:
        source = io.BytesIO(data)
        return cls(*(np.lib.format.read_array(source, allow_pickle=False) for _ in fields(cls)))


@dataclass(frozen=True, slots=True)
class _Place:
    folder: Path
    resume: bool


_PLACE: ContextVar[_Place | None] = ContextVar("checkpoints", default=None)


@contextmanager
def keeping(folder: Path, *, resume: bool) -> Iterator[None]:
    """Chains sampled inside are kept in ``folder`` until the block ends without an error.

    With ``resume`` those of an earlier run are continued, otherwise removed.
    """
    if not resume:
        shutil.rmtree(folder, ignore_errors=True)
    token = _PLACE.set(_Place(folder, resume))
    try:
        yield
    finally:
        _PLACE.reset(token)
    shutil.rmtree(folder, ignore_errors=True)


class Journal:
    """One chain's file; reads what is valid of an earlier run, then appends.  Without a place it keeps nothing."""

    def __init__(self, name: str, job: bytes) -> None:
        """``job`` is everything that the chain follows from, but for this package's version."""
        place = _PLACE.get()
        self.path = None if place is None else place.folder / f"{name}.chain"
        self._job = hashlib.sha256(version("reflectance_fit").encode() + job).digest()
        self.blocks: list[Block] = []
        self._end = 0
        if self.path is None or place is None or not place.resume or not self.path.exists():
            return
        records, ends = _valid(self.path.read_bytes())
        if not records or records[0] != self._job:
            _log.info("%s: left by another job or version, not continued", self.path)
            return
        self.blocks = [Block.from_bytes(record) for record in records[1:]]
        self._end = ends[-1]
        _log.info("%s: %d blocks of steps continued", self.path, len(self.blocks))

    def append(self, block: Block) -> None:
        """Add a block; when this returns it is on the disk.

        Raises ReflectanceFitError where it cannot be written; earlier blocks stay.
        """
        if self.path is None:
            return
        payload = [block.to_bytes()] if self._end else [self._job, block.to_bytes()]
        data = b"".join(_RECORD.pack(len(p), zlib.crc32(p)) + p for p in payload)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("r+b" if self._end else "wb") as file:
                # A torn record of an earlier run goes.
                file.truncate(self._end)
                file.seek(self._end)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            message = (
                f"cannot keep the sampled chains here: {error.strerror or error}; "
                "make room, then give the same command with --resume"
            )
            raise ReflectanceFitError(Problem(str(self.path.parent), None, message)) from error
        self._end += len(data)


def _valid(data: bytes) -> tuple[list[bytes], list[int]]:
    """The records before the first that is cut short or altered, and where each ends."""
    records: list[bytes] = []
    ends: list[int] = []
    start = 0
    while start + _RECORD.size <= len(data):
        length, checksum = _RECORD.unpack_from(data, start)
        start += _RECORD.size
        record = data[start : start + min(length, _LONGEST)]
        if len(record) < length or zlib.crc32(record) != checksum:
            break
        start += length
        records.append(record)
        ends.append(start)
    return records, ends
