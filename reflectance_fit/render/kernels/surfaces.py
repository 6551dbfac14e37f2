"""The rarer surfaces, kind by kind: their lanes are brought side by side, scattered and put back."""

from __future__ import annotations

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.coat import coat
from reflectance_fit.render.kernels.lanes import (
    COAT,
    GLASS,
    MIRROR,
    POLARIZER,
    RETARDER,
    ROUGH_GLASS,
    ROUGH_MIRROR,
    Floats,
    Has,
    Tables,
    Words,
)
from reflectance_fit.render.kernels.queue import brought, put_back, take_light
from reflectance_fit.render.kernels.rough import rough_metal
from reflectance_fit.render.kernels.rough_glass import rough_glass
from reflectance_fit.render.kernels.sheets import sheet
from reflectance_fit.render.kernels.smooth import smooth_glass, smooth_metal


@vectorised
def scatter(
    has: Has,
    F: Floats,
    I: Words,
    G: Floats,
    J: Words,
    Q: Floats,
    tables: Tables,
    with_glass: int | None,
    with_metal: int | None,
    with_rough_metal: int | None,
    with_rough_glass: int | None,
    with_coat: int | None,
    with_sheets: int | None,
) -> None:
    """Light from the sampled light, and a new direction, of all lanes but those on Lambertian surfaces."""
    if with_glass is not None:
        n = brought(has, F, I, G, J, GLASS)
        smooth_glass(has, G, J, Q, tables, n)
        put_back(has, F, I, Q, n)
    if with_metal is not None:
        n = brought(has, F, I, G, J, MIRROR)
        smooth_metal(has, G, J, Q, tables, n)
        put_back(has, F, I, Q, n)
    if with_rough_metal is not None:
        n = brought(has, F, I, G, J, ROUGH_MIRROR)
        rough_metal(has, G, J, Q, tables, n)
        take_light(has, F, I, Q, n)
        put_back(has, F, I, Q, n)
    if with_rough_glass is not None:
        n = brought(has, F, I, G, J, ROUGH_GLASS)
        rough_glass(has, G, J, Q, tables, n)
        take_light(has, F, I, Q, n)
        put_back(has, F, I, Q, n)
    if with_coat is not None:
        n = brought(has, F, I, G, J, COAT)
        coat(has, G, J, Q, tables, n)
        take_light(has, F, I, Q, n)
        put_back(has, F, I, Q, n)
    if with_sheets is not None:
        for kind in (POLARIZER, RETARDER):
            n = brought(has, F, I, G, J, kind)
            sheet(has, G, J, Q, tables, kind, n)
            put_back(has, F, I, Q, n)
