"""Hot pixels: those that are far brighter than their like in a dark frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reflectance_fit.capture.bins import Mask
from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.errors import Problem, ReflectanceFitError

# Of the pixels' robust spread: noise alone never gets there, and what a pixel of 8 adds to a mean of
# hundreds is below that mean's sigma.
_FAR = 8.0
_LEAST_SPREAD_DN = 0.5  # rounding alone
_MOST = 0.02  # sensors have 0.01 to 0.5 % at the longest exposures


def find_hot(path: Path, reading: Reading) -> Mask:
    """The hot pixels of a dark frame; ReflectanceFitError for what cannot be read or is not dark."""
    return hot_of(read_frame(path, reading), path)


def hot_of(dark: RawFrame, path: Path) -> Mask:
    """The hot pixels of ``dark``, which is the file at ``path``; ReflectanceFitError for what is not dark."""
    mask = hot_pixels(dark)
    if mask is None:
        message = (
            f"is no dark: more than {_MOST:.0%} of its pixels stand out; cover the lens and take it again"
        )
        raise ReflectanceFitError(Problem(str(path), None, message))
    return mask


def hot_pixels(dark: RawFrame) -> Mask | None:
    """Pixels more than 8 robust standard deviations above the median of their position in the cell.

    None where more than 2 % are: such a frame saw light.
    """
    n = len(dark.channels)
    hot = np.zeros(dark.cfa.shape, dtype=bool)
    for y in range(n):
        for x in range(n):
            dn = dark.cfa[y::n, x::n]
            middle = float(np.median(dn))
            spread = 1.4826 * float(np.median(np.abs(dn - np.float32(middle))))
            hot[y::n, x::n] = dn > middle + _FAR * max(spread, _LEAST_SPREAD_DN)
    return None if hot.mean() > _MOST else Mask.of(hot)
