"""Cells of four polarizers, each tested by itself: do both crossed pairs see the same light?

Runs in the decoding worker.  Cells that fail alone show dust, edges finer than a cell, or pixels that respond
unlike; what all cells have in common shows in the means over them (``balance``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import Bins, Box, Mask, Region, Shift
from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.capture.stokes_pixels import redundancy

FloatArray = NDArray[np.float64]

BEYOND = 4.0  # standard deviations; of noise alone 6 cells in 100 000
_TYPICAL_PRNU = 0.005  # where no map corrects the pixels
_ROWS = 256


def uneven_cells(
    frame: RawFrame,
    bins: Bins,
    noise: Mapping[str, tuple[float, float]],
    shift: Shift | None = None,
    mask: Mask | None = None,
) -> dict[str, tuple[int, int]]:
    """Of each channel: how many cells are more than 4 standard deviations uneven, and how many there are.

    Parameters
    ----------
    frame : RawFrame
        With a polarizer on every pixel, else there are no cells.
    bins : Bins
        Cells outside do not count: whole cells inside a Region, those with their centre inside other bins.
    noise : channel of the sensor to (a, b)
        The variance of a pixel is a (DN - black) + b; a spread of the pixels' response of 0.5 % is added.
    shift : Shift, optional
        Where the frame shows the bins.
    mask : Mask, optional
        Cells with a pixel of it do not count, nor do those with a clipped one.
    """
    found: dict[str, tuple[int, int]] = {}
    box = bins.box() if shift is None else shift.moved(bins.box())
    n = len(frame.channels)
    for top in range(0, n, 2):
        for left in range(0, n, 2):
            channel = str(frame.channels[top, left])
            axes = frame.axes_deg[top : top + 2, left : left + 2].ravel()
            if channel not in noise or not np.isfinite(axes).all():
                continue
            beyond, cells = found.get(channel, (0, 0))
            for signal, lost, (x, y) in _cells(frame, box, (top, left), mask):
                slope, floor = noise[channel]
                variance = slope * np.maximum(signal, 0.0) + floor + (_TYPICAL_PRNU * signal) ** 2
                try:
                    z = redundancy(signal, variance, np.radians(axes)).z[~lost & _seen(bins, shift, x, y)]
                except ValueError:  # axes of another kind are not redundant
                    return {}
                beyond, cells = beyond + int(np.count_nonzero(np.abs(z) > BEYOND)), cells + z.size
            found[channel] = beyond, cells
    return found


def _seen(bins: Bins, shift: Shift | None, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
    """Whether cells with their centres in columns x and rows y are of the bins, shape (rows, columns)."""
    if isinstance(bins, Region):
        return np.ones((len(y), len(x)), dtype=np.bool_)
    across, down = np.meshgrid(x, y)
    there = (across.ravel(), down.ravel()) if shift is None else shift.back(across.ravel(), down.ravel())
    return bins.angles(*there)[0].reshape(across.shape)


def _cells(
    frame: RawFrame, box: Box, corner: tuple[int, int], mask: Mask | None
) -> Iterator[tuple[FloatArray, NDArray[np.bool_], tuple[FloatArray, FloatArray]]]:
    """The whole cells inside ``box`` at one corner: signals, shape (4, rows, columns), which do not count, and where.

    The last are x of the columns and y of the rows of their centres.
    """
    n = len(frame.channels)
    height, width = frame.cfa.shape
    left = box[1].start + (corner[1] - box[1].start) % n
    columns = max(0, (min(box[1].stop, width) - left - 2) // n + 1)
    start = box[0].start + (corner[0] - box[0].start) % n
    stop = min(box[0].stop, height) - 1
    for top in range(start, stop, _ROWS * n):
        rows = len(range(top, min(stop, top + _ROWS * n), n))
        signals, lost = [], np.zeros((rows, columns), dtype=np.bool_)
        for y, x in np.ndindex(2, 2):
            site = (corner[0] + y, corner[1] + x)
            down = slice(top + y, top + y + (rows - 1) * n + 1, n)
            across = slice(left + x, left + x + max(0, columns - 1) * n + 1, n)
            dn = frame.cfa[down, across][:, :columns]
            black = float(frame.black[site])
            above = dn - black if frame.maps is None else frame.maps.above_black(dn, (down, across), black)
            signals.append(np.asarray(above, dtype=np.float64))
            lost |= dn >= frame.clip[site]
            if mask is not None:
                lost |= mask.rows(down)[:, across][:, :columns]
        x = left + 0.5 + n * np.arange(columns, dtype=np.float64)
        yield np.stack(signals), lost, (x, top + 0.5 + n * np.arange(rows, dtype=np.float64))
