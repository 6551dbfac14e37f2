"""Whether decoded pixels can be a photograph: damage that no decoder reports, and levels that cannot be.

A file cut or overwritten on a card often decodes without an exception, to
zeros, to one value, to noise, or to a picture that is shifted from some row
on.  Rows spread over the whole height are looked at, about a megapixel of a
large frame, so that a frame of any size costs little.  What falls on a few
pixels only, no look at pixels can tell: for that there are hashes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_BANDS = 56  # of cell rows, beside the last ones
_LAST = 8
# Pixels that are 0 although black is not: a few are dead, more are lost.
_ZERO_SHARE = 1e-4
# Of the range from black to white.  Black levels drift with temperature by far less than the first;
# clipping is known to lie up to a tenth above the nominal white, so the last leaves room.
_BELOW_MEDIAN, _BELOW, _ABOVE = 0.01, 0.03, 0.25
_STRAY_SHARE = 0.01
_VARIED = 0.1  # of the rows: fewer, and the scene or the test picture is even
# Variance over signal, both as parts of the range, is one over the electrons a pixel holds: cameras
# at their highest ISO come to 0.03, white noise over the whole range to 0.17.
_MOST_NOISE = 0.06
_DIM = 0.1  # below this part of the range read noise counts
_RUN = 32  # pixels of one position in a row, over which light changes little
# A sector of a card, 512 bytes, is twice as many pixels: a run of zeros as long as it has a block of these.
_BLOCK = 128
_APART = 4  # cell rows, over which noise and a lens's picture of anything but upright lines change
# Correlation of noise between such rows: photographs have up to 0.13 where their columns differ, stripes 0.25 and more.
_LIKE, _UNLIKE = 0.2, 0.1
# Of neighbouring columns: behind a blur of 0.7 pixels 0.09 and more, in damage mostly below 0.05.
_BESIDE = 0.08
_LEAST_COLUMNS = 400  # for a correlation to 0.03
_LEAST_ROWS = 3
_LEAST_SPREAD_DN = 2.0  # rounding is no noise


class _Site(NamedTuple):
    """Pixels of one position of the filter cell, in the cell ``rows`` looked at; the last rows are the frame's last."""

    dn: NDArray[np.uint16]
    rows: NDArray[np.int64]
    black: float
    white: float

    @property
    def range(self) -> float:
        return self.white - self.black


def implausible(cfa: NDArray[np.uint16], black: FloatArray, white: FloatArray) -> str | None:
    """Why these cannot be the pixels of a photograph, with what to do; None where they can.

    Parameters
    ----------
    cfa : uint16, shape (h, w)
        Raw values, DN.
    black, white : float, shape (n, n)
        Levels of each pixel of the top left cell, DN.
    """
    if not np.all(black < white):
        return f"its black level {black.max():g} is not below its white level {white.min():g}"
    sites = list(_sites(cfa, black, white))
    return _no_picture(cfa, sites) or _lost(cfa, sites) or _levels(sites) or _noise(sites) or _stripes(sites)


def _sites(cfa: NDArray[np.uint16], black: FloatArray, white: FloatArray) -> Iterator[_Site]:
    n = len(black)
    rows, width = len(cfa) // n, cfa.shape[1] // n * n
    cells = cfa[: rows * n].reshape(rows, n, -1)
    looked_at = np.unique(
        np.r_[np.linspace(0, rows - 1, _BANDS).astype(int), np.arange(max(0, rows - _LAST), rows)]
    )
    sample = cells[looked_at]
    for y in range(n):
        for x in range(n):
            dn = np.ascontiguousarray(sample[:, y, x:width:n])
            yield _Site(dn, looked_at, float(black[y, x]), float(white[y, x]))


def _no_picture(cfa: NDArray[np.uint16], sites: list[_Site]) -> str | None:
    # A hopelessly overexposed frame is alike everywhere too, and counts as saturated.
    if all(s.dn.min() == s.dn.max() < s.white for s in sites) and _constant(cfa, len(sites)):
        values = ", ".join(f"{v}" for v in sorted({int(s.dn[0, 0]) for s in sites}))
        return (
            f"every pixel is {values}: there is no picture; copy it from the camera again, or expose it less"
        )
    return None


def _constant(cfa: NDArray[np.uint16], positions: int) -> bool:
    """Whether each position of the cell has one value throughout."""
    n = math.isqrt(positions)
    height, width = (side // n * n for side in cfa.shape)
    return bool(np.all(cfa[:height, :width].reshape(height // n, n, width // n, n) == cfa[:n, None, :n]))


def _lost(cfa: NDArray[np.uint16], sites: list[_Site]) -> str | None:
    """Parts of the picture without values of their own."""
    # With noise, zeros have ones and twos beside them; where nothing lies between 0 and the picture they are no values.
    share = float(np.mean([_lost_zeros(s) for s in sites]))
    runs = cfa.reshape(-1)[: cfa.size // _BLOCK * _BLOCK].reshape(-1, _BLOCK)
    if share > _ZERO_SHARE or (min(s.black for s in sites) >= 1 and not runs.any(axis=1).all()):
        return (
            "many of its pixels are 0, far below black: a part of it is lost; copy it from the camera again"
        )
    last = [s.dn[-_LAST:] for s in sites]
    same = all(
        bool(np.all(rows == rows[0, 0])) and rows[0, 0] < s.white for rows, s in zip(last, sites, strict=True)
    )
    varied = any(np.mean(np.any(s.dn != s.dn[:, :1], axis=1)) > _VARIED for s in sites)
    if same and varied and all(len(s.dn) > 2 * _LAST for s in sites):
        return "its last rows all have one value: its end is lost; copy it from the camera again"
    return None


def _lost_zeros(s: _Site) -> float:
    zeros, next_to = np.count_nonzero(s.dn == 0), np.count_nonzero(s.dn < s.black / 4)
    return zeros / s.dn.size if s.black >= 1 and zeros > 4 * (next_to - zeros) else 0.0


def _levels(sites: list[_Site]) -> str | None:
    """Black above the picture, or white below it."""
    for s in sites:
        median = float(np.median(s.dn))
        below = float(np.mean(s.dn < s.black - _BELOW * s.range))
        if median < s.black - _BELOW_MEDIAN * s.range:
            return (
                f"its black level {s.black:g} is above the picture, whose median is {median:g}; "
                "state camera.black_dn"
            )
        if below > _STRAY_SHARE:
            return (
                f"{100 * below:.2g} % of its pixels are far below its black level {s.black:g}; "
                "state camera.black_dn, or copy it from the camera again"
            )
        above = float(np.mean(s.dn > s.white + _ABOVE * s.range))
        if above > _STRAY_SHARE:
            return (
                f"{100 * above:.2g} % of its pixels are far above its white level {s.white:g}; "
                "state camera.white_dn"
            )
    return None


def _noise(sites: list[_Site]) -> str | None:
    """Noise that no light makes: the typical variance between neighbours, against what they see."""
    typical = [_scatter(s) for s in sites if s.dn.shape[1] >= _RUN]
    if typical and float(np.median(np.concatenate(typical))) > _MOST_NOISE:
        return (
            "its pixels are noise: neighbours differ as no light makes them; it was read with a wrong layout "
            "or is damaged; copy it from the camera again"
        )
    return None


def _scatter(s: _Site) -> FloatArray:
    """Half the mean square difference of neighbours over the signal, both as parts of the range, of each run."""
    runs = s.dn[:, : s.dn.shape[1] // _RUN * _RUN].reshape(-1, _RUN)
    light = (runs.astype(np.float32) - np.float32(s.black)) / np.float32(s.range)
    variance = 0.5 * np.mean(np.diff(light, axis=1) ** 2, axis=1)
    return np.asarray(variance / np.maximum(light.mean(axis=1), _DIM), dtype=np.float64)


def _stripes(sites: list[_Site]) -> str | None:
    """Noise of one row that is that of the rows below it, from some row to the end.

    Lossless JPEG states each pixel as a difference from those above and to the left: after a wrong one, what was
    lost goes on down to the last row.  A scene of upright lines does so as well, but a lens shows each line in two
    neighbouring columns, which the code keeps apart.
    """
    if sites[0].dn.shape[1] < _LEAST_COLUMNS:
        return None
    noise = [_smallest(s) for s in sites]
    likeness = np.mean([_correlation(one[:-1], one[1:]) for one in noise], axis=0)
    from_here = np.minimum.accumulate(likeness[::-1])[::-1] > _LIKE
    for first in range(_LEAST_ROWS, len(likeness) - _LEAST_ROWS + 1):
        if from_here[first] and np.median(likeness[:first]) < _UNLIKE:
            if abs(_beside(noise, first)) > _BESIDE:
                return None
            return (
                "from some row on its pixels repeat those above: a part of it is damaged; "
                "copy it from the camera again"
            )
    return None


def _beside(noise: list[FloatArray], first: int) -> float:
    """Correlation of each column with the next one, of other pixels of the cell, in the row below."""
    n = math.isqrt(len(noise))
    found = []
    for at, one in enumerate(noise):
        last = at % n == n - 1
        left, right = (one[:, :-1], noise[at + 1 - n][:, 1:]) if last else (one, noise[at + 1])
        found.append(np.mean(_correlation(left[:-1], right[1:])[first:]))
    return float(np.mean(found))


def _smallest(s: _Site) -> FloatArray:
    """What is noise in rows that lie apart, 0 where there is more than noise or nothing but rounding."""
    apart = np.flatnonzero(np.diff(s.rows) >= _APART)
    dn = s.dn[np.r_[apart, apart[-1:] + 1]].astype(np.float32)
    # What a lens shows changes little from pixel to pixel; twice their differences are noise, but at edges.
    noise = dn[:, 2:] - 2 * dn[:, 1:-1] + dn[:, :-2]
    spread = 1.4826 * np.median(np.abs(noise), axis=1, keepdims=True)
    return np.asarray(np.where((np.abs(noise) < 1.5 * spread) & (spread > _LEAST_SPREAD_DN), noise, 0.0))


def _correlation(one: FloatArray, other: FloatArray) -> FloatArray:
    """Of rows of mean 0, shape (rows,), over what is 0 in neither; 0 where there is nothing."""
    both = (one != 0) & (other != 0)
    norm = np.sqrt(np.sum(one**2 * both, axis=1) * np.sum(other**2 * both, axis=1))
    return np.asarray(np.sum(one * other, axis=1) / np.maximum(norm, 1.0), dtype=np.float64)
