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

from reflectance_fit.physics.jit import threaded
from reflectance_fit.physics.kernels import interface
from reflectance_fit.pixels.closed_form import sin_cos
from reflectance_fit.pixels.grid import lanes, lowest_minima, of_all_points
from reflectance_fit.pixels.newton import ETA, SQUARE, STATE, descend_lanes, upper_limits
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
    VIEW,
    B,
    IntArray,
    Q,
    accumulate,
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

# Light must lower chi2 by as much.
_LIGHT = 9.0


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
            lanes(theta[v], first, count, line)
            for i in range(B):
                s, c = sin_cos(line[i])
                angle[i], angle[B + i] = c, s
            for i in range(B):
                alike = alike and line[i] == line[0]
        for j in range(m):
            a = frame_cell[j]
            v = cell_view[a]
            lanes(variance[j], first, count, line)
            lanes(values[j], first, count, value)
            lanes(cos_2s[v], first, count, cos)
            lanes(sin_2s[v], first, count, sin)
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
        here, state = np.empty(FOUND * B), np.empty(STATE * B)
        any_active = False
        for i in range(count):
            any_active = any_active or active[i]
        grid = np.full(points * B, math.inf)
        of_points, of_views = np.empty(views * groups * Q * B), np.empty(views * Q * B)
        if alike:
            of_all_points(angles, point_eta, point_k, of_points)
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
        lowest_minima(grid, len(etas), len(ks), best)
        minima = np.empty(STARTS * MINIMUM * B)
        starting = np.zeros(B, dtype=np.bool_)
        for z in range(STARTS):
            lowest = best[z * 2 * B : (z + 1) * 2 * B]
            for i in range(B):
                starting[i] = active[i] and lowest[i] < math.inf
                p = int(lowest[B + i]) if starting[i] else 0
                state[ETA + i] = point_eta[p]
                state[SQUARE + i] = max(point_k[p] ** 2, FLOOR) if free_k else 0.0
            rested = descend_lanes(
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
                minima[at + i], minima[at + B + i] = state[ETA + i], state[SQUARE + i]
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
            upper_limits(
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
