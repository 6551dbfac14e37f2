"""Where a sensor truly clips: the spike at the top of an overexposed frame's histogram.

The white level of a file is nominal.  A well that fills before the converter
does, or a 12-bit converter in a 16-bit file, clips below it, and a mean over
such pixels would be too low without a sign of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_BANDS = 400  # of cell rows: highlights are small
_MIN_PIXELS = 30
_RATIO = 2.0  # of the spike to as many values below it; without clipping counts fall towards the top
_WIDTH = 0.002  # of the range: pixels do not all clip at one value
_RUN = 32
_LIT = 0.1  # of the top: where shot noise shows
_NOISE_ROWS = 8  # one in so many tells the noise


def measured_white(cfa: NDArray[np.uint16], black: FloatArray, white: FloatArray) -> FloatArray:
    """The lower of the nominal white and the measured clip point, of each pixel of the cell.

    Parameters
    ----------
    cfa : uint16, shape (h, w)
        Raw values, DN.
    black, white : float, shape (n, n)
        Nominal levels of each pixel of the top left cell, DN.

    Returns
    -------
    float, shape (n, n)
        DN; nominal where nothing is clipped, or where frames without noise do not tell.
    """
    n = len(black)
    rows, width = len(cfa) // n, cfa.shape[1] // n * n
    cells = cfa[: rows * n].reshape(rows, n, -1)[:: max(1, rows // _BANDS)]
    found = white.copy()
    for y in range(n):
        for x in range(n):
            dn = np.ascontiguousarray(cells[:, y, x:width:n])
            spike = _spike(dn, float(black[y, x]), float(white[y, x]))
            if spike is not None:
                found[y, x] = spike
    return found


def _spike(dn: NDArray[np.uint16], black: float, white: float) -> float | None:
    """The clip point of one position of the cell, where its pixels show one below ``white``."""
    top = int(dn.max())
    if top >= white or top <= black:
        return None
    widest = max(1, round(_WIDTH * (top - black)))
    if np.count_nonzero(dn > top - widest) < _MIN_PIXELS:
        return None
    noise = _noise_at(dn[::_NOISE_ROWS], black, top, widest)
    # Without noise every even patch is a spike; with it, one that is narrower than noise is none of the scene's.
    if noise < 1.0:
        return None
    width = max(1, min(widest, round(0.5 * noise)))
    spike = int(np.count_nonzero(dn > top - width))
    below = int(np.count_nonzero(dn > top - 2 * width)) - spike
    return float(top - width + 1) if spike >= _MIN_PIXELS and spike > _RATIO * below else None


def _noise_at(dn: NDArray[np.uint16], black: float, top: int, widest: int) -> float:
    """Standard deviation of shot noise at ``top``, DN, from how neighbours differ where there is light."""
    runs = dn[:, : dn.shape[1] // _RUN * _RUN].reshape(-1, _RUN)
    # Clipped pixels have no shot noise.
    light = runs[runs.max(axis=1, initial=0) <= top - widest].astype(np.float32) - np.float32(black)
    mean = light.mean(axis=1)
    lit = mean > _LIT * (top - black)
    if not lit.any():
        return 0.0
    # Second differences, of variance 6, are blind to gradients.
    variance = np.mean(np.diff(light[lit], n=2, axis=1) ** 2, axis=1) / 6
    return float(np.sqrt(np.median(variance / mean[lit]) * (top - black)))
