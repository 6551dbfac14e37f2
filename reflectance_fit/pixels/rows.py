"""Readings of many pixels as arrays: what frames have in common once, what pixels have each by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

MOST_FRAMES = 65535  # dof is a uint16


@dataclass(frozen=True, slots=True, eq=False)
class PixelRows:
    """m frames of n pixels; no array is copied.

    A flat sample has one number a view for theta and for s, a ball one view with its arrays, a board that was
    tilted several views with theirs.

    Parameters
    ----------
    values, variance : float32, shape (m, n)
        Signals with flats and darks divided out, and the variance of each, above 0, in the same unit squared.
        A NaN in either: that reading is missing.
    view : int, shape (m,)
        Which line of ``theta``, ``cos_2s`` and ``sin_2s`` a frame has.
    gain : int, shape (m,)
        Frames of equal number share one unknown gain, one a pixel; -1: reflectances, gain 1.
    light : float, shape (m, 4)
        Incident Stokes vector in the (s, p) frame of docs/conventions.md, as `Observations` has it.
    diattenuation : float, shape (m,)
        Of the analyzer, 1 for an ideal one.
    analyzer : float, shape (m,)
        Transmission axis, radians counter-clockwise from the picture's horizontal; NaN without an analyzer.
    retarder, retardance : float, shape (m,)
        Fast axis from the picture's horizontal and retardance, radians; NaN without a retarder.
    theta : float32, shape (views, n) or (views, 1)
        Angle of incidence, radians in [0, pi/2].
    cos_2s, sin_2s : float32, shape (views, n) or (views, 1)
        Of twice the angle from the picture's horizontal to the s axis.
    exterior_ior : float
        Index of the medium around the sample; eta and k are reported relative to vacuum.

    Raises
    ------
    ValueError
        Where shapes or types do not fit each other.
    """

    values: Float32Array
    variance: Float32Array
    view: NDArray[np.int64]
    gain: NDArray[np.int64]
    light: FloatArray
    diattenuation: FloatArray
    analyzer: FloatArray
    retarder: FloatArray
    retardance: FloatArray
    theta: Float32Array
    cos_2s: Float32Array
    sin_2s: Float32Array
    exterior_ior: float = 1.0

    def __post_init__(self) -> None:
        m, n = self.values.shape
        for name in ("values", "variance", "theta", "cos_2s", "sin_2s"):
            if getattr(self, name).dtype != np.float32:
                raise ValueError(f"{name} must be float32")
        if self.variance.shape != (m, n):
            raise ValueError(
                f"variance has the shape {self.variance.shape}, values {(m, n)}: make them equal"
            )
        if m > MOST_FRAMES:
            raise ValueError(f"{m} frames are more than {MOST_FRAMES}; average those of equal settings")
        for name in ("view", "gain", "diattenuation", "analyzer", "retarder", "retardance"):
            if getattr(self, name).shape != (m,):
                raise ValueError(f"{name} must have one number a frame: shape ({m},)")
        if self.light.shape != (m, 4):
            raise ValueError(f"light must have one Stokes vector a frame: shape ({m}, 4)")
        views = len(self.theta)
        for name in ("theta", "cos_2s", "sin_2s"):
            if getattr(self, name).shape not in ((views, n), (views, 1)):
                raise ValueError(f"{name} must have the shape ({views}, {n}) or ({views}, 1)")
        if self.cos_2s.shape != self.sin_2s.shape:
            raise ValueError("cos_2s and sin_2s must have equal shapes")
        if m and (self.view.min() < 0 or self.view.max() >= views):
            raise ValueError(f"view must number the {views} lines of theta, from 0")
        if m and self.gain.min() < -1:
            raise ValueError("gain must number the groups of equal gain from 0, or be -1 for reflectances")

    @property
    def turns(self) -> bool:
        """Whether the s axis differs from pixel to pixel."""
        return bool(self.cos_2s.shape[1] > 1)

    def responses(self) -> FloatArray:
        """What each frame reads of R_s, R_p and r_s conj(r_p) = C at gain 1: shape (m, 4, 3).

        A signal is ``sum_q (x_q0 + x_q1 cos 2s + x_q2 sin 2s) q`` over q = R_s, R_p, Re C, Im C.  Where s is one
        direction a view it is in ``x_q0``, and the others are 0.

        The Mueller chain of ``physics.mueller``, multiplied out: behind analyzer and retarder the detector takes
        d . S with d in the picture's frame, and in the frame of s its d1 and d2 turn by 2s.
        """
        d = _detectors(self)
        total, difference = self.light[:, 0] + self.light[:, 1], self.light[:, 0] - self.light[:, 1]
        zero = np.zeros(len(d))
        # d1 and d2 in the frame of s, as factors of (1, cos 2s, sin 2s)
        d1 = np.stack([zero, d[:, 1], d[:, 2]], axis=1)
        d2 = np.stack([zero, d[:, 2], -d[:, 1]], axis=1)
        d0, d3 = np.outer(d[:, 0], [1.0, 0.0, 0.0]), np.outer(d[:, 3], [1.0, 0.0, 0.0])
        l2, l3 = self.light[:, 2, None], self.light[:, 3, None]
        found = np.stack(
            [
                0.5 * total[:, None] * (d0 + d1),
                0.5 * difference[:, None] * (d0 - d1),
                l2 * d2 + l3 * d3,
                l2 * d3 - l3 * d2,
            ],
            axis=1,
        )
        if not self.turns:
            cos, sin = (x[self.view, 0].astype(np.float64)[:, None] for x in (self.cos_2s, self.sin_2s))
            # In the order in which the kernels add, so that a tile of one pixel has the same bits.
            found[:, :, 0] = (found[:, :, 0] + found[:, :, 1] * cos) + found[:, :, 2] * sin
            found[:, :, 1:] = 0.0
        return found


def _detectors(rows: PixelRows) -> FloatArray:
    """d of a signal d . S, S the reflected Stokes vector with S1 along the picture's horizontal: shape (m, 4)."""
    d = np.zeros((len(rows.view), 4))
    bare = np.isnan(rows.analyzer)
    twice = np.where(bare, 0.0, 2 * rows.analyzer)
    d[:, 0] = np.where(bare, 1.0, 0.5)
    half = np.where(bare, 0.0, 0.5 * rows.diattenuation)
    retarded = ~np.isnan(rows.retarder)
    axis = np.where(retarded, 2 * rows.retarder, 0.0)
    delay = np.where(retarded, rows.retardance, 0.0)
    # The analyzer's axis in the retarder's frame; what crosses it is delayed; and back.
    along, across = np.cos(twice - axis), np.sin(twice - axis)
    d[:, 1] = half * (np.cos(axis) * along - np.sin(axis) * across * np.cos(delay))
    d[:, 2] = half * (np.sin(axis) * along + np.cos(axis) * across * np.cos(delay))
    d[:, 3] = half * across * np.sin(delay)
    return d
