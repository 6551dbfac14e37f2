"""Where a sample shows something else than itself: specular dots, dust, and light from its neighbours.

Both tests compare cells with what the rest of the picture lets expect, and take the
scatter of the whole for their unit, so a textured sample is not full of highlights.
They mask little rather than much: a clean photograph loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.ndimage import (
    binary_dilation,
    binary_erosion,
    distance_transform_edt,
    label,
    map_coordinates,
    maximum_filter,
    minimum_filter,
)

from reflectance_fit.views import BoolArray, FloatArray, StokesMaps

# Cells on a side of a block whose median stands for all that is smooth.
_BLOCK = 8
_LEAST_CELLS = 12  # of a block, for its median
# A cell or block is another thing when it is this many robust standard deviations off ...
_SIGMAS = 8.0
# ... and by this much: share of S0 for dots, degree of polarization for stray light.
_LEAST_DOT, _LEAST_STRAY = 0.04, 0.02
_MAD = 1.4826  # times the median absolute deviation is a normal distribution's standard deviation
_AZIMUTHS = 24
_RINGS = np.radians(np.arange(0.0, 90.1, 2.0))
_FEW_BLOCKS = 12
_ROUNDS = 6  # of a robust fit
_MIDDLE = 0.6  # of the picture, in each direction


@dataclass(frozen=True, slots=True, eq=False)
class Rings:
    """Where the cells are on a ball: angle of incidence and direction of s, radians, shape (h, w); NaN beside it."""

    theta: FloatArray
    s_axis: FloatArray


def highlights(stokes: StokesMaps, inside: BoolArray, rings: Rings | None = None) -> BoolArray:
    """Cells that are much brighter or darker than those around them, and their neighbours; shape (h, w).

    ``inside`` are the cells of the sample.  On a ball brightness is taken
    relative to that of its ring, give or take what the rings change by within
    the cell: one colour's pixels do not lie in the middle of it.
    """
    level = np.log(np.where(inside, stokes.s0, np.nan))
    steep = np.zeros_like(level)
    if rings is not None:
        expected = np.where(np.isfinite(rings.theta), _of_ring(level, rings.theta), np.nan)
        level, steep = level - expected, _step(expected)
    residual = level - _smooth(level)
    scatter = _MAD * np.nanmedian(np.abs(residual)) if np.isfinite(residual).any() else np.inf
    with np.errstate(invalid="ignore"):
        dots = np.abs(residual) > np.maximum(max(_SIGMAS * scatter, _LEAST_DOT), steep)
    # The blur of a lens spreads a dot over its neighbours.
    return np.asarray(binary_dilation(dots, np.ones((3, 3), dtype=bool)) & inside)


def stray_light(stokes: StokesMaps, inside: BoolArray, rings: Rings | None = None) -> BoolArray:
    """Cells whose polarization is not the sample's: light that came by way of something else; shape (h, w).

    On a ball every ring has one s1 and no s2 in its own (s, p) frame: blocks
    of a ring that differ from its median are masked.  On a flat sample the
    polarization changes smoothly over the picture: blocks that leave a
    quadratic surface are masked if they are connected with the sample's edge,
    where neighbours shine in.
    """
    if rings is None:
        return _from_the_edge(stokes, inside)
    turned = np.cos(2 * rings.s_axis), np.sin(2 * rings.s_axis)
    along = stokes.s1 * turned[0] + stokes.s2 * turned[1]
    across = stokes.s2 * turned[0] - stokes.s1 * turned[1]
    ring = np.digitize(np.nan_to_num(rings.theta), _RINGS) - 1
    azimuth = np.floor(np.nan_to_num(rings.s_axis) % (2 * np.pi) / (2 * np.pi) * _AZIMUTHS).astype(int)
    block = np.where(inside, ring * _AZIMUTHS + azimuth % _AZIMUTHS, -1)
    count = len(_RINGS) * _AZIMUTHS
    strange = np.zeros(count, dtype=bool)
    for values in (along, across):
        medians = _medians(values, block, count).reshape(-1, _AZIMUTHS)
        expected = np.zeros(len(_RINGS)) if values is across else _median(medians)
        off = medians - expected[:, None]
        scatter = _MAD * _median(np.abs(off))
        with np.errstate(invalid="ignore"):
            strange |= (np.abs(off) > np.maximum(_SIGMAS * scatter, _LEAST_STRAY)[:, None]).ravel()
    return np.asarray(np.where(block >= 0, strange[block], False))


def _from_the_edge(stokes: StokesMaps, inside: BoolArray) -> BoolArray:
    height, width = inside.shape
    rows, columns = -(-height // _BLOCK), -(-width // _BLOCK)
    down, across = np.indices(inside.shape) // _BLOCK
    block = np.where(inside, down * columns + across, -1)
    y, x = np.indices((rows, columns))
    strange = np.zeros((rows, columns), dtype=bool)
    known = np.zeros((rows, columns), dtype=bool)
    for values in (stokes.s1, stokes.s2):
        medians = _medians(values, block, rows * columns).reshape(rows, columns)
        known = np.isfinite(medians)
        if known.sum() < _FEW_BLOCKS:
            return np.zeros(inside.shape, dtype=bool)
        off = medians - _surface(x, y, medians)
        scatter = _MAD * np.median(np.abs(off[known]))
        with np.errstate(invalid="ignore"):
            strange |= np.abs(off) > max(_SIGMAS * scatter, _LEAST_STRAY)
    groups, number = label(strange)
    outline = known & ~binary_erosion(known, np.ones((3, 3), dtype=bool))
    at_edge = set(np.unique(groups[outline])) - {0}
    wanted = np.isin(groups, list(at_edge)) if number else strange
    return np.asarray(np.kron(wanted, np.ones((_BLOCK, _BLOCK), dtype=bool))[:height, :width] & inside)


def _surface(x: NDArray[np.int64], y: NDArray[np.int64], values: FloatArray) -> FloatArray:
    """A quadratic surface through ``values`` that outliers do not bend (Tukey's biweight)."""
    known = np.isfinite(values)
    u, v = (2.0 * t / max(1, int(t.max())) - 1.0 for t in (x, y))
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    design, wanted = terms[known], values[known]
    # Neighbours shine in from the edges: the middle says what is smooth.
    weight = np.where((np.abs(u[known]) < _MIDDLE) & (np.abs(v[known]) < _MIDDLE), 1.0, 0.0)
    for _ in range(_ROUNDS):
        coefficients = np.linalg.lstsq(weight[:, None] * design, weight * wanted, rcond=None)[0]
        off = wanted - design @ coefficients
        scatter = _MAD * float(np.median(np.abs(off))) + 1e-9
        weight = np.clip(1.0 - (off / (6.0 * scatter)) ** 2, 0.0, 1.0)
    return np.asarray(terms @ coefficients)


def _of_ring(level: FloatArray, theta: FloatArray) -> FloatArray:
    """The median over each cell's ring, interpolated between rings, whose own angle is their median too."""
    edges = np.radians(np.arange(0.0, 90.1, 1.0))
    block = np.where(
        np.isfinite(level) & np.isfinite(theta), np.digitize(np.nan_to_num(theta), edges) - 1, -1
    )
    medians = _medians(level, block, len(edges))
    known = np.isfinite(medians)
    if known.sum() < 2:
        return np.zeros_like(level)
    middles = _medians(np.where(np.isfinite(level), theta, np.nan), block, len(edges))
    return np.asarray(make_interp_spline(middles[known], medians[known], k=1)(theta))


def _step(values: FloatArray) -> FloatArray:
    """A quarter of what a cell and its finite neighbours span: of a slope, what half a cell changes."""
    known = np.isfinite(values)
    highest = maximum_filter(np.where(known, values, -np.inf), 3)
    lowest = minimum_filter(np.where(known, values, np.inf), 3)
    return np.where(known, 0.25 * (highest - lowest), np.nan)


def _smooth(level: FloatArray) -> FloatArray:
    """Medians of blocks, interpolated: what varies over many cells."""
    height, width = level.shape
    rows, columns = max(1, height // _BLOCK), max(1, width // _BLOCK)
    down = np.minimum(np.arange(height) * rows // height, rows - 1)
    across = np.minimum(np.arange(width) * columns // width, columns - 1)
    block = np.where(np.isfinite(level), down[:, None] * columns + across, -1)
    medians = _medians(level, block, rows * columns).reshape(rows, columns)
    known = np.isfinite(medians)
    if not known.any():
        return np.full_like(level, np.nan)
    # Blocks without a median take that of the nearest block.
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    # Beyond the middles of the outer blocks it goes on as it went, or a slope would stand out at the edges.
    wider = np.pad(medians[tuple(nearest)], 1, mode="reflect", reflect_type="odd")
    y, x = ((np.arange(n) + 0.5) * blocks / n + 0.5 for n, blocks in ((height, rows), (width, columns)))
    return np.asarray(map_coordinates(wider, np.meshgrid(y, x, indexing="ij"), order=1))


def _medians(values: FloatArray, block: NDArray[np.int64], count: int) -> FloatArray:
    """The median of the finite values of each block; NaN of blocks with few.  Block -1 counts nowhere."""
    use = (block >= 0) & np.isfinite(values)
    order = np.lexsort((values[use], block[use]))
    sorted_values, sorted_block = values[use][order], block[use][order]
    starts = np.searchsorted(sorted_block, np.arange(count + 1))
    size = np.diff(starts)
    enough = size >= _LEAST_CELLS
    medians = np.full(count, np.nan)
    low, high = starts[:-1][enough] + (size[enough] - 1) // 2, starts[:-1][enough] + size[enough] // 2
    medians[enough] = 0.5 * (sorted_values[low] + sorted_values[high])
    return medians


def _median(rows: FloatArray) -> FloatArray:
    """Of each row's finite entries; NaN where there are none."""
    known = np.isfinite(rows).any(axis=1)
    medians = np.full(len(rows), np.nan)
    medians[known] = np.nanmedian(rows[known], axis=1)
    return medians
