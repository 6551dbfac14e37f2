"""Pictures laid over rectangles."""

from __future__ import annotations

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    EDGE_U,
    EDGE_V,
    LANES,
    MET,
    MOST,
    OF_COLOUR,
    OF_TEXTURE,
    PAINT,
    PRIMARIES,
    PX,
    PY,
    PZ,
    SHAPE,
    SHAPE_IDS,
    Floats,
    Has,
    Tables,
    Words,
    i32,
    u32,
)
from reflectance_fit.render.kernels.values import primaries, value
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def paint(has: Has, F: Floats, I: Words, tables: Tables) -> None:
    """PAINT: reflectance of the diffuse surface that is met, of its curve or of the pixel there."""
    shapes, shape_ids = tables.shapes, tables.shape_ids
    zero, half, one = like(0.0, F[0]), like(0.5, F[0]), like(1.0, F[0])
    for j in range(LANES):
        met = I[MET + j] & MOST
        g, w = met * SHAPE, met * SHAPE_IDS
        colour, texture = shape_ids[w + OF_COLOUR], shape_ids[w + OF_TEXTURE]
        # 0: none, so the first is number 1.
        painted = texture > u32(0)
        t = u32(u32(sel(painted, u32(texture - u32(1)), u32(0))) * u32(3))
        first, width, height = (
            tables.paint_ids[t],
            tables.paint_ids[t + 1],
            tables.paint_ids[t + 2],
        )
        x, y, z = (
            F[PX + j] - shapes[g],
            F[PY + j] - shapes[g + 1],
            F[PZ + j] - shapes[g + 2],
        )
        a, b = g + EDGE_U, g + EDGE_V
        u = x * shapes[a] + y * shapes[a + 1] + z * shapes[a + 2]
        v = x * shapes[b] + y * shapes[b + 1] + z * shapes[b + 2]
        across = min(max((u + one) * half, zero), one) * like(i32(width), one)
        down = min(max((one - v) * half, zero), one) * like(i32(height), one)
        column = u32(min(i32(across), i32(width) - i32(1)))
        line = u32(min(i32(down), i32(height) - i32(1)))
        pixel = sel(painted, u32(first + u32(u32(line * width) + column)), u32(0))
        for c in range(len(has.channels)):
            plain = value(has, F, tables.curves, colour, c, j)
            seen = primaries(has, F, tables, tables.paint, pixel, PRIMARIES, c, j)
            F[PAINT + c * LANES + j] = sel(painted, seen, plain)
