"""From one frame's pixels to a few numbers a bin: what runs inside the decoding worker.

Planes are never mixed and nothing is demosaiced: each pixel counts once, in
the channel whose filter it has.  Values are DN above black.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.raw import RawFrame

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Region:
    """A rectangle of sensor pixels, x1 and y1 exclusive, as one bin; all of the sensor where it is larger."""

    x0: int = 0
    y0: int = 0
    x1: int = 2**31
    y1: int = 2**31


@dataclass(frozen=True, slots=True)
class SphereBins:
    """Rings of the angle of incidence times sectors of the local analyzer angle, on an opaque ball.

    The ball is seen orthographically: sin(theta) is the distance from the
    centre over the radius.  The plane of incidence holds the radius, so s
    runs along the circle.  Pixel centres have integer coordinates.
    ``analyzer`` is the transmission axis in the picture (radians,
    counter-clockwise from its horizontal); ``edges`` are the rings' (radians).
    """

    center_x: float
    center_y: float
    radius: float
    analyzer: float
    edges: tuple[float, ...]
    sectors: int


Bins = Region | SphereBins


@dataclass(frozen=True, slots=True, eq=False)
class PlaneMeans:
    """One colour plane, averaged per bin; arrays of shape (bins,).

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

    ``noise`` maps a plane to (a, b): the variance of a pixel is a * mean + b in
    DN^2, by the file's noise profile; None without one.  ``scatter`` maps a
    plane to its mean (DN above black) and the variance between neighbouring
    pixels, both over the middle half of the sensor.
    """

    bins: tuple[Bins, ...]
    planes: tuple[dict[str, PlaneMeans], ...]
    noise: dict[str, tuple[float, float]] | None
    scatter: dict[str, tuple[float, float]]

    def over(self, bins: Bins) -> dict[str, PlaneMeans]:
        """The planes' means over one of ``bins``."""
        return self.planes[self.bins.index(bins)]


def reduce_frame(frame: RawFrame, bins: tuple[Bins, ...], is_flat: bool = False) -> FrameMeans:
    """Average ``frame`` over each of ``bins``.

    A sample's mean over its flat's is the mean reflectance of a bin weighted by
    the flat, so it belongs to angles weighted alike: those of the flat.
    """
    names = sorted({str(name) for name in frame.pattern.flat})
    noise = None
    if frame.noise_profile is not None:
        # The profile speaks of (DN - black) / (white - black).
        span = {name: frame.white - float(frame.black[frame.pattern == name].mean()) for name in names}
        noise = {name: (s * span[name], o * span[name] ** 2) for name, (s, o) in frame.noise_profile.items()}
    planes = tuple({name: _plane(frame, name, which, is_flat) for name in names} for which in bins)
    return FrameMeans(bins, planes, noise, {name: _scatter(frame, name) for name in names})


def _scatter(frame: RawFrame, name: str) -> tuple[float, float]:
    """Mean, and half the mean squared difference of horizontal neighbours: blind to slow gradients."""
    y, x = np.argwhere(frame.pattern == name)[0]
    height, width = frame.cfa.shape
    rows = slice(height // 4 // 2 * 2 + y, 3 * height // 4, 2)
    columns = slice(width // 4 // 2 * 2 + x, 3 * width // 4, 2)
    dn = frame.cfa[rows, columns].astype(np.float32)
    return float(dn.mean() - frame.black[y, x]), float(0.5 * np.mean(np.diff(dn, axis=1) ** 2))


def _plane(frame: RawFrame, name: str, bins: Bins, is_flat: bool) -> PlaneMeans:
    parts = [_site(frame, y, x, bins, is_flat) for y in (0, 1) for x in (0, 1) if frame.pattern[y, x] == name]
    pixels = np.sum([p.pixels for p in parts], axis=0)

    def pooled(field: str, weights: list[FloatArray]) -> FloatArray:
        total = np.sum([np.nan_to_num(getattr(p, field)) * w for p, w in zip(parts, weights, strict=True)], 0)
        weight = np.sum(weights, axis=0)
        return np.asarray(np.where(weight > 0, total / np.where(weight > 0, weight, 1), np.nan))

    counts = [p.pixels.astype(np.float64) for p in parts]
    levels = [np.nan_to_num(p.mean) * p.pixels for p in parts] if is_flat else counts
    angles = ("theta", "theta_squared", "cos_2phi", "sin_2phi")
    known = isinstance(bins, SphereBins)
    return PlaneMeans(
        pixels=pixels,
        saturated=np.sum([p.saturated for p in parts], axis=0),
        mean=pooled("mean", counts),
        **{a: pooled(a, levels) if known else np.full(len(pixels), np.nan) for a in angles},
    )


def _site(frame: RawFrame, y: int, x: int, bins: Bins, is_flat: bool) -> PlaneMeans:
    """One of the four positions of the filter pattern: every second pixel of every second row."""
    black = float(frame.black[y, x])
    clip = frame.clip[y, x]
    if isinstance(bins, Region):
        rows = slice(bins.y0 + (y - bins.y0) % 2, bins.y1, 2)
        columns = slice(bins.x0 + (x - bins.x0) % 2, bins.x1, 2)
        dn = frame.cfa[rows, columns]
        unknown = np.full(1, np.nan)
        return PlaneMeans(
            pixels=np.array([dn.size]),
            saturated=np.array([np.count_nonzero(dn >= clip)]),
            mean=np.array([dn.mean(dtype=np.float64) - black if dn.size else np.nan]),
            theta=unknown,
            theta_squared=unknown,
            cos_2phi=unknown,
            sin_2phi=unknown,
        )
    # Only the ball's bounding box.
    top, left = (max(0, math.floor(c - bins.radius)) for c in (bins.center_y, bins.center_x))
    rows = slice(top + (y - top) % 2, math.ceil(bins.center_y + bins.radius) + 1, 2)
    columns = slice(left + (x - left) % 2, math.ceil(bins.center_x + bins.radius) + 1, 2)
    dn = frame.cfa[rows, columns]
    down, right = 2 * np.indices(dn.shape)
    across = (columns.start + right - bins.center_x).ravel()
    up = (bins.center_y - rows.start - down).ravel()
    dn = dn.ravel()
    distance = np.hypot(across, up)
    inside = distance < bins.radius * math.sin(bins.edges[-1])
    inside &= distance >= bins.radius * math.sin(bins.edges[0])
    dn, across, up, distance = dn[inside], across[inside], up[inside], distance[inside]
    theta = np.arcsin(distance / bins.radius)
    # s stands a right angle ahead of the outward radius.
    phi = bins.analyzer - (np.arctan2(up, across) + math.pi / 2)
    sector = np.floor(phi % math.pi / math.pi * bins.sectors).astype(np.int64) % bins.sectors
    ring = np.clip(np.searchsorted(bins.edges, theta, side="right") - 1, 0, len(bins.edges) - 2)
    bin_of = ring * bins.sectors + sector
    count = (len(bins.edges) - 1) * bins.sectors
    pixels = np.bincount(bin_of, minlength=count)
    signal = dn - black
    level = np.bincount(bin_of, weights=signal, minlength=count)

    def mean(values: FloatArray) -> FloatArray:
        weights, weight = (signal * values, level) if is_flat else (values, pixels)
        total = np.bincount(bin_of, weights=weights, minlength=count)
        return np.asarray(np.where(weight > 0, total / np.where(weight > 0, weight, 1), np.nan))

    return PlaneMeans(
        pixels=pixels,
        saturated=np.bincount(bin_of, weights=dn >= clip, minlength=count).astype(np.int64),
        mean=np.where(pixels > 0, level / np.maximum(pixels, 1), np.nan),
        theta=mean(theta),
        theta_squared=mean(theta**2),
        cos_2phi=mean(np.cos(2 * phi)),
        sin_2phi=mean(np.sin(2 * phi)),
    )
