"""One plane of a frame, cell by cell: the numbers that ``plane_means`` gives of bins, of each pixel of a map.

Where a frame shows a cell's content between its own pixels, or polarizers on
the pixels see it from four places, values are interpolated linearly between
pixels of one kind.  Interpolation averages: ``pixels`` says how many pixels
the value is worth, and its variance with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from reflectance_fit.capture.bins import Cells, Mask
from reflectance_fit.capture.plane_means import PlaneMeans
from reflectance_fit.capture.raw import Plane, RawFrame

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Places = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Sensor pixels x, y in the frame from those of the map."""


def middle_of(frame: RawFrame, channel: str) -> tuple[float, float]:
    """Where a channel's pixels are in a cell, in the mean over its planes: (x, y) from the first pixel."""
    sites = [site for plane in frame.planes() if plane.channel == channel for site in frame.sites(plane)]
    y, x = np.mean(sites, axis=0)
    return float(x), float(y)


def pixel_means(
    frame: RawFrame, plane: Plane, cells: Cells, places: Places | None, mask: Mask | None, clip: float
) -> PlaneMeans:
    """``plane`` of every cell; arrays of shape (rows * columns,).

    ``places`` moves positions of the map to those of the frame, None: they
    are the same.  ``mask`` is left out, of the frame's own pixels; ``clip`` is
    the lowest DN above black that counts as clipped, beside the frame's own.
    A cell without pixels, or beyond the picture, has a NaN mean.  Angles are
    NaN: they are those of the cell, not of its pixels.
    """
    total, worth, saturated = (np.zeros(cells.count) for _ in range(3))
    count = np.zeros(cells.count)
    middle = middle_of(frame, plane.channel)
    for site in frame.sites(plane):
        here = (float(site[1]), float(site[0]))
        # Pixels with a polarizer each see the cell from places of their own.
        wanted = here if plane.axis_deg is None else middle
        if places is None and wanted == here:
            value, clipped, kept, spread = _own(frame, site, cells, mask, clip)
        else:
            x, y = cells.places(*wanted)
            if places is not None:
                x, y = places(x, y)
            value, clipped, kept, spread = _between(frame, site, x, y, mask, clip)
        total += np.where(kept, value, 0.0)
        worth += np.where(kept, spread, 0.0)
        saturated += kept & clipped
        count += kept
    unknown = np.full(cells.count, math.nan)
    seen = count > 0
    mean = np.where(seen, total / np.where(seen, count, 1.0), math.nan)
    pixels = np.where(seen, count**2 / np.where(seen, worth, 1.0), 0.0)
    return PlaneMeans(pixels, saturated, mean, unknown, unknown, unknown, unknown)


Values = tuple[FloatArray, BoolArray, BoolArray, FloatArray | float]
"""Above black, whether clipped, whether there is a value, and the sum of the squared weights."""


def _own(frame: RawFrame, site: tuple[int, int], cells: Cells, mask: Mask | None, clip: float) -> Values:
    """The pixel of each cell itself; all cells lie in the picture."""
    down, across = (
        slice(box.start + at, box.stop, cells.pitch) for box, at in zip(cells.box(), site, strict=True)
    )
    value, clipped, out = _read(frame, down, across, mask, clip)
    return value.ravel(), clipped.ravel(), ~out.ravel(), 1.0


def _read(
    frame: RawFrame, down: slice, across: slice, mask: Mask | None, clip: float
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Above black, whether clipped and whether masked."""
    dn = frame.cfa[down, across]
    black, highest = (_at(levels, down, across) for levels in (frame.black, frame.clip))
    level = np.minimum(highest, black + clip)
    value = dn - black if frame.maps is None else frame.maps.above_black(dn, (down, across), black)
    out = np.zeros(dn.shape, dtype=bool) if mask is None else mask.rows(down)[:, across]
    return np.asarray(value, dtype=np.float64), dn >= level, out


def _at(levels: FloatArray, down: slice, across: slice) -> FloatArray:
    """Levels of pixels; where all are of one place of the pattern one number, of shape (1, 1)."""
    n = len(levels)
    rows = np.arange(down.start, down.stop, down.step) % n
    columns = np.arange(across.start, across.stop, across.step) % n
    if down.step % n == 0 and across.step % n == 0:
        rows, columns = rows[:1], columns[:1]
    return np.asarray(levels[np.ix_(rows, columns)])


def _between(
    frame: RawFrame, site: tuple[int, int], x: FloatArray, y: FloatArray, mask: Mask | None, clip: float
) -> Values:
    """Linear interpolation between pixels of one place of the pattern, at sensor positions x, y of any shape."""
    n = len(frame.channels)
    height, width = frame.cfa.shape
    rows, columns = len(range(site[0], height, n)), len(range(site[1], width, n))
    at_row, at_column = (y.ravel() - site[0]) / n, (x.ravel() - site[1]) / n
    inside = (at_row >= 0) & (at_row <= rows - 1) & (at_column >= 0) & (at_column <= columns - 1)
    if not inside.any():
        nowhere = np.zeros(x.size, dtype=bool)
        return np.full(x.size, math.nan), nowhere, nowhere, 1.0
    first_row, first_column = int(at_row[inside].min()), int(at_column[inside].min())
    last_row = min(rows, int(at_row[inside].max()) + 2)
    last_column = min(columns, int(at_column[inside].max()) + 2)
    value, clipped, out = _read(
        frame,
        slice(site[0] + n * first_row, site[0] + n * (last_row - 1) + 1, n),
        slice(site[1] + n * first_column, site[1] + n * (last_column - 1) + 1, n),
        mask,
        clip,
    )
    # Where there is nothing the first pixel stands in, which no weight of 0 turns into NaN.
    r = np.where(inside, at_row - first_row, 0.0)
    c = np.where(inside, at_column - first_column, 0.0)
    where = np.stack([r, c])

    def touches(marked: BoolArray) -> BoolArray:
        if not marked.any():
            return np.zeros(x.size, dtype=bool)
        return np.asarray(map_coordinates(marked.astype(np.float64), where, order=1) > 0)

    fr, fc = r - np.floor(r), c - np.floor(c)
    weights = ((1 - fr) ** 2 + fr**2) * ((1 - fc) ** 2 + fc**2)
    found = np.asarray(map_coordinates(value, where, order=1), dtype=np.float64)
    return found, touches(clipped), inside & ~touches(out), weights
