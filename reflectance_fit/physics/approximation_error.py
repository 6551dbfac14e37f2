"""How far an approximation of the unpolarized reflectance is off: over all angles, and over a posterior.

An error is approximation minus exact.  Angles are kept as beta = 90 degrees -
theta in radians: the cosine of theta is sin(beta), and what happens within
1e-8 degrees of grazing incidence keeps its digits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.approximations import Curve
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.physics.fitted_approximations import TABLE_CELLS
from reflectance_fit.physics.fresnel import reflectances

Floats = NDArray[np.float64]

_RIGHT = np.pi / 2.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
# The table's cells and their middles, where its error peaks.
_HALF_CELLS = np.arcsin(np.linspace(0.0, 1.0, 2 * TABLE_CELLS + 1) ** 2)
# Halvings towards a kink: what is left of a square root there is below 2^-40, its integral below 2^-120.
_KINK_HALVINGS = 80
_ZOOM_POINTS, _ZOOMS = 33, 3


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


def approximation_error(eta: float, k: float, approximation: Curve) -> ApproximationError:
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

    Notes
    -----
    Gauss-Legendre on the panels of `panels` and the cells of the table, between which everything is smooth.
    Their nodes are also where the largest errors are looked for, which are then zoomed in on.

    Examples
    --------
    >>> from reflectance_fit.physics.approximations import schlick
    >>> worst = approximation_error(1.5, 0.0, lambda c: schlick(c, 0.04))
    >>> print(f"{worst.max_abs_error:.3f} at {worst.at_deg:.0f} degrees")
    0.036 at 85 degrees
    """

    def both(beta: Floats) -> tuple[Floats, Floats]:
        c = np.sin(beta)
        exact = reflectances(c, eta, k).mean
        return approximation(c) - exact, exact

    def absolute(beta: Floats) -> Floats:
        return np.abs(both(beta)[0])

    def relative(beta: Floats) -> Floats:
        return _relative(*both(beta))

    beta, weights = quadrature(np.concatenate([panels(eta, k), _HALF_CELLS]))
    difference, exact = both(beta)
    largest = _zoom(absolute, beta, np.abs(difference))
    largest_relative = _zoom(relative, beta, _relative(difference, exact))
    flux = weights * np.sin(2.0 * beta)  # 2 c dc
    albedo, bias = float(flux @ exact), float(flux @ difference)
    error = float(both(np.array([largest]))[0][0])
    return ApproximationError(
        max_abs_error=abs(error),
        error=error,
        at_deg=_theta_deg(largest),
        max_rel_error=float(relative(np.array([largest_relative]))[0]),
        max_rel_at_deg=_theta_deg(largest_relative),
        rms_error=float(np.sqrt(weights @ difference**2 / _RIGHT)),
        albedo_error=bias / albedo if albedo > 0.0 else 0.0 if bias == 0.0 else float(np.inf),
    )


def panels(eta: float, k: float) -> Floats:
    """Edges in radians, from 0 to pi/2, between which F(beta) is smooth.

    They halve towards grazing incidence, down to below the scale on which a near match or a large index
    ends there, and towards the critical angle from both sides.
    """
    eta_, k_ = checked_index(eta, k)
    # F goes to 1 at grazing incidence within |eps - 1|^(1/2) in cos_theta_i, or within 1 / |eta + ik|.
    contrast = np.hypot((eta_ - 1.0) * (eta_ + 1.0) - k_**2, 2.0 * eta_ * k_)
    scale = min(1.0, float(np.sqrt(contrast)), float(1.0 / np.hypot(eta_, k_)))
    # An exact match has no scale at all.
    halvings = 8 + int(np.ceil(-np.log2(scale if scale > 0.0 else 1.0)))
    # w = (eps - sin^2(theta))^(1/2) turns from real to imaginary at sin^2(theta) = Re eps: sharply for k = 0.
    cosine2 = float((1.0 - eta_) * (1.0 + eta_) + k_**2)
    if not 0.0 < cosine2 < 1.0:
        return _halving(0.0, _RIGHT, halvings)
    kink = float(np.arcsin(np.sqrt(cosine2)))
    return np.concatenate(
        [
            _halving(0.0, 0.5 * kink, halvings),
            _halving(kink, 0.5 * kink, _KINK_HALVINGS),
            _halving(kink, _RIGHT, _KINK_HALVINGS),
        ]
    )


def quadrature(edges: Floats) -> tuple[Floats, Floats]:
    """Angles beta in radians, rising from 0 to pi/2, and weights that integrate over them.

    Gauss-Legendre between neighbouring ``edges``; the edges are among the angles, with weight 0.
    """
    edges = np.unique(np.clip(edges, 0.0, _RIGHT))
    half, centre = np.diff(edges)[:, np.newaxis] / 2.0, (edges[1:] + edges[:-1])[:, np.newaxis] / 2.0
    beta = np.concatenate([edges, (centre + half * _NODES).ravel()])
    weights = np.concatenate([np.zeros_like(edges), (half * _WEIGHTS).ravel()])
    order = np.argsort(beta, kind="stable")
    return beta[order], weights[order]


def max_abs_errors(
    eta: Floats, k: Floats, curves: Sequence[Callable[[Floats, Floats], Curve]], at_deg: Sequence[float]
) -> tuple[Floats, ...]:
    """The largest absolute error of each approximation for each of M materials that are much alike.

    Parameters
    ----------
    eta, k : float, shape (M,)
        Relative indices, such as draws of a posterior.
    curves : sequence of callable
        Approximations as `approximations` has them, from eta and k of shape (M, 1).
    at_deg : sequence of float
        Where each of them is worst for one such material; looked at besides a grid.

    Returns
    -------
    tuple of float, shape (M,)
        One for each of ``curves``.

    Raises
    ------
    ValueError
        If an eta is not positive or a k is negative.
    """
    grid, _ = quadrature(panels(float(np.median(eta)), float(np.median(k))))
    eta, k = eta[:, np.newaxis], k[:, np.newaxis]

    def exact(angles: Floats) -> Floats:
        return reflectances(np.sin(angles), eta, k).mean

    worst = np.radians(90.0 - np.asarray(at_deg))
    beta = np.unique(np.concatenate([grid, worst]))
    coarse_exact = exact(beta)
    results = []
    for curve in curves:
        approximation = curve(eta, k)
        coarse = np.abs(approximation(np.sin(beta)) - coarse_exact)
        at = np.argmax(coarse, axis=-1)
        # The worst angles of the draws lie together: all draws are looked at again between the outermost two.
        low, high = beta[max(at.min() - 1, 0)], beta[min(at.max() + 1, beta.size - 1)]
        angles = np.linspace(low, high, 2 * _ZOOM_POINTS)
        fine = np.abs(approximation(np.sin(angles)) - exact(angles))
        results.append(np.maximum(coarse.max(axis=-1), fine.max(axis=-1)))
    return tuple(results)


def _halving(low: float, high: float, halvings: int) -> Floats:
    """low, and low + (high - low) 2^-j for j from ``halvings`` down to 0."""
    return np.concatenate([[low], low + (high - low) * 0.5 ** np.arange(halvings, -1.0, -1.0)])


def _relative(difference: Floats, exact: Floats) -> Floats:
    # No reflection at all (an index match): any error is infinitely large beside it.
    beside_zero = np.where(difference == 0.0, 0.0, np.inf)
    return np.where(exact > 0.0, np.abs(difference) / np.where(exact > 0.0, exact, 1.0), beside_zero)


def _zoom(size: Callable[[Floats], Floats], beta: Floats, sizes: Floats) -> float:
    """The beta where size is largest: the best of the angles given, then finer and finer around it."""
    for _ in range(_ZOOMS):
        best = _largest(sizes)
        low, high = beta[max(best - 1, 0)], beta[min(best + 1, beta.size - 1)]
        # The best so far stays among them, so a kink is not lost.
        sides = np.linspace(low, beta[best], _ZOOM_POINTS), np.linspace(beta[best], high, _ZOOM_POINTS)
        beta = np.unique(np.concatenate(sides))
        sizes = size(beta)
    return float(beta[_largest(sizes)])


def _largest(sizes: Floats) -> int:
    """Index of the largest, and where several are as large the last: the one nearest to normal incidence."""
    return int(np.flatnonzero(sizes >= sizes.max() * (1.0 - 1e-14))[-1])


def _theta_deg(beta: float) -> float:
    return float(90.0 - np.degrees(beta))
