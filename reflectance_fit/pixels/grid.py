"""The grid from whose lowest local minima descents begin, compiled: readings, points and minima of a block."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import inlined
from reflectance_fit.physics.kernels import interface
from reflectance_fit.pixels.rows import Float32Array, FloatArray
from reflectance_fit.pixels.sums import VIEW, B, Q
from reflectance_fit.pixels.verdict import STARTS


@inlined
def lanes(row: Float32Array, first: int, count: int, line: FloatArray) -> None:
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
def of_all_points(angles: FloatArray, eta: FloatArray, k: FloatArray, of_points: FloatArray) -> None:
    """q of every view and point of the grid at the angles of lane 0: for each view and B points the lines of q."""
    groups = len(eta) // B
    for group in range(len(of_points) // (Q * B)):
        v, first = group // groups, (group % groups) * B
        c, s = angles[v * VIEW * B], angles[v * VIEW * B + B]
        q, etas, ks = of_points[group * Q * B :][: Q * B], eta[first:][:B], k[first:][:B]
        for i in range(B):
            q[i], q[B + i], q[2 * B + i], q[3 * B + i] = interface(c, s, etas[i], ks[i])


@inlined
def lowest_minima(grid: FloatArray, rows: int, columns: int, best: FloatArray) -> None:
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
