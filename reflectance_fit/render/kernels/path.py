"""Paths of one tile: every lane takes the tile's next sample as soon as its path has ended, so that none idles."""

from __future__ import annotations

import numpy as np

from reflectance_fit.physics.jit import tracer, vectorised
from reflectance_fit.render.kernels.camera import begin
from reflectance_fit.render.kernels.diffuse import diffuse
from reflectance_fit.render.kernels.intersect import closest, meet, shadow
from reflectance_fit.render.kernels.lanes import (
    BEYOND,
    COLUMN,
    DEPTH,
    DONE,
    FAR,
    IDLE,
    KEY,
    KIND,
    LAMP,
    LANES,
    LAST,
    LEFT,
    LINE,
    LIST,
    MET,
    OX,
    OY,
    OZ,
    POLARIZER,
    PX,
    PY,
    PZ,
    QUANTILES,
    RUNNING,
    SAMPLE,
    SHARE,
    SLOT,
    STATE,
    WAVE,
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
from reflectance_fit.render.kernels.lights import found, sample
from reflectance_fit.render.kernels.queue import listed
from reflectance_fit.render.kernels.random import draw, mix
from reflectance_fit.render.kernels.sheets import lit_through_sheets
from reflectance_fit.render.kernels.sky import sky_found, sky_sample
from reflectance_fit.render.kernels.surfaces import scatter
from reflectance_fit.render.kernels.texture import paint
from reflectance_fit.render.kernels.values import FIRST_NM, POINTS, STEP_NM
from reflectance_fit.render.lobes.select import like, sel

# The first ray that Russian roulette may end.
_ROULETTE = 5


@vectorised
def _add_spectral(has: Has, F: Floats, film: Floats, tables: Tables, slot: int, j: int) -> None:
    """What the wavelengths of one lane look like, in linear sRGB."""
    rows = row_count(has)
    for c in range(len(has.channels)):
        x = (F[WAVE + c * LANES + j] - like(FIRST_NM, F[0])) * like(1.0 / STEP_NM, F[0])
        cell = min(max(int(x), 0), POINTS - 2)
        share = x - like(cell, x)
        for k in range(3):
            at = QUANTILES + 1 + k * POINTS + cell
            seen = tables.spectra[at] + share * (tables.spectra[at + 1] - tables.spectra[at])
            seen = seen * F[SHARE + c * LANES + j]
            for r in range(rows):
                film[slot * 3 * rows + k * rows + r] += seen * F[gathered(has, c, r) + j]


@vectorised
def retire(has: Has, F: Floats, I: Words, film: Floats, tables: Tables, n: int) -> int:
    """Adds what the listed lanes gathered to their pixels; how many were not numbers and are left out."""
    discarded = 0
    size = len(has.channels) * row_count(has)
    for q in range(n):
        j = I[LIST + q] & LAST
        slot = I[SLOT + j] * size
        total = like(0.0, F[0])
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                total += F[gathered(has, c, r) + j]
        if not (abs(total) < like(np.inf, total)):
            discarded += 1
            continue
        if len(has.spectral) > 0:
            _add_spectral(has, F, film, tables, I[SLOT + j], j)
            continue
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                film[slot + c * row_count(has) + r] += F[gathered(has, c, r) + j]
    return discarded


@vectorised
def go_on(has: Has, F: Floats, I: Words, deepest: int) -> None:
    """The next ray from where this one ended, unless it ended there for good; Russian roulette."""
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    for j in range(LANES):
        kind = I[KIND + j]
        running = I[STATE + j] == u32(RUNNING)
        largest = F[row(has, 0, 0, 0) + j]
        for c in range(1, len(has.channels)):
            largest = max(largest, F[row(has, c, 0, 0) + j])
        u, _ = draw(has, I, j, 3, one)
        # Sheets are no events of their own: they use no random number, and no length of the path.
        straight = kind >= u32(POLARIZER) if len(has.sheets) > 0 else False
        stay = sel((I[DEPTH + j] < u32(_ROULETTE - 1)) | straight, one, min(largest, one))
        ended = (kind <= u32(LAMP)) | (u >= stay) | (largest <= zero)
        scale = one / max(stay, like(1e-30, one))
        for c in range(len(has.channels)):
            for r in range(row_count(has)):
                for s in range(components(has)):
                    F[row(has, c, r, s) + j] = F[row(has, c, r, s) + j] * scale
        F[OX + j] = sel(straight, F[OX + j], F[PX + j])
        F[OY + j] = sel(straight, F[OY + j], F[PY + j])
        F[OZ + j] = sel(straight, F[OZ + j], F[PZ + j])
        if len(has.sheets) > 0:
            F[BEYOND + j] = sel(straight, F[FAR + j], zero)
        I[LEFT + j] = sel(straight, I[LEFT + j], I[MET + j])
        I[DEPTH + j] = u32(I[DEPTH + j] + sel(straight, u32(0), u32(1)))
        I[STATE + j] = sel(running & ended, u32(DONE), I[STATE + j])


@tracer
def trace(
    has: Has,
    tables: Tables,
    F: Floats,
    I: Words,
    G: Floats,
    J: Words,
    Q: Floats,
    film: Floats,
    left: int,
    top: int,
    width: int,
    height: int,
    first_group: int,
    groups: int,
    samples: int,
    picture_width: int,
    seed: int,
    deepest: int,
    with_lamps: int | None,
    with_image: int | None,
    with_textures: int | None,
    with_glass: int | None,
    with_metal: int | None,
    with_rough_metal: int | None,
    with_rough_glass: int | None,
    with_coat: int | None,
    with_sheets: int | None,
) -> int:
    """Traces all samples of a tile's pixels in some groups; adds them to ``film``, a group after the other.

    The last arguments are None where a scene has no such thing: then numba does not even look at its part.
    """
    for j in range(LANES):
        I[STATE + j] = u32(DONE)
        I[SLOT + j] = u32(0)
    for k in range(len(F)):
        F[k] = like(0.0, F[0])
    # Hashed by itself: pixel and seed combined as they are would give another seed the same numbers in other pixels.
    start = mix(u32(mix(u32(seed)) + u32(seed >> 32)))
    x, y, group, number = 0, 0, 0, 0
    slot = 0
    discarded = 0
    more = True
    while True:
        n = listed(I, STATE, DONE)
        discarded += retire(has, F, I, film, tables, n)
        for q in range(n):
            j = I[LIST + q] & LAST
            if more:
                I[STATE + j] = u32(RUNNING)
                I[DEPTH + j] = u32(0)
                I[COLUMN + j] = u32(left + x)
                I[LINE + j] = u32(top + y)
                I[SLOT + j] = u32(slot)
                I[KEY + j] = u32(first_group + group)
                I[SAMPLE + j] = u32(number)
                number += 1
                if number == samples:
                    number = 0
                    x += 1
                    slot += 1
                    if x == width:
                        x = 0
                        y += 1
                        if y == height:
                            y = 0
                            group += 1
                            more = group < groups
            else:
                I[STATE + j] = u32(IDLE)
        if not more:
            idle = 0
            for j in range(LANES):
                idle += int(I[STATE + j] == u32(IDLE))
            if idle == LANES:
                return discarded
        begin(has, F, I, tables, start, u32(picture_width))
        closest(has, F, I, tables)
        meet(has, F, I, tables)
        if with_textures is not None:
            paint(has, F, I, tables)
        found(has, F, I, tables)
        if with_image is not None:
            sky_found(has, F, I, tables)
        for j in range(LANES):
            last = I[DEPTH + j] >= u32(deepest)
            last = last & (I[KIND + j] < u32(POLARIZER))
            I[KIND + j] = sel(last, min(I[KIND + j], u32(LAMP)), I[KIND + j])
        if with_lamps is not None:
            sample(has, F, I, tables)
            if with_image is not None:
                sky_sample(has, F, I, tables)
            shadow(has, F, I, tables)
            if with_sheets is not None:
                lit_through_sheets(has, F, I, tables)
        diffuse(has, F, I, tables)
        scatter(
            has, F, I, G, J, Q, tables,
            with_glass, with_metal, with_rough_metal, with_rough_glass, with_coat, with_sheets,
        )  # fmt: skip
        go_on(has, F, I, deepest)


@tracer
def summed(film: Floats, groups: int, entries: int, scale: float) -> Floats:
    """Sums over groups of a tile's entries times ``scale``, then of their squares; ``film`` is dark again."""
    sums = np.zeros(2 * entries)
    for group in range(groups):
        for k in range(entries):
            mean = film[group * entries + k] * scale
            sums[k] += mean
            sums[entries + k] += mean * mean
            film[group * entries + k] = 0.0
    return sums
