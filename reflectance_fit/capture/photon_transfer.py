"""Photon transfer: a sensor's gain, read noise and PRNU from pairs of equal frames.

    Var(DN) = a (DN - black) + b,    a = 1 / (electrons a DN),    b = (read noise in DN)^2 + 1/12

What differs between two frames of one scene is noise; what pixels differ by, vignetting and texture are in both and
cancel.  The variance within one frame has all of it, and would pass PRNU off as photons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
T = TypeVar("T", bound=np.generic)

QUANTISATION = 1 / 12  # DN^2, of rounding to whole numbers
_BLOCKS = 16  # across and down: enough that each is evenly lit
_LEAST_SIDE = 8
# Of a block: more clipped pixels than this share, and the variance is too low.
_CLIPPED_SHARE = 1e-3
_USED_SHARE = 0.5
_ROUNDS = 4  # of reweighting, which converges to 1e-4 in two


@dataclass(frozen=True, slots=True, eq=False)
class PairBlocks:
    """Two frames of one scene and exposure, compared block by block; arrays of shape (blocks,).

    With means A and B above black and c = A / B over all blocks, ``variance`` is
    that of A - c B, so it is a ``signal`` + b ``frames``: ``signal`` is
    A + c^2 B and ``frames`` 1 + c^2.  ``level`` is the mean of A and B, DN.
    ``fixed`` is half the product of the two frames' differences between
    neighbours: noise averages out of it, and what pixels differ by is left,
    squared.  ``pixels`` counts those of a block.
    """

    signal: FloatArray
    frames: FloatArray
    variance: FloatArray
    level: FloatArray
    fixed: FloatArray
    pixels: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class PhotonTransfer:
    """The noise of a pixel, a (DN - black) + b, with one standard deviation of each.

    ``slope`` a is in DN an electron, ``floor`` b in DN^2 with the quantisation
    in it; ``dark`` is the variance of a pixel in the darks (b where there are
    none).  ``prnu`` is the relative spread of the pixels' response, NaN where
    nothing says.  ``reduced_chi2`` is 1 for a sensor that follows the model.
    """

    slope: float
    slope_sigma: float
    floor: float
    floor_sigma: float
    dark: float
    prnu: float
    reduced_chi2: float

    def __str__(self) -> str:
        return (
            f"gain {self.gain_e_per_dn:.4g} electrons a DN, read noise {self.read_noise_e:.3g} electrons,"
            f" PRNU {100 * self.prnu:.2g} %"
        )

    @property
    def gain_e_per_dn(self) -> float:
        return 1.0 / self.slope

    @property
    def read_noise_e(self) -> float:
        """Electrons; 0 where quantisation alone makes more noise."""
        return math.sqrt(max(self.dark - QUANTISATION, 0.0)) / self.slope


def compare_pair(
    first: NDArray[np.uint16],
    second: NDArray[np.uint16],
    black: float | NDArray[np.floating[Any]],
    clip: float,
    *,
    dark: bool = False,
    hot: NDArray[np.bool_] | None = None,
) -> PairBlocks:
    """Block statistics of one plane of two frames.

    Parameters
    ----------
    first, second : uint16, shape (h, w)
        Pixels of one filter; neighbours in the array are neighbours of that plane.
    black : float, scalar or shape (h, w)
        DN.
    clip : float
        DN from which a pixel counts as clipped.  So do those at 0, where noise below black is cut off.
    dark : bool
        Frames without light, which have no common scale.
    hot : bool, shape (h, w), optional
        Pixels that are left out: their dark current has a noise of its own.
    """
    side = max(_LEAST_SIDE, min(first.shape) // _BLOCKS)
    rows, columns = first.shape[0] // side, first.shape[1] // side

    def blocks(image: NDArray[T]) -> NDArray[T]:
        """Squares, shape (blocks, side, side); what is left at the edges is not used."""
        cut = image[: rows * side, : columns * side].reshape(rows, side, columns, side)
        return cut.swapaxes(1, 2).reshape(rows * columns, side, side)

    lost = (first >= clip) | (second >= clip) | (first == 0) | (second == 0)
    used = blocks(np.ones(first.shape, dtype=bool) if hot is None else ~hot)
    shares = used.mean(axis=(1, 2)), (blocks(lost) & used).mean(axis=(1, 2))
    kept = (shares[0] >= _USED_SHARE) & (shares[1] <= _CLIPPED_SHARE)
    used = used[kept]
    # In float32 counts are good to 1e-3 DN, at half the memory.
    a, b = (blocks(image.astype(np.float32) - np.float32(black))[kept] for image in (first, second))
    mean_a, mean_b = (counts.mean(axis=(1, 2), dtype=np.float64, where=used) for counts in (a, b))
    if dark and len(a):
        # One level: the weights below would follow its scatter, and favour the blocks that came out dark.
        mean_a, mean_b = (np.full(len(a), mean.mean()) for mean in (mean_a, mean_b))
    scale = 1.0 if dark or not np.sum(mean_b) > 0 else float(np.sum(mean_a) / np.sum(mean_b))
    both = used[:, :, 1:] & used[:, :, :-1]
    fixed = np.mean(np.diff(a, axis=2) * np.diff(b, axis=2), axis=(1, 2), dtype=np.float64, where=both) / 2
    return PairBlocks(
        signal=mean_a + scale**2 * mean_b,
        frames=np.full(len(a), 1 + scale**2),
        variance=np.var(a - np.float32(scale) * b, axis=(1, 2), ddof=1, dtype=np.float64, where=used),
        level=(mean_a + mean_b) / 2,
        fixed=np.asarray(fixed),
        pixels=np.asarray(used.sum(axis=(1, 2)), dtype=np.int64),
    )


def fit_transfer(flats: Sequence[PairBlocks], darks: Sequence[PairBlocks]) -> PhotonTransfer:
    """The line through all blocks of all pairs.

    A variance of n pixels has a relative spread of sqrt(2 / (n - 1)); the line is
    weighted by that of the model, for weighting by the measured variance would
    favour those that came out low.

    Raises ValueError where the blocks have too few levels for a line: one level and no dark.

    Notes
    -----
    EMVA Standard 1288, release 4.0, section 6; the variance of differences of two frames as in
    J. Janesick, Photon Transfer (SPIE, 2007), chapter 5.
    """
    pairs = [*flats, *darks]
    signal, frames, variance, pixels = (
        np.concatenate([np.asarray(getattr(p, name), dtype=float) for p in pairs] or [np.zeros(0)])
        for name in ("signal", "frames", "variance", "pixels")
    )
    if not len(signal) or np.ptp(signal / frames) < 0.05 * np.max(np.abs(signal / frames)):
        raise ValueError("the pairs have one level only; add a pair of darks or of darker flats")
    design = np.stack([signal, frames], axis=1)
    model = variance
    for _ in range(_ROUNDS):
        sigma = np.maximum(model, QUANTISATION) * np.sqrt(2.0 / (pixels - 1))
        covariance = np.linalg.inv((design / sigma[:, None] ** 2).T @ design)
        slope, floor = covariance @ (design / sigma[:, None] ** 2).T @ variance
        model = design @ (slope, floor)
    if not slope > 0:
        raise ValueError("the noise of the flats does not grow with their signal; are they photographs?")
    in_darks = np.concatenate([d.variance / d.frames for d in darks] or [np.zeros(0)])
    return PhotonTransfer(
        slope=float(slope),
        slope_sigma=math.sqrt(covariance[0, 0]),
        floor=max(float(floor), 0.0),
        floor_sigma=math.sqrt(covariance[1, 1]),
        dark=float(in_darks.mean()) if len(in_darks) else max(float(floor), 0.0),
        prnu=_prnu(flats, darks),
        reduced_chi2=float(np.sum(((variance - model) / sigma) ** 2) / max(len(variance) - 2, 1)),
    )


def _prnu(flats: Sequence[PairBlocks], darks: Sequence[PairBlocks]) -> float:
    """Relative spread of the pixels' response: what is fixed in the flats, less that of the darks."""
    dsnu = np.concatenate([d.fixed for d in darks] or [np.zeros(0)])
    offset = float(dsnu.mean()) if len(dsnu) else 0.0
    level = np.concatenate([f.level for f in flats] or [np.zeros(0)])
    if not len(level):
        return math.nan
    fixed = np.concatenate([f.fixed for f in flats]) - offset
    return math.sqrt(max(float(np.sum(level**2 * fixed) / np.sum(level**4)), 0.0))
