"""What renderers use instead of Fresnel's equations, and what that costs.

An error is approximation minus exact, for unpolarized light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics.domain import checked_cosine, checked_index
from reflectance_fit.physics.fresnel import reflectances

Floats = NDArray[np.float64]

_GRID_POINTS = 4001
_ZOOM_POINTS = 81


class ConductorApproximation(NamedTuple):
    """Approximate power reflectance of a conductor; float, shape S.  ``mean`` is for unpolarized light."""

    s: Floats
    p: Floats
    mean: Floats


@dataclass(frozen=True, slots=True)
class ApproximationError:
    """How far an approximation of the unpolarized reflectance is off, over 0 to 90 degrees.

    Relative errors are fractions: 0.23 is 23 percent.
    """

    max_abs_error: float  # the largest |approximation - exact|
    error: float  # the same with its sign
    at_deg: float  # where
    max_rel_error: float  # the largest |approximation - exact| / exact; inf where exact is 0
    max_rel_at_deg: float  # where
    rms_error: float  # root mean square over theta, uniform
    albedo_error: float  # of the hemispherical albedo 2 int F(c) c dc, relative and signed


def schlick(cos_theta_i: ArrayLike, r0: ArrayLike) -> Floats:
    """Schlick's approximation R0 + (1 - R0) (1 - cos_theta_i)^5 of the unpolarized reflectance.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    r0 : float, broadcastable to S
        Power reflectance at normal incidence, in [0, 1].

    Raises
    ------
    ValueError
        If either is outside its range.

    Notes
    -----
    Schlick, Computer Graphics Forum 13 (1994) 233, eq. 15.

    Examples
    --------
    >>> print(f"{schlick(0.5, 0.04):.2f}")
    0.07
    """
    c = checked_cosine(cos_theta_i)
    r0 = np.asarray(r0, dtype=np.float64)
    if not np.all((r0 >= 0.0) & (r0 <= 1.0)):
        raise ValueError("r0 must be a power reflectance in [0, 1]; is it in percent?")
    result: Floats = r0 + (1.0 - r0) * (1.0 - c) ** 5
    return result[()]


def conductor_approximation(cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike) -> ConductorApproximation:
    """The textbook approximation of a conductor's reflectance, which drops sin^2(theta_i) beside eps.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, or k is negative.

    Notes
    -----
    Pharr & Humphreys, Physically Based Rendering, 2nd ed., 8.2.1, r_parallel
    and r_perpendicular: ((eta^2 + k^2) c^2 -+ 2 eta c + 1) and
    ((eta^2 + k^2) -+ 2 eta c + c^2), here as sums of squares.
    """
    c = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    s: Floats = ((eta - c) ** 2 + k**2) / ((eta + c) ** 2 + k**2)
    p: Floats = ((eta * c - 1.0) ** 2 + (k * c) ** 2) / ((eta * c + 1.0) ** 2 + (k * c) ** 2)
    return ConductorApproximation(s[()], p[()], ((s + p) / 2.0)[()])


def approximation_error(
    eta: float, k: float, approximation: Callable[[Floats], Floats]
) -> ApproximationError:
    """Compare an approximation with the exact unpolarized reflectance of one material.

    Parameters
    ----------
    eta, k : float
        Index of the far medium relative to the near one, eta + ik.
    approximation : callable
        From cos_theta_i, shape (N,), to reflectance, shape (N,).

    Raises
    ------
    ValueError
        If eta is not positive or k is negative.

    Examples
    --------
    >>> worst = approximation_error(1.5, 0.0, lambda c: schlick(c, 0.04))
    >>> print(f"{worst.max_abs_error:.3f} at {worst.at_deg:.0f} degrees")
    0.036 at 85 degrees
    """

    def both(theta_deg: Floats) -> tuple[Floats, Floats]:
        c, _ = cos_sin_deg(theta_deg)
        exact = reflectances(c, eta, k).mean
        return approximation(c) - exact, exact

    def relative(theta_deg: Floats) -> Floats:
        error, exact = both(theta_deg)
        # No reflection at all (an index match): any error is infinitely large beside it.
        beside_zero = np.where(error == 0.0, 0.0, np.inf)
        return np.where(exact > 0.0, np.abs(error) / np.where(exact > 0.0, exact, 1.0), beside_zero)

    theta_deg = np.linspace(0.0, 90.0, _GRID_POINTS)
    at_deg = _worst(lambda t: np.abs(both(t)[0]), theta_deg)
    rel_at_deg = _worst(relative, theta_deg)
    error = float(both(np.array([at_deg]))[0][0])
    difference, exact = both(theta_deg)
    weight = np.sin(2.0 * np.radians(theta_deg))  # 2 c dc = sin(2 theta) dtheta
    albedo, bias = np.trapezoid(weight * exact), np.trapezoid(weight * difference)
    return ApproximationError(
        max_abs_error=abs(error),
        error=error,
        at_deg=at_deg,
        max_rel_error=float(relative(np.array([rel_at_deg]))[0]),
        max_rel_at_deg=rel_at_deg,
        rms_error=float(np.sqrt(np.trapezoid(difference**2) / (_GRID_POINTS - 1))),
        albedo_error=float(bias / albedo) if albedo > 0.0 else float(np.inf),
    )


def _worst(size: Callable[[Floats], Floats], theta_deg: Floats) -> float:
    """Angle in degrees where size is largest: the grid's best, then twice a finer grid around it."""
    for _ in range(2):
        best = int(np.argmax(size(theta_deg)))
        low, high = theta_deg[max(best - 1, 0)], theta_deg[min(best + 1, theta_deg.size - 1)]
        theta_deg = np.linspace(low, high, _ZOOM_POINTS)
    return float(theta_deg[np.argmax(size(theta_deg))])
