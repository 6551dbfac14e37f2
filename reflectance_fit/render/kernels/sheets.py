"""Polarizer and retarder sheets: rays and sampled light pass them straight on, each with its Mueller matrix.

A tilted polarizer blocks what lies along the projection of its blocking axis (Korger et al., "The polarization
properties of a tilted polarizer", Opt. Express 21 (2013) 27032); a retarder has its fast axis projected and its retardance
at every angle.
"""

from __future__ import annotations

import math

import numpy as np

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
    DX,
    DY,
    DZ,
    EDGE_U,
    EDGE_V,
    LAMPS,
    LANES,
    LIGHT,
    LX,
    LY,
    LZ,
    M0,
    M1,
    M2,
    M3,
    MET,
    MOST,
    NORMAL,
    OF_KIND,
    POLARIZER,
    PX,
    PY,
    PZ,
    Q_ALONE,
    Q_DENSITY,
    Q_FACTOR,
    Q_SQUEEZE,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    REACH,
    SEEN,
    SHAPE,
    SHAPE_IDS,
    SQUEEZE,
    STATE_1,
    STATE_2,
    STATE_3,
    Floats,
    Has,
    Tables,
    Words,
    components,
    row,
    row_count,
    u32,
)
from reflectance_fit.render.kernels.polarization import state_of
from reflectance_fit.render.kernels.queue import CHUNK
from reflectance_fit.render.kernels.values import frame
from reflectance_fit.render.lobes.mueller import double_angle, polarize, retard, turn
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def _axis(
    shapes: Floats, g: int, polarizer: bool, dx: float, dy: float, dz: float
) -> tuple[float, float, float]:
    """The axis of the sheet whose numbers begin at g, transmitting or fast, for a ray along d."""
    one, tiny = like(1.0, dx), like(1e-18, dx)
    ux, uy, uz = (
        shapes[g + EDGE_U],
        shapes[g + EDGE_U + 1],
        shapes[g + EDGE_U + 2],
    )
    vx, vy, vz = (
        shapes[g + EDGE_V],
        shapes[g + EDGE_V + 1],
        shapes[g + EDGE_V + 2],
    )
    cos, sin = shapes[g + M0], shapes[g + M1]
    along, across = sel(polarizer, -sin, cos), sel(polarizer, cos, sin)
    along = along / math.sqrt(ux * ux + uy * uy + uz * uz)
    across = across / math.sqrt(vx * vx + vy * vy + vz * vz)
    x, y, z = along * ux + across * vx, along * uy + across * vy, along * uz + across * vz
    part = x * dx + y * dy + z * dz
    x, y, z = x - part * dx, y - part * dy, z - part * dz
    length = one / math.sqrt(max(x * x + y * y + z * z, tiny))
    x, y, z = x * length, y * length, z * length
    return (
        sel(polarizer, y * dz - z * dy, x),
        sel(polarizer, z * dx - x * dz, y),
        sel(polarizer, x * dy - y * dx, z),
    )


@vectorised
def _through(
    shapes: Floats, g: int, polarizer: bool, r0: float, r1: float, r2: float, r3: float
) -> tuple[float, float, float, float]:
    """A row times the sheet's matrix, in the frame of its axis."""
    p0, p1, p2, p3 = polarize(r0, r1, r2, r3, shapes[g + M2])
    q2, q3 = retard(r2, r3, shapes[g + M2], shapes[g + M3])
    return sel(polarizer, p0, r0), sel(polarizer, p1, r1), sel(polarizer, p2, q2), sel(polarizer, p3, q3)


@vectorised
def sheet(has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, kind: int, n: int) -> None:
    """Camera rays through one kind of sheet."""
    half, one = like(0.5, F[0]), like(1.0, F[0])
    polarizer = kind == POLARIZER
    for block in range(0, n, CHUNK):
        for j in range(block, block + CHUNK):
            g = (I[MET + j] & MOST) * SHAPE
            dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
            Q[QX + j], Q[QY + j], Q[QZ + j] = dx, dy, dz
            Q[Q_DENSITY + j] = F[DENSITY + j]
            Q[Q_SQUEEZE + j] = F[SQUEEZE + j]
            Q[Q_ALONE + j] = F[ALONE + j]
            cos, sin = one, half
            if len(has.rows) > 0:
                ax, ay, az = F[AX + j], F[AY + j], F[AZ + j]
                sx, sy, sz = _axis(tables.shapes, g, polarizer, dx, dy, dz)
                cos, sin = double_angle(ax, ay, az, sx, sy, sz, -dx, -dy, -dz)
                Q[QA + j], Q[QB + j], Q[QC + j] = sx, sy, sz
            for c in range(len(has.channels)):
                for r in range(row_count(has)):
                    f = row(has, c, r, 0) + j
                    k = Q_FACTOR + (c * row_count(has) + r) * components(has) * LANES + j
                    if len(has.rows) == 0:
                        Q[k] = F[f] * (half if polarizer else one)
                    else:
                        r1, r2 = turn(F[f + LANES], F[f + 2 * LANES], cos, sin)
                        r3 = F[f + 3 * LANES]
                        r0, r1, r2, r3 = _through(tables.shapes, g, polarizer, F[f], r1, r2, r3)
                        Q[k], Q[k + LANES], Q[k + 2 * LANES], Q[k + 3 * LANES] = r0, r1, r2, r3


@vectorised
def _distance(F: Floats, shapes: Floats, g: int, circular: bool, j: int) -> float:
    """From the point met to the sheet, along the direction of the sampled light; infinite: not between the two."""
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    cx, cy, cz = F[PX + j] - shapes[g], F[PY + j] - shapes[g + 1], F[PZ + j] - shapes[g + 2]
    dx, dy, dz = F[LX + j], F[LY + j], F[LZ + j]
    nx, ny, nz = shapes[g + NORMAL], shapes[g + NORMAL + 1], shapes[g + NORMAL + 2]
    t = -(cx * nx + cy * ny + cz * nz) / (dx * nx + dy * ny + dz * nz)
    px, py, pz = cx + t * dx, cy + t * dy, cz + t * dz
    u = abs(px * shapes[g + EDGE_U] + py * shapes[g + EDGE_U + 1] + pz * shapes[g + EDGE_U + 2])
    v = abs(px * shapes[g + EDGE_V] + py * shapes[g + EDGE_V + 1] + pz * shapes[g + EDGE_V + 2])
    extent = sel(circular, u * u + v * v, max(u, v))
    between = (t > zero) & (t < F[REACH + j]) & (extent <= one)
    return sel(between, t, like(np.inf, one))


@vectorised
def lit_through_sheets(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """What sheets leave of the sampled light: S0 into SEEN, the rest over S0 into STATE_1 to STATE_3, of axis B.

    Lane by lane: from the light on, through the sheets in the order of their distance.
    """
    shapes, shape_ids, counts, lamps = tables.shapes, tables.shape_ids, tables.counts, tables.lamps
    zero, half, one = like(0.0, F[0]), like(0.5, F[0]), like(1.0, F[0])
    first, last = counts[0], counts[0] + counts[1] + counts[2]
    for j in range(LANES):
        dx, dy, dz = F[LX + j], F[LY + j], F[LZ + j]
        s0, s1, s2, s3 = one, zero, zero, zero
        bx, by, bz = frame(dx, dy, dz)[:3]
        if len(has.polarized) > 0:
            lamp = I[LIGHT + j] if len(has.lamps) > 1 else u32(0)
            bx, by, bz, s1, s2, s3 = state_of(lamps, lamp * LAMPS, dx, dy, dz)
        before = like(np.inf, one)
        for _ in range(first, last):
            # The farthest sheet that is not behind the light or passed already.
            far, place = zero, -1
            for s in range(first, last):
                if shape_ids[s * SHAPE_IDS + OF_KIND] >= u32(POLARIZER):
                    t = _distance(F, shapes, s * SHAPE, s >= counts[0] + counts[1], j)
                    if t > far and t < before:
                        far, place = t, s
            if place < 0:
                break
            before = far
            g = place * SHAPE
            polarizer = shape_ids[place * SHAPE_IDS + OF_KIND] == u32(POLARIZER)
            if len(has.rows) == 0:
                s0 = s0 * (half if polarizer else one)
                continue
            x, y, z = _axis(shapes, g, polarizer, dx, dy, dz)
            cos, sin = double_angle(bx, by, bz, x, y, z, -dx, -dy, -dz)
            s1, s2 = turn(s1, s2, cos, sin)
            # Columns: the matrices in their own frames are those of rows, a retarder's transposed.
            s0, s1, s2, s3 = _on_state(shapes, g, polarizer, s0, s1, s2, s3)
            bx, by, bz = x, y, z
        F[SEEN + j] = F[SEEN + j] * s0
        if len(has.rows) > 0:
            over = sel(s0 > zero, one / s0, zero)
            F[BX + j], F[BY + j], F[BZ + j] = bx, by, bz
            F[STATE_1 + j], F[STATE_2 + j], F[STATE_3 + j] = s1 * over, s2 * over, s3 * over


@vectorised
def _on_state(
    shapes: Floats, g: int, polarizer: bool, s0: float, s1: float, s2: float, s3: float
) -> tuple[float, float, float, float]:
    """The sheet's matrix times a Stokes vector, in the frame of its axis."""
    p0, p1, p2, p3 = polarize(s0, s1, s2, s3, shapes[g + M2])
    q2, q3 = retard(s2, s3, shapes[g + M2], -shapes[g + M3])
    return sel(polarizer, p0, s0), sel(polarizer, p1, s1), sel(polarizer, p2, q2), sel(polarizer, p3, q3)
