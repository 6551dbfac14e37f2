"""From the minima of a pixel's chi2 to its eta and k with sigma and status, compiled.

The rules are those of `inference.identify` at the best point instead of over draws: an interval of +- 2 sigma that
spans more than a quarter of the prior's range has learned next to nothing, and a k whose interval reaches 0 is an
upper limit.
"""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import inlined
from reflectance_fit.pixels.closed_form import WIDE
from reflectance_fit.pixels.rows import FloatArray
from reflectance_fit.pixels.status import Status
from reflectance_fit.pixels.sums import B

# Lines of a minimum: eta, k^2, chi2, half the curvature (11, 12, 22), and 1 where the descent came to rest.
MINIMUM = 7
# Descents of a pixel, and so minima at most.
STARTS = 3
# k^2 that stands for k = 0 where k is free, as derivatives by k^2 need a k to divide by: one that changes nothing.
FLOOR = 1e-20
# Of normal laws: 95 % to both sides, and to one.
_TWO_SIDED, ONE_SIDED = 1.96, 1.645
# chi2 by which a minimum may be above the lowest and still be the truth; minima that differ by less are equal.
_RIVAL, _TIE = 3.84, 1e-6
# Standard deviations, and share of eta, by which minima differ that are two.
_APART, _SAME = 4.0, 1e-4
# Curvatures whose determinant is below this share of their product are of one equation for two unknowns.
_RIDGE = 1e-10

_IDENTIFIED, _UPPER_LIMIT = int(Status.IDENTIFIED), int(Status.UPPER_LIMIT)
_AMBIGUOUS, _NOT_IDENTIFIED = int(Status.AMBIGUOUS), int(Status.NOT_IDENTIFIED)
_NOT_CONVERGED = int(Status.NOT_CONVERGED)


@inlined
def chosen(minima: FloatArray, i: int, free_k: bool, expected: float) -> int:
    """Which of lane i's minima is the answer: the lowest.

    Where k is 0, one above the outside's index goes before those below it that fit no better than noise would
    have it.  Equal ones: the eta nearest to ``expected``.
    """
    lowest = math.inf
    for z in range(STARTS):
        lowest = min(lowest, minima[(z * MINIMUM + 2) * B + i])
    dense = False
    for z in range(STARTS):
        at = z * MINIMUM * B + i
        dense = dense or (minima[at] >= 1 and minima[at + 2 * B] <= lowest + _RIVAL)
    which, best, distance = 0, math.inf, math.inf
    for z in range(STARTS):
        at = z * MINIMUM * B + i
        eta, chi2 = minima[at], minima[at + 2 * B]
        aside = not free_k and dense and eta < 1
        apart = max(eta / expected, expected / eta)
        tie = _TIE * (1 + lowest)
        if not aside and (chi2 < best - tie or (chi2 < best + tie and apart < distance)):
            which, best, distance = z, chi2, apart
    return which


@inlined
def deviations(minima: FloatArray, z: int, i: int, free_k: bool) -> tuple[float, float, float]:
    """Standard deviations of eta and k^2 and their correlation at a minimum; infinite on a ridge."""
    at = z * MINIMUM * B + i
    h11, h12, h22 = minima[at + 3 * B], minima[at + 4 * B], minima[at + 5 * B]
    if not free_k:
        return (1 / math.sqrt(h11) if h11 > 0 else math.inf), 0.0, 0.0
    det = h11 * h22 - h12 * h12
    if not det > _RIDGE * h11 * h22:
        return math.inf, math.inf, 0.0
    return math.sqrt(h22 / det), math.sqrt(h11 / det), -h12 / math.sqrt(h11 * h22)


@inlined
def reaches_zero(square: float, deviation: float) -> bool:
    """Whether the interval of k has its lower end under a tenth of k; in k^2, as sigma of k has no bound near 0."""
    return square - _TWO_SIDED * deviation < 0.01 * square or square <= FLOOR


@inlined
def status_of(
    minima: FloatArray,
    z: int,
    i: int,
    free_k: bool,
    bounds: FloatArray,
    deviation: tuple[float, float],
    limit: float,
) -> int:
    """The verdict on minimum z of lane i; ``deviation`` of eta and k^2, ``limit`` the 95 % limit of k."""
    at = z * MINIMUM * B + i
    eta, square, chi2 = minima[at], minima[at + B], minima[at + 2 * B]
    rival = False
    for other in range(STARTS):
        o = other * MINIMUM * B + i
        aside = not free_k and eta >= 1 and minima[o] < 1
        far = abs(minima[o] - eta) > max(_APART * deviation[0], _SAME * eta)
        if free_k:
            far = far or abs(minima[o + B] - square) > max(_APART * deviation[1], _SAME * (square + FLOOR))
        rival = rival or (minima[o + 2 * B] <= chi2 + _RIVAL and far and not aside)
    code = _IDENTIFIED
    wide = not (deviation[0] <= WIDE * eta) or eta <= bounds[0] or eta >= bounds[1]
    if free_k:
        bounded = reaches_zero(square, deviation[1])
        code = _UPPER_LIMIT if bounded else code
        quarter = 0.25 * bounds[2]
        wide = wide or (limit > quarter if bounded else 2 * deviation[1] / math.sqrt(square) > quarter)
        wide = wide or square >= bounds[2] ** 2
    code = _AMBIGUOUS if rival else code
    code = _NOT_CONVERGED if minima[at + 6 * B] == 0 else code
    # Along a ridge a descent need not come to rest.
    return _NOT_IDENTIFIED if wide else code
