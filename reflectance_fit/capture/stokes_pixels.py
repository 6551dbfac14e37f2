"""Stokes vectors of signals behind analyzers: of every pixel by itself, or of the means over a region.

A signal behind an ideal half of unpolarized light is (S0 + D (S1 cos 2a + S2 sin 2a)) / 2, as in physics.stokes;
a is the transmission axis, counter-clockwise from the picture's horizontal, and so S1 > 0 is light that
vibrates along it.  S3 passes a linear analyzer unseen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.stokes import checked_diattenuation

FloatArray = NDArray[np.float64]

_SAME_AXIS = math.radians(0.01)


@dataclass(frozen=True, slots=True, eq=False)
class StokesFit:
    """The best Stokes vectors of a stack of signals.

    ``stokes`` has shape (..., 3): S0, S1, S2 in the unit of the signals;
    ``covariance`` shape (..., 3, 3).  ``chi2`` is what the signals differ from
    the vector's by, in standard deviations squared, with ``dof`` degrees of
    freedom.  NaN where a signal is NaN.
    """

    stokes: FloatArray
    covariance: FloatArray
    chi2: FloatArray
    dof: int

    @property
    def dolp(self) -> FloatArray:
        """Degree of linear polarization; noise alone gives about its sigma, so below that it says nothing."""
        s0, s1, s2 = np.moveaxis(self.stokes, -1, 0)
        return np.asarray(np.hypot(s1, s2) / s0)

    @property
    def dolp_sigma(self) -> FloatArray:
        s0, s1, s2 = np.moveaxis(self.stokes, -1, 0)
        linear = np.hypot(s1, s2)
        return self._sigma(np.stack([-linear / s0**2, s1 / (linear * s0), s2 / (linear * s0)], axis=-1))

    @property
    def aolp(self) -> FloatArray:
        """Angle of linear polarization, radians in (-pi/2, pi/2], counter-clockwise from the horizontal."""
        return np.asarray(0.5 * np.arctan2(self.stokes[..., 2], self.stokes[..., 1]))

    @property
    def aolp_sigma(self) -> FloatArray:
        """Radians; meaningless where it nears 1, as without polarization."""
        _, s1, s2 = np.moveaxis(self.stokes, -1, 0)
        twice = 2.0 * (s1**2 + s2**2)
        return self._sigma(np.stack([np.zeros_like(s1), -s2 / twice, s1 / twice], axis=-1))

    def _sigma(self, gradient: FloatArray) -> FloatArray:
        """Of a function of the vector with this gradient, to first order."""
        return np.asarray(np.sqrt(np.einsum("...i,...ij,...j->...", gradient, self.covariance, gradient)))


def fit_stokes(
    signal: ArrayLike, variance: ArrayLike, axis: ArrayLike, diattenuation: ArrayLike = 1.0
) -> StokesFit:
    """Weighted least squares over the first axis.

    Parameters
    ----------
    signal : float, shape (n, ...)
        Signals behind n analyzers, one unknown scene for each of the other positions.
    variance : float, broadcastable to signal
        Above 0.  Without correlations between the n.
    axis : float, shape (n,)
        Transmission axes, radians; three of them in different directions.
    diattenuation : float, broadcastable to (n,)
        Of the analyzers, above 0 to 1.

    Raises
    ------
    ValueError
        For fewer than three directions, and variances that are not above 0.

    Notes
    -----
    J. S. Tyo, "Design of optimal polarimeters: maximization of signal-to-noise ratio and minimization of
    systematic error", Applied Optics 41, 619 (2002); its analyzer vectors are the rows of A here.

    Examples
    --------
    >>> found = fit_stokes([1.0, 0.5, 0.0, 0.5], 1e-4, np.radians([0, 45, 90, 135]))
    >>> print(np.round(found.stokes, 3), f"{found.dolp:.3f} +- {found.dolp_sigma:.3f}")
    [1. 1. 0.] 1.000 +- 0.017
    """
    values = np.asarray(signal, dtype=np.float64)
    axes = np.asarray(axis, dtype=np.float64)
    d = np.broadcast_to(checked_diattenuation(diattenuation), axes.shape)
    a = 0.5 * np.stack([np.ones_like(axes), d * np.cos(2 * axes), d * np.sin(2 * axes)], axis=-1)
    if len(axes) < 3 or np.linalg.matrix_rank(a, tol=1e-6) < 3:
        raise ValueError("a Stokes vector needs signals behind three axes that differ; add analyzer angles")
    variances = np.broadcast_to(np.asarray(variance, dtype=np.float64), values.shape)
    if np.any(variances <= 0):
        raise ValueError("variances must be above 0; add the read noise and the quantisation")
    weight = 1.0 / variances
    normal = np.tensordot(weight, a[:, :, None] * a[:, None, :], axes=(0, 0))
    # Not solvable where a signal is missing: those are told apart by the result, which is NaN anyway.
    lost = ~np.isfinite(normal).all(axis=(-2, -1), keepdims=True)
    covariance = np.where(lost, np.nan, np.linalg.inv(np.where(lost, np.eye(3), normal)))
    stokes = np.einsum("...ij,...j->...i", covariance, np.tensordot(weight * values, a, axes=(0, 0)))
    rest = values - np.tensordot(a, stokes, axes=(1, -1))
    return StokesFit(stokes, covariance, np.asarray(np.sum(weight * rest**2, axis=0)), len(axes) - 3)


class Redundancy(NamedTuple):
    """I0 + I90 against I45 + I135, which are both S0 in any light.

    ``difference`` is I0 + I90 - I45 - I135 in the unit of the signals, ``z`` the same in its standard
    deviations; ``imbalance`` is (I0 + I90) / (I45 + I135) - 1.
    """

    difference: FloatArray
    z: FloatArray
    imbalance: FloatArray


def redundancy(signal: ArrayLike, variance: ArrayLike, axis: ArrayLike) -> Redundancy:
    """Whether four signals behind two crossed pairs of analyzers agree on the whole power.

    Parameters as of ``fit_stokes`` with n = 4; the axes, in any order, are two pairs at right angles, and the
    pair with the axis nearest to the horizontal counts as 0 and 90.  Equal diattenuations drop out.

    Raises ValueError for other axes: without two pairs there is nothing to compare.

    Examples
    --------
    >>> found = redundancy([1.02, 0.5, 0.0, 0.5], 1e-4, np.radians([0, 45, 90, 135]))
    >>> print(f"{found.imbalance:.3f} z {found.z:.1f}")
    0.020 z 1.0
    """
    values = np.asarray(signal, dtype=np.float64)
    first, second = crossed_pairs(np.asarray(axis, dtype=np.float64))
    one, other = values[first].sum(axis=0), values[second].sum(axis=0)
    total = np.broadcast_to(np.asarray(variance, dtype=np.float64), values.shape).sum(axis=0)
    difference = one - other
    # Where there is no light there is no ratio.
    lit = other > 0
    imbalance = np.where(lit, difference / np.where(lit, other, 1.0), np.nan)
    return Redundancy(np.asarray(difference), np.asarray(difference / np.sqrt(total)), imbalance)


def crossed_pairs(axis: FloatArray) -> tuple[list[int], list[int]]:
    """Indices of the two pairs at right angles among four axes (radians); see ``redundancy``."""
    order = sorted(range(len(axis)), key=lambda j: abs(math.remainder(axis[j], math.pi)))
    if len(order) == 4:
        nearest = order[0]
        partners = [j for j in order[1:] if _crossed(axis[nearest], axis[j])]
        rest = sorted(set(order[1:]) - set(partners))
        if len(partners) == 1 and _crossed(axis[rest[0]], axis[rest[1]]):
            return [nearest, partners[0]], rest
    raise ValueError("the axes are not two pairs at right angles; the redundancy test needs those")


def _crossed(one: float, other: float) -> bool:
    return abs(abs(math.remainder(one - other, math.pi)) - math.pi / 2) < _SAME_AXIS
