"""The black level from pixels that no light reaches, for files that state none.

A sensor has such pixels beside its picture.  A DNG lists them as MaskedAreas,
or at least says by its ActiveArea what is not picture.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.tiff import Area

FloatArray = NDArray[np.float64]

_MIN_PIXELS = 400  # of each position of the cell: a black level to a twentieth of read noise
_NEAR = 4  # pixels beside the picture that light leaks into
_SPREAD = 0.01  # of white: dark pixels differ by less
_HIGHEST = 0.2  # of white: no black level is above
_NOISE_ONLY = 1.5  # spread over how neighbours differ: above it there is a picture


def measured_black(
    sensor: NDArray[np.uint16], masked: tuple[Area, ...], origin: tuple[int, int], white: float
) -> FloatArray | None:
    """Mean of the masked pixels by position in the 2 x 2 cell, DN.

    Parameters
    ----------
    sensor : uint16, shape (h, w)
        All pixels of the sensor.
    masked : tuple of (top, left, bottom, right)
        Areas that are stated to be dark; without any, what lies above and to
        the left of the picture, where it proves dark.
    origin : (row, column)
        Where the picture and its cell begin.
    white : float
        Nominal saturation, DN.

    Returns
    -------
    float, shape (2, 2), or None
        None where there are too few such pixels, or they are not dark.

    Notes
    -----
    The mean is over what lies within 5 robust standard deviations of the
    median, which leaves out defects.
    """
    areas = masked or _margins(sensor.shape, origin)
    found = np.empty((2, 2))
    for y in (0, 1):
        for x in (0, 1):
            parts = [_position(sensor, area, (origin[0] + y) % 2, (origin[1] + x) % 2) for area in areas]
            dn = np.concatenate(parts) if parts else np.empty(0)
            if dn.size < _MIN_PIXELS:
                return None
            middle = np.median(dn)
            spread = max(1.4826 * float(np.median(np.abs(dn - middle))), 0.5)
            beside = 1.4826 * float(np.median(np.abs(np.diff(dn)))) / math.sqrt(2)
            dark = spread <= _SPREAD * white and middle <= _HIGHEST * white
            if not dark or spread > _NOISE_ONLY * max(beside, 0.5):
                return None
            found[y, x] = dn[np.abs(dn - middle) <= 5 * spread].mean()
    return found


def _margins(shape: tuple[int, ...], origin: tuple[int, int]) -> tuple[Area, ...]:
    top, left = origin
    return (0, 0, max(0, top - _NEAR), shape[1]), (top, 0, shape[0], max(0, left - _NEAR))


def _position(sensor: NDArray[np.uint16], area: Area, row: int, column: int) -> FloatArray:
    """The pixels of an area in rows and columns of one parity."""
    top, left, bottom, right = area
    rows = slice(top + (row - top) % 2, bottom, 2)
    return sensor[rows, left + (column - left) % 2 : right : 2].astype(np.float64).ravel()
