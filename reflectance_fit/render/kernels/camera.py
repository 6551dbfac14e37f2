"""Rays of the camera, for lanes that begin a path."""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    AX,
    AY,
    AZ,
    BEYOND,
    COLUMN,
    DENSITY,
    DEPTH,
    DX,
    DY,
    DZ,
    KEY,
    LANES,
    LEFT,
    LINE,
    NOTHING,
    OX,
    OY,
    OZ,
    QUANTILES,
    SAMPLE,
    SHARE,
    SQUEEZE,
    WAVE,
    Floats,
    Has,
    Tables,
    Words,
    components,
    gathered,
    i32,
    row,
    row_count,
    u32,
)
from reflectance_fit.render.kernels.random import pair, prepared
from reflectance_fit.render.lobes.select import like, sel

# Entries of the camera's array: position, optical axis, what a step across and down the picture (from -1 to 1) adds to
# position and direction, the picture's right, one over the size, and the four rows.
AT, AXIS, MOVE_X, MOVE_Y, TURN_X, TURN_Y, RIGHT, STEP, FIRST_ROWS = 0, 3, 6, 9, 12, 15, 18, 21, 23


@vectorised
def begin(has: Has, F: Floats, I: Words, tables: Tables, start: int, width: int) -> None:
    """New rays where DEPTH is 0, which becomes 1; KEY is the number of a group until then.

    ``start`` comes from the seed; the picture is ``width`` pixels wide.
    """
    camera = tables.camera
    zero, one, two = like(0.0, F[0]), like(1.0, F[0]), like(2.0, F[0])
    for j in range(LANES):
        new = I[DEPTH + j] == u32(0)
        pixel = u32(u32(I[LINE + j] * width) + I[COLUMN + j])
        key, sample = prepared(has.sobol, start, pixel, I[KEY + j], I[SAMPLE + j])
        key, sample = sel(new, key, I[KEY + j]), sel(new, sample, I[SAMPLE + j])
        I[KEY + j], I[SAMPLE + j] = key, sample
        a, b = pair(has.sobol, key, sample, u32(0), one)
        x = (like(i32(I[COLUMN + j]), one) + a) * camera[STEP] * two - one
        y = one - (like(i32(I[LINE + j]), one) + b) * camera[STEP + 1] * two
        dx = camera[AXIS] + x * camera[TURN_X] + y * camera[TURN_Y]
        dy = camera[AXIS + 1] + x * camera[TURN_X + 1] + y * camera[TURN_Y + 1]
        dz = camera[AXIS + 2] + x * camera[TURN_X + 2] + y * camera[TURN_Y + 2]
        length = one / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * length, dy * length, dz * length
        F[OX + j] = sel(new, camera[AT] + x * camera[MOVE_X] + y * camera[MOVE_Y], F[OX + j])
        F[OY + j] = sel(new, camera[AT + 1] + x * camera[MOVE_X + 1] + y * camera[MOVE_Y + 1], F[OY + j])
        F[OZ + j] = sel(new, camera[AT + 2] + x * camera[MOVE_X + 2] + y * camera[MOVE_Y + 2], F[OZ + j])
        F[DX + j], F[DY + j], F[DZ + j] = (
            sel(new, dx, F[DX + j]),
            sel(new, dy, F[DY + j]),
            sel(new, dz, F[DZ + j]),
        )
        F[DENSITY + j] = sel(new, zero, F[DENSITY + j])
        if len(has.refracting) > 0:
            F[SQUEEZE + j] = sel(new, one, F[SQUEEZE + j])
        if len(has.sheets) > 0:
            F[BEYOND + j] = sel(new, zero, F[BEYOND + j])
        if len(has.rows) > 0:
            # The picture's right, turned with the optical axis into the ray the shortest way.
            rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
            share = (rx * dx + ry * dy + rz * dz) / (
                one + dx * camera[AXIS] + dy * camera[AXIS + 1] + dz * camera[AXIS + 2]
            )
            F[AX + j] = sel(new, rx - (dx + camera[AXIS]) * share, F[AX + j])
            F[AY + j] = sel(new, ry - (dy + camera[AXIS + 1]) * share, F[AY + j])
            F[AZ + j] = sel(new, rz - (dz + camera[AXIS + 2]) * share, F[AZ + j])
        if len(has.spectral) > 0:
            hero, _ = pair(has.sobol, key, sample, u32(1), one)
            cells = like(QUANTILES, one)
            for c in range(len(has.channels)):
                u = hero + like(0.25 * c, one)
                u = sel(u >= one, u - one, u) * cells
                cell = i32(u)
                low, high = tables.spectra[cell], tables.spectra[cell + 1]
                k = c * LANES + j
                F[WAVE + k] = sel(new, low + (u - like(cell, one)) * (high - low), F[WAVE + k])
                # One over the density, and over the number of wavelengths.
                F[SHARE + k] = sel(new, (high - low) * cells * like(0.25, one), F[SHARE + k])
            F[ALONE + j] = sel(new, zero, F[ALONE + j])
        I[LEFT + j] = sel(new, u32(NOTHING), I[LEFT + j])
        I[DEPTH + j] = sel(new, u32(1), I[DEPTH + j])
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                for s in range(components(has)):
                    k = row(has, c, r, s)
                    F[k + j] = sel(new, camera[FIRST_ROWS + 4 * r + s], F[k + j])
                k = gathered(has, c, r)
                F[k + j] = sel(new, zero, F[k + j])
