"""Integrals over boxes with an error estimate, by adaptive Gauss-Kronrod rules of scipy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cubature

Floats = NDArray[np.float64]
Integrand = Callable[[Floats], Floats]

# Gauss-Kronrod's estimate is that of the 10-point rule and the value that of the 21-point one,
# so the true error is far smaller; a smaller tolerance would be below rounding.
RTOL = 1e-12
_MAX_SUBDIVISIONS = 40


@dataclass(frozen=True, slots=True)
class Integral:
    """What a quadrature found.

    ``error`` estimates the absolute error of ``value``, without that of rounding.  ``converged`` is false
    where the integrand was too rough for the tolerance: then trust ``value`` to ``error`` at best.
    """

    value: float
    error: float
    converged: bool

    def times(self, factor: float) -> Integral:
        """The integral of ``factor`` times the same integrand."""
        return Integral(factor * self.value, abs(factor) * self.error, self.converged)


def integrate(f: Integrand, boxes: Floats, *, rtol: float = RTOL, atol: float = 0.0) -> Integral:
    """Integral of f over boxes in D dimensions.

    Every box is first seen at 21 points along each axis; those that add more than their share to the
    error are divided.  Something that lies between all these points is not seen, so boxes must be
    small where the integrand may be sharp.

    Parameters
    ----------
    f : function of float, shape (..., D), to float, shape (...)
        The integrand.
    boxes : float, shape (N, 2, D)
        Lower and upper corner of each.
    rtol, atol : float
        The sought error, relative to the sum over all boxes and absolute.

    Raises
    ------
    ValueError
        If f is NaN or infinite somewhere.
    """
    low, size = boxes[:, 0], boxes[:, 1] - boxes[:, 0]
    volume = np.prod(size, axis=-1)

    def in_all(x: Floats) -> Floats:
        return np.asarray(_finite(f(low + size * x[:, None, :])) * volume)

    dimensions = boxes.shape[-1]
    first = cubature(in_all, np.zeros(dimensions), np.ones(dimensions), max_subdivisions=0)

    def in_one(box: int) -> Integrand:
        return lambda x: f(low[box] + size[box] * x) * volume[box]

    return _refined(np.array(first.estimate), np.array(first.error), in_one, dimensions, rtol, atol)


def integrate_pieces(pieces: Sequence[Integrand], dimensions: int, *, rtol: float = RTOL) -> Integral:
    """Sum of the integrals of several functions, each over the unit box; otherwise as `integrate`."""
    corners = np.zeros(dimensions), np.ones(dimensions)
    first = [cubature(_guarded(f), *corners, max_subdivisions=0) for f in pieces]
    value, error = np.array([found.estimate for found in first]), np.array([found.error for found in first])
    return _refined(value, error, pieces.__getitem__, dimensions, rtol, 0.0)


def _refined(
    value: Floats,
    error: Floats,
    piece: Callable[[int], Integrand],
    dimensions: int,
    rtol: float,
    atol: float,
) -> Integral:
    """The sum, after those of its terms that miss their share of the tolerance have been divided."""
    allowed = max(rtol * abs(float(value.sum())), atol)
    share = allowed / len(value)
    converged = True
    if error.sum() > allowed:
        for i in np.flatnonzero(error > share):
            found = cubature(
                _guarded(piece(int(i))),
                np.zeros(dimensions),
                np.ones(dimensions),
                rtol=rtol,
                atol=share,
                max_subdivisions=_MAX_SUBDIVISIONS,
            )
            value[i], error[i] = found.estimate, found.error
            converged &= found.status == "converged"
    return Integral(float(value.sum()), float(error.sum()), converged)


def grid(*edges: Floats) -> Floats:
    """Boxes, shape (N, 2, D), between the edges along each of D axes."""
    low = np.meshgrid(*(e[:-1] for e in edges), indexing="ij")
    high = np.meshgrid(*(e[1:] for e in edges), indexing="ij")
    corners = [np.stack([axis.ravel() for axis in side], axis=-1) for side in (low, high)]
    return np.stack(corners, axis=1)


def _guarded(f: Integrand) -> Integrand:
    return lambda x: _finite(f(x))


def _finite(values: Floats) -> Floats:
    # cubature takes NaN for converged.
    if not np.all(np.isfinite(values)):
        raise ValueError("the function to integrate is NaN or infinite somewhere; bound it first")
    return values
