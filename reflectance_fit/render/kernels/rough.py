"""Rough metals and rough glass: GGX facets, light sampled and directions drawn by the facets that are visible."""

from __future__ import annotations

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.fresnel_of import metal_block
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    ALPHA,
    DEPTH,
    DRAWS,
    KEY,
    KIND,
    LIST,
    LIT,
    LX,
    LY,
    LZ,
    MET,
    Q_ALONE,
    Q_DENSITY,
    Q_SQUEEZE,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    ROUGH_MIRROR,
    SAMPLE,
    SEEN,
    SHAPE,
    SHAPE_IDS,
    SQUEEZE,
    Has,
    Tables,
)
from reflectance_fit.render.kernels.local import gather_light, no_light, plane_of, side, to_local, to_world
from reflectance_fit.render.kernels.queue import CHUNK, listed, put_back, take_light, weigh
from reflectance_fit.render.kernels.random import pair
from reflectance_fit.render.kernels.values import power_heuristic
from reflectance_fit.render.lobes import ggx
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


@stage
def rough_metal(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, tables: Tables) -> None:
    """Reflection, on either side."""
    n = listed(I, KIND, ROUGH_MIRROR)
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    for block in range(0, n, CHUNK):
        for q in range(block, block + CHUNK):
            j = I[u32(u32(LIST) + u32(q))]
            here = side(F, j)
            met = I[u32(u32(MET) + j)]
            shape = u32(met * u32(SHAPE_IDS))
            alpha = tables.shapes[u32(u32(met * u32(SHAPE)) + u32(ALPHA))]
            no_light(has, Q, q)
            if len(has.lamps) > 0:
                lx, ly, lz = to_local(here, F[u32(u32(LX) + j)], F[u32(u32(LY) + j)], F[u32(u32(LZ) + j)])
                hx, hy, hz, cosine = ggx.half(here.vx, here.vy, here.vz, lx, ly, lz)
                d = ggx.ndf(alpha, hx, hy, hz)
                lit = F[u32(u32(LIT) + j)]
                weight = ggx.reflection_value(alpha, here.vz, lz, d) * F[u32(u32(SEEN) + j)]
                mis = power_heuristic(lit, ggx.reflection_pdf(alpha, here.vz, d))
                weight = weight * sel(lit > zero, mis, one)
                if len(has.smooth) > 0:
                    weight = weight * F[u32(u32(SQUEEZE) + j)]
                wx, wy, wz = to_world(here, hx, hy, hz)
                sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
                for c in range(len(has.channels)):
                    ra, rb, rc, rd = metal_block(has, F, tables, shape, c, j, min(cosine, one))
                    gather_light(
                        has, F, I, Q, tables.lamps, c, q, j, weight, sx, sy, sz, ra, rb, rc, rd, cos, sin
                    )
            u, v = pair(
                has.sobol, I[u32(u32(KEY) + j)], I[u32(u32(SAMPLE) + j)],
                u32(u32(I[u32(u32(DEPTH) + j)] * u32(DRAWS)) + u32(1)), one,
            )  # fmt: skip
            hx, hy, hz = ggx.sample_visible(alpha, here.vx, here.vy, here.vz, u, v)
            lx, ly, lz, cosine = ggx.mirrored(here.vx, here.vy, here.vz, hx, hy, hz)
            weight = ggx.reflection_weight(alpha, here.vz, lz)
            Q[Q_DENSITY + q] = ggx.reflection_pdf(alpha, here.vz, ggx.ndf(alpha, hx, hy, hz))
            Q[QX + q], Q[QY + q], Q[QZ + q] = to_world(here, lx, ly, lz)
            Q[Q_SQUEEZE + q] = F[u32(u32(SQUEEZE) + j)]
            Q[Q_ALONE + q] = F[u32(u32(ALONE) + j)]
            wx, wy, wz = to_world(here, hx, hy, hz)
            sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
            Q[QA + q], Q[QB + q], Q[QC + q] = sx, sy, sz
            for c in range(len(has.channels)):
                ra, rb, rc, rd = metal_block(has, F, tables, shape, c, j, min(max(cosine, zero), one))
                weigh(has, F, Q, c, q, j, weight * ra, weight * rb, weight * rc, weight * rd, cos, sin)
    take_light(has, F, I, Q, n)
    put_back(has, F, I, Q, n)
