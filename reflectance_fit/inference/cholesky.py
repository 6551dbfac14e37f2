"""Small positive definite systems, compiled: normal equations of gains and of Newton steps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.jit import kernel

FloatArray = NDArray[np.float64]


@kernel
def cholesky_solve(n: FloatArray, rhs: FloatArray) -> float:
    """Solve n x = rhs in place (n becomes its factor, rhs becomes x); log det n, NaN if not positive."""
    size = len(rhs)
    log_det = 0.0
    for j in range(size):
        for m in range(j):
            n[j, j] -= n[j, m] * n[j, m]
        if not n[j, j] > 0:
            return math.nan
        n[j, j] = math.sqrt(n[j, j])
        log_det += 2 * math.log(n[j, j])
        for i in range(j + 1, size):
            for m in range(j):
                n[i, j] -= n[i, m] * n[j, m]
            n[i, j] /= n[j, j]
    for i in range(size):
        for m in range(i):
            rhs[i] -= n[i, m] * rhs[m]
        rhs[i] /= n[i, i]
    for i in range(size - 1, -1, -1):
        for m in range(i + 1, size):
            rhs[i] -= n[m, i] * rhs[m]
        rhs[i] /= n[i, i]
    return log_det


@kernel
def inverse_diagonal(factor: FloatArray, j: int, work: FloatArray) -> float:
    """Element (j, j) of the inverse of L L^T, given L."""
    total = 0.0
    for i in range(j, len(work)):
        work[i] = 1.0 if i == j else 0.0
        for m in range(j, i):
            work[i] -= factor[i, m] * work[m]
        work[i] /= factor[i, i]
        total += work[i] * work[i]
    return total
