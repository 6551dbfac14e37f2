"""The normal equations of `problem`'s objective, compiled: what a Newton step is made of.

In whitened residuals r and their derivatives D = dr/dx,

    grad F / 2 = D^T r          Hess F / 2 ~ D^T S^-1 D - C^T N^-1 C,   C = A^T S^-1 D,  N = A^T S^-1 A

with A the columns of the gains: eliminating them is variable projection in Kaufman's form (BIT 15 (1975) 49).
S^-1 has a term of rank one for each goniometer setting whose angle has an error.

The objective is even in k, but for phases, and its Newton steps in k never arrive at k = 0.  So k may be taken
by its square; in total reflection and for phases k itself is the better coordinate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.cholesky import cholesky_solve
from reflectance_fit.inference.derivatives import gradient_at_angle
from reflectance_fit.inference.forward import DARK, DIFFUSE, FIRST_SIGMA, OFFSET, K, incidence, turns_of
from reflectance_fit.inference.problem import Problem, fill_vector
from reflectance_fit.inference.rows import LAST_POWER, Rows
from reflectance_fit.physics.jit import shared

FloatArray = NDArray[np.float64]

# Below it slopes by k^2 are those of this k: at k = 0 itself they are 0 / 0.
_SMALL_K = 1e-4


@shared
def normal_equations(
    rows: Rows,
    problem: Problem,
    x: FloatArray,
    squared: bool,
    whitened: FloatArray,
    gains: FloatArray,
    gradient: FloatArray,
    curvature: FloatArray,
) -> None:
    """Half of F's gradient and of its Hessian (Gauss-Newton) at ``x``.

    ``whitened`` and ``gains`` are what `objective` left there.  With
    ``squared``, k is taken by its square.  Where the problem is not exact the
    gradient lacks what log det S and the angles' errors add.
    """
    # Taken out of their tuples once: in a loop each time costs two atomic counts, more than all the arithmetic.
    places, logarithmic, weight = problem.places, problem.logarithmic, problem.weight
    code, censored, setting, theta_sigma = rows.code, rows.censored, rows.setting, rows.theta_sigma
    gain_of, estimated, sigma, largest = rows.gain, rows.estimated, rows.sigma, rows.largest
    size = len(x)
    # Few arrays, as each costs as much as a row or two.
    parameters = np.empty((2, len(problem.template)))
    p, by_p = parameters[0], parameters[1, :FIRST_SIGMA]
    fill_vector(problem, x, p)
    rate = np.empty(size)  # dp / dx
    for j in range(size):
        rate[j], gradient[j] = 1.0, 0.0
        if logarithmic[j]:
            rate[j] = p[places[j]]
        if squared and j == problem.square:
            p[K] = max(p[K], _SMALL_K)
            rate[j] = 0.5 / p[K]
    turns = turns_of(p)
    n = len(whitened)
    jacobian = np.zeros((size, n))
    settings = rows.settings if rows.errors_in_angle else 0
    of_gains = np.zeros((2 * rows.gains + 1, rows.gains))
    normal, factor, rhs = of_gains[: rows.gains], of_gains[rows.gains : -1], of_gains[-1]
    by_coordinate = np.zeros((2 * rows.gains, size))
    mixed, solved = by_coordinate[: rows.gains], by_coordinate[rows.gains :]
    of_settings = np.zeros((2 + size + rows.gains, settings))
    steepness, error = of_settings[0], of_settings[1]
    pull, coupling = of_settings[2 : 2 + size], of_settings[2 + size :]
    for i in range(n):
        if censored[i]:
            continue
        c, s = incidence(rows, i, turns)
        c = max(c, 0.0)
        value = gradient_at_angle(rows, i, c, s, p, turns, problem.optics, by_p)
        g = gain_of[i]
        gain = gains[g] if g >= 0 else 1.0
        e = estimated[i]
        inverse = 1 / (sigma[i] if e < 0 else math.exp(p[FIRST_SIGMA + e]))
        scale = gain * inverse
        if code[i] <= LAST_POWER:
            by_p[DARK], by_p[DIFFUSE] = 1 / gain, largest[i] / gain
        for j in range(size):
            place = places[j]
            if place < FIRST_SIGMA:
                jacobian[j, i] = -scale * by_p[place] * rate[j]
            elif place == FIRST_SIGMA + e:
                # d^2/dx^2 of e^(-2x) r^2 + 2x is 4 r^2 where it is 0 on average, not the 2 r^2 of a sum of squares.
                jacobian[j, i] = -math.sqrt(2.0) * whitened[i]
        column = value * inverse if g >= 0 else 0.0
        if g >= 0:
            normal[g, g] += column * column
            for j in range(size):
                mixed[g, j] += column * jacobian[j, i]
        if rows.errors_in_angle and theta_sigma[i] > 0:
            a = setting[i]
            slope = scale * math.degrees(by_p[OFFSET])
            error[a] = theta_sigma[i] ** 2
            steepness[a] += slope * slope
            for j in range(size):
                pull[j, a] += slope * jacobian[j, i]
            if g >= 0:
                coupling[g, a] += slope * column
    # Row by row within each sum, not sum by sum within each row: sums stay in registers.
    for j in range(size):
        which = places[j] - FIRST_SIGMA
        for i in range(n):
            if which < 0:
                gradient[j] += jacobian[j, i] * whitened[i]
            elif which == estimated[i] and not censored[i]:
                gradient[j] += 1 - whitened[i] ** 2
        for m in range(j + 1):
            total = 0.0
            for i in range(n):
                total += jacobian[j, i] * jacobian[m, i]
            curvature[j, m] = total
    if rows.errors_in_angle:
        for a in range(settings):
            share = error[a] / (1 + error[a] * steepness[a])
            for j in range(size):
                for m in range(j + 1):
                    curvature[j, m] -= share * pull[j, a] * pull[m, a]
            for g in range(rows.gains):
                for j in range(size):
                    mixed[g, j] -= share * coupling[g, a] * pull[j, a]
                for h in range(rows.gains):
                    normal[g, h] -= share * coupling[g, a] * coupling[h, a]
    for j in range(size if rows.gains > 0 else 0):
        for g in range(rows.gains):
            rhs[g] = mixed[g, j]
            for h in range(rows.gains):
                factor[g, h] = normal[g, h]
        cholesky_solve(factor, rhs)
        for g in range(rows.gains):
            solved[g, j] = rhs[g]
    for j in range(size):
        for m in range(j + 1):
            for g in range(rows.gains):
                curvature[j, m] -= mixed[g, j] * solved[g, m]
            curvature[m, j] = curvature[j, m]
        scaled = weight[j] * (rate[j] if squared and j == problem.square else 1.0)
        curvature[j, j] += scaled * scaled
        gradient[j] += (x[j] - problem.mean[j]) * weight[j] * scaled
