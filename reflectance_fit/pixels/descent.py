"""eta, and k where it is free, of every pixel by Gauss-Newton, compiled: many pixels a step.

A grid over the whole prior has a few local minima, a damped Gauss-Newton descent in (eta, k^2) takes the lowest
of them to theirs, and the lowest is the maximum of the likelihood with the gains at their
best.  A lane that has arrived is left alone, and no sum runs over lanes: a pixel's bits do not depend on its
neighbours in a block, on tiles or on threads.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from reflectance_fit.physics.jit import inlined, threaded
from reflectance_fit.physics.kernels import interface
from reflectance_fit.pixels.closed_form import sin_cos
from reflectance_fit.pixels.rows import Float32Array, FloatArray
from reflectance_fit.pixels.status import Status
from reflectance_fit.pixels.sums import (
    CELL,
    CHI2,
    CURVE_11,
    CURVE_12,
    CURVE_22,
    FOUND,
    GAIN,
    JET,
    SLOPE_1,
    SLOPE_2,
    VIEW,
    B,
    IntArray,
    Q,
    accumulate,
    evaluate,
    objective,
)
from reflectance_fit.pixels.verdict import (
    FLOOR,
    MINIMUM,
    ONE_SIDED,
    STARTS,
    chosen,
    deviations,
    reaches_zero,
    status_of,
)

_UPPER_LIMIT, _TOO_FEW, _NO_LIGHT = int(Status.UPPER_LIMIT), int(Status.TOO_FEW), int(Status.NO_LIGHT)

_STEPS = 60
_DAMPING, _MOST_DAMPING = 1e-3, 1e12
# As shares of sum w y^2: a step that promises no more of chi2 has arrived; the rounding of chi2.
_REST, _ROUNDING = 1e-15, 1e-14
# Light must lower chi2 by as much.
_LIGHT = 9.0
_LIMIT_ROUNDS = 8  # of a fixed point whose logarithm's error halves each time

# Lines of a descent's state.
_ETA, _SQUARE, _ETA_TO, _SQUARE_TO, _K_TO, _DAMP, _PROMISE = (i * B for i in range(7))
_STATE = 7


@threaded
def descend(
    values: Float32Array,
    variance: Float32Array,
    responses: FloatArray,
    frame_cell: IntArray,
    cell_view: IntArray,
    cell_gain: IntArray,
    gains: int,
    crossed: bool,
    theta: Float32Array,
    cos_2s: Float32Array,
    sin_2s: Float32Array,
    reason: NDArray[np.uint8],
    etas: FloatArray,
    ks: FloatArray,
    bounds: FloatArray,
    expected: float,
    free_k: bool,
    found: Float32Array,
    dof: NDArray[np.uint16],
    status: NDArray[np.uint8],
) -> None:
    """Fill ``found`` (3 or 6, n): eta, sigma, chi2 and, with k free, k, sigma and correlation; ``dof`` and ``status``.

    ``values``, ``variance`` are (m, n), ``responses`` (m, 4, 3).  Frame j belongs to cell ``frame_cell[j]``, which
    has a view and a gain; gain number ``gains`` is that of reflectances.  ``etas`` and ``ks`` span the
    grid, ``bounds`` are (eta low, eta high, k high); these and ``expected`` are relative to the outside, as is what is
    filled.
    """
    m, n = values.shape
    views = len(theta)
    unknowns = 2 if free_k else 1
    points = len(etas) * len(ks)
    groups = (points + B - 1) // B
    point_eta, point_k = np.ones(groups * B), np.zeros(groups * B)
    for p in range(points):
        point_eta[p], point_k[p] = etas[p // len(ks)], ks[p % len(ks)]
    for block in prange((n + B - 1) // B):
        first = block * B
        count = min(B, n - first)
        cells = np.zeros(len(cell_view) * CELL * B)
        angles, total, number = np.empty(views * VIEW * B), np.zeros(B), np.zeros(B)
        lit = np.zeros((gains + 1) * B)
        line, value = np.empty(B), np.empty(B)
        cos, sin = np.empty(B), np.empty(B)
        alike = True
        for v in range(views):
            angle = angles[v * VIEW * B :]
            _lanes(theta[v], first, count, line)
            for i in range(B):
                s, c = sin_cos(line[i])
                angle[i], angle[B + i] = c, s
            for i in range(B):
                alike = alike and line[i] == line[0]
        for j in range(m):
            a = frame_cell[j]
            v = cell_view[a]
            _lanes(variance[j], first, count, line)
            _lanes(values[j], first, count, value)
            _lanes(cos_2s[v], first, count, cos)
            _lanes(sin_2s[v], first, count, sin)
            for i in range(B):
                there = value[i] == value[i] and line[i] > 0
                line[i], value[i] = (1 / line[i] if there else 0.0), (value[i] if there else 0.0)
            response = responses[j]
            a_lit = lit[cell_gain[a] * B : (cell_gain[a] + 1) * B]
            a_cell = cells[a * CELL * B : (a + 1) * CELL * B]
            accumulate(a_cell, total, number, a_lit, line, value, response, crossed, cos, sin)
        active, free = np.zeros(B, dtype=np.bool_), np.zeros(B)
        for i in range(count):
            taken = 0.0
            for g in range(gains):
                taken += 1.0 if lit[g * B + i] > 0 else 0.0
            free[i] = number[i] - taken - unknowns
            active[i] = reason[first + i] == 0 and free[i] >= 0
        jet, of_gains = np.empty(JET * B), np.empty((gains + 1) * GAIN * B)
        here, state = np.empty(FOUND * B), np.empty(_STATE * B)
        any_active = False
        for i in range(count):
            any_active = any_active or active[i]
        grid = np.full(points * B, math.inf)
        of_points, of_views = np.empty(views * groups * Q * B), np.empty(views * Q * B)
        if alike:
            _of_points(angles, point_eta, point_k, of_points)
        for p in range(points if any_active else 0):
            for v in range(views):
                q, angle = of_views[v * Q * B : (v + 1) * Q * B], angles[v * VIEW * B : (v + 1) * VIEW * B]
                if alike:
                    one = of_points[(v * groups + p // B) * Q * B + p % B :]
                    q0, q1, q2, q3 = one[0], one[B], one[2 * B], one[3 * B]
                    for i in range(B):
                        q[i], q[B + i], q[2 * B + i], q[3 * B + i] = q0, q1, q2, q3
                else:
                    eta, k = point_eta[p], point_k[p]
                    for i in range(B):
                        q[i], q[B + i], q[2 * B + i], q[3 * B + i] = interface(angle[i], angle[B + i], eta, k)
            chi2 = grid[p * B : (p + 1) * B]
            objective(cells, cell_view, cell_gain, gains, crossed, total, of_views, of_gains, chi2)
        best = np.full(2 * STARTS * B, math.inf)
        _lowest(grid, len(etas), len(ks), best)
        minima = np.empty(STARTS * MINIMUM * B)
        starting = np.zeros(B, dtype=np.bool_)
        for z in range(STARTS):
            lowest = best[z * 2 * B : (z + 1) * 2 * B]
            for i in range(B):
                starting[i] = active[i] and lowest[i] < math.inf
                p = int(lowest[B + i]) if starting[i] else 0
                state[_ETA + i] = point_eta[p]
                state[_SQUARE + i] = max(point_k[p] ** 2, FLOOR) if free_k else 0.0
            rested = _descend(
                cells,
                cell_view,
                cell_gain,
                gains,
                crossed,
                angles,
                total,
                starting,
                bounds,
                free_k,
                jet,
                of_gains,
                here,
                state,
            )
            at = z * MINIMUM * B
            for i in range(B):
                minima[at + i], minima[at + B + i] = state[_ETA + i], state[_SQUARE + i]
                minima[at + 2 * B + i] = max(here[CHI2 + i], 0.0)
                minima[at + 3 * B + i], minima[at + 4 * B + i] = here[CURVE_11 + i], here[CURVE_12 + i]
                minima[at + 5 * B + i], minima[at + 6 * B + i] = here[CURVE_22 + i], rested[i]
        which = np.zeros(B, dtype=np.int64)
        for i in range(count):
            which[i] = chosen(minima, i, free_k, expected) if active[i] else 0
        limit = np.zeros(B)
        bounded = False
        for i in range(count if free_k else 0):
            _, of_square, _ = deviations(minima, which[i], i, free_k)
            bounded = bounded or (
                active[i] and reaches_zero(minima[(which[i] * MINIMUM + 1) * B + i], of_square)
            )
        if bounded:
            _limits(
                cells,
                cell_view,
                cell_gain,
                gains,
                crossed,
                angles,
                total,
                minima,
                which,
                bounds,
                jet,
                of_gains,
                here,
                limit,
            )
        for i in range(count):
            at, z = first + i, which[i]
            lines = z * MINIMUM * B + i
            dark = total[i] - minima[lines + 2 * B] < _LIGHT or not (minima[lines + 2 * B] < math.inf)
            if not active[i] or dark:
                found[:, at], dof[at] = np.float32(math.nan), 0
                missing = _TOO_FEW if free[i] < 0 else _NO_LIGHT
                status[at] = reason[at] if reason[at] > 0 else missing
                continue
            of_eta, of_square, correlation = deviations(minima, z, i, free_k)
            code = status_of(minima, z, i, free_k, bounds, (of_eta, of_square), limit[i])
            found[0, at], found[1, at] = np.float32(minima[lines]), np.float32(of_eta)
            found[2, at] = np.float32(minima[lines + 2 * B])
            dof[at], status[at] = np.uint16(free[i]), code
            if free_k:
                k = math.sqrt(minima[lines + B]) if minima[lines + B] > FLOOR else 0.0
                found[3, at] = np.float32(k)
                found[4, at] = np.float32(
                    (limit[i] - k) / ONE_SIDED if reaches_zero(k * k, of_square) else of_square / (2 * k)
                )
                found[5, at] = np.float32(correlation)


@inlined
def _lanes(row: Float32Array, first: int, count: int, line: FloatArray) -> None:
    """A block's part of a row, which may have one number for all pixels; lanes beyond ``count`` repeat the last."""
    if len(row) == 1:
        line[:] = np.float64(row[0])
    elif count == B:
        part = row[first : first + B]
        for i in range(B):
            line[i] = np.float64(part[i])
    else:
        for i in range(B):
            line[i] = np.float64(row[first + min(i, count - 1)])


@inlined
def _of_points(angles: FloatArray, eta: FloatArray, k: FloatArray, of_points: FloatArray) -> None:
    """q of every view and point of the grid at the angles of lane 0: for each view and B points the lines of q."""
    groups = len(eta) // B
    for group in range(len(of_points) // (Q * B)):
        v, first = group // groups, (group % groups) * B
        c, s = angles[v * VIEW * B], angles[v * VIEW * B + B]
        q, etas, ks = of_points[group * Q * B :][: Q * B], eta[first:][:B], k[first:][:B]
        for i in range(B):
            q[i], q[B + i], q[2 * B + i], q[3 * B + i] = interface(c, s, etas[i], ks[i])


@inlined
def _lowest(grid: FloatArray, rows: int, columns: int, best: FloatArray) -> None:
    """Each lane's lowest local minima of chi2 over the grid, lowest first: lines of chi2 and the point's number."""
    # Of a point and its neighbours along k.
    along = np.empty(len(grid))
    for p in range(rows * columns):
        b = p % columns
        before = grid[(p - 1 if b > 0 else p) * B :][:B]
        here, after = grid[p * B :][:B], grid[(p + 1 if b + 1 < columns else p) * B :][:B]
        least = along[p * B :][:B]
        for i in range(B):
            least[i] = min(min(before[i], after[i]), here[i])
    value, number = np.empty(B), np.empty(B)
    for p in range(rows * columns):
        a, last = p // columns, rows - 1
        before = along[(p - columns if a > 0 else p) * B :][:B]
        here, after = along[p * B :][:B], along[(p + columns if a < last else p) * B :][:B]
        own = grid[p * B :][:B]
        for i in range(B):
            least_of_all = min(min(before[i], after[i]), here[i])
            value[i], number[i] = (own[i] if own[i] <= least_of_all else math.inf), np.float64(p)
        for z in range(STARTS):
            chi2, point = best[2 * z * B :][:B], best[(2 * z + 1) * B :][:B]
            for i in range(B):
                one, two, lower = chi2[i], value[i], value[i] < chi2[i]
                chi2[i], value[i] = (two if lower else one), (one if lower else two)
                one, two = point[i], number[i]
                point[i], number[i] = (two if lower else one), (one if lower else two)


@inlined
def _limits(
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
def _descend(
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
        state[_ETA_TO + i], state[_SQUARE_TO + i] = state[_ETA + i], state[_SQUARE + i]
        state[_K_TO + i], state[_PROMISE + i] = math.sqrt(state[_SQUARE + i]), math.inf
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
            state[_ETA + i] = state[_ETA_TO + i] if take else state[_ETA + i]
            state[_SQUARE + i] = state[_SQUARE_TO + i] if take else state[_SQUARE + i]
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
            eta, square = state[_ETA + i], state[_SQUARE + i]
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
