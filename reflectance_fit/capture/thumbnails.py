"""A frame as a small picture: the mean of each plane over square cells of sensor pixels.

Bins say what a material does; cells show where in the picture something is not as it should be.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import Bins, Box, Mask, Shift
from reflectance_fit.capture.raw import Plane, RawFrame

Picture = NDArray[np.float32]
FloatArray = NDArray[np.float64]

MOST_CELLS = 400
"""On the longer side: an aureole of a few cells is seen, and a frame takes a megabyte."""


@dataclass(frozen=True, slots=True)
class CellGrid:
    """``rows`` x ``columns`` cells of ``pitch`` x ``pitch`` sensor pixels, the first pixel at (``left``, ``top``)."""

    left: int
    top: int
    pitch: int
    rows: int
    columns: int

    def centres(self) -> tuple[FloatArray, FloatArray]:
        """x of the columns and y of the rows, sensor pixels, broadcast to shape (rows, columns)."""
        middle = (self.pitch - 1) / 2
        x = self.left + middle + self.pitch * np.arange(self.columns, dtype=np.float64)
        y = self.top + middle + self.pitch * np.arange(self.rows, dtype=np.float64)
        across, down = np.meshgrid(x, y)
        return across, down

    def mask(self, masked: NDArray[np.bool_], shape: tuple[int, int]) -> Mask:
        """The sensor pixels of the cells that are True in ``masked``, shape (rows, columns); sensor of ``shape``."""
        across = np.zeros((self.rows, shape[1]), dtype=bool)
        width = self.pitch * self.columns
        across[:, self.left : self.left + width] = np.repeat(masked, self.pitch, axis=1)
        # Packed before the rows are repeated: the picture of all pixels would be eight times as large.
        packed = np.packbits(across, axis=1)
        bits = np.zeros((shape[0], packed.shape[1]), dtype=np.uint8)
        bits[self.top : self.top + self.pitch * self.rows] = np.repeat(packed, self.pitch, axis=0)
        return Mask(shape, bits)


@dataclass(frozen=True, slots=True, eq=False)
class CellPicture:
    """A frame over cells.

    ``means`` are DN above black, float32 of shape (planes, rows, columns):
    infinite where a pixel of the cell is clipped, NaN where the cell leaves
    the picture.  ``shape`` is the sensor's, (h, w).
    """

    planes: tuple[Plane, ...]
    grid: CellGrid
    shape: tuple[int, int]
    means: Picture

    def save(self, path: Path) -> None:
        """Write to ``path``: pictures of many frames must not pile up in memory."""
        np.savez(
            path,
            channels=np.array([plane.channel for plane in self.planes]),
            axes_deg=np.array(
                [np.nan if plane.axis_deg is None else plane.axis_deg for plane in self.planes]
            ),
            grid=np.array(astuple(self.grid)),
            shape=np.array(self.shape),
            means=self.means,
        )

    @classmethod
    def load(cls, path: Path) -> CellPicture:
        """Read what ``save`` wrote."""
        with np.load(path) as file:
            channels, axes = file["channels"].tolist(), file["axes_deg"].tolist()
            planes = tuple(
                Plane(channel, None if math.isnan(axis) else axis)
                for channel, axis in zip(channels, axes, strict=True)
            )
            height, width = file["shape"].tolist()
            return cls(planes, CellGrid(*file["grid"].tolist()), (height, width), file["means"])


def box_over(bins: Iterable[Bins]) -> Box:
    """Rows and columns that hold all of ``bins``."""
    boxes = [one.box() for one in bins]
    rows, columns = zip(*boxes, strict=True)
    return _hull(rows), _hull(columns)


def _hull(slices: tuple[slice, ...]) -> slice:
    return slice(min(s.start for s in slices), max(s.stop for s in slices))


def grid_over(box: Box, shape: tuple[int, int], n: int) -> CellGrid:
    """The cells over what lies of ``box`` in a sensor of ``shape`` whose pattern repeats over ``n`` pixels."""
    rows, columns = box
    top, left = math.ceil(rows.start / n) * n, math.ceil(columns.start / n) * n
    height, width = max(0, min(rows.stop, shape[0]) - top), max(0, min(columns.stop, shape[1]) - left)
    pitch = n * max(1, math.ceil(max(height, width) / (n * MOST_CELLS)))
    return CellGrid(left, top, pitch, height // pitch, width // pitch)


def cell_means(
    frame: RawFrame, box: Box, shift: Shift | None = None, mask: Mask | None = None
) -> CellPicture:
    """The means over the cells of ``box``, less the pixels of ``mask``; NaN where a cell has no others.

    With ``shift`` the cells are those of the view's first frame, moved by whole patterns.
    """
    n = len(frame.channels)
    shape = (frame.cfa.shape[0], frame.cfa.shape[1])
    grid = grid_over(box, shape, n)
    moved = _whole(shift, grid, n)
    planes = frame.planes()
    means = np.full((len(planes), grid.rows, grid.columns), np.nan, dtype=np.float32)
    if means.size:
        clipped = bool(np.any(frame.cfa.max() >= frame.clip))
        for plane, mean in zip(planes, means, strict=True):
            sites = [_site(frame, grid, site, moved, mask, clipped=clipped) for site in frame.sites(plane)]
            mean[...] = sum(sites[1:], sites[0]) / len(sites)
    return CellPicture(planes, grid, shape, means)


def _whole(shift: Shift | None, grid: CellGrid, n: int) -> tuple[int, int]:
    """By how many pixels, right and down and multiples of ``n``, the middle of the cells is moved."""
    if shift is None:
        return 0, 0
    x, y = grid.left + grid.pitch * grid.columns / 2, grid.top + grid.pitch * grid.rows / 2
    (a, b), (c, d) = shift.matrix
    moved = (a * x + b * y + shift.offset[0] - x, c * x + d * y + shift.offset[1] - y)
    right, down = (n * round(by / n) for by in moved)
    return right, down


def _site(
    frame: RawFrame,
    grid: CellGrid,
    site: tuple[int, int],
    moved: tuple[int, int],
    mask: Mask | None,
    *,
    clipped: bool,
) -> Picture:
    """The means over the pixels of one position of the pattern; NaN where the cells leave the picture."""
    import cv2  # here, for only workers need it

    n = len(frame.channels)
    height, width = frame.cfa.shape
    # Cells that are inside the picture, moved.
    left, top = grid.left + moved[0], grid.top + moved[1]
    first_row, first_column = max(0, -(top // grid.pitch)), max(0, -(left // grid.pitch))
    rows = min(grid.rows, (height - top) // grid.pitch)
    columns = min(grid.columns, (width - left) // grid.pitch)
    mean = np.full((grid.rows, grid.columns), np.nan, dtype=np.float32)
    if rows <= first_row or columns <= first_column:
        return mean
    y0, x0 = top + first_row * grid.pitch, left + first_column * grid.pitch
    y1, x1 = top + rows * grid.pitch, left + columns * grid.pitch
    down, across = slice(y0 + (site[0] - y0) % n, y1, n), slice(x0 + (site[1] - x0) % n, x1, n)
    pixels = frame.cfa[down, across]
    size = (columns - first_column, rows - first_row)
    masked = None if mask is None else mask.rows(down)[:, across]
    # INTER_AREA by a whole factor is the mean over blocks.
    blocks: Picture = np.asarray(
        cv2.resize(pixels.astype(np.float32), size, interpolation=cv2.INTER_AREA), dtype=np.float32
    )
    if masked is not None:
        _take_out(blocks, pixels, masked, grid.pitch // n)
    inner = np.asarray(blocks - np.float32(frame.black[site]), dtype=np.float32)
    if clipped:
        above = pixels >= frame.clip[site]
        if masked is not None:
            above &= ~masked
        share = cv2.resize(above.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        inner[share > 0] = np.inf
    mean[first_row:rows, first_column:columns] = inner
    return mean


def _take_out(blocks: Picture, pixels: NDArray[np.uint16], masked: NDArray[np.bool_], side: int) -> None:
    """Make the means of ``blocks`` of side x side ``pixels`` those of the pixels that are not ``masked``, in place."""
    y, x = np.nonzero(masked)
    cell = np.ravel_multi_index((y // side, x // side), blocks.shape)
    number = np.bincount(cell, minlength=blocks.size)
    total = np.bincount(cell, weights=pixels[y, x], minlength=blocks.size)
    cells = np.flatnonzero(number)
    left = side**2 - number[cells]
    kept = side**2 * blocks.flat[cells].astype(np.float64) - total[cells]
    blocks.flat[cells] = np.where(left > 0, kept / np.maximum(left, 1), np.nan)
