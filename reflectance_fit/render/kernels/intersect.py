"""What rays meet, a shape at a time, all lanes beside one another.

No distance is too small to count: a ray cannot meet again the flat shape that
it leaves, and of the sphere that it leaves it meets the other side, where c = 0
in t^2 - 2 b t + c = 0 is known exactly.  So nothing leaks at any scale.
"""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    BEYOND,
    DX,
    DY,
    DZ,
    EDGE_U,
    EDGE_V,
    FAR,
    FEW,
    KIND,
    LAMP,
    LANES,
    LEFT,
    LX,
    LY,
    LZ,
    MET,
    MISS,
    MOST,
    NORMAL,
    NOTHING,
    NX,
    NY,
    NZ,
    OF_KIND,
    OX,
    OY,
    OZ,
    PLACE,
    POLARIZER,
    PX,
    PY,
    PZ,
    RADIUS2,
    REACH,
    SEEN,
    SHAPE,
    SHAPE_IDS,
    SPHERES,
    STATE,
    TARGET,
    Floats,
    Has,
    Tables,
    Words,
    u32,
)
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def _to_sphere(
    cx: float, cy: float, cz: float, dx: float, dy: float, dz: float, radius2: float, left: bool, after: float
) -> float:
    """Distance from the origin, c before its centre, along d; infinite: not met."""
    zero, inf = like(0.0, cx), like(np.inf, cx)
    b = cx * dx + cy * dy + cz * dz
    # From the point nearest to the centre, where nothing cancels.
    px, py, pz = cx - b * dx, cy - b * dy, cz - b * dz
    rest = radius2 - (px * px + py * py + pz * pz)
    half = math.sqrt(max(rest, zero))
    near, far = b - half, b + half
    t = sel(left, b + b, sel(near > after, near, far))
    return sel((t > after) & (left | (rest > zero)), t, inf)


@vectorised
def closest(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """The nearest shape on each ray, MET, and its distance, FAR; NOTHING and infinity where there is none."""
    shapes, counts = tables.shapes, tables.counts
    zero, one, inf = like(0.0, F[0]), like(1.0, F[0]), like(np.inf, F[0])
    for j in range(LANES):
        F[FAR + j] = inf
        I[MET + j] = u32(NOTHING)
    spheres, rectangles, disks = counts[0], counts[1], counts[2]
    for s in range(spheres):
        g = s * SHAPE
        x, y, z, r2 = shapes[g], shapes[g + 1], shapes[g + 2], shapes[g + RADIUS2]
        me = u32(s)
        for j in range(LANES):
            after = F[BEYOND + j] if len(has.sheets) > 0 else zero
            t = _to_sphere(
                x - F[OX + j], y - F[OY + j], z - F[OZ + j], F[DX + j], F[DY + j], F[DZ + j],
                r2, I[LEFT + j] == me, after,
            )  # fmt: skip
            nearer = t < F[FAR + j]
            F[FAR + j] = sel(nearer, t, F[FAR + j])
            I[MET + j] = sel(nearer, me, I[MET + j])
    for s in range(spheres, spheres + rectangles + disks + counts[3]):
        g = s * SHAPE
        x, y, z = shapes[g], shapes[g + 1], shapes[g + 2]
        nx, ny, nz = shapes[g + NORMAL], shapes[g + NORMAL + 1], shapes[g + NORMAL + 2]
        ux, uy, uz = shapes[g + EDGE_U], shapes[g + EDGE_U + 1], shapes[g + EDGE_U + 2]
        vx, vy, vz = shapes[g + EDGE_V], shapes[g + EDGE_V + 1], shapes[g + EDGE_V + 2]
        me = u32(s)
        circular = s >= spheres + rectangles
        for j in range(LANES):
            after = F[BEYOND + j] if len(has.sheets) > 0 else zero
            cx, cy, cz = F[OX + j] - x, F[OY + j] - y, F[OZ + j] - z
            dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
            t = -(cx * nx + cy * ny + cz * nz) / (dx * nx + dy * ny + dz * nz)
            px, py, pz = cx + t * dx, cy + t * dy, cz + t * dz
            u, v = abs(px * ux + py * uy + pz * uz), abs(px * vx + py * vy + pz * vz)
            extent = sel(circular, u * u + v * v, max(u, v))
            nearer = (t > after) & (t < F[FAR + j]) & (extent <= one) & (I[LEFT + j] != me)
            F[FAR + j] = sel(nearer, t, F[FAR + j])
            I[MET + j] = sel(nearer, me, I[MET + j])


@vectorised
def shadow(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """SEEN: 1 where nothing but sheets lies between the point met and the sampled light, else 0."""
    shapes, shape_ids, counts = tables.shapes, tables.shape_ids, tables.counts
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    for j in range(LANES):
        F[SEEN + j] = one
    spheres, rectangles, disks = counts[0], counts[1], counts[2]
    # No light hides itself.  Where there is one, its shape is left out for all lanes alike.
    alone = len(has.lamps) == 1
    for s in range(spheres):
        if alone and shape_ids[s * SHAPE_IDS + OF_KIND] == u32(LAMP):
            continue
        g = s * SHAPE
        x, y, z, r2 = shapes[g], shapes[g + 1], shapes[g + 2], shapes[g + RADIUS2]
        me = u32(s)
        for j in range(LANES):
            t = _to_sphere(
                x - F[PX + j], y - F[PY + j], z - F[PZ + j], F[LX + j], F[LY + j], F[LZ + j],
                r2, I[MET + j] == me, zero,
            )  # fmt: skip
            hidden = (t < F[REACH + j]) & (alone | (I[TARGET + j] != me))
            F[SEEN + j] = sel(hidden, zero, F[SEEN + j])
    for s in range(spheres, spheres + rectangles + disks + counts[3]):
        if len(has.sheets) > 0 and shape_ids[s * SHAPE_IDS + OF_KIND] >= u32(POLARIZER):
            continue
        if alone and shape_ids[s * SHAPE_IDS + OF_KIND] == u32(LAMP):
            continue
        g = s * SHAPE
        x, y, z = shapes[g], shapes[g + 1], shapes[g + 2]
        nx, ny, nz = shapes[g + NORMAL], shapes[g + NORMAL + 1], shapes[g + NORMAL + 2]
        ux, uy, uz = shapes[g + EDGE_U], shapes[g + EDGE_U + 1], shapes[g + EDGE_U + 2]
        vx, vy, vz = shapes[g + EDGE_V], shapes[g + EDGE_V + 1], shapes[g + EDGE_V + 2]
        me = u32(s)
        circular = s >= spheres + rectangles
        for j in range(LANES):
            cx, cy, cz = F[PX + j] - x, F[PY + j] - y, F[PZ + j] - z
            dx, dy, dz = F[LX + j], F[LY + j], F[LZ + j]
            t = -(cx * nx + cy * ny + cz * nz) / (dx * nx + dy * ny + dz * nz)
            px, py, pz = cx + t * dx, cy + t * dy, cz + t * dz
            u, v = abs(px * ux + py * uy + pz * uz), abs(px * vx + py * vy + pz * vz)
            extent = sel(circular, u * u + v * v, max(u, v))
            hidden = (
                (t > zero) & (t < F[REACH + j]) & (extent <= one)
                & (I[MET + j] != me) & (alone | (I[TARGET + j] != me))
            )  # fmt: skip
            F[SEEN + j] = sel(hidden, zero, F[SEEN + j])


@vectorised
def meet(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """The point met, moved onto the shape, its outward normal and KIND, MISS without one."""
    shapes, shape_ids = tables.shapes, tables.shape_ids
    one, zero = like(1.0, F[0]), like(0.0, F[0])
    for j in range(LANES):
        missed = I[MET + j] == u32(NOTHING)
        s = sel(missed, u32(0), I[MET + j])
        round_ = s < u32(tables.counts[SPHERES])
        # Of a sphere centre and radius, of a plane its normal and how far it is from the origin along it.
        if len(has.few) > 0:
            x, y, z, size, kind = zero, zero, one, zero, u32(MISS)
            for k in range(FEW):
                mine, g = s == u32(k), k * SHAPE + PLACE
                x, y = sel(mine, shapes[g], x), sel(mine, shapes[g + 1], y)
                z, size = sel(mine, shapes[g + 2], z), sel(mine, shapes[g + 3], size)
                kind = sel(mine, shape_ids[k * SHAPE_IDS + OF_KIND], kind)
        else:
            g = (s & MOST) * SHAPE + PLACE
            x, y, z, size = shapes[g], shapes[g + 1], shapes[g + 2], shapes[g + 3]
            kind = shape_ids[(s & MOST) * SHAPE_IDS + OF_KIND]
        t = sel(missed, zero, F[FAR + j])
        px, py, pz = F[OX + j] + t * F[DX + j], F[OY + j] + t * F[DY + j], F[OZ + j] + t * F[DZ + j]
        nx, ny, nz = sel(round_, px - x, x), sel(round_, py - y, y), sel(round_, pz - z, z)
        length = one / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * length, ny * length, nz * length
        off = size - (px * nx + py * ny + pz * nz)
        F[NX + j], F[NY + j], F[NZ + j] = nx, ny, nz
        F[PX + j] = sel(round_, x + size * nx, px + off * nx)
        F[PY + j] = sel(round_, y + size * ny, py + off * ny)
        F[PZ + j] = sel(round_, z + size * nz, pz + off * nz)
        I[MET + j] = s  # a shape there is, for lanes that are listed without need
        asleep = I[STATE + j] != u32(0)
        I[KIND + j] = sel(asleep, u32(10), sel(missed, u32(MISS), kind))
