"""How good an analyzer is and where its axis lies, from photographs of a polarized lamp through it.

Malus with a real polarizer: the signal is proportional to 1 + D P cos 2(a + e - L), where D is the analyzer's
diattenuation, a its stated axis and e the error of that, P and L the source's degree and direction of
polarization.  Only a source that is known tells D from P and e from L.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.capture.stokes_pixels import fit_stokes

FloatArray = NDArray[np.float64]

_SAME_AXIS = math.radians(0.5)


@dataclass(frozen=True, slots=True)
class PolarizerFit:
    """What a series says, with one standard deviation of each.

    ``diattenuation`` is at most 1.  ``axis_error`` (radians, in (-pi/2, pi/2])
    is what the stated axis falls short of the true one, counter-clockwise;
    NaN where the series cannot tell.
    """

    diattenuation: float
    diattenuation_sigma: float
    axis_error: float
    axis_error_sigma: float

    @property
    def is_resolved(self) -> bool:
        """Whether the leakage 1 - D stands out of the noise; else D is as good as 1."""
        return 1.0 - self.diattenuation > self.diattenuation_sigma

    @property
    def extinction_ratio(self) -> float:
        """Parallel over crossed transmittance, (1 + D) / (1 - D)."""
        rest = 1.0 - self.diattenuation
        return (1.0 + self.diattenuation) / rest if rest > 0 else math.inf


def fit_polarizer(
    signal: ArrayLike, variance: ArrayLike, angle: ArrayLike, source_dolp: float = 1.0
) -> PolarizerFit:
    """Diattenuation and error of the axis from a Malus series, or diattenuation from a crossed pair.

    Parameters
    ----------
    signal, variance : float, shape (n,)
        Darks subtracted and of one lamp: what is left of a dark looks like leakage.
    angle : float, shape (n,)
        Stated axis of the analyzer minus the source's direction, radians; the axis alone where the direction is
        not known (then ``axis_error`` is minus the source's direction).
    source_dolp : float
        Above 0 to 1; below 1 it is divided out.

    Raises
    ------
    ValueError
        For fewer than three different axes, unless there are two at right angles.

    Notes
    -----
    The weights make the crossed frames, whose noise is least, decide D; scatter beyond the noise (a lamp that
    flickers, an axis set by hand) widens both sigmas by the root of the reduced chi squared.  A pair that is
    turned by e from the source's direction shows D cos 2e: 2 degrees look like an extinction ratio of 820.

    Examples
    --------
    >>> a = np.radians([0, 30, 60, 90, 120, 150])
    >>> found = fit_polarizer(1 + 0.98 * np.cos(2 * a - 0.2), 1e-6, a)
    >>> print(f"{found.diattenuation:.3f} {found.extinction_ratio:.0f} {found.axis_error:.2f} rad")
    0.980 99 -0.10 rad
    """
    if not 0 < source_dolp <= 1:
        raise ValueError("the source's degree of polarization must be above 0 and at most 1")
    values, angles = np.asarray(signal, dtype=float), np.asarray(angle, dtype=float)
    variances = np.broadcast_to(np.asarray(variance, dtype=float), values.shape)
    directions = _directions(angles)
    if len(directions) == 2 and abs(math.cos(directions[1] - directions[0])) < math.sin(_SAME_AXIS):
        return _pair(values, variances, angles, source_dolp)
    if len(directions) < 3:
        raise ValueError("a polarizer needs frames at three analyzer axes, or at two that are crossed")
    found = fit_stokes(values, variances, angles)
    widen = math.sqrt(max(1.0, float(found.chi2) / found.dof)) if found.dof else 1.0
    return PolarizerFit(
        diattenuation=min(float(found.dolp) / source_dolp, 1.0),
        diattenuation_sigma=widen * float(found.dolp_sigma) / source_dolp,
        # The signal is greatest where a + e is L: at -e.
        axis_error=-float(found.aolp),
        axis_error_sigma=widen * float(found.aolp_sigma),
    )


def combine(fits: Sequence[PolarizerFit]) -> PolarizerFit:
    """The weighted mean of several, wider where they differ by more than they should.

    The axes are those of the first to within a right angle; NaN without any.
    """
    errors = np.array([f.axis_error for f in fits])
    nearby = errors[0] + np.array([math.remainder(e - errors[0], math.pi) for e in errors])
    d, d_sigma = _mean(np.array([f.diattenuation for f in fits]), [f.diattenuation_sigma for f in fits])
    e, e_sigma = _mean(nearby, [f.axis_error_sigma for f in fits])
    return PolarizerFit(d, d_sigma, math.remainder(e, math.pi), e_sigma)


def _pair(values: FloatArray, variances: FloatArray, angles: FloatArray, source_dolp: float) -> PolarizerFit:
    """Frames along two crossed axes: the brighter is the parallel one."""
    along = np.abs(np.cos(angles - angles[0])) > math.sqrt(0.5)
    sides = [_mean(values[mask], np.sqrt(variances[mask])) for mask in (along, ~along)]
    (bright, bright_sigma), (dim, dim_sigma) = sorted(sides, reverse=True)
    total = bright + dim
    sigma = 2 * math.hypot(dim * bright_sigma, bright * dim_sigma) / total**2
    d = (bright - dim) / total / source_dolp
    return PolarizerFit(min(d, 1.0), sigma / source_dolp, math.nan, math.nan)


def _mean(values: FloatArray, sigmas: ArrayLike) -> tuple[float, float]:
    """Weighted, with a sigma that covers the scatter."""
    weight = 1.0 / np.asarray(sigmas, dtype=float) ** 2
    mean = float(np.sum(weight * values) / np.sum(weight))
    chi2 = float(np.sum(weight * (values - mean) ** 2))
    widen = math.sqrt(max(1.0, chi2 / (len(values) - 1))) if len(values) > 1 else 1.0
    return mean, widen / math.sqrt(float(np.sum(weight)))


def _directions(angles: FloatArray) -> list[float]:
    """The angles without those that repeat an axis."""
    found: list[float] = []
    for angle in angles:
        if all(abs(math.remainder(angle - other, math.pi)) > _SAME_AXIS for other in found):
            found.append(float(angle))
    return found
