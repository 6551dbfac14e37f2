"""What the rim of a ball looks like across its outline, and how badly a rim at each place explains what is seen.

Across its outline a ball is no even step.  Towards the rim it mirrors ever
more, with the root of the distance, so half of the height is not where the
outline is, by half a pixel and more.  In an even surround there is no step at
all, and the outline is where that root begins.  So a rim is what Fresnel's
equations make of it, in terms that are linear, behind the camera's blur.

Notes
-----
Near grazing incidence the amplitude r_p of an index n is (1 - u) / (1 + u) with u = c / b, where c is the
cosine of incidence and b = sqrt(n^2 - 1) / n^2; the power is 1 - 4 w + 4 w^2 in w = u / (1 + u) = c / (c + b).
b is 0.49 for n = 1.3, 0.43 for n = 2: one value serves dielectrics.  r_s goes with c / (b n^2) and needs
the lower powers of w alone, and so do metals, whose rims change little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

INSIDE, OUTSIDE = 12.0, 8.0
"""Pixels to either side of where the outline is thought to be."""
SEARCH = 4.0
"""How far from there it may be, pixels."""
_STEP, _BIN, _FINE = 0.1, 0.25, 0.02
PLACES = np.arange(-INSIDE + _BIN / 2, OUTSIDE, _BIN)
SHIFTS = np.arange(-SEARCH, SEARCH + _STEP / 2, _STEP)
_TABLE = np.arange(-INSIDE - SEARCH - 1, OUTSIDE + SEARCH + 1, _FINE)
_GRAZING = 0.47  # b below


def profiles(
    row: NDArray[np.int64], rows: int, distance: FloatArray, value: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean value by row and distance, and how many pixels it is of, shape (rows, bins)."""
    place = np.minimum(((distance + INSIDE) / _BIN).astype(int), len(PLACES) - 1)
    shape = rows, len(PLACES)
    weights = np.bincount(row * len(PLACES) + place, minlength=rows * len(PLACES)).astype(np.float64)
    total = np.bincount(row * len(PLACES) + place, weights=value, minlength=rows * len(PLACES))
    return (total / np.maximum(weights, 1)).reshape(shape), weights.reshape(shape)


def misfits(means: FloatArray, weights: FloatArray, blur: float, radius: float, *, step: bool) -> FloatArray:
    """Weighted squares that a rim at each of SHIFTS leaves of each profile, shape (rows, shifts).

    ``blur`` is the standard deviation of the camera's, beside that of a pixel's
    own width, ``radius`` the ball's, both in pixels.  With ``step`` the ball's
    brightness at its rim may be another than that beside it.  Both kinds of
    rim have as many terms, so that their misfits compare.
    """
    return _misfit(means, weights, _rim(PLACES[None] - SHIFTS[:, None], blur, radius, step))


def smooth_misfit(means: FloatArray, weights: FloatArray) -> FloatArray:
    """What a curve without an edge leaves of each, shape (rows,)."""
    curve = np.vander(PLACES / OUTSIDE, 5)
    return _misfit(means, weights, curve[None])[:, 0]


def _misfit(means: FloatArray, weights: FloatArray, design: FloatArray) -> FloatArray:
    """Weighted squares left by each design, shape (designs, bins, terms), in each row; shape (rows, designs)."""
    designs, bins, terms = design.shape
    products = (design[..., :, None] * design[..., None, :]).transpose(1, 0, 2, 3).reshape(bins, -1)
    normal = (weights @ products).reshape(-1, designs, terms, terms)
    right = ((weights * means) @ design.transpose(1, 0, 2).reshape(bins, -1)).reshape(-1, designs, terms)
    # A touch of the identity: a row may have no pixel beyond the edge.
    normal += 1e-10 * (1 + weights.sum(axis=1))[:, None, None, None] * np.eye(terms)
    found = np.linalg.solve(normal, right[..., None])[..., 0]
    square = np.sum(weights * means**2, axis=1)
    left = square[:, None] - np.sum(found * right, axis=-1)
    return np.asarray(np.maximum(left, 1e-12 * square[:, None] + 1e-300))


def _rim(distance: FloatArray, blur: float, radius: float, step: bool) -> FloatArray:
    """What a blurred rim may look like at distances outwards from it, pixels: shape S + (terms,)."""
    reach, half = round(5 * blur / _FINE), round(0.5 / _FINE)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * _FINE / blur) ** 2)
    kernel = np.convolve(kernel, np.ones(2 * half + 1))
    kernel /= kernel.sum()
    t = np.arange(-reach - half, len(_TABLE) + reach + half) * _FINE + _TABLE[0]
    inside = np.clip(-t, 0.0, radius)
    cosine = np.sqrt(inside * (2 * radius - inside)) / radius
    w = cosine / (cosine + _GRAZING)
    sharp = [np.ones_like(t), np.maximum(t, 0.0), w, w**2, np.where(t < 0, 1.0, 0.0) if step else w**3]
    blurred = np.stack([np.convolve(term, kernel, mode="valid") for term in sharp], axis=-1)
    return np.asarray(blurred[np.rint((distance - _TABLE[0]) / _FINE).astype(int)], dtype=np.float64)
