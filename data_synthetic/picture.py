"""From a scene to what falls on the sensor: pixels of finite size, a lens that blurs, a wedge that shifts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

from .sensor import FloatArray, Sensor

Floats = NDArray[np.float64]

# Points in a pixel that sees an edge: a Fibonacci lattice (I. H. Sloan and S. Joe, Lattice Methods for Multiple
# Integration, 1994).  Its rows and columns are evenly spaced with a point each, so an edge along either is
# met to 1/110 of a pixel.
_POINTS, _STEP = 55, 34
_FINE = (np.stack([np.arange(_POINTS), np.arange(_POINTS) * _STEP % _POINTS], axis=1) + 0.5) / _POINTS - 0.5
# Gauss-Legendre, two by two: a mean to the third order.
_GAUSS = tuple((dx / math.sqrt(12), dy / math.sqrt(12)) for dx in (-1, 1) for dy in (-1, 1))
# At a time, because the arrays in between are large.
_ROWS = 64
_EDGE_PIXELS = 300


@dataclass(frozen=True, slots=True)
class Optics:
    """What lies between the scene and the sensor.

    Parameters
    ----------
    focal_px : float or None
        Focal length, the principal point in the middle; None for a view from
        afar without perspective.  A board needs one.
    blur_px : float
        Standard deviation of the lens's Gaussian point spread, pixels.
    wedge_px : float
        How far the analyzer's faces, not quite parallel, throw the picture;
        the direction turns with the analyzer.
    """

    focal_px: float | None = None
    blur_px: float = 0.0
    wedge_px: float = 0.0

    def shift_px(self, analyzer_deg: float) -> tuple[float, float]:
        """By how much x and y of every point grow behind an analyzer at this angle."""
        angle = np.radians(analyzer_deg)
        return float(self.wedge_px * np.cos(angle)), float(-self.wedge_px * np.sin(angle))


class Scene(Protocol):
    """What `scenes` and `perspective` have in common; points x, y broadcast to S."""

    def stokes(self, x: ArrayLike, y: ArrayLike, eta: ArrayLike, k: ArrayLike) -> Floats:
        """Stokes vectors at points where the sample's index is eta + ik (shape C), shape C + S + (4,)."""

    def part(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
        """A number for what is seen at points, shape S: between equal ones light changes little."""

    @property
    def is_curved(self) -> bool:
        """Whether the angle of incidence changes so much over a pixel that its middle does not stand for it."""


def stokes_image(
    scene: Scene,
    sensor: Sensor,
    indices: Mapping[str, tuple[float, float]],
    optics: Optics,
    shift_px: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """The scene where the pixels are, each in its own colour.

    Parameters
    ----------
    indices : colour to (eta, k)
        Of the sample, relative to vacuum.
    shift_px : float, float
        By how much the picture is to the right and lower.

    Returns
    -------
    float32, shape (height, width, 4)
    """
    image = np.empty((sensor.height, sensor.width, 4), dtype=np.float32)
    x = np.arange(sensor.width, dtype=np.float64) - shift_px[0]
    y = np.arange(sensor.height, dtype=np.float64)[:, None] - shift_px[1]
    edges = _edges(scene, x[0], y[0, 0], image.shape[:2])
    if not optics.blur_px:
        for rows, columns, colour, _ in sensor.cell():
            eta, k = indices[colour]
            image[rows, columns] = _pixels(scene, x[columns], y[rows], edges[rows, columns], eta, k)
        return image
    # A lens knows nothing of colour filters: light of neighbouring pixels comes in, whatever theirs.
    eta, k = np.array(list(indices.values())).T
    sharp = _pixels(scene, x, y, edges, eta, k)
    blurred = dict(
        zip(indices, gaussian_filter(sharp, optics.blur_px, axes=(1, 2), mode="nearest"), strict=True)
    )
    for rows, columns, colour, _ in sensor.cell():
        image[rows, columns] = blurred[colour][rows, columns]
    return image


def _edges(scene: Scene, left: float, top: float, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which pixels see more than one part, by their corners; ``left`` and ``top`` are of the first one's centre."""
    height, width = shape
    part = scene.part(left - 0.5 + np.arange(width + 1), top - 0.5 + np.arange(height + 1)[:, None])
    corners = [part[:-1, :-1], part[:-1, 1:], part[1:, :-1], part[1:, 1:]]
    return np.asarray(np.any([corner != corners[0] for corner in corners[1:]], axis=0))


def _pixels(
    scene: Scene, x: Floats, y: Floats, edges: NDArray[np.bool_], eta: ArrayLike, k: ArrayLike
) -> FloatArray:
    """Means over pixels centred at x (w,) and y (h, 1), shape C + (h, w, 4): one point where it stands for all."""
    image = np.empty((*np.shape(eta), *edges.shape, 4), dtype=np.float32)
    for first in range(0, len(y), _ROWS):
        rows = slice(first, first + _ROWS)
        points = _GAUSS if scene.is_curved else ((0.0, 0.0),)
        image[..., rows, :, :] = sum(scene.stokes(x + dx, y[rows] + dy, eta, k) for dx, dy in points) / len(
            points
        )
    at_y, at_x = np.nonzero(edges)
    for first in range(0, len(at_x), _EDGE_PIXELS):
        of_y, of_x = (z[first : first + _EDGE_PIXELS] for z in (at_y, at_x))
        fine = x[of_x][:, None] + _FINE[:, 0], y[of_y, 0][:, None] + _FINE[:, 1]
        image[..., of_y, of_x, :] = scene.stokes(*fine, eta, k).mean(axis=-2)
    return image
