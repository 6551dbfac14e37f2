"""Lists of lanes that meet a rarer kind of surface, and the way back from what it made of them."""

from __future__ import annotations

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    AX,
    AY,
    AZ,
    BX,
    BY,
    BZ,
    DENSITY,
    DEPTH,
    DX,
    DY,
    DZ,
    EMIT,
    KEY,
    KIND,
    LANES,
    LAST,
    LIGHT,
    LIST,
    LIT,
    LX,
    LY,
    LZ,
    MET,
    NX,
    NY,
    NZ,
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
    SAMPLE,
    SEEN,
    SQUEEZE,
    STATE_1,
    STATE_2,
    STATE_3,
    WAVE,
    Floats,
    Has,
    Words,
    components,
    gathered,
    row,
    row_count,
    u32,
)
from reflectance_fit.render.lobes.mueller import reflect, turn

# What one round of a loop over a list takes on: a vector of the widest registers in float32.
CHUNK = 8


@vectorised
def listed(I: Words, field: int, wanted: int) -> int:
    """Writes the lanes whose field has the wanted value to LIST; how many they are."""
    n = u32(0)
    for j in range(LANES):
        I[LIST + n] = u32(j)
        n = u32(n + u32(I[field + j] == u32(wanted)))
    return n


# What surfaces read of a lane, of its ray and surface and of the sampled light.
_OF_RAY = (DX, DY, DZ, NX, NY, NZ)
_OF_LIGHT = (LX, LY, LZ, LIT, SEEN)
_OF_STATE = (BX, BY, BZ, STATE_1, STATE_2, STATE_3)
_OF_PATH = (MET, KEY, SAMPLE, DEPTH, LIGHT)
_AXIS = (AX, AY, AZ)


@vectorised
def brought(has: Has, F: Floats, I: Words, G: Floats, J: Words, kind: int) -> int:
    """Copies the lanes that meet ``kind`` to G and J, side by side, as F and I hold them; how many they are.

    A surface reads some of them several times, and gathers are what takes longest.
    """
    n = listed(I, KIND, kind)
    for q in range(n):
        j = I[LIST + q] & LAST
        for field in _OF_PATH:
            J[field + q] = I[field + j]
        for field in _OF_RAY:
            G[field + q] = F[field + j]
        if len(has.refracting) > 0:
            G[SQUEEZE + q] = F[SQUEEZE + j]
        if len(has.sheets) > 0:
            G[DENSITY + q] = F[DENSITY + j]
        if len(has.rows) > 0:
            for field in _AXIS:
                G[field + q] = F[field + j]
        if len(has.lamps) > 0:
            for field in _OF_LIGHT:
                G[field + q] = F[field + j]
            if len(has.polarized) > 0:
                for field in _OF_STATE:
                    G[field + q] = F[field + j]
        if len(has.spectral) > 0:
            G[ALONE + q] = F[ALONE + j]
        for c in range(len(has.channels)):
            if len(has.spectral) > 0:
                G[WAVE + c * LANES + q] = F[WAVE + c * LANES + j]
            if len(has.lamps) > 0:
                G[EMIT + c * LANES + q] = F[EMIT + c * LANES + j]
            for r in range(row_count(has)):
                for s in range(components(has)):
                    k = row(has, c, r, s)
                    G[k + q] = F[k + j]
    return n


@vectorised
def put_back(has: Has, F: Floats, I: Words, Q: Floats, n: int) -> None:
    """New direction, density, axis; rows times factor or block."""
    for q in range(n):
        j = I[LIST + q] & LAST
        F[DX + j] = Q[QX + q]
        F[DY + j] = Q[QY + q]
        F[DZ + j] = Q[QZ + q]
        F[DENSITY + j] = Q[Q_DENSITY + q]
        F[SQUEEZE + j] = Q[Q_SQUEEZE + q]
        if len(has.spectral) > 0:
            F[ALONE + j] = Q[Q_ALONE + q]
        if len(has.rows) > 0:
            F[AX + j] = Q[QA + q]
            F[AY + j] = Q[QB + q]
            F[AZ + j] = Q[QC + q]
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                for s in range(components(has)):
                    k = (c * row_count(has) + r) * components(has) + s
                    F[ROWS + k * LANES + j] = Q[Q_FACTOR + k * LANES + q]


@vectorised
def take_light(has: Has, F: Floats, I: Words, Q: Floats, n: int) -> None:
    """Adds what the listed lanes got from the sampled light."""
    for q in range(n):
        j = I[LIST + q] & LAST
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                k = c * row_count(has) + r
                F[gathered(has, c, r) + j] += Q[Q_LIGHT + k * LANES + q]


@vectorised
def weigh(
    has: Has, F: Floats, Q: Floats, c: int, j: int,
    a: float, b: float, e: float, d: float, cos: float, sin: float,
) -> None:  # fmt: skip
    """A lane's rows of one channel, turned into the plane of incidence, times the block (a, b, e, d) of a Mueller matrix."""
    for r in range(row_count(has)):
        k = (c * row_count(has) + r) * components(has) * LANES
        if len(has.rows) == 0:
            Q[Q_FACTOR + k + j] = F[ROWS + k + j] * a
        else:
            r0, r3 = F[ROWS + k + j], F[ROWS + k + 3 * LANES + j]
            r1, r2 = turn(F[ROWS + k + LANES + j], F[ROWS + k + 2 * LANES + j], cos, sin)
            r0, r1, r2, r3 = reflect(r0, r1, r2, r3, a, b, e, d)
            Q[Q_FACTOR + k + j] = r0
            Q[Q_FACTOR + k + LANES + j] = r1
            Q[Q_FACTOR + k + 2 * LANES + j] = r2
            Q[Q_FACTOR + k + 3 * LANES + j] = r3
