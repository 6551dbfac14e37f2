"""Lambertian surfaces: in place, for they are the most common."""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    AX,
    AY,
    AZ,
    DENSITY,
    DIFFUSE,
    DX,
    DY,
    DZ,
    EMIT,
    FEW,
    KIND,
    LANES,
    LIT,
    LX,
    LY,
    LZ,
    MET,
    MOST,
    NX,
    NY,
    NZ,
    OF_COLOUR,
    PAINT,
    SEEN,
    SHAPE_IDS,
    SQUEEZE,
    Floats,
    Has,
    Tables,
    Words,
    components,
    gathered,
    row,
    row_count,
    u32,
)
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.kernels.values import frame, power_heuristic, value
from reflectance_fit.render.lobes.select import cos_sin_turn, like, sel


@vectorised
def _albedo(has: Has, F: Floats, I: Words, tables: Tables, c: int, j: int) -> float:
    """Reflectance of what lane j meets, at one of its channels."""
    if len(has.textures) > 0:
        return F[PAINT + c * LANES + j]
    if len(has.few) == 0 or len(has.spectral) > 0:
        colour = tables.shape_ids[(I[MET + j] & MOST) * SHAPE_IDS + OF_COLOUR]
        return value(has, F, tables.curves, colour, c, j)
    albedo = like(1.0, F[0])
    for k in range(FEW):
        colour = tables.shape_ids[k * SHAPE_IDS + OF_COLOUR]
        albedo = sel(I[MET + j] == u32(k), value(has, F, tables.curves, colour, c, j), albedo)
    return albedo


@vectorised
def diffuse(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """Light from the sampled light, and a new direction in proportion to its cosine."""
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    over_pi = like(1.0 / math.pi, one)
    for j in range(LANES):
        here = I[KIND + j] == u32(DIFFUSE)
        nx, ny, nz = F[NX + j], F[NY + j], F[NZ + j]
        front = F[DX + j] * nx + F[DY + j] * ny + F[DZ + j] * nz < zero
        nx, ny, nz = sel(front, nx, -nx), sel(front, ny, -ny), sel(front, nz, -nz)
        weight = zero
        if len(has.lamps) > 0:
            cosine = max(F[LX + j] * nx + F[LY + j] * ny + F[LZ + j] * nz, zero) * over_pi
            lit = F[LIT + j]
            weight = sel(lit > zero, power_heuristic(lit, cosine), one) * cosine * F[SEEN + j]
            weight = sel(here & (weight > zero), weight, zero)
            if len(has.refracting) > 0:
                weight = weight * F[SQUEEZE + j]
        a, b = draw(has, I, j, 1, one)
        cos, sin = cos_sin_turn(b)
        radius, up = math.sqrt(a), math.sqrt(one - a)
        sx, sy, sz, tx, ty, tz = frame(nx, ny, nz)
        p, q = radius * cos, radius * sin
        F[DX + j] = sel(here, p * sx + q * tx + up * nx, F[DX + j])
        F[DY + j] = sel(here, p * sy + q * ty + up * ny, F[DY + j])
        F[DZ + j] = sel(here, p * sz + q * tz + up * nz, F[DZ + j])
        F[DENSITY + j] = sel(here, up * over_pi, F[DENSITY + j])
        for c in range(len(has.channels)):
            albedo = sel(here, _albedo(has, F, I, tables, c, j), one)
            for r in range(row_count(has)):
                k = row(has, c, r, 0)
                kept = F[k + j] * albedo
                if len(has.lamps) > 0:
                    g = gathered(has, c, r)
                    F[g + j] = F[g + j] + weight * (kept * F[EMIT + c * LANES + j])
                F[k + j] = kept
                for s in range(1, components(has)):
                    F[k + s * LANES + j] = sel(here, zero, F[k + s * LANES + j])
        if len(has.rows) > 0:
            F[AX + j] = sel(here, sx, F[AX + j])
            F[AY + j] = sel(here, sy, F[AY + j])
            F[AZ + j] = sel(here, sz, F[AZ + j])
