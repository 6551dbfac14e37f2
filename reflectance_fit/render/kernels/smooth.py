"""Smooth interfaces: glass, which reflects or refracts, and metal."""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.fresnel_of import glass_blocks, glass_reflectance, metal_block
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    DX,
    DY,
    DZ,
    MET,
    MOST,
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
    SHAPE_IDS,
    SQUEEZE,
    Floats,
    Has,
    Tables,
    Words,
)
from reflectance_fit.render.kernels.local import plane_of
from reflectance_fit.render.kernels.queue import CHUNK, weigh
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def smooth_glass(has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, n: int) -> None:
    """Reflection with the probability of the channels' mean reflectance, else refraction."""
    zero, one, two = like(0.0, F[0]), like(1.0, F[0]), like(2.0, F[0])
    count = len(has.channels)
    # The channel that is refracted: the middle one, or the first wavelength.
    leading = 1 if count == 3 else 0
    for block in range(0, n, CHUNK):
        for j in range(block, block + CHUNK):
            dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
            nx, ny, nz = F[NX + j], F[NY + j], F[NZ + j]
            cosine = -(dx * nx + dy * ny + dz * nz)
            front = cosine > zero
            c = min(abs(cosine), one)
            nx, ny, nz = sel(front, nx, -nx), sel(front, ny, -ny), sel(front, nz, -nz)
            shape = (I[MET + j] & MOST) * SHAPE_IDS
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
                    chance = sel(F[ALONE + j] > zero, power, chance)
                chance = sel(cos_t > zero, chance, one)
            _, u = draw(has, I, j, 2, one)
            back = u < chance
            over = one / relative
            along = sel(back, one, over)
            push = sel(back, two * c, c * over - cos_t)
            tx, ty, tz = along * dx + push * nx, along * dy + push * ny, along * dz + push * nz
            length = one / math.sqrt(tx * tx + ty * ty + tz * tz)
            Q[QX + j], Q[QY + j], Q[QZ + j] = tx * length, ty * length, tz * length
            Q[Q_DENSITY + j] = zero
            Q[Q_SQUEEZE + j] = F[SQUEEZE + j] * sel(back, one, over * over)
            scale = one / sel(back, chance, one - chance)
            sx, sy, sz, cos, sin = plane_of(has, F, j, nx, ny, nz)
            Q[QA + j], Q[QB + j], Q[QC + j] = sx, sy, sz
            apart = zero
            if len(has.spectral) > 0:
                apart = sel(back | same | (F[ALONE + j] > zero), zero, one)
                Q[Q_ALONE + j] = F[ALONE + j] + apart
            for k in range(count):
                share = scale
                if len(has.spectral) > 0:
                    # The first wavelength goes on for all.
                    share = share * sel(apart > zero, like(count, one) if k == 0 else zero, one)
                if len(has.rows) == 0 and len(has.dispersive) == 0:
                    # Drawn by its own reflectance.
                    weigh(has, F, Q, k, j, one, zero, zero, zero, cos, sin)
                else:
                    ra, rb, rc, rd = glass_blocks(has, F, tables, shape, k, j, c, front, back)
                    weigh(has, F, Q, k, j, share * ra, share * rb, share * rc, share * rd, cos, sin)


@vectorised
def smooth_metal(has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, n: int) -> None:
    """Reflection, on either side."""
    zero, one, two = like(0.0, F[0]), like(1.0, F[0]), like(2.0, F[0])
    for block in range(0, n, CHUNK):
        for j in range(block, block + CHUNK):
            dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
            nx, ny, nz = F[NX + j], F[NY + j], F[NZ + j]
            cosine = -(dx * nx + dy * ny + dz * nz)
            c = min(abs(cosine), one)
            push = two * cosine
            tx, ty, tz = dx + push * nx, dy + push * ny, dz + push * nz
            length = one / math.sqrt(tx * tx + ty * ty + tz * tz)
            Q[QX + j], Q[QY + j], Q[QZ + j] = tx * length, ty * length, tz * length
            Q[Q_DENSITY + j] = zero
            Q[Q_SQUEEZE + j] = F[SQUEEZE + j]
            Q[Q_ALONE + j] = F[ALONE + j]
            sx, sy, sz, cos, sin = plane_of(has, F, j, nx, ny, nz)
            Q[QA + j], Q[QB + j], Q[QC + j] = sx, sy, sz
            shape = (I[MET + j] & MOST) * SHAPE_IDS
            for k in range(len(has.channels)):
                ra, rb, rc, rd = metal_block(has, F, tables, shape, k, j, c)
                weigh(has, F, Q, k, j, ra, rb, rc, rd, cos, sin)
