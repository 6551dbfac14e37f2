"""Where in the picture which angle of incidence is seen: what pixels are averaged over.

Positions are (x, y) in raw sensor pixels, x to the right and y down, pixel
centres at whole numbers.  Directions in the picture are radians,
counter-clockwise from its horizontal as displayed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Box = tuple[slice, slice]


@dataclass(frozen=True, slots=True)
class Region:
    """A rectangle of sensor pixels, x1 and y1 exclusive, as one bin; all of the sensor where it is larger."""

    x0: int = 0
    y0: int = 0
    x1: int = 2**31
    y1: int = 2**31

    @property
    def count(self) -> int:
        """How many bins there are."""
        return 1

    def box(self) -> Box:
        """Rows and columns."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    def holds(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Whether positions lie on the region's pixels."""
        return (x >= self.x0 - 0.5) & (x < self.x1 - 0.5) & (y >= self.y0 - 0.5) & (y < self.y1 - 0.5)


class AngleBins(Protocol):
    """Rings of the angle of incidence times sectors of the local analyzer angle phi.

    ``edges`` are the rings' (radians).  ``analyzer`` is the transmission axis
    before the sensor, None where each pixel has a polarizer of its own.  phi
    is the axis' angle from s, which has another direction at each pixel.  Bin
    number ``ring * sectors + sector``.
    """

    @property
    def edges(self) -> tuple[float, ...]: ...
    @property
    def sectors(self) -> int: ...
    @property
    def analyzer(self) -> float | None: ...
    @property
    def count(self) -> int: ...
    @property
    def curvature(self) -> float:
        """Of a ball, radians a pixel where it is seen face on; 0 of a plane, over a pixel of which angles are one."""

    def box(self) -> Box:
        """Rows and columns outside of which there is nothing."""

    def angles(self, x: FloatArray, y: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
        """Which of the positions (x, y), shape (n,), are seen; of those the angle of incidence and the direction of s."""


class Ringed:
    """What has ``edges`` of rings and ``sectors``: as many bins as both make."""

    __slots__ = ()
    edges: tuple[float, ...]
    sectors: int

    @property
    def count(self) -> int:
        """How many bins there are."""
        return (len(self.edges) - 1) * self.sectors


@dataclass(frozen=True, slots=True)
class SphereBins(Ringed):
    """An opaque ball, seen orthographically.

    sin(theta) is the distance from the centre over the radius.  The plane of
    incidence holds the radius, so s runs along the circle.
    """

    center_x: float
    center_y: float
    radius: float
    analyzer: float | None
    edges: tuple[float, ...]
    sectors: int

    @property
    def curvature(self) -> float:
        return 1.0 / self.radius

    def box(self) -> Box:
        top, left = (max(0, math.floor(c - self.radius)) for c in (self.center_y, self.center_x))
        bottom, right = (max(0, math.ceil(c + self.radius) + 1) for c in (self.center_y, self.center_x))
        return slice(top, bottom), slice(left, right)

    def angles(self, x: FloatArray, y: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
        across, up = x - self.center_x, self.center_y - y
        distance = np.hypot(across, up)
        inside = (distance < self.radius * math.sin(self.edges[-1])) & (
            distance >= self.radius * math.sin(self.edges[0])
        )
        theta = np.arcsin(distance[inside] / self.radius)
        # s stands a right angle ahead of the outward radius.
        return inside, theta, np.arctan2(up[inside], across[inside]) + math.pi / 2


@dataclass(frozen=True, slots=True)
class Cells:
    """Every cell of the sensor's pattern as a bin of its own: what a map is made of.

    ``rows`` x ``columns`` cells of ``pitch`` x ``pitch`` sensor pixels, the
    first pixel at (``left``, ``top``), a multiple of the pitch.  Bin number
    ``row * columns + column``.  ``shares_gain`` where all that is compared
    was seen by the same pixels, calibrated by the same flats.
    """

    left: int
    top: int
    pitch: int
    rows: int
    columns: int
    shares_gain: bool = True

    @property
    def count(self) -> int:
        """How many bins there are."""
        return self.rows * self.columns

    def box(self) -> Box:
        """Rows and columns of sensor pixels."""
        return (
            slice(self.top, self.top + self.pitch * self.rows),
            slice(self.left, self.left + self.pitch * self.columns),
        )

    def places(self, dx: float, dy: float) -> tuple[FloatArray, FloatArray]:
        """x and y of what lies (``dx``, ``dy``) from the first pixel of each cell, shape (rows, columns)."""
        x = self.left + dx + self.pitch * np.arange(self.columns, dtype=np.float64)
        y = self.top + dy + self.pitch * np.arange(self.rows, dtype=np.float64)
        across, down = np.meshgrid(x, y)
        return across, down


Bins = Region | AngleBins


@dataclass(frozen=True, slots=True)
class Shift:
    """Where a frame shows what the view's first frame shows at (x, y): at A (x, y) + b.

    ``matrix`` is ((a11, a12), (a21, a22)), ``offset`` (b1, b2), pixels.
    """

    matrix: tuple[tuple[float, float], tuple[float, float]] = ((1.0, 0.0), (0.0, 1.0))
    offset: tuple[float, float] = (0.0, 0.0)

    def forward(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions in this frame of positions in the first one."""
        (a, b), (c, d) = self.matrix
        return a * x + b * y + self.offset[0], c * x + d * y + self.offset[1]

    def back(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions in the first frame of positions in this one."""
        (a, b), (c, d) = self.matrix
        x, y = x - self.offset[0], y - self.offset[1]
        determinant = a * d - b * c
        return (d * x - b * y) / determinant, (a * y - c * x) / determinant

    def moved(self, box: Box) -> Box:
        """Rows and columns that hold those of ``box`` of the first frame."""
        rows, columns = box
        x = np.array([columns.start, columns.stop, columns.start, columns.stop], dtype=np.float64)
        y = np.array([rows.start, rows.start, rows.stop, rows.stop], dtype=np.float64)
        (a, b), (c, d) = self.matrix
        there_x, there_y = a * x + b * y + self.offset[0], c * x + d * y + self.offset[1]

        def around(values: FloatArray) -> slice:
            return slice(max(0, math.floor(values.min()) - 1), max(0, math.ceil(values.max()) + 1))

        return around(there_y), around(there_x)


@dataclass(frozen=True, slots=True, eq=False)
class Mask:
    """Sensor pixels that are left out in every frame, a bit each: a picture of 24 megapixels takes 3 MB."""

    shape: tuple[int, int]
    bits: NDArray[np.uint8]

    @classmethod
    def of(cls, masked: BoolArray) -> Mask:
        """From a picture that is True where pixels are left out, shape (h, w)."""
        return cls((masked.shape[0], masked.shape[1]), np.packbits(masked, axis=1))

    def picture(self) -> BoolArray:
        """True where pixels are left out, shape (h, w)."""
        return np.unpackbits(self.bits, axis=1, count=self.shape[1]).astype(bool)

    def rows(self, rows: slice) -> BoolArray:
        """The same of some rows."""
        return np.unpackbits(self.bits[rows], axis=1, count=self.shape[1]).astype(bool)

    def __or__(self, other: Mask) -> Mask:
        return Mask(self.shape, self.bits | other.bits)

    def moved(self, shift: Shift) -> Mask:
        """Where a frame of that ``shift`` shows what is masked in the view's first frame, to the nearest pixel."""
        height, width = self.shape
        first, there = self.picture(), np.zeros(self.shape, dtype=bool)
        marked = np.flatnonzero(self.bits.any(axis=1))
        columns = slice(0, width)
        rows = (
            shift.moved((slice(int(marked[0]), int(marked[-1]) + 1), columns))[0]
            if len(marked)
            else slice(0, 0)
        )
        x = np.arange(width, dtype=np.float64)
        for row in range(rows.start, min(rows.stop, height)):
            there_x, there_y = shift.back(x, np.full(width, float(row)))
            column, line = np.rint(there_x).astype(np.int64), np.rint(there_y).astype(np.int64)
            inside = (column >= 0) & (column < width) & (line >= 0) & (line < height)
            there[row, inside] = first[line[inside], column[inside]]
        return Mask.of(there)
