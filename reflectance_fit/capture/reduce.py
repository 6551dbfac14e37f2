"""From one frame's pixels to a few numbers a bin: what runs inside the decoding worker.

Planes are never mixed and nothing is demosaiced: each pixel counts once, in
the channel whose filter it has.  Values are DN above black.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import AngleBins, Bins, Box, Mask, Region, Shift
from reflectance_fit.capture.dofp_cells import uneven_cells
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.thumbnails import cell_means
from reflectance_fit.inputs import sha256_of

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

    pixels: IntArray
    saturated: IntArray
    mean: FloatArray
    theta: FloatArray
    theta_squared: FloatArray
    cos_2phi: FloatArray
    sin_2phi: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class FrameMeans:
    """A frame reduced: for each kind of bins asked for, the means of every plane.

    ``noise`` maps a channel to (a, b): the variance of a pixel is a * mean + b
    in DN^2, by the file's noise profile; None without one.  ``scatter`` maps a
    plane to its mean (DN above black) and the variance between neighbouring
    pixels, both over the middle half of the sensor.  ``clip`` maps a plane to
    what counts as clipped, DN above black.  ``shape`` is the sensor's, (h, w).
    ``sha256`` is the file's, "" of a frame that comes from none;
    ``unused_bits`` as in RawFrame.  ``uneven`` maps a channel to how many cells
    fail the test of ``uneven_cells``, and to all.
    """

    bins: tuple[Bins, ...]
    planes: tuple[dict[Plane, PlaneMeans], ...]
    noise: dict[str, tuple[float, float]] | None
    scatter: dict[Plane, tuple[float, float]]
    clip: dict[Plane, float]
    shape: tuple[int, int]
    sha256: str = ""
    unused_bits: int = 0
    uneven: dict[str, tuple[int, int]] = field(default_factory=dict)

    def over(self, bins: Bins) -> dict[Plane, PlaneMeans]:
        """The planes' means over one of ``bins``."""
        return self.planes[self.bins.index(bins)]


@dataclass(frozen=True, slots=True)
class Changed:
    """A file whose bytes are not those that the manifest states; it was not decoded."""

    sha256: str


def reduce_file(
    path: Path,
    reading: Reading,
    stated_sha256: str | None,
    bins: tuple[Bins, ...],
    is_flat: bool = False,
    shift: Shift | None = None,
    mask: Mask | None = None,
    cell_noise: Mapping[str, tuple[float, float]] | None = None,
    cells: tuple[Box, Path] | None = None,
) -> FrameMeans | Changed:
    """Check, decode and reduce one file; ReflectanceFitError for what cannot be read.

    ``cell_noise`` is the noise to test cells of polarizers with, for channels of which the file does not tell;
    None: they are not tested.  ``cells`` are rows and columns to be seen as a CellPicture, and the file to write
    that to.
    """
    found = sha256_of(path)
    if stated_sha256 not in (None, found):
        return Changed(found)
    frame = read_frame(path, reading)
    # That frames differ in size is told by the capture as a whole.
    fitting = mask if mask is not None and mask.shape == frame.cfa.shape else None
    if cells is not None:
        cell_means(frame, cells[0], shift, fitting).save(cells[1])
    means = reduce_frame(frame, bins, is_flat, shift, fitting)
    uneven = {}
    if cell_noise is not None and bins:
        uneven = uneven_cells(frame, bins[0], (means.noise or {}) | dict(cell_noise), shift, fitting)
    return replace(means, sha256=found, uneven=uneven)


def reduce_frame(
    frame: RawFrame,
    bins: tuple[Bins, ...],
    is_flat: bool = False,
    shift: Shift | None = None,
    mask: Mask | None = None,
) -> FrameMeans:
    """Average ``frame`` over each of ``bins``, less the pixels of ``mask``.

    ``bins`` are places in the first frame of the view; ``shift`` says where
    this frame shows them.  A sample's mean over its flat's is the mean
    reflectance of a bin weighted by the flat, so it belongs to angles weighted
    alike: those of the flat.
    """
    noise = None
    if frame.noise_profile is not None:
        # The profile speaks of (DN - black) / (white - black).
        span = {
            c: float((frame.white - frame.black)[frame.channels == c].mean()) for c in frame.noise_profile
        }
        noise = {c: (s * span[c], o * span[c] ** 2) for c, (s, o) in frame.noise_profile.items()}
    planes = tuple(
        {plane: _plane(frame, plane, which, is_flat, shift, mask) for plane in frame.planes()}
        for which in bins
    )
    scatter = {plane: _scatter(frame, plane) for plane in frame.planes()}
    above = frame.clip - frame.black
    clip = {plane: min(float(above[site]) for site in frame.sites(plane)) for plane in frame.planes()}
    height, width = frame.cfa.shape
    return FrameMeans(bins, planes, noise, scatter, clip, (height, width), unused_bits=frame.unused_bits)


def _scatter(frame: RawFrame, plane: Plane) -> tuple[float, float]:
    """Mean, and half the mean squared difference of horizontal neighbours: blind to slow gradients."""
    y, x = frame.sites(plane)[0]
    n = len(frame.channels)
    height, width = frame.cfa.shape
    rows = slice(height // 4 // n * n + y, 3 * height // 4, n)
    columns = slice(width // 4 // n * n + x, 3 * width // 4, n)
    dn = frame.cfa[rows, columns].astype(np.float32)
    return float(dn.mean() - frame.black[y, x]), float(0.5 * np.mean(np.diff(dn, axis=1) ** 2))


def _plane(
    frame: RawFrame, plane: Plane, bins: Bins, is_flat: bool, shift: Shift | None, mask: Mask | None
) -> PlaneMeans:
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
