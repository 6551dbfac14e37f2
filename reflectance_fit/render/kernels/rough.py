"""Rough metals and rough glass: GGX facets, light sampled and directions drawn by the facets that are visible."""

from __future__ import annotations

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.fresnel_of import metal_block
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    ALPHA,
    LIT,
    LX,
    LY,
    LZ,
    MET,
    MOST,
    Q_ALONE,
    Q_DENSITY,
    Q_SQUEEZE,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    SEEN,
    SHAPE,
    SHAPE_IDS,
    SQUEEZE,
    Floats,
    Has,
    Tables,
    Words,
)
from reflectance_fit.render.kernels.local import gather_light, no_light, plane_of, side, to_local, to_world
from reflectance_fit.render.kernels.queue import CHUNK, weigh
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.kernels.values import power_heuristic
from reflectance_fit.render.lobes import ggx
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def rough_metal(has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, n: int) -> None:
    """Reflection, on either side."""
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    for block in range(0, n, CHUNK):
        for j in range(block, block + CHUNK):
            here = side(F, j)
            met = I[MET + j] & MOST
            shape = met * SHAPE_IDS
            alpha = tables.shapes[met * SHAPE + ALPHA]
            no_light(has, Q, j)
            if len(has.lamps) > 0:
                lx, ly, lz = to_local(here, F[LX + j], F[LY + j], F[LZ + j])
                hx, hy, hz, cosine = ggx.half(here.vx, here.vy, here.vz, lx, ly, lz)
                d = ggx.ndf(alpha, hx, hy, hz)
                lit = F[LIT + j]
                weight = ggx.reflection_value(alpha, here.vz, lz, d) * F[SEEN + j]
                mis = power_heuristic(lit, ggx.reflection_pdf(alpha, here.vz, d))
                weight = weight * sel(lit > zero, mis, one)
                if len(has.refracting) > 0:
                    weight = weight * F[SQUEEZE + j]
                wx, wy, wz = to_world(here, hx, hy, hz)
                sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
                for c in range(len(has.channels)):
                    ra, rb, rc, rd = metal_block(has, F, tables, shape, c, j, min(cosine, one))
                    gather_light(
                        has, F, I, Q, tables.lamps, c, j, weight, sx, sy, sz, ra, rb, rc, rd, cos, sin
                    )
            u, v = draw(has, I, j, 1, one)
            hx, hy, hz = ggx.sample_visible(alpha, here.vx, here.vy, here.vz, u, v)
            lx, ly, lz, cosine = ggx.mirrored(here.vx, here.vy, here.vz, hx, hy, hz)
            weight = ggx.reflection_weight(alpha, here.vz, lz)
            Q[Q_DENSITY + j] = ggx.reflection_pdf(alpha, here.vz, ggx.ndf(alpha, hx, hy, hz))
            Q[QX + j], Q[QY + j], Q[QZ + j] = to_world(here, lx, ly, lz)
            Q[Q_SQUEEZE + j] = F[SQUEEZE + j]
            Q[Q_ALONE + j] = F[ALONE + j]
            wx, wy, wz = to_world(here, hx, hy, hz)
            sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
            Q[QA + j], Q[QB + j], Q[QC + j] = sx, sy, sz
            for c in range(len(has.channels)):
                ra, rb, rc, rd = metal_block(has, F, tables, shape, c, j, min(max(cosine, zero), one))
                weigh(has, F, Q, c, j, weight * ra, weight * rb, weight * rc, weight * rd, cos, sin)
