"""From a point of the grid to a minimum of chi2, compiled: damped Gauss-Newton in (eta, k^2), and what bounds k there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.jit import inlined
from reflectance_fit.pixels.rows import FloatArray
from reflectance_fit.pixels.sums import (
    CHI2,
    CURVE_11,
    CURVE_12,
    CURVE_22,
    FOUND,
    SLOPE_1,
    SLOPE_2,
    B,
    IntArray,
    evaluate,
)
from reflectance_fit.pixels.verdict import FLOOR, MINIMUM, ONE_SIDED

_STEPS = 60
_DAMPING, _MOST_DAMPING = 1e-3, 1e12
# As shares of sum w y^2: a step that promises no more of chi2 has arrived; the rounding of chi2.
_REST, _ROUNDING = 1e-15, 1e-14
_LIMIT_ROUNDS = 8  # of a fixed point whose logarithm's error halves each time

# Lines of a descent's state.
ETA, SQUARE, _ETA_TO, _SQUARE_TO, _K_TO, _DAMP, _PROMISE = (i * B for i in range(7))
STATE = 7


@inlined
def upper_limits(
    cells: FloatArray,
    cell_view: IntArray,
    cell_gain: IntArray,
    gains: int,
    crossed: bool,
    angles: FloatArray,
    total: FloatArray,
    minima: FloatArray,
    which: IntArray,
    bounds: FloatArray,
    jet: FloatArray,
    of_gains: FloatArray,
    there: FloatArray,
    limit: FloatArray,
) -> None:
    """Upper 95 % limits of k at each lane's minimum, from the curvature at the limit itself.

    The curvature at k = 0 says nothing where readings feel k and not its square, as with a retarder.  L^2 = k^2 +
    1.645 sigma(k^2 at L) is the limit where they feel the square, and twice as careful as need be where they feel k.
    """
    eta = np.empty(B)
    for i in range(B):
        eta[i], limit[i] = minima[which[i] * MINIMUM * B + i], 0.1
    for _ in range(_LIMIT_ROUNDS):
        evaluate(cells, cell_view, cell_gain, gains, crossed, angles, total, eta, limit, jet, of_gains, there)
        for i in range(B):
            h11, h12, h22 = there[CURVE_11 + i], there[CURVE_12 + i], there[CURVE_22 + i]
            left = h22 - h12 * h12 / h11 if h11 > 0 else h22
            square = minima[(which[i] * MINIMUM + 1) * B + i]
            reach = square + (ONE_SIDED / math.sqrt(left) if left > 0 else math.inf)
            limit[i] = min(max(math.sqrt(reach), 1e-6), bounds[2])


@inlined
def descend_lanes(
    cells: FloatArray,
    cell_view: IntArray,
    cell_gain: IntArray,
    gains: int,
    crossed: bool,
    angles: FloatArray,
    total: FloatArray,
    active: NDArray[np.bool_],
    bounds: FloatArray,
    free_k: bool,
    jet: FloatArray,
    of_gains: FloatArray,
    here: FloatArray,
    state: FloatArray,
) -> FloatArray:
    """Take the active lanes from eta and k^2 of ``state`` to a minimum; 1 where one was reached.

    ``here`` is what `evaluate` finds there.
    """
    rested, moving, there = np.zeros(B), np.zeros(B), np.empty(FOUND * B)
    low, high, most = bounds[0], bounds[1], bounds[2] ** 2
    for i in range(B):
        moving[i] = 1.0 if active[i] else 0.0
        state[_DAMP + i] = _DAMPING
        state[_ETA_TO + i], state[_SQUARE_TO + i] = state[ETA + i], state[SQUARE + i]
        state[_K_TO + i], state[_PROMISE + i] = math.sqrt(state[SQUARE + i]), math.inf
        here[CHI2 + i] = math.inf
    for _ in range(_STEPS):
        evaluate(
            cells,
            cell_view,
            cell_gain,
            gains,
            crossed,
            angles,
            total,
            state[_ETA_TO : _ETA_TO + B],
            state[_K_TO : _K_TO + B],
            jet,
            of_gains,
            there,
        )
        any_moving = 0.0
        for i in range(B):
            better = there[CHI2 + i] < here[CHI2 + i] + _ROUNDING * total[i]
            take = moving[i] > 0 and (better or here[CHI2 + i] == math.inf)
            for line in range(FOUND):
                here[line * B + i] = there[line * B + i] if take else here[line * B + i]
            state[ETA + i] = state[_ETA_TO + i] if take else state[ETA + i]
            state[SQUARE + i] = state[_SQUARE_TO + i] if take else state[SQUARE + i]
            damp = state[_DAMP + i]
            damp = max(0.1 * damp, 1e-15) if take else 10.0 * damp
            state[_DAMP + i] = damp
            arrived = moving[i] > 0 and state[_PROMISE + i] <= _REST * total[i]
            rested[i] = 1.0 if arrived else rested[i]
            stay = arrived or damp > _MOST_DAMPING or not (here[CHI2 + i] < math.inf)
            moving[i] = 0.0 if stay else moving[i]
            any_moving += moving[i]
        if any_moving == 0:
            break
        for i in range(B):
            eta, square = state[ETA + i], state[SQUARE + i]
            g1, g2 = here[SLOPE_1 + i], here[SLOPE_2 + i]
            h11, h12, h22 = here[CURVE_11 + i], here[CURVE_12 + i], here[CURVE_22 + i]
            # At a bound that the slope presses against, only the other moves.
            held_1 = (eta <= low and g1 < 0) or (eta >= high and g1 > 0)
            held_2 = not free_k or (square <= FLOOR and g2 < 0) or (square >= most and g2 > 0)
            h12 = 0.0 if held_1 or held_2 else h12
            g1, h11 = (0.0 if held_1 else g1), (1.0 if held_1 or h11 == 0 else h11)
            g2, h22 = (0.0 if held_2 else g2), (1.0 if held_2 or h22 == 0 else h22)
            damped = 1 + state[_DAMP + i]
            det = h11 * h22 * damped * damped - h12 * h12
            step_1 = (h22 * damped * g1 - h12 * g2) / det
            step_2 = (h11 * damped * g2 - h12 * g1) / det
            eta_to = min(max(eta + step_1, max(0.5 * eta, low)), min(2 * eta, high))
            square_to = min(max(square + step_2, FLOOR), min(4 * square + 1, most)) if free_k else square
            state[_ETA_TO + i], state[_SQUARE_TO + i] = eta_to, square_to
            state[_K_TO + i] = math.sqrt(square_to)
            # What a linear model promises of the step as taken.
            state[_PROMISE + i] = abs((eta_to - eta) * g1) + abs((square_to - square) * g2)
    return rested
