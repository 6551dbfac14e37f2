"""The outline of a ball in a photograph, to a few hundredths of a pixel: what runs inside the decoding worker.

Across its outline a ball is no even step.  Towards the rim it mirrors ever
more, with the root of the distance, so half of the height is not where the
outline is, by half a pixel and more.  Each sector's pixels are therefore fitted
with a step, a root and a slope that end at the outline, blurred alike.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from reflectance_fit.capture.outline import Outline
from reflectance_fit.capture.overview import overview
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float64]

_COARSE_PX = 400  # longer side of the picture in which the ball is first looked for
_LEAST_RADIUS = 0.04  # of that side
_SECTORS = 96
_WINDOW = 10.0  # pixels to either side of where the outline is thought to be
_SEARCH = 4.0  # how far from there it may be
_STEP = 0.1
_BLURS = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
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
    """Points on the outline near ``outline``, their scatter, and the smooth curve through them."""
    direction, distance, value = _near(picture, outline)
    sector = np.minimum((direction / (2 * math.pi) * _SECTORS).astype(int), _SECTORS - 1)
    order = np.argsort(sector, kind="stable")
    cuts = np.searchsorted(sector[order], np.arange(1, _SECTORS))
    parts = [(distance[i], value[i], direction[i]) for i in np.split(order, cuts)]
    parts = [part for part in parts if len(part[0]) >= 3 * _WINDOW]
    best: tuple[float, list[tuple[float, float]]] = (math.inf, [])
    for blur in _BLURS:
        basis = _Basis(blur)
        edges = [basis.edge(d, v) for d, v, _ in parts]
        # Each sector's noise is its own, so misfits count by their logarithms.
        total = sum(math.log(max(misfit, 1e-300)) for _, misfit, _ in edges)
        if total < best[0]:
            best = (total, [(at, gain) for at, _, gain in edges])
    at = np.array([edge for edge, _ in best[1]])
    seen = np.array([gain > _LEAST_GAIN and abs(edge) < _SEARCH - _STEP for edge, gain in best[1]], dtype=bool)
    middle = np.array([_mean_direction(part[2]) for part in parts])
    waves = _waves(middle)
    for _ in range(10):
        if seen.sum() < _LEAST_SHARE * _SECTORS:
            raise ReflectanceFitError(_NOT_SEEN)
        change = np.linalg.lstsq(waves[seen], at[seen])[0]
        left = at - waves @ change
        scatter = 1.4826 * float(np.median(np.abs(left[seen])))
        kept = seen & (np.abs(left) <= max(4 * scatter, 1e-3))
        if np.array_equal(kept, seen):
            break
        seen = kept
    radius = outline.radius(middle[seen]) + at[seen]
    x, y = outline.x + radius * np.cos(middle[seen]), outline.y + radius * np.sin(middle[seen])
    return np.stack([x, y], axis=-1), scatter, _Round(outline.x, outline.y, outline.series + change)


def _near(picture: FloatArray, outline: _Round) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Direction from the middle, distance outwards from the outline, and value of the pixels about it."""
    height, width = picture.shape
    reach = float(outline.series[0] + np.abs(outline.series[1:]).sum()) + _WINDOW + 2
    rows = slice(max(0, math.floor(outline.y - reach)), min(height, math.ceil(outline.y + reach) + 1))
    columns = slice(max(0, math.floor(outline.x - reach)), min(width, math.ceil(outline.x + reach) + 1))
    y, x = np.mgrid[rows, columns]
    across, down = x - outline.x, y - outline.y
    far = np.hypot(across, down)
    ring = np.abs(far - outline.series[0]) < reach - outline.series[0]
    direction = np.arctan2(down[ring], across[ring]) % (2 * math.pi)
    distance = far[ring] - outline.radius(direction)
    close = np.abs(distance) < _WINDOW
    return direction[close], distance[close], picture[rows, columns][ring][close]


def _mean_direction(direction: FloatArray) -> float:
    return float(direction.mean())  # a sector does not go over the full turn


class _Basis:
    """What a blurred rim may look like, as functions of the distance outwards from the outline."""

    def __init__(self, blur: float) -> None:
        reach = _WINDOW + _SEARCH + 1
        self._t = np.arange(-reach, reach, 0.02)
        kernel_t = np.arange(-5 * blur, 5 * blur + 0.01, 0.02)
        kernel = np.exp(-0.5 * (kernel_t / blur) ** 2)
        kernel /= kernel.sum()
        # Beyond the table by the kernel's width, which is cut off again.
        wide = np.arange(len(self._t) + len(kernel) - 1) * 0.02 + self._t[0] - 5 * blur
        inside = np.maximum(-wide, 0.0)
        root = np.convolve(np.sqrt(inside), kernel, mode="valid")
        slope = np.convolve(inside, kernel, mode="valid")
        n = len(self._t)
        self._columns = np.stack(
            [np.ones(n), ndtr(-self._t / blur), root[:n], slope[:n], self._t + slope[:n]], axis=-1
        )

    def edge(self, distance: FloatArray, value: FloatArray) -> tuple[float, float, float]:
        """Where the outline is, the variance left, and by how many of them it is better than without an edge."""
        places = np.arange(-_SEARCH, _SEARCH + _STEP / 2, _STEP)
        index = np.rint((distance - places[:, None] - self._t[0]) / 0.02).astype(int)
        design = self._columns[np.clip(index, 0, len(self._t) - 1)]
        scale = float(np.abs(value).max()) or 1.0
        target = value / scale
        normal = np.einsum("pni,pnj->pij", design, design)
        right = np.einsum("pni,n->pi", design, target)
        # A touch of the identity: a sector may have no pixel beyond the edge.
        found = np.linalg.solve(normal + 1e-9 * len(target) * np.eye(5), right[..., None])[..., 0]
        misfit = target @ target - 2 * np.sum(found * right, -1) + np.einsum("pi,pij,pj->p", found, normal, found)
        k = int(np.argmin(misfit))
        at = places[k]
        if 0 < k < len(places) - 1:
            before, here, after = misfit[k - 1 : k + 2]
            at += 0.5 * _STEP * (before - after) / (before - 2 * here + after)
        curve = np.polynomial.polynomial.polyvander(distance / _WINDOW, 4)
        without = np.sum((target - curve @ np.linalg.lstsq(curve, target)[0]) ** 2)
        variance = max(float(misfit[k]), 1e-12) / max(len(target) - 7, 1)
        return float(at), variance, float((without - misfit[k]) / variance)
