"""The outline of a ball in a photograph, to a few hundredths of a pixel: what runs inside the decoding worker.

Across its outline a ball is no even step.  Towards the rim it mirrors ever
more, with the root of the distance, so half of the height is not where the
outline is, by half a pixel and more.  Each sector's pixels are therefore fitted
with a step, a root and a slope that end at the outline, blurred alike.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize, minimize_scalar
from scipy.special import ndtr

from reflectance_fit.capture.outline import Outline
from reflectance_fit.capture.overview import overview
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float64]

_COARSE_PX = 400  # longer side of the picture in which the ball is first looked for
_LEAST_RADIUS = 0.04  # of that side
_SECTORS = 96
_INSIDE, _OUTSIDE = 12.0, 8.0  # pixels to either side of where the outline is thought to be
_SEARCH = 4.0  # how far from there it may be
_STEP, _BIN, _FINE = 0.1, 0.25, 0.02
_LOG_BLURS = (math.log(0.3), math.log(4.0))
_POWERS = (0.5, 1.0, 1.5)
_PLACES = np.arange(-_INSIDE + _BIN / 2, _OUTSIDE, _BIN)
_SHIFTS = np.arange(-_SEARCH, _SEARCH + _STEP / 2, _STEP)
_MIDDLES = (np.arange(_SECTORS) + 0.5) * 2 * math.pi / _SECTORS
_TABLE = np.arange(-_INSIDE - _SEARCH - 1, _OUTSIDE + _SEARCH + 1, _FINE)
_HARMONICS = 3  # an outline in perspective is an ellipse: shift and stretch
_LEAST_GAIN = 25.0  # by how many variances an edge must explain more than a smooth curve does
_LEAST_SHARE = 0.5  # of the sectors
_NOT_SEEN = (
    "does not show the outline of a ball all around; photograph it (role: geometry) before a "
    "darker or brighter ground, or state center_px and radius_px"
)


def ball_in_file(path: Path, reading: Reading) -> Outline:
    """Decode one file and find the ball in it; ReflectanceFitError where its outline is not seen."""
    frame = read_frame(path, reading)
    picture, origin, step = overview(frame)
    points, noise = find_outline(picture)
    height, width = frame.cfa.shape
    return Outline(points * step + np.array(origin), noise * step, (height, width))


def find_outline(picture: FloatArray) -> tuple[FloatArray, float]:
    """Points on the outline of the largest ball, shape (N, 2), pixels of ``picture``; and how far they scatter.

    Raises ReflectanceFitError when less than half of the outline is seen.
    """
    factor = max(1, math.ceil(max(picture.shape) / _COARSE_PX))
    x, y, radius = _circle(_shrunk(picture, factor))
    outline = _Round(x, y, np.array([radius] + [0.0] * (2 * _HARMONICS)))
    while True:
        small = _shrunk(picture, factor)
        for _ in range(2):
            points, noise, outline = _refined(small, outline)
        if factor == 1:
            return points, noise
        finer = max(1, factor // 3)
        outline, factor = outline.scaled(factor / finer), finer


class _Round:
    """A closed curve: its distance from (x, y) as a Fourier series of the direction."""

    def __init__(self, x: float, y: float, series: FloatArray) -> None:
        self.x, self.y, self.series = x, y, series

    def radius(self, direction: FloatArray) -> FloatArray:
        return np.asarray(_waves(direction) @ self.series)

    def scaled(self, factor: float) -> _Round:
        """On a picture ``factor`` times finer: there the first pixel's middle is at (factor - 1) / 2."""
        first = (factor - 1) / 2
        return _Round(self.x * factor + first, self.y * factor + first, self.series * factor)


def _waves(direction: FloatArray) -> FloatArray:
    turns = direction[..., None] * np.arange(1, _HARMONICS + 1)
    return np.concatenate([np.ones((*direction.shape, 1)), np.cos(turns), np.sin(turns)], axis=-1)


def _shrunk(picture: FloatArray, factor: int) -> FloatArray:
    height, width = (side // factor for side in picture.shape)
    blocks = picture[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _circle(picture: FloatArray) -> tuple[float, float, float]:
    """The circle that most edges are on: x, y, radius."""
    import cv2

    dark, bright = np.percentile(picture, (0.5, 99.5))
    if not dark < bright:
        raise ReflectanceFitError(_NOT_SEEN)
    grey = np.sqrt(np.clip((picture - dark) / (bright - dark), 0.0, 1.0))
    longest = max(picture.shape)
    found = cv2.HoughCircles(
        cv2.GaussianBlur(np.round(255 * grey).astype(np.uint8), (0, 0), 1.0),
        cv2.HOUGH_GRADIENT_ALT,
        1.5,
        longest / 4,
        param1=150,
        param2=0.6,
        minRadius=round(_LEAST_RADIUS * longest),
        maxRadius=round(0.6 * longest),
    )
    # None, (1, N, 3) or (N, 3), by OpenCV's version.
    circles = np.zeros((0, 3)) if found is None else np.asarray(found, dtype=np.float64).reshape(-1, 3)
    if not len(circles):
        raise ReflectanceFitError(_NOT_SEEN)
    x, y, radius = circles[np.argmax(circles[:, 2])]
    return float(x), float(y), float(radius)


def _refined(picture: FloatArray, outline: _Round) -> tuple[FloatArray, float, _Round]:
    """Points on the outline near ``outline``, how far it may be off, and the smooth curve through them."""
    profiles, weights = _profiles(*_near(picture, outline))
    waves = _waves(_MIDDLES)
    seen = _seen(profiles, weights)

    def fitted(log_blur: float) -> tuple[float, FloatArray, float]:
        return _joint(_misfits(profiles[seen], weights[seen], math.exp(log_blur)), weights[seen], waves[seen])

    best = minimize_scalar(
        lambda b: fitted(b)[0], bounds=_LOG_BLURS, method="bounded", options={"xatol": 0.02}
    )
    _, change, sigma = fitted(best.x)
    moved = _Round(outline.x, outline.y, outline.series + change)
    radius = moved.radius(_MIDDLES[seen])
    x, y = outline.x + radius * np.cos(_MIDDLES[seen]), outline.y + radius * np.sin(_MIDDLES[seen])
    return np.stack([x, y], axis=-1), sigma, moved


def _seen(profiles: FloatArray, weights: FloatArray) -> NDArray[np.bool_]:
    """Sectors with an edge, and one that lies with the others'."""
    log_blur = minimize_scalar(
        lambda b: np.log(_misfits(profiles, weights, math.exp(b)).min(axis=1)).sum(),
        bounds=_LOG_BLURS,
        method="bounded",
        options={"xatol": 0.1},
    ).x
    misfits = _misfits(profiles, weights, math.exp(log_blur))
    k = np.argmin(misfits, axis=1)
    pixels = weights.sum(axis=1)
    gain = pixels * (_smooth_misfit(profiles, weights) / misfits.min(axis=1) - 1)
    full = np.count_nonzero(weights, axis=1) > len(_PLACES) // 2
    seen = (gain > _LEAST_GAIN) & full & (k > 0) & (k < len(_SHIFTS) - 1)
    waves = _waves(_MIDDLES)
    for _ in range(10):
        if seen.sum() < _LEAST_SHARE * _SECTORS:
            raise ReflectanceFitError(_NOT_SEEN)
        left = _SHIFTS[k] - waves @ np.linalg.lstsq(waves[seen], _SHIFTS[k][seen])[0]
        kept = seen & (np.abs(left) <= max(4 * 1.4826 * float(np.median(np.abs(left[seen]))), 2 * _STEP))
        if np.array_equal(kept, seen):
            break
        seen = kept
    return np.asarray(seen)


def _joint(misfits: FloatArray, weights: FloatArray, waves: FloatArray) -> tuple[float, FloatArray, float]:
    """The smooth change of the outline that all sectors together prefer: minus log likelihood, change, sigma of its mean.

    Each sector's noise is its own, so its misfit counts by its logarithm.
    """
    pixels = weights.sum(axis=1)
    curves = CubicSpline(_SHIFTS, 0.5 * pixels[:, None] * np.log(misfits), axis=1)
    rows = np.arange(len(pixels))

    def at(change: FloatArray, order: int) -> FloatArray:
        places = np.clip(waves @ change, -_SEARCH, _SEARCH)
        return np.asarray(curves(places, order)[rows, rows])

    change: FloatArray = np.asarray(
        np.linalg.lstsq(waves, _SHIFTS[np.argmin(misfits, axis=1)])[0], dtype=np.float64
    )

    def loss(moved: FloatArray) -> tuple[float, FloatArray]:
        return float(at(moved, 0).sum()), np.asarray(waves.T @ at(moved, 1))

    found: Any = minimize(loss, change, jac=True, method="BFGS")
    bend = np.maximum(at(found.x, 2), 0.0)
    covariance = np.linalg.pinv(waves.T @ (bend[:, None] * waves))
    return float(found.fun), np.asarray(found.x), math.sqrt(covariance[0, 0])


def _near(picture: FloatArray, outline: _Round) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Direction from the middle, distance outwards from the outline, and value of the pixels about it."""
    height, width = picture.shape
    reach = float(outline.series[0] + np.abs(outline.series[1:]).sum()) + _OUTSIDE + 2
    rows = slice(max(0, math.floor(outline.y - reach)), min(height, math.ceil(outline.y + reach) + 1))
    columns = slice(max(0, math.floor(outline.x - reach)), min(width, math.ceil(outline.x + reach) + 1))
    y, x = np.mgrid[rows, columns]
    across, down = x - outline.x, y - outline.y
    far = np.hypot(across, down)
    ring = np.abs(far - outline.series[0]) < reach - outline.series[0] + _INSIDE - _OUTSIDE
    direction = np.arctan2(down[ring], across[ring]) % (2 * math.pi)
    distance = far[ring] - outline.radius(direction)
    close = (distance > -_INSIDE) & (distance < _OUTSIDE)
    return direction[close], distance[close], picture[rows, columns][ring][close]


def _profiles(
    direction: FloatArray, distance: FloatArray, value: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean value by sector and distance, and how many pixels it is of, shape (sectors, bins)."""
    sector = np.minimum((direction / (2 * math.pi) * _SECTORS).astype(int), _SECTORS - 1)
    place = ((distance + _INSIDE) / _BIN).astype(int)
    cell = sector * len(_PLACES) + np.minimum(place, len(_PLACES) - 1)
    size = _SECTORS * len(_PLACES)
    weights = np.bincount(cell, minlength=size).astype(np.float64)
    total = np.bincount(cell, weights=value, minlength=size)
    shape = (_SECTORS, len(_PLACES))
    return (total / np.maximum(weights, 1)).reshape(shape), weights.reshape(shape)


def _misfits(profiles: FloatArray, weights: FloatArray, blur: float) -> FloatArray:
    """What a rim at each of the shifts leaves of each sector's profile, shape (sectors, shifts)."""
    return _misfit(profiles, weights, _rim(_PLACES[None] - _SHIFTS[:, None], blur))


def _smooth_misfit(profiles: FloatArray, weights: FloatArray) -> FloatArray:
    """What a curve without an edge leaves."""
    curve = np.vander(_PLACES / _OUTSIDE, 5)
    return _misfit(profiles, weights, curve[None])[:, 0]


def _misfit(profiles: FloatArray, weights: FloatArray, design: FloatArray) -> FloatArray:
    """Weighted squares left by each design, shape (designs, bins, terms), in each sector; shape (sectors, designs)."""
    designs, bins, terms = design.shape
    products = (design[..., :, None] * design[..., None, :]).transpose(1, 0, 2, 3).reshape(bins, -1)
    normal = (weights @ products).reshape(-1, designs, terms, terms)
    right = ((weights * profiles) @ design.transpose(1, 0, 2).reshape(bins, -1)).reshape(-1, designs, terms)
    # A touch of the identity: a sector may have no pixel beyond the edge.
    normal += 1e-10 * (1 + weights.sum(axis=1))[:, None, None, None] * np.eye(terms)
    found = np.linalg.solve(normal, right[..., None])[..., 0]
    square = np.sum(weights * profiles**2, axis=1)
    left = square[:, None] - np.sum(found * right, axis=-1)
    return np.asarray(np.maximum(left, 1e-12 * square[:, None] + 1e-300))


def _rim(distance: FloatArray, blur: float) -> FloatArray:
    """What a blurred rim may look like at distances outwards from it: shape S + (terms,)."""
    t = _TABLE
    kernel_t = np.arange(-round(5 * blur / _FINE), round(5 * blur / _FINE) + 1) * _FINE
    kernel = np.exp(-0.5 * (kernel_t / blur) ** 2)
    pad = len(kernel) // 2
    inside = np.maximum(-(np.arange(-pad, len(t) + pad) * _FINE + t[0]), 0.0)
    powers = [np.convolve(inside**power, kernel / kernel.sum(), mode="valid") for power in _POWERS]
    step = ndtr(-t / blur)
    columns = [np.ones_like(t), t + np.convolve(inside, kernel / kernel.sum(), mode="valid"), step, *powers]
    index = np.rint((distance - t[0]) / _FINE).astype(int)
    return np.asarray(np.stack(columns, axis=-1)[index], dtype=np.float64)
