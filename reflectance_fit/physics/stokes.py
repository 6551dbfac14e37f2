"""Stokes vectors, shape (..., 4), in the (s, p) frame of a ray.

The receiver looks at the source; p = ray direction x s.  S1 > 0 is s, S2 > 0
is halfway from s towards p, S3 = 2 Im(E_s conj(E_p)) > 0 is right circular:
the field turns clockwise for the receiver.  Time factor exp(-i omega t).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def unpolarized() -> Floats:
    """Unpolarized light of power 1."""
    return np.array([1.0, 0.0, 0.0, 0.0])


def linear(angle: ArrayLike) -> Floats:
    """Linearly polarized light of power 1, shape (..., 4); angle in radians from s towards p.

    ``linear(0)`` is s, ``linear(pi/2)`` is p, and ``linear(pi/4)`` is all S2.
    """
    double = 2.0 * _finite("angle", angle)
    return np.stack([np.ones_like(double), np.cos(double), np.sin(double), np.zeros_like(double)], axis=-1)


def circular(hand: Literal["right", "left"]) -> Floats:
    """Circularly polarized light of power 1: right has S3 = 1."""
    if hand not in ("right", "left"):
        raise ValueError(f"the hand of circular light is 'right' or 'left', not {hand!r}")
    return np.array([1.0, 0.0, 0.0, 1.0 if hand == "right" else -1.0])


def dolp(stokes: ArrayLike) -> Floats:
    """Degree of linear polarization sqrt(S1^2 + S2^2) / S0, in [0, 1] for physical light; NaN without light."""
    s0, s1, s2, _ = _components(stokes)
    return _over(np.hypot(s1, s2), s0)


def aolp(stokes: ArrayLike) -> Floats:
    """Angle of linear polarization in radians from s towards p, in [0, pi); 0 where there is none."""
    _, s1, s2, _ = _components(stokes)
    angle = np.mod(0.5 * np.arctan2(s2, s1), np.pi)
    # The remainder of a tiny negative angle rounds up to pi itself.
    return np.where(angle >= np.pi, 0.0, angle)[()]


def docp(stokes: ArrayLike) -> Floats:
    """Degree of circular polarization S3 / S0, in [-1, 1]: positive is right; NaN without light."""
    s0, _, _, s3 = _components(stokes)
    return _over(s3, s0)


def analyzer_signal(stokes: ArrayLike, phi: ArrayLike, diattenuation: ArrayLike = 1.0) -> Floats:
    """Power behind a linear analyzer, (S0 + D (S1 cos 2 phi + S2 sin 2 phi)) / 2.

    Parameters
    ----------
    stokes : float, shape (..., 4)
    phi : float, broadcastable to stokes' leading shape
        Transmission axis in radians from s towards p, counter-clockwise for the receiver.
    diattenuation : float, broadcastable likewise
        (T_max - T_min) / (T_max + T_min), in [0, 1].

    Notes
    -----
    S3 does not appear: a linear analyzer is blind to it, and so to the sign of i.

    Examples
    --------
    >>> print(analyzer_signal(linear(0.0), 0.0), analyzer_signal(unpolarized(), 0.3))
    1.0 0.5
    """
    s0, s1, s2, _ = _components(stokes)
    double = 2.0 * _finite("phi", phi)
    d = checked_diattenuation(diattenuation)
    result: Floats = (s0 + d * (s1 * np.cos(double) + s2 * np.sin(double))) / 2.0
    return result[()]


def checked_diattenuation(diattenuation: ArrayLike) -> Floats:
    """Diattenuation as float64, or ValueError outside [0, 1]."""
    value = np.asarray(diattenuation, dtype=np.float64)
    if not np.all((value >= 0.0) & (value <= 1.0)):
        raise ValueError("diattenuation must be in [0, 1]; is it an extinction ratio or in percent?")
    return value


def _components(stokes: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
    value = np.asarray(stokes, dtype=np.float64)
    if value.ndim == 0 or value.shape[-1] != 4:
        raise ValueError(f"a Stokes vector has 4 numbers in its last axis; the shape is {value.shape}")
    return value[..., 0], value[..., 1], value[..., 2], value[..., 3]


def _over(part: Floats, whole: Floats) -> Floats:
    lit = whole > 0.0
    return np.where(lit, part / np.where(lit, whole, 1.0), np.nan)[()]


def _finite(name: str, angle: ArrayLike) -> Floats:
    value = np.asarray(angle, dtype=np.float64)
    if not np.all(np.isfinite(value)):
        raise ValueError(f"{name} must be finite (radians)")
    return value
