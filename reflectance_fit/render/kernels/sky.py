"""A picture of the surroundings: directions drawn by its pixels' brightness, and what rays find that meet nothing.

``sky`` holds the pixels, then for each its density per solid angle and the share it keeps in its row's alias table,
then the rows' shares, then the cosines between rows, from the zenith down; ``sky_ids`` the columns' aliases and the rows'.
A pixel is drawn uniformly over its solid angle.
"""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    AX,
    AY,
    AZ,
    CHOSEN,
    DENSITY,
    DEPTH,
    DRAWS,
    DX,
    DY,
    DZ,
    KEY,
    KIND,
    LAMPS,
    LANES,
    LIST,
    MISS,
    SAMPLE,
    SKY_HEIGHT,
    SKY_LAMP,
    SKY_PRIMARIES,
    SKY_WIDTH,
    SQUEEZE,
    Has,
    Tables,
    gathered,
    row,
    row_count,
)
from reflectance_fit.render.kernels.polarization import polarized
from reflectance_fit.render.kernels.queue import listed
from reflectance_fit.render.kernels.random import pair
from reflectance_fit.render.kernels.values import primaries
from reflectance_fit.render.lobes.select import cos_sin_turn, like, sel

u32 = np.uint32
i32 = np.int32


@stage
def _per_pixel(has: Has) -> int:
    return 3 if len(has.spectral) > 0 else len(has.channels)


@stage
def sky_sample(
    has: Has, I: np.ndarray, tables: Tables, j: int, one: float
) -> tuple[float, float, float, float, int]:
    """A direction, its density per solid angle and its pixel."""
    width, height = u32(tables.counts[SKY_WIDTH]), u32(tables.counts[SKY_HEIGHT])
    size = u32(width * height)
    densities = u32(size * u32(_per_pixel(has)))
    keeps = u32(densities + size)
    row_keeps = u32(keeps + size)
    cosines = u32(row_keeps + height)
    draw = u32(I[DEPTH + j] * u32(DRAWS))
    a, b = pair(has.sobol, I[KEY + j], I[SAMPLE + j], draw, one)
    p, q = pair(has.sobol, I[KEY + j], I[SAMPLE + j], u32(draw + u32(4)), one)
    x, y = pair(has.sobol, I[KEY + j], I[SAMPLE + j], u32(draw + u32(5)), one)
    line = u32(i32(a * like(i32(height), one)))
    kept = p < tables.sky[u32(row_keeps + line)]
    line = sel(kept, line, tables.sky_ids[u32(size + line)])
    column = u32(i32(b * like(i32(width), one)))
    cell = u32(u32(line * width) + column)
    kept = q < tables.sky[u32(keeps + cell)]
    column = sel(kept, column, tables.sky_ids[cell])
    cell = u32(u32(line * width) + column)
    upper, lower = tables.sky[u32(cosines + line)], tables.sky[u32(u32(cosines + line) + u32(1))]
    z = upper + y * (lower - upper)
    across = math.sqrt(max((one - z) * (one + z), like(0.0, one)))
    turn = like(0.5, one) - (like(i32(column), one) + x) / like(i32(width), one)
    cos, sin = cos_sin_turn(sel(turn < like(0.0, one), turn + one, turn))
    return across * cos, across * sin, z, tables.sky[u32(densities + cell)], cell


@stage
def sky_found(has: Has, F: np.ndarray, I: np.ndarray, tables: Tables) -> None:
    """Radiance of the picture for lanes that meet nothing, weighed against sampling it; one by one."""
    n = listed(I, KIND, MISS)
    width, height = tables.counts[SKY_WIDTH], tables.counts[SKY_HEIGHT]
    densities = width * height * _per_pixel(has)
    lamp = tables.counts[SKY_LAMP]
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    chosen = tables.lamps[lamp * LAMPS + CHOSEN]
    for q in range(n):
        j = I[u32(u32(LIST) + u32(q))]
        dx, dy, dz = F[u32(u32(DX) + j)], F[u32(u32(DY) + j)], F[u32(u32(DZ) + j)]
        x = 0.5 - math.atan2(dy, dx) / (2.0 * math.pi)
        y = math.acos(min(max(dz, -one), one)) / math.pi
        column, line = min(int(x * width), width - 1), min(int(y * height), height - 1)
        cell = line * width + column
        density = F[u32(u32(DENSITY) + j)]
        weight = one
        if density > zero:
            ratio = chosen * tables.sky[densities + cell] / density
            weight = one / (one + ratio * ratio)
        if len(has.smooth) > 0:
            weight = weight * F[u32(u32(SQUEEZE) + j)]
        for c in range(len(has.channels)):
            radiance = weight * primaries(has, F, tables, tables.sky, u32(cell), SKY_PRIMARIES, c, j)
            for r in range(row_count(has)):
                k = u32(u32(row(has, c, r, 0)) + j)
                seen = F[k]
                if len(has.rows) > 0:
                    seen = polarized(
                        has, tables.lamps, u32(lamp * LAMPS), dx, dy, dz,
                        F[u32(u32(AX) + j)], F[u32(u32(AY) + j)], F[u32(u32(AZ) + j)],
                        seen, F[u32(k + u32(LANES))], F[u32(k + u32(2 * LANES))], F[u32(k + u32(3 * LANES))],
                    )  # fmt: skip
                F[u32(u32(gathered(has, c, r)) + j)] += radiance * seen
