"""From photographs to a number for every pixel: tiles of cells, each estimated by itself and kept on the disk."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import Cells
from reflectance_fit.capture.frames import Capture
from reflectance_fit.capture.pixel_signals import PixelSignals, PixelSource
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.map_columns import FIELDS, OF_K
from reflectance_fit.map_rows import Together, pixel_rows
from reflectance_fit.pixels.estimate import PixelResult, estimate
from reflectance_fit.pixels.status import Status


@dataclass(frozen=True, slots=True, eq=False)
class MapJob:
    """What every tile is computed from.

    ``channels`` maps each to what all of its pixels together tell.
    """

    source: PixelSource
    channels: Mapping[str, Together]

    @property
    def fields(self) -> tuple[str, ...]:
        """The fields that the map has."""
        has_k = any(channel.model == "conductor" for channel in self.channels.values())
        return tuple(name for name in FIELDS if has_k or name not in OF_K)


@dataclass(frozen=True, slots=True)
class Tile:
    """A part of the map: its first row and column, what it shows, and the file that its numbers go to."""

    row: int
    column: int
    cells: Cells
    path: Path


def tiles_of(extent: Cells, side: int, folder: Path) -> Iterator[Tile]:
    """``extent`` in squares of ``side`` cells, cut at the edges, row by row."""
    for row in range(0, extent.rows, side):
        for column in range(0, extent.columns, side):
            part = replace(
                extent,
                left=extent.left + extent.pitch * column,
                top=extent.top + extent.pitch * row,
                rows=min(side, extent.rows - row),
                columns=min(side, extent.columns - column),
            )
            yield Tile(row, column, part, folder / f"tile-{row:06d}-{column:06d}.npz")


def compute_tile(job: MapJob, tile: Tile) -> None:
    """Estimate a tile and write its file, whole or not at all: it may be computed twice, by two workers at once."""
    parts = [
        pixels_of(job.source.signals(channel, tile.cells), together, job.source.capture)
        for channel, together in job.channels.items()
    ]
    shape = (len(parts), tile.cells.rows, tile.cells.columns)
    fields = {name: np.stack([part[name] for part in parts]).reshape(shape) for name in job.fields}
    # Of another process, or another machine, that computes the same tile.
    unfinished = tile.path.with_name(f".{tile.path.stem}.{os.urandom(8).hex()}.npz")
    try:
        np.savez(unfinished, allow_pickle=False, **fields)
        unfinished.replace(tile.path)
    finally:
        unfinished.unlink(missing_ok=True)


def pixels_of(signals: PixelSignals, together: Together, capture: Capture) -> dict[str, NDArray[Any]]:
    """The fields of one channel of some cells, shape (cells,) each."""
    if np.isnan(signals.variance).all():
        message = (
            "how noisy its pixels are is not known, so no sigma can be given; state camera.noise, "
            "or photograph flats and darks in pairs"
        )
        raise ReflectanceFitError(Problem(str(capture.path), None, message))
    rows = pixel_rows(signals, together, capture.exterior_ior)
    reason = np.where(signals.inside, 0, Status.OUTSIDE).astype(np.uint8)
    result = estimate(rows, together.model, reason, expected_eta=together.eta)
    status = result.status.copy()
    few = status == Status.TOO_FEW
    status[few & signals.masked] = Status.MASKED
    status[few & signals.saturated] = Status.SATURATED
    return _fields(result, status)


def _fields(result: PixelResult, status: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
    found = {
        "eta": result.eta,
        "eta_sigma": result.eta_sigma,
        "k": result.k,
        "k_sigma": result.k_sigma,
        "eta_k_correlation": result.correlation,
        "chi2": result.chi2,
        "dof": result.dof,
        "status": status,
    }
    nothing = np.full(status.shape, np.nan, dtype=np.float32)
    return {name: nothing if values is None else values for name, values in found.items()}


class Tiles:
    """The numbers of all tiles, as bands of rows; of a tile that was lost all is NaN, and the status says so."""

    def __init__(self, tiles: Sequence[Tile], lost: frozenset[Path], columns: int) -> None:
        self._tiles, self._lost, self._columns = tiles, lost, columns

    def band(self, name: str, channel: int, rows: slice) -> NDArray[Any]:
        """Some rows of a field of one channel, shape (rows, columns)."""
        dtype = FIELDS[name].dtype
        band = np.zeros((rows.stop - rows.start, self._columns), dtype=dtype)
        for tile in self._tiles:
            first, last = max(rows.start, tile.row), min(rows.stop, tile.row + tile.cells.rows)
            if first >= last:
                continue
            there = (
                slice(first - rows.start, last - rows.start),
                slice(tile.column, tile.column + tile.cells.columns),
            )
            if tile.path in self._lost:
                band[there] = Status.TILE_LOST if name == "status" else math.nan if dtype == "float32" else 0
                continue
            with np.load(tile.path, allow_pickle=False) as file:
                band[there] = file[name][channel, first - tile.row : last - tile.row]
        return band
