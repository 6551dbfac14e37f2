"""Smooth interfaces: glass, which reflects or refracts, and metal."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.fresnel_of import glass_blocks, glass_reflectance, metal_block
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    DEPTH,
    DRAWS,
    DX,
    DY,
    DZ,
    GLASS,
    KEY,
    KIND,
    LIST,
    MET,
    MIRROR,
    NX,
    NY,
    NZ,
    Q_ALONE,
    Q_DENSITY,
    Q_SQUEEZE,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    SAMPLE,
    SHAPE_IDS,
    SQUEEZE,
    Has,
    Tables,
)
from reflectance_fit.render.kernels.local import plane_of
from reflectance_fit.render.kernels.queue import CHUNK, listed, put_back, weigh
from reflectance_fit.render.kernels.random import pair
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


@stage
def smooth_glass(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, tables: Tables) -> None:
    """Reflection with the probability of the channels' mean reflectance, else refraction."""
    n = listed(I, KIND, GLASS)
    zero, one, two = like(0.0, F[0]), like(1.0, F[0]), like(2.0, F[0])
    count = len(has.channels)
    # The channel that is refracted: the middle one, or the first wavelength.
    leading = 1 if count == 3 else 0
    for block in range(0, n, CHUNK):
        for q in range(block, block + CHUNK):
            j = I[u32(u32(LIST) + u32(q))]
            dx, dy, dz = F[u32(u32(DX) + j)], F[u32(u32(DY) + j)], F[u32(u32(DZ) + j)]
            nx, ny, nz = F[u32(u32(NX) + j)], F[u32(u32(NY) + j)], F[u32(u32(NZ) + j)]
            cosine = -(dx * nx + dy * ny + dz * nz)
            front = cosine > zero
            c = min(abs(cosine), one)
            nx, ny, nz = sel(front, nx, -nx), sel(front, ny, -ny), sel(front, nz, -nz)
            shape = u32(I[u32(u32(MET) + j)] * u32(SHAPE_IDS))
            power, cos_t, relative = glass_reflectance(has, F, tables, shape, leading, j, c, front)
            chance = power
            same = True
            if len(has.dispersive) > 0:
                total = zero
                for k in range(count):
                    other, _, index = glass_reflectance(has, F, tables, shape, k, j, c, front)
                    total += other
                    same = same & (index == relative)
                chance = total / like(count, one)
                if len(has.spectral) > 0:
                    chance = sel(F[u32(u32(ALONE) + j)] > zero, power, chance)
                chance = sel(cos_t > zero, chance, one)
            _, u = pair(
                has.sobol, I[u32(u32(KEY) + j)], I[u32(u32(SAMPLE) + j)],
                u32(u32(I[u32(u32(DEPTH) + j)] * u32(DRAWS)) + u32(2)), one,
            )  # fmt: skip
            back = u < chance
            over = one / relative
            along = sel(back, one, over)
            push = sel(back, two * c, c * over - cos_t)
            tx, ty, tz = along * dx + push * nx, along * dy + push * ny, along * dz + push * nz
            length = one / math.sqrt(tx * tx + ty * ty + tz * tz)
            Q[QX + q], Q[QY + q], Q[QZ + q] = tx * length, ty * length, tz * length
            Q[Q_DENSITY + q] = zero
            Q[Q_SQUEEZE + q] = F[u32(u32(SQUEEZE) + j)] * sel(back, one, over * over)
            scale = one / sel(back, chance, one - chance)
            sx, sy, sz, cos, sin = plane_of(has, F, j, nx, ny, nz)
            Q[QA + q], Q[QB + q], Q[QC + q] = sx, sy, sz
            apart = zero
            if len(has.spectral) > 0:
                apart = sel(back | same | (F[u32(u32(ALONE) + j)] > zero), zero, one)
                Q[Q_ALONE + q] = F[u32(u32(ALONE) + j)] + apart
            for k in range(count):
                share = scale
                if len(has.spectral) > 0:
                    # The first wavelength goes on for all.
                    share = share * sel(apart > zero, like(count, one) if k == 0 else zero, one)
                if len(has.rows) == 0 and len(has.dispersive) == 0:
                    # Drawn by its own reflectance.
                    weigh(has, F, Q, k, q, j, one, zero, zero, zero, cos, sin)
                else:
                    ra, rb, rc, rd = glass_blocks(has, F, tables, shape, k, j, c, front, back)
                    weigh(has, F, Q, k, q, j, share * ra, share * rb, share * rc, share * rd, cos, sin)
    put_back(has, F, I, Q, n)


@stage
def smooth_metal(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, tables: Tables) -> None:
    """Reflection, on either side."""
    n = listed(I, KIND, MIRROR)
    zero, one, two = like(0.0, F[0]), like(1.0, F[0]), like(2.0, F[0])
    for block in range(0, n, CHUNK):
        for q in range(block, block + CHUNK):
            j = I[u32(u32(LIST) + u32(q))]
            dx, dy, dz = F[u32(u32(DX) + j)], F[u32(u32(DY) + j)], F[u32(u32(DZ) + j)]
            nx, ny, nz = F[u32(u32(NX) + j)], F[u32(u32(NY) + j)], F[u32(u32(NZ) + j)]
            cosine = -(dx * nx + dy * ny + dz * nz)
            c = min(abs(cosine), one)
            push = two * cosine
            tx, ty, tz = dx + push * nx, dy + push * ny, dz + push * nz
            length = one / math.sqrt(tx * tx + ty * ty + tz * tz)
            Q[QX + q], Q[QY + q], Q[QZ + q] = tx * length, ty * length, tz * length
            Q[Q_DENSITY + q] = zero
            Q[Q_SQUEEZE + q] = F[u32(u32(SQUEEZE) + j)]
            Q[Q_ALONE + q] = F[u32(u32(ALONE) + j)]
            sx, sy, sz, cos, sin = plane_of(has, F, j, nx, ny, nz)
            Q[QA + q], Q[QB + q], Q[QC + q] = sx, sy, sz
            shape = u32(I[u32(u32(MET) + j)] * u32(SHAPE_IDS))
            for k in range(len(has.channels)):
                ra, rb, rc, rd = metal_block(has, F, tables, shape, k, j, c)
                weigh(has, F, Q, k, q, j, ra, rb, rc, rd, cos, sin)
    put_back(has, F, I, Q, n)
