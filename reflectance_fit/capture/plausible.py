"""Whether decoded pixels can be a photograph: damage that no decoder reports, and levels that cannot be.

A file cut or overwritten on a card often decodes without an exception, to
zeros, to one value, or to noise.  Rows spread over the whole height are looked
at, about a megapixel of a large frame, so that a frame of any size costs little.
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


class _Site(NamedTuple):
    """Pixels of one position of the filter cell, in the rows looked at; the last rows are the frame's last."""

    dn: NDArray[np.uint16]
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
    return _no_picture(cfa, sites) or _lost(sites) or _levels(sites) or _noise(sites)


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
            yield _Site(np.ascontiguousarray(sample[:, y, x:width:n]), float(black[y, x]), float(white[y, x]))


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


def _lost(sites: list[_Site]) -> str | None:
    """Parts of the picture without values of their own."""
    # With noise, zeros have ones and twos beside them; where nothing lies between 0 and the picture they are no values.
    share = float(np.mean([_lost_zeros(s) for s in sites]))
    if share > _ZERO_SHARE:
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
