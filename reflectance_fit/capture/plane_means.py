"""The means of one plane of a frame over bins.

Planes are never mixed and nothing is demosaiced: each pixel counts once, in
the channel whose filter it has.  Values are DN above black.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import AngleBins, Bins, Mask, Region, Shift
from reflectance_fit.capture.raw import Plane, RawFrame

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Pixels at a time: their angles take 50 bytes each.
_CHUNK = 500_000


@dataclass(frozen=True, slots=True, eq=False)
class PlaneMeans:
    """One plane, averaged per bin; arrays of shape (bins,).

    ``saturated`` counts clipped pixels, which ``mean`` includes.  ``theta``
    (radians), its square, ``cos_2phi`` and ``sin_2phi`` are means over the
    pixels, of a flat weighted by its signal; phi is the analyzer's angle from
    s.  They are NaN for a Region.  Empty bins have NaN means.
    """

    pixels: IntArray | FloatArray
    saturated: IntArray | FloatArray
    mean: FloatArray
    theta: FloatArray
    theta_squared: FloatArray
    cos_2phi: FloatArray
    sin_2phi: FloatArray


def plane_means(
    frame: RawFrame, plane: Plane, bins: Bins, is_flat: bool, shift: Shift | None, mask: Mask | None
) -> PlaneMeans:
    """``plane`` over ``bins``, less the pixels of ``mask``; angles of a flat are weighted by its signal."""
    sums = _Sums.zero(bins.count)
    for site in frame.sites(plane):
        if isinstance(bins, Region):
            _add_region(sums, frame, site, bins, shift, mask)
        else:
            _add_angles(sums, frame, site, plane, bins, is_flat, shift, mask)
    pixels = sums.pixels.astype(np.int64)
    saturated = sums.saturated.astype(np.int64)
    mean = _divided(sums.level, sums.pixels)
    if isinstance(bins, Region):
        unknown = np.full(1, np.nan)
        return PlaneMeans(pixels, saturated, mean, unknown, unknown, unknown, unknown)
    weight = sums.level if is_flat else sums.pixels
    return PlaneMeans(pixels, saturated, mean, *(_divided(angle, weight) for angle in sums.angles))


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """Sums over the pixels of each bin, added to in place; ``angles`` are weighted, shape (4, bins)."""

    pixels: FloatArray
    saturated: FloatArray
    level: FloatArray
    angles: FloatArray

    @classmethod
    def zero(cls, count: int) -> _Sums:
        return cls(np.zeros(count), np.zeros(count), np.zeros(count), np.zeros((4, count)))


def _divided(total: FloatArray, weight: FloatArray) -> FloatArray:
    return np.asarray(np.where(weight > 0, total / np.where(weight > 0, weight, 1.0), np.nan))


def _pieces(
    frame: RawFrame, site: tuple[int, int], bins: Bins, shift: Shift | None, mask: Mask | None
) -> Iterator[tuple[slice, slice, NDArray[np.bool_] | None]]:
    """Rows and columns of one position of the cell where bins may lie, in pieces, and which pixels are masked."""
    n = len(frame.channels)
    rows, columns = bins.box() if shift is None else shift.moved(bins.box())
    top, left = rows.start + (site[0] - rows.start) % n, columns.start + (site[1] - columns.start) % n
    bottom, right = min(rows.stop, frame.cfa.shape[0]), min(columns.stop, frame.cfa.shape[1])
    step = max(1, _CHUNK // max(1, (right - left) // n)) * n
    across = slice(left, right, n)
    for start in range(top, bottom, step):
        down = slice(start, min(start + step, bottom), n)
        masked = None if mask is None else mask.rows(down)[:, across]
        yield down, across, masked


def _positions(
    rows: slice, columns: slice, shape: tuple[int, ...], shift: Shift | None
) -> tuple[FloatArray, FloatArray]:
    """Where the pixels of a piece are in the first frame of the view, x and y, shape (pixels,)."""
    x = np.broadcast_to(np.arange(columns.start, columns.stop, columns.step, dtype=np.float64), shape).ravel()
    down = np.arange(rows.start, rows.stop, rows.step, dtype=np.float64)
    y = np.broadcast_to(down[:, None], shape).ravel()
    return (x, y) if shift is None else shift.back(x, y)


def _add_region(
    sums: _Sums, frame: RawFrame, site: tuple[int, int], bins: Region, shift: Shift | None, mask: Mask | None
) -> None:
    black, clip = float(frame.black[site]), frame.clip[site]
    for rows, columns, masked in _pieces(frame, site, bins, shift, mask):
        dn = frame.cfa[rows, columns]
        kept: Any = ... if masked is None else ~masked
        if shift is not None:
            inside = bins.holds(*_positions(rows, columns, dn.shape, shift)).reshape(dn.shape)
            kept = inside if masked is None else inside & kept
        sums.pixels[0] += dn[kept].size
        sums.saturated[0] += np.count_nonzero(dn[kept] >= clip)
        if frame.maps is None:
            sums.level[0] += float(dn[kept].sum(dtype=np.int64)) - black * dn[kept].size
        else:
            above = frame.maps.above_black(dn, (rows, columns), black)
            sums.level[0] += float(above[kept].sum(dtype=np.float64))


def _add_angles(
    sums: _Sums,
    frame: RawFrame,
    site: tuple[int, int],
    plane: Plane,
    bins: AngleBins,
    is_flat: bool,
    shift: Shift | None,
    mask: Mask | None,
) -> None:
    black, clip = float(frame.black[site]), frame.clip[site]
    axis = bins.analyzer if plane.axis_deg is None else math.radians(plane.axis_deg)
    if axis is None:
        raise ValueError("bins without an analyzer are for sensors with polarizers on the pixels")
    for rows, columns, masked in _pieces(frame, site, bins, shift, mask):
        dn = frame.cfa[rows, columns]
        signal = dn - black if frame.maps is None else frame.maps.above_black(dn, (rows, columns), black)
        inside, theta, s_direction = bins.angles(*_positions(rows, columns, dn.shape, shift))
        dn, signal = dn.ravel()[inside], signal.ravel()[inside]
        if masked is not None:
            kept = ~masked.ravel()[inside]
            dn, signal, theta, s_direction = dn[kept], signal[kept], theta[kept], s_direction[kept]
        phi = axis - s_direction
        sector = np.floor(phi % math.pi / math.pi * bins.sectors).astype(np.int64) % bins.sectors
        ring = np.clip(np.searchsorted(bins.edges, theta, side="right") - 1, 0, len(bins.edges) - 2)
        number = ring * bins.sectors + sector

        def total(values: NDArray[np.floating[Any]] | None, number: NDArray[np.int64] = number) -> FloatArray:
            return np.bincount(number, weights=values, minlength=bins.count).astype(np.float64)

        weight = signal if is_flat else np.ones(1)
        sums.pixels[:] += total(None)
        sums.saturated[:] += total((dn >= clip).astype(np.float64))
        sums.level[:] += total(signal)
        for row, values in enumerate(_over_pixels(theta, phi, bins.curvature)):
            sums.angles[row] += total(weight * values)


def _over_pixels(
    theta: FloatArray, phi: FloatArray, curvature: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Means over each pixel's square of theta, its square, cos 2 phi and sin 2 phi, given those at the middle.

    On a ball sin(theta) is the distance from its middle in units of the radius,
    1 / ``curvature`` pixels, and phi goes with the direction.  To second order a
    mean is the value plus 1/24 of the Laplacian, pixels being 1 wide.
    """
    if curvature == 0.0:
        return theta, theta**2, np.cos(2 * phi), np.sin(2 * phi)
    sine, cosine = np.sin(theta), np.cos(theta)
    square = curvature**2
    mean = theta + square / 24 * (sine / cosine**3 + 1 / (sine * cosine))
    turned = 1 - square / (6 * sine**2)
    return mean, mean**2 + square / (12 * cosine**2), turned * np.cos(2 * phi), turned * np.sin(2 * phi)
