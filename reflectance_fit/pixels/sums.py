"""Readings of a block of pixels as sums, compiled: all that a fit of eta and k needs of them.

A signal is g p . q with q = (R_s, R_p, Re C, Im C) of its view's angle, C = r_s conj(r_p), and p of the optics.  The
readings of one view and one gain, a cell, enter chi2 only through

    A = sum w p p^T,   b = sum w p y,   c = sum w y^2,

so that a descent's steps cost the same whatever the number of frames.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.derivatives import interface_gradients
from reflectance_fit.physics.jit import inlined
from reflectance_fit.pixels.rows import FloatArray

IntArray = NDArray[np.int64]

B = 64  # lanes of a block; constant, so that the compiler knows that lines of a buffer do not meet

_LEAST_K = 1e-10  # to divide by where k = 0

# Lines of a cell: the upper triangle of A by rows, then b.
CELL = 14
# Lines of a gain: q A q, b q; those with the derivatives f of q by eta and h by k^2: f A q, h A q, f A f, f A h, h A h,
# b f, b h.
GAIN = 9
# Lines of a view: cosine and sine of the angle.
VIEW = 2
# Lines of q.
Q = 4
# Lines of q, f and h.
JET = 12
# Lines of what `evaluate` finds: chi2; half its slope downwards by eta and by k^2; half its curvature.
CHI2, SLOPE_1, SLOPE_2, CURVE_11, CURVE_12, CURVE_22 = (i * B for i in range(6))
FOUND = 6


@inlined
def accumulate(
    cell: FloatArray,
    total: FloatArray,
    readings: FloatArray,
    lit: FloatArray,
    weight: FloatArray,
    value: FloatArray,
    response: FloatArray,
    crossed: bool,
    cos_2s: FloatArray,
    sin_2s: FloatArray,
) -> None:
    """One frame's readings into the sums of its cell; ``total`` is c, ``readings`` their number, ``lit`` that of its
    gain.  A reading that is not there has weight and value 0."""
    p, weighted = np.empty(4 * B), np.empty(B)
    for a in range(4 if crossed else 2):
        line, r = p[a * B : (a + 1) * B], response[a]
        for i in range(B):
            line[i] = r[0] + r[1] * cos_2s[i] + r[2] * sin_2s[i]
    for a in range(4 if crossed else 2):
        one = p[a * B : (a + 1) * B]
        for i in range(B):
            weighted[i] = weight[i] * one[i]
        for b in range(a, 4 if crossed else 2):
            # By rows of the upper triangle.
            at = (a * (7 - a) // 2 + b) * B
            line, two = cell[at : at + B], p[b * B : (b + 1) * B]
            for i in range(B):
                line[i] += weighted[i] * two[i]
        line = cell[(10 + a) * B : (11 + a) * B]
        for i in range(B):
            line[i] += weighted[i] * value[i]
    for i in range(B):
        total[i] += weight[i] * value[i] * value[i]
    for i in range(B):
        readings[i] += 1.0 if weight[i] > 0 else 0.0
    for i in range(B):
        lit[i] += 1.0 if weight[i] > 0 else 0.0


@inlined
def objective(
    cells: FloatArray,
    cell_view: IntArray,
    cell_gain: IntArray,
    gains: int,
    crossed: bool,
    total: FloatArray,
    of_views: FloatArray,
    of_gains: FloatArray,
    chi2: FloatArray,
) -> None:
    """chi2 of every lane at the q ``of_views``, the gains at their best; infinite where one of them is not above 0.

    ``crossed``: readings feel C, as in light with S2 or S3.
    """
    for g in range(gains + 1):
        gain = of_gains[g * GAIN * B : (g + 1) * GAIN * B]
        for i in range(2 * B):
            gain[i] = 0.0
    for a in range(len(cell_view)):
        cell, gain = cells[a * CELL * B :], of_gains[cell_gain[a] * GAIN * B :]
        q = of_views[cell_view[a] * Q * B :]
        if crossed:
            for i in range(B):
                q0, q1, q2, q3 = q[i], q[B + i], q[2 * B + i], q[3 * B + i]
                a0, a1, a2, a3 = _times(cell, i, q0, q1, q2, q3)
                gain[i] += q0 * a0 + q1 * a1 + q2 * a2 + q3 * a3
                b0, b1, b2, b3 = cell[10 * B + i], cell[11 * B + i], cell[12 * B + i], cell[13 * B + i]
                gain[B + i] += q0 * b0 + q1 * b1 + q2 * b2 + q3 * b3
        else:
            for i in range(B):
                q0, q1, b0, b1 = q[i], q[B + i], cell[10 * B + i], cell[11 * B + i]
                a0, a1 = _times_powers(cell, i, q0, q1)
                gain[i] += q0 * a0 + q1 * a1
                gain[B + i] += q0 * b0 + q1 * b1
    for i in range(B):
        chi2[i] = total[i]
    for g in range(cell_gain.max() + 1):
        gain = of_gains[g * GAIN * B : (g + 1) * GAIN * B]
        for i in range(B):
            normal, right = gain[i], gain[B + i]
            best = right / normal if g < gains else 1.0
            change = best * (best * normal - 2 * right)
            # Without readings there is no gain.
            chi2[i] += (change if best > 0 else math.inf) if normal > 0 else 0.0


@inlined
def _times(
    cell: FloatArray, i: int, q0: float, q1: float, q2: float, q3: float
) -> tuple[float, float, float, float]:
    """A q."""
    a01, a02, a03 = cell[B + i], cell[2 * B + i], cell[3 * B + i]
    a12, a13, a23 = cell[5 * B + i], cell[6 * B + i], cell[8 * B + i]
    return (
        cell[i] * q0 + a01 * q1 + a02 * q2 + a03 * q3,
        a01 * q0 + cell[4 * B + i] * q1 + a12 * q2 + a13 * q3,
        a02 * q0 + a12 * q1 + cell[7 * B + i] * q2 + a23 * q3,
        a03 * q0 + a13 * q1 + a23 * q2 + cell[9 * B + i] * q3,
    )


@inlined
def _times_powers(cell: FloatArray, i: int, q0: float, q1: float) -> tuple[float, float]:
    """A q where nothing but R_s and R_p is read."""
    a01 = cell[B + i]
    return cell[i] * q0 + a01 * q1, a01 * q0 + cell[4 * B + i] * q1


@inlined
def _gather(cell: FloatArray, jet: FloatArray, gain: FloatArray) -> None:
    """Add what a cell has of its gain's lines."""
    for i in range(B):
        q0, q1, q2, q3 = jet[i], jet[B + i], jet[2 * B + i], jet[3 * B + i]
        a0, a1, a2, a3 = _times(cell, i, q0, q1, q2, q3)
        b0, b1, b2, b3 = cell[10 * B + i], cell[11 * B + i], cell[12 * B + i], cell[13 * B + i]
        gain[i] += q0 * a0 + q1 * a1 + q2 * a2 + q3 * a3
        gain[B + i] += q0 * b0 + q1 * b1 + q2 * b2 + q3 * b3
        f0, f1, f2, f3 = jet[4 * B + i], jet[5 * B + i], jet[6 * B + i], jet[7 * B + i]
        h0, h1, h2, h3 = jet[8 * B + i], jet[9 * B + i], jet[10 * B + i], jet[11 * B + i]
        gain[2 * B + i] += f0 * a0 + f1 * a1 + f2 * a2 + f3 * a3
        gain[3 * B + i] += h0 * a0 + h1 * a1 + h2 * a2 + h3 * a3
        gain[7 * B + i] += f0 * b0 + f1 * b1 + f2 * b2 + f3 * b3
        gain[8 * B + i] += h0 * b0 + h1 * b1 + h2 * b2 + h3 * b3
        a0, a1, a2, a3 = _times(cell, i, f0, f1, f2, f3)
        gain[4 * B + i] += f0 * a0 + f1 * a1 + f2 * a2 + f3 * a3
        gain[5 * B + i] += h0 * a0 + h1 * a1 + h2 * a2 + h3 * a3
        a0, a1, a2, a3 = _times(cell, i, h0, h1, h2, h3)
        gain[6 * B + i] += h0 * a0 + h1 * a1 + h2 * a2 + h3 * a3


@inlined
def _gather_powers(cell: FloatArray, jet: FloatArray, gain: FloatArray) -> None:
    """`_gather` where nothing but R_s and R_p is read: a quarter of the work."""
    for i in range(B):
        q0, q1, b0, b1 = jet[i], jet[B + i], cell[10 * B + i], cell[11 * B + i]
        f0, f1, h0, h1 = jet[4 * B + i], jet[5 * B + i], jet[8 * B + i], jet[9 * B + i]
        a0, a1 = _times_powers(cell, i, q0, q1)
        gain[i] += q0 * a0 + q1 * a1
        gain[B + i] += q0 * b0 + q1 * b1
        gain[2 * B + i] += f0 * a0 + f1 * a1
        gain[3 * B + i] += h0 * a0 + h1 * a1
        gain[7 * B + i] += f0 * b0 + f1 * b1
        gain[8 * B + i] += h0 * b0 + h1 * b1
        a0, a1 = _times_powers(cell, i, f0, f1)
        gain[4 * B + i] += f0 * a0 + f1 * a1
        gain[5 * B + i] += h0 * a0 + h1 * a1
        a0, a1 = _times_powers(cell, i, h0, h1)
        gain[6 * B + i] += h0 * a0 + h1 * a1


@inlined
def evaluate(
    cells: FloatArray,
    cell_view: IntArray,
    cell_gain: IntArray,
    gains: int,
    crossed: bool,
    angles: FloatArray,
    total: FloatArray,
    eta: FloatArray,
    k: FloatArray,
    jet: FloatArray,
    of_gains: FloatArray,
    found: FloatArray,
) -> None:
    """As `objective`, each lane at its own eta and k, with slopes and Gauss-Newton's curvature by eta and k^2."""
    for i in range(len(of_gains)):
        of_gains[i] = 0.0
    for a in range(len(cell_view)):
        cell, gain = cells[a * CELL * B :], of_gains[cell_gain[a] * GAIN * B :]
        if a == 0 or cell_view[a] != cell_view[a - 1]:
            angle = angles[cell_view[a] * VIEW * B :]
            if crossed:
                for i in range(B):
                    q, _, f, h = interface_gradients(angle[i], angle[B + i], eta[i], k[i])
                    scale = 0.5 / max(k[i], _LEAST_K)
                    jet[i], jet[B + i], jet[2 * B + i], jet[3 * B + i] = q
                    jet[4 * B + i], jet[5 * B + i], jet[6 * B + i], jet[7 * B + i] = f
                    jet[8 * B + i], jet[9 * B + i] = scale * h[0], scale * h[1]
                    jet[10 * B + i], jet[11 * B + i] = scale * h[2], scale * h[3]
            else:
                for i in range(B):
                    q, _, f, h = interface_gradients(angle[i], angle[B + i], eta[i], k[i])
                    scale = 0.5 / max(k[i], _LEAST_K)
                    jet[i], jet[B + i] = q[0], q[1]
                    jet[4 * B + i], jet[5 * B + i] = f[0], f[1]
                    jet[8 * B + i], jet[9 * B + i] = scale * h[0], scale * h[1]
        if crossed:
            _gather(cell, jet, gain)
        else:
            _gather_powers(cell, jet, gain)
    for i in range(FOUND * B):
        found[i] = 0.0
    for i in range(B):
        found[CHI2 + i] = total[i]
    for g in range(cell_gain.max() + 1):
        gain = of_gains[g * GAIN * B : (g + 1) * GAIN * B]
        # Gains at their best follow eta and k: their directions are taken out of the curvature.
        share = 1.0 if g < gains else 0.0
        for i in range(B):
            normal, right, m1, m2 = gain[i], gain[B + i], gain[2 * B + i], gain[3 * B + i]
            there = normal > 0
            inverse = 1 / normal if there else 0.0
            best = (right * inverse if g < gains else 1.0) if there else 0.0
            change = best * (best * normal - 2 * right)
            found[CHI2 + i] += (change if best > 0 else math.inf) if there else 0.0
            found[SLOPE_1 + i] += best * (gain[7 * B + i] - best * m1)
            found[SLOPE_2 + i] += best * (gain[8 * B + i] - best * m2)
            inverse *= share
            best2 = best * best
            found[CURVE_11 + i] += best2 * (gain[4 * B + i] - m1 * m1 * inverse)
            found[CURVE_12 + i] += best2 * (gain[5 * B + i] - m1 * m2 * inverse)
            found[CURVE_22 + i] += best2 * (gain[6 * B + i] - m2 * m2 * inverse)
