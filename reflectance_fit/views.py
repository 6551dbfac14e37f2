"""What the analyzer views of one set and angle show together, cell by cell: for pictures, not for fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Singular values below this share of the largest: the axes do not tell the Stokes parameters apart.
_RANK = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class StokesMaps:
    """Stokes parameters of every cell, arrays of shape (h, w), in the picture's frame; NaN where nothing counts.

    ``s1`` and ``s2`` are fractions of ``s0``.  ``redundancy`` is what the
    views say that no Stokes vector can, over ``s0``; None of three views.
    """

    s0: FloatArray
    s1: FloatArray
    s2: FloatArray
    redundancy: FloatArray | None

    @property
    def dolp(self) -> FloatArray:
        """Degree of linear polarization."""
        return np.hypot(self.s1, self.s2)

    @property
    def aolp(self) -> FloatArray:
        """Azimuth of linear polarization in [0, pi), radians counter-clockwise from the picture's horizontal."""
        return np.asarray((0.5 * np.arctan2(self.s2, self.s1)) % np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class ViewMaps:
    """One channel of one view: its Stokes maps, the angles, and what is masked.

    ``left``, ``top`` and ``pitch`` say where the cells are in sensor pixels.
    ``theta`` is the angle of incidence in radians, shape (h, w) or a single
    number; ``inside`` are the sample's cells.  ``masked`` maps a reason to the
    cells of them that are left out for it.
    """

    name: str
    channel: str
    left: int
    top: int
    pitch: int
    stokes: StokesMaps
    theta: FloatArray
    inside: BoolArray
    masked: dict[str, BoolArray]


def stokes_maps(pictures: ArrayLike, axes: ArrayLike, diattenuation: float) -> StokesMaps | None:
    """Stokes parameters by least squares from pictures behind analyzers; None where the axes do not determine them.

    Parameters
    ----------
    pictures : float, shape (views, h, w)
        Signals on one scale; not finite where a cell does not count.
    axes : float, shape (views,)
        Transmission axes, radians counter-clockwise from the picture's horizontal.
    diattenuation : float in (0, 1]

    Notes
    -----
    A view sees (S0 + D (S1 cos 2a + S2 sin 2a)) / 2.  With four views 45
    degrees apart ``redundancy`` is (I0 - I45 + I90 - I135) / (2 S0), signed;
    of more views it is the length of all such combinations.
    """
    signals, a = np.asarray(pictures, dtype=np.float64), np.asarray(axes, dtype=np.float64)
    design = 0.5 * np.stack(
        [np.ones_like(a), diattenuation * np.cos(2 * a), diattenuation * np.sin(2 * a)], axis=1
    )
    left, singular, _ = np.linalg.svd(design, full_matrices=True)
    if len(a) < 3 or singular[2] < _RANK * singular[0]:
        return None
    usable = np.where(np.isfinite(signals).all(axis=0), signals, np.nan)
    s0, s1, s2 = np.tensordot(np.linalg.pinv(design), usable, axes=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        bright = np.where(s0 > 0, s0, np.nan)
        redundancy = None
        if len(a) > 3:
            unexplained = left[:, 3:] * np.where(left[:1, 3:] < 0, -1.0, 1.0)
            parts = np.tensordot(unexplained.T, usable, axes=1) / bright
            redundancy = parts[0] if len(parts) == 1 else np.sqrt(np.sum(parts**2, axis=0))
        return StokesMaps(bright, s1 / bright, s2 / bright, redundancy)
