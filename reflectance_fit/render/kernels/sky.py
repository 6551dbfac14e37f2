"""A picture of the surroundings: directions drawn by its pixels' brightness, and what rays find that meet nothing.

``sky`` holds the pixels, then for each its density per solid angle and the share it keeps in its row's alias table,
then the rows' shares, then the cosines between rows, from the zenith down; ``sky_ids`` the columns' aliases and the rows'.
A pixel is drawn uniformly over its solid angle.
"""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    AX,
    AY,
    AZ,
    CHOSEN,
    DENSITY,
    DX,
    DY,
    DZ,
    EMIT,
    KIND,
    LAMPS,
    LANES,
    LAST,
    LIGHT,
    LIST,
    LIT,
    LX,
    LY,
    LZ,
    MISS,
    REACH,
    SKY_HEIGHT,
    SKY_LAMP,
    SKY_PRIMARIES,
    SKY_WIDTH,
    SQUEEZE,
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
from reflectance_fit.render.kernels.queue import listed
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.kernels.values import primaries
from reflectance_fit.render.lobes.select import cos_sin_turn, like, sel


@vectorised
def _per_pixel(has: Has) -> int:
    return 3 if len(has.spectral) > 0 else len(has.channels)


@vectorised
def sky_sample(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """Where the light chosen is the picture: a direction towards it, and what it sends over the density."""
    width, height = tables.counts[SKY_WIDTH], tables.counts[SKY_HEIGHT]
    size = width * height
    densities = size * _per_pixel(has)
    keeps = densities + size
    row_keeps = keeps + size
    cosines = row_keeps + height
    lamp = tables.counts[SKY_LAMP]
    zero, half, one = like(0.0, F[0]), like(0.5, F[0]), like(1.0, F[0])
    chosen = tables.lamps[lamp * LAMPS + CHOSEN]
    for j in range(LANES):
        picture = I[LIGHT + j] == u32(lamp) if len(has.lamps) > 1 else True
        a, b = draw(has, I, j, 0, one)
        p, q = draw(has, I, j, 4, one)
        x, y = draw(has, I, j, 5, one)
        line = u32(i32(a * like(height, one)))
        line = sel(p < tables.sky[row_keeps + line], line, tables.sky_ids[size + line])
        column = u32(i32(b * like(width, one)))
        cell = line * width + column
        column = sel(q < tables.sky[keeps + cell], column, tables.sky_ids[cell])
        cell = line * width + column
        upper, lower = tables.sky[cosines + line], tables.sky[cosines + line + 1]
        z = upper + y * (lower - upper)
        across = math.sqrt(max((one - z) * (one + z), zero))
        turn = half - (like(i32(column), one) + x) / like(width, one)
        cos, sin = cos_sin_turn(sel(turn < zero, turn + one, turn))
        density = tables.sky[densities + cell] * chosen
        F[LX + j] = sel(picture, across * cos, F[LX + j])
        F[LY + j] = sel(picture, across * sin, F[LY + j])
        F[LZ + j] = sel(picture, z, F[LZ + j])
        F[REACH + j] = sel(picture, like(np.inf, one), F[REACH + j])
        F[LIT + j] = sel(picture, density, F[LIT + j])
        strength = sel(density > zero, one / density, zero)
        for c in range(len(has.channels)):
            shone = strength * primaries(has, F, tables, tables.sky, cell, SKY_PRIMARIES, c, j)
            F[EMIT + c * LANES + j] = sel(picture, shone, F[EMIT + c * LANES + j])


@vectorised
def sky_found(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """Radiance of the picture for lanes that meet nothing, weighed against sampling it; one by one."""
    n = listed(I, KIND, MISS)
    width, height = tables.counts[SKY_WIDTH], tables.counts[SKY_HEIGHT]
    densities = width * height * _per_pixel(has)
    lamp = tables.counts[SKY_LAMP]
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    chosen = tables.lamps[lamp * LAMPS + CHOSEN]
    for q in range(n):
        j = I[LIST + q] & LAST
        dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
        x = 0.5 - math.atan2(dy, dx) / (2.0 * math.pi)
        y = math.acos(min(max(dz, -one), one)) / math.pi
        column, line = min(int(x * width), width - 1), min(int(y * height), height - 1)
        cell = line * width + column
        density = F[DENSITY + j]
        weight = one
        if density > zero:
            ratio = chosen * tables.sky[densities + cell] / density
            weight = one / (one + ratio * ratio)
        if len(has.refracting) > 0:
            weight = weight * F[SQUEEZE + j]
        for c in range(len(has.channels)):
            radiance = weight * primaries(has, F, tables, tables.sky, cell, SKY_PRIMARIES, c, j)
            for r in range(row_count(has)):
                k = row(has, c, r, 0) + j
                seen = F[k]
                if len(has.rows) > 0:
                    seen = polarized(
                        has, tables.lamps, lamp * LAMPS, dx, dy, dz,
                        F[AX + j], F[AY + j], F[AZ + j],
                        seen, F[k + LANES], F[k + 2 * LANES], F[k + 3 * LANES],
                    )  # fmt: skip
                F[gathered(has, c, r) + j] += radiance * seen
