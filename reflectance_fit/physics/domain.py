"""Where the formulas of this package hold, checked once at each public function.

Every comparison is written so that NaN fails too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Squares of the index appear in products of two: 1e100 keeps every one of them finite and normal.
LARGEST_INDEX = 1e100
SMALLEST_ETA = 1e-100
BAD_COSINE = "cos_theta_i must be a cosine in [0, 1]; is it an angle in degrees?"


def checked_cosine(cos_theta_i: ArrayLike) -> NDArray[np.float64]:
    """Cosine of an angle of incidence as float64, or ValueError outside [0, 1]."""
    cosine = np.asarray(cos_theta_i, dtype=np.float64)
    if not np.all((cosine >= 0.0) & (cosine <= 1.0)):
        raise ValueError(BAD_COSINE)
    return cosine


def checked_angle(theta_i: ArrayLike) -> NDArray[np.float64]:
    """Angle of incidence in radians as float64, or ValueError outside [0, pi/2]."""
    theta = np.asarray(theta_i, dtype=np.float64)
    if not np.all((theta >= 0.0) & (theta <= np.pi / 2)):
        raise ValueError("theta_i must be in [0, pi/2] radians; is it an angle in degrees?")
    return theta


def checked_angle_deg(theta_i_deg: ArrayLike) -> NDArray[np.float64]:
    """Angle of incidence in degrees as float64, or ValueError outside [0, 90]."""
    theta = np.asarray(theta_i_deg, dtype=np.float64)
    if not np.all((theta >= 0.0) & (theta <= 90.0)):
        raise ValueError("theta_i_deg must be an angle of incidence in [0, 90] degrees from the normal")
    return theta


def checked_eta_minus_one(eta_minus_one: ArrayLike) -> NDArray[np.float64]:
    """Distance of a near-matched index from 1 as float64, or ValueError outside [-0.5, 1]."""
    distance = np.asarray(eta_minus_one, dtype=np.float64)
    if not np.all((distance >= -0.5) & (distance <= 1.0)):
        raise ValueError("eta_minus_one must be in [-0.5, 1]; give an index further from 1 as eta")
    return distance


def checked_index(eta: ArrayLike, k: ArrayLike = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Relative index as float64, or ValueError unless 1e-100 <= eta <= 1e100 and 0 <= k <= 1e100."""
    eta = np.asarray(eta, dtype=np.float64)
    if not np.all((eta >= SMALLEST_ETA) & (eta <= LARGEST_INDEX)):
        raise ValueError("eta must be positive (from 1e-100 to 1e100)")
    return eta, checked_extinction(k)


def checked_extinction(k: ArrayLike) -> NDArray[np.float64]:
    """Extinction coefficient as float64, or ValueError unless 0 <= k <= 1e100."""
    k = np.asarray(k, dtype=np.float64)
    if not np.all((k >= 0.0) & (k <= LARGEST_INDEX)):
        raise ValueError("k must not be negative (0 to 1e100): the index is eta + ik; is yours n - ik?")
    return k


def checked_reflectance(r0: ArrayLike) -> NDArray[np.float64]:
    """Power reflectance as float64, or ValueError outside [0, 1)."""
    value = np.asarray(r0, dtype=np.float64)
    if not np.all((value >= 0.0) & (value < 1.0)):
        raise ValueError("r0 must be a power reflectance in [0, 1); is it in percent?")
    return value
