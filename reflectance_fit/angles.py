"""Degrees at the border, radians inside, and cosines that keep their digits near 90 degrees."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def cos_sin_deg(theta_deg: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine of angles in degrees in [0, 90], any shape, each to about one ulp.

    Above 45 degrees the cosine is the sine of the complement: 90 - theta_deg
    is exact there (Sterbenz), so grazing angles lose nothing.
    """
    theta = np.asarray(theta_deg, dtype=float)
    complement = np.radians(90.0 - theta)
    direct = np.radians(theta)
    steep = theta > 45.0
    return np.where(steep, np.sin(complement), np.cos(direct)), np.where(
        steep, np.cos(complement), np.sin(direct)
    )
