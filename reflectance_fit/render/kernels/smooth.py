"""Smooth interfaces: glass, which reflects or refracts, and metal."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    AX,
    AY,
    AZ,
    DEPTH,
    DX,
    DY,
    DZ,
    GLASS,
    Has,
    KEY,
    KIND,
    LIST,
    MET,
    MIRROR,
    NX,
    NY,
    NZ,
    OF_A,
    OF_B,
    OF_ETA,
    OF_K,
    OF_POWER,
    OF_R0,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    Q_ALONE,
    Q_DENSITY,
    Q_SQUEEZE,
    SAMPLE,
    SHAPE_IDS,
    SQUEEZE,
    Tables,
)
from reflectance_fit.render.kernels.queue import CHUNK, listed, put_back, weigh
from reflectance_fit.render.kernels.random import pair
from reflectance_fit.render.kernels.values import value
from reflectance_fit.render.lobes.fresnel import (
    approximate,
    conductor_mueller,
    conductor_power,
    dielectric_mueller,
    dielectric_power,
    dielectric_transmission,
    large_index,
)
from reflectance_fit.render.lobes.mueller import across, double_angle
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


@stage
def approximated(has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float) -> float:
    """r0 + b (1 - c)^5 - a c (1 - c)^power with the surface's coefficients; the power is 6 but for one form."""
    r0 = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_R0))], channel, j)
    b = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_B))], channel, j)
    a = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_A))], channel, j)
    if len(has.approximate) == 1:
        return approximate(c, r0, b, a)
    power = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_POWER))], channel, j)
    zero = like(0.0, c)
    return approximate(c, r0, b, zero) - a * c * max(like(1.0, c) - c, zero) ** power


@stage
def glass_reflectance(
    has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float, front: bool
) -> tuple[float, float, float]:
    """Reflectance, cosine of refraction and relative index at a dielectric, by the Fresnel form in use."""
    one = like(1.0, c)
    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], channel, j)
    relative = sel(front, eta, one / eta)
    r_s, r_p, cos_t = dielectric_power(c, relative)
    power = like(0.5, c) * (r_s + r_p)
    if len(has.approximate) > 0:
        # On the side of the lower index; total reflection is what it is.
        thin = sel(relative >= one, c, cos_t)
        if len(has.approximate) != 2:
            form = approximated(has, F, tables, shape, channel, j, thin)
        else:
            form = large_index(thin, sel(relative >= one, relative, one / relative), like(0.0, c))
        power = sel(cos_t > like(0.0, c), form, one)
    return power, cos_t, relative


@stage
def metal_reflectance(has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float) -> float:
    """Reflectance of a metal for unpolarized light, by the Fresnel form in use."""
    if len(has.approximate) == 1 or len(has.approximate) == 3:
        return approximated(has, F, tables, shape, channel, j, c)
    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], channel, j)
    k = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_K))], channel, j)
    if len(has.approximate) == 2:
        return large_index(c, eta, k)
    r_s, r_p = conductor_power(c, eta, k)
    return like(0.5, c) * (r_s + r_p)


@stage
def smooth_glass(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, tables: Tables) -> None:  # noqa: E741
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
                u32(u32(I[u32(u32(DEPTH) + j)] * u32(4)) + u32(2)), one,
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
            cos, sin = one, zero
            if len(has.rows) > 0:
                ax, ay, az = F[u32(u32(AX) + j)], F[u32(u32(AY) + j)], F[u32(u32(AZ) + j)]
                sx, sy, sz = across(dx, dy, dz, nx, ny, nz, ax, ay, az)
                cos, sin = double_angle(ax, ay, az, sx, sy, sz, -dx, -dy, -dz)
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
                if len(has.rows) > 0:
                    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], k, j)
                    index = sel(front, eta, one / eta)
                    ra, rb, rc, rd = dielectric_mueller(c, index)
                    ta, tb, tc = dielectric_transmission(c, index)
                    weigh(
                        has, F, Q, k, q, j,
                        share * sel(back, ra, ta), share * sel(back, rb, tb),
                        share * sel(back, rc, tc), share * sel(back, rd, zero), cos, sin,
                    )  # fmt: skip
                elif len(has.dispersive) > 0:
                    other, _, _ = glass_reflectance(has, F, tables, shape, k, j, c, front)
                    weigh(has, F, Q, k, q, j, share * sel(back, other, one - other), zero, zero, zero, cos, sin)
                else:
                    weigh(has, F, Q, k, q, j, one, zero, zero, zero, cos, sin)
    put_back(has, F, I, Q, n)


@stage
def smooth_metal(has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, tables: Tables) -> None:  # noqa: E741
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
            cos, sin = one, zero
            if len(has.rows) > 0:
                ax, ay, az = F[u32(u32(AX) + j)], F[u32(u32(AY) + j)], F[u32(u32(AZ) + j)]
                sx, sy, sz = across(dx, dy, dz, nx, ny, nz, ax, ay, az)
                cos, sin = double_angle(ax, ay, az, sx, sy, sz, -dx, -dy, -dz)
                Q[QA + q], Q[QB + q], Q[QC + q] = sx, sy, sz
            shape = u32(I[u32(u32(MET) + j)] * u32(SHAPE_IDS))
            for k in range(len(has.channels)):
                if len(has.rows) > 0:
                    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], k, j)
                    loss = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_K))], k, j)
                    ra, rb, rc, rd = conductor_mueller(c, eta, loss)
                    weigh(has, F, Q, k, q, j, ra, rb, rc, rd, cos, sin)
                else:
                    power = metal_reflectance(has, F, tables, shape, k, j, c)
                    weigh(has, F, Q, k, q, j, power, zero, zero, zero, cos, sin)
    put_back(has, F, I, Q, n)
