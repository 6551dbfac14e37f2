"""Lights: drawing a direction towards one, and what a ray finds that meets one."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    AX,
    AY,
    AZ,
    BALL,
    CHOSEN,
    DENSITY,
    DIRECTIONAL,
    DX,
    DY,
    DZ,
    EMIT,
    FAR,
    HALF_U,
    HALF_V,
    KEEP,
    KIND,
    LAMP,
    LAMP_ALIAS,
    LAMP_CURVE,
    LAMP_IDS,
    LAMP_SHAPE,
    LAMPS,
    LANES,
    LIGHT,
    LIT,
    LX,
    LY,
    LZ,
    MET,
    MISS,
    MOST,
    NX,
    NY,
    NZ,
    OF_LIGHT,
    OX,
    OY,
    OZ,
    POINT,
    PX,
    PY,
    PZ,
    REACH,
    ROUND,
    SAMPLED,
    SHAPE_IDS,
    SIZE,
    SQUEEZE,
    TARGET,
    TURNED,
    Floats,
    Has,
    Tables,
    Words,
    gathered,
    i32,
    row,
    row_count,
    u32,
)
from reflectance_fit.render.kernels.polarization import polarized
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.kernels.values import frame, value
from reflectance_fit.render.lobes.select import cos_sin_turn, like, sel


@vectorised
def cone(sin2: float) -> float:
    """1 - cos of the half angle whose squared sine is given, without cancelling."""
    one = like(1.0, sin2)
    return sin2 / (one + math.sqrt(max(one - sin2, like(0.0, sin2))))


@vectorised
def choose(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """One light for each lane, by an alias table of their powers."""
    one = like(1.0, F[0])
    count = like(tables.counts[SAMPLED], one)
    for j in range(LANES):
        u, _ = draw(has, I, j, 2, one)
        x = u * count
        cell = i32(x)
        keep = tables.lamps[cell * LAMPS + KEEP]
        other = tables.lamp_ids[cell * LAMP_IDS + LAMP_ALIAS]
        I[LIGHT + j] = sel(x - like(cell, one) < keep, u32(cell), other)


@vectorised
def sample(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """A direction towards a light from the point met; its radiance over the density, which is of solid angle."""
    lamps, lamp_ids = tables.lamps, tables.lamp_ids
    zero, one, two, inf = like(0.0, F[0]), like(1.0, F[0]), like(2.0, F[0]), like(np.inf, F[0])
    if len(has.lamps) > 1:
        choose(has, F, I, tables)
    for j in range(LANES):
        light = I[LIGHT + j] if len(has.lamps) > 1 else u32(0)
        g, w = light * LAMPS, light * LAMP_IDS
        kind = lamp_ids[w]
        chosen = lamps[g + CHOSEN]
        ax, ay, az = lamps[g], lamps[g + 1], lamps[g + 2]
        x, y, z = ax - F[PX + j], ay - F[PY + j], az - F[PZ + j]
        size = lamps[g + SIZE]
        reach, lit, strength = one, zero, zero
        lx, ly, lz = x, y, z
        if len(has.area) > 0:
            a, b = draw(has, I, j, 0, one)
            cos, sin = cos_sin_turn(b)
            radius = math.sqrt(a)
            round_ = kind == u32(ROUND)
            p, q = sel(round_, radius * cos, two * a - one), sel(round_, radius * sin, two * b - one)
            nx, ny, nz = (
                lamps[g + TURNED],
                lamps[g + TURNED + 1],
                lamps[g + TURNED + 2],
            )
            ux, uy, uz = (
                lamps[g + HALF_U],
                lamps[g + HALF_U + 1],
                lamps[g + HALF_U + 2],
            )
            vx, vy, vz = (
                lamps[g + HALF_V],
                lamps[g + HALF_V + 1],
                lamps[g + HALF_V + 2],
            )
            fx, fy, fz = x + p * ux + q * vx, y + p * uy + q * vy, z + p * uz + q * vz
            far2 = fx * fx + fy * fy + fz * fz
            reach = math.sqrt(far2)
            over = one / reach
            lx, ly, lz = fx * over, fy * over, fz * over
            facing = -(lx * nx + ly * ny + lz * nz)
            lit = far2 / (facing * size)
            strength = sel(facing > zero, one / lit, zero)
            if len(has.area) > 1:
                # A sphere: uniform in the cone under which it is seen.
                ball = kind == u32(BALL)
                far2 = x * x + y * y + z * z
                over = one / math.sqrt(far2)
                wx, wy, wz = x * over, y * over, z * over
                most = cone(min(size * size * over * over, one))
                less = a * most
                across = math.sqrt(less * (two - less))
                sx, sy, sz, tx, ty, tz = frame(wx, wy, wz)
                p, q, up = across * cos, across * sin, one - less
                cx, cy, cz = p * sx + q * tx + up * wx, p * sy + q * ty + up * wy, p * sz + q * tz + up * wz
                along = up * far2 * over
                rest = size * size - across * across * far2
                lx, ly, lz = sel(ball, cx, lx), sel(ball, cy, ly), sel(ball, cz, lz)
                reach = sel(ball, along - math.sqrt(max(rest, zero)), reach)
                area = like(2.0 * math.pi, one) * most
                lit = sel(ball, one / area, lit)
                strength = sel(ball, sel(far2 > size * size, area, zero), strength)
        if len(has.points) > 0:
            point, sun = kind == u32(POINT), kind == u32(DIRECTIONAL)
            far2 = x * x + y * y + z * z
            over = one / math.sqrt(far2)
            lx = sel(point, x * over, sel(sun, ax, lx))
            ly = sel(point, y * over, sel(sun, ay, ly))
            lz = sel(point, z * over, sel(sun, az, lz))
            reach = sel(point, far2 * over, sel(sun, inf, reach))
            strength = sel(point, over * over, sel(sun, one, strength))
            lit = sel(point | sun, zero, lit)
        F[LX + j], F[LY + j], F[LZ + j] = lx, ly, lz
        F[REACH + j], F[LIT + j] = reach, lit * chosen
        # At a point light itself it is infinite, and would be not a number where nothing is taken of it.
        strength = sel(strength < inf, strength / chosen, zero)
        curve = lamp_ids[w + LAMP_CURVE]
        for c in range(len(has.channels)):
            F[EMIT + c * LANES + j] = strength * value(has, F, tables.curves, curve, c, j)
        I[TARGET + j] = lamp_ids[w + LAMP_SHAPE]


@vectorised
def found(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """Radiance of the surroundings and of lights that rays meet, weighed against sampling them."""
    lamps, lamp_ids = tables.lamps, tables.lamp_ids
    zero, one, pi = like(0.0, F[0]), like(1.0, F[0]), like(math.pi, F[0])
    background = u32(tables.counts[SAMPLED])
    around, only = lamp_ids[background * LAMP_IDS + LAMP_CURVE], lamp_ids[LAMP_CURVE]
    for j in range(LANES):
        missed = I[KIND + j] == u32(MISS)
        weight = sel(missed, one, zero)
        light, curve = background, around
        if len(has.area) > 0:
            met = I[KIND + j] == u32(LAMP)
            lamp = u32(0)
            if len(has.lamps) > 1:
                lamp = tables.shape_ids[(I[MET + j] & MOST) * SHAPE_IDS + OF_LIGHT]
                lamp = sel(met, lamp, u32(0))
            g, w = lamp * LAMPS, lamp * LAMP_IDS
            size, chosen = lamps[g + SIZE], lamps[g + CHOSEN]
            facing = -(F[DX + j] * F[NX + j] + F[DY + j] * F[NY + j] + F[DZ + j] * F[NZ + j])
            over = facing * size / (F[FAR + j] * F[FAR + j])
            if len(has.area) > 1:
                x = lamps[g] - F[OX + j]
                y = lamps[g + 1] - F[OY + j]
                z = lamps[g + 2] - F[OZ + j]
                part = size * size / (x * x + y * y + z * z)
                over = sel(lamp_ids[w] == u32(BALL), (pi + pi) * cone(min(part, one)), over)
            density = F[DENSITY + j]
            # Delta lobes (density 0) could not have been sampled: weight 1.
            ratio = sel(density > zero, chosen / (over * max(density, like(1e-30, one))), zero)
            mis = one / (one + ratio * ratio)
            weight = sel(met & (facing > zero), mis, weight)
            light = sel(met, lamp, light)
            curve = sel(met, lamp_ids[w + LAMP_CURVE], curve)
        beyond = sel(missed, one, zero)
        if len(has.refracting) > 0:
            weight, beyond = weight * F[SQUEEZE + j], beyond * F[SQUEEZE + j]
        for c in range(len(has.channels)):
            if len(has.lamps) > 1 or len(has.spectral) > 0:
                radiance = weight * value(has, F, tables.curves, curve, c, j)
            else:
                # The surroundings and one light at most, the same for all lanes: nothing to gather.
                radiance = beyond * value(has, F, tables.curves, around, c, j)
                radiance += (weight - beyond) * value(has, F, tables.curves, only, c, j)
            for r in range(row_count(has)):
                k = row(has, c, r, 0)
                seen = F[k + j]
                if len(has.rows) > 0:
                    seen = polarized(
                        has, lamps, light * LAMPS, F[DX + j], F[DY + j], F[DZ + j],
                        F[AX + j], F[AY + j], F[AZ + j],
                        seen, F[k + LANES + j], F[k + 2 * LANES + j], F[k + 3 * LANES + j],
                    )  # fmt: skip
                k = gathered(has, c, r)
                F[k + j] = F[k + j] + radiance * seen
