"""Lists of lanes that meet a rarer kind of surface, and the way back from what it made of them."""

from __future__ import annotations

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    AX,
    AY,
    AZ,
    DENSITY,
    DX,
    DY,
    DZ,
    LANES,
    LIST,
    Q_ALONE,
    Q_DENSITY,
    Q_FACTOR,
    Q_LIGHT,
    Q_SQUEEZE,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    ROWS,
    SQUEEZE,
    Has,
    components,
    gathered,
    row_count,
)
from reflectance_fit.render.lobes.mueller import reflect, turn

u32 = np.uint32

# What one round of a loop over a list takes on: a vector of the widest registers in float32.
CHUNK = 16


@stage
def listed(I: np.ndarray, field: int, wanted: int) -> int:
    """Writes the lanes whose field has the wanted value to LIST; how many they are."""
    n = u32(0)
    for j in range(LANES):
        I[u32(u32(LIST) + n)] = u32(j)
        n = u32(n + u32(I[field + j] == u32(wanted)))
    return n


@stage
def put_back(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, n: int) -> None:
    """New direction, density, axis; rows times factor or block."""
    for q in range(n):
        j = I[u32(u32(LIST) + u32(q))]
        F[u32(u32(DX) + j)] = Q[QX + q]
        F[u32(u32(DY) + j)] = Q[QY + q]
        F[u32(u32(DZ) + j)] = Q[QZ + q]
        F[u32(u32(DENSITY) + j)] = Q[Q_DENSITY + q]
        F[u32(u32(SQUEEZE) + j)] = Q[Q_SQUEEZE + q]
        if len(has.spectral) > 0:
            F[u32(u32(ALONE) + j)] = Q[Q_ALONE + q]
        if len(has.rows) > 0:
            F[u32(u32(AX) + j)] = Q[QA + q]
            F[u32(u32(AY) + j)] = Q[QB + q]
            F[u32(u32(AZ) + j)] = Q[QC + q]
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                for s in range(components(has)):
                    k = (c * row_count(has) + r) * components(has) + s
                    F[u32(u32(ROWS + k * LANES) + j)] = Q[Q_FACTOR + k * LANES + q]


@stage
def take_light(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, n: int) -> None:
    """Adds what the listed lanes got from the sampled light."""
    for q in range(n):
        j = I[u32(u32(LIST) + u32(q))]
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                k = c * row_count(has) + r
                F[u32(u32(gathered(has, c, r)) + j)] += Q[Q_LIGHT + k * LANES + q]


@stage
def weigh(
    has: Has, F: np.ndarray, Q: np.ndarray, c: int, q: int, j: int,
    a: float, b: float, e: float, d: float, cos: float, sin: float,
) -> None:  # fmt: skip
    """A lane's rows of one channel, turned into the plane of incidence, times the block (a, b, e, d) of a Mueller matrix."""
    for r in range(row_count(has)):
        k = (c * row_count(has) + r) * components(has) * LANES
        if len(has.rows) == 0:
            Q[Q_FACTOR + k + q] = F[u32(u32(ROWS + k) + j)] * a
        else:
            r0, r3 = F[u32(u32(ROWS + k) + j)], F[u32(u32(ROWS + k + 3 * LANES) + j)]
            r1, r2 = turn(F[u32(u32(ROWS + k + LANES) + j)], F[u32(u32(ROWS + k + 2 * LANES) + j)], cos, sin)
            r0, r1, r2, r3 = reflect(r0, r1, r2, r3, a, b, e, d)
            Q[Q_FACTOR + k + q] = r0
            Q[Q_FACTOR + k + LANES + q] = r1
            Q[Q_FACTOR + k + 2 * LANES + q] = r2
            Q[Q_FACTOR + k + 3 * LANES + q] = r3
