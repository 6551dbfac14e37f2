"""Pictures laid over rectangles."""

from __future__ import annotations

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    EDGE_U,
    EDGE_V,
    LANES,
    MET,
    OF_COLOUR,
    OF_TEXTURE,
    PAINT,
    PRIMARIES,
    PX,
    PY,
    PZ,
    SHAPE,
    SHAPE_IDS,
    Has,
    Tables,
)
from reflectance_fit.render.kernels.values import primaries, value
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


@stage
def paint(has: Has, F: np.ndarray, I: np.ndarray, tables: Tables) -> None:
    """PAINT: reflectance of the diffuse surface that is met, of its curve or of the pixel there."""
    shapes, shape_ids = tables.shapes, tables.shape_ids
    zero, half, one = like(0.0, F[0]), like(0.5, F[0]), like(1.0, F[0])
    for j in range(LANES):
        met = I[MET + j]
        g, w = u32(met * u32(SHAPE)), u32(met * u32(SHAPE_IDS))
        colour, texture = shape_ids[u32(w + u32(OF_COLOUR))], shape_ids[u32(w + u32(OF_TEXTURE))]
        # 0: none, so the first is number 1.
        painted = texture > u32(0)
        t = u32(u32(sel(painted, u32(texture - u32(1)), u32(0))) * u32(3))
        first, width, height = (
            tables.paint_ids[t],
            tables.paint_ids[u32(t + u32(1))],
            tables.paint_ids[u32(t + u32(2))],
        )
        x, y, z = (
            F[PX + j] - shapes[g],
            F[PY + j] - shapes[u32(g + u32(1))],
            F[PZ + j] - shapes[u32(g + u32(2))],
        )
        a, b = u32(g + u32(EDGE_U)), u32(g + u32(EDGE_V))
        u = x * shapes[a] + y * shapes[u32(a + u32(1))] + z * shapes[u32(a + u32(2))]
        v = x * shapes[b] + y * shapes[u32(b + u32(1))] + z * shapes[u32(b + u32(2))]
        across = min(max((u + one) * half, zero), one) * like(np.int32(width), one)
        down = min(max((one - v) * half, zero), one) * like(np.int32(height), one)
        column = u32(min(np.int32(across), np.int32(width) - np.int32(1)))
        line = u32(min(np.int32(down), np.int32(height) - np.int32(1)))
        pixel = sel(painted, u32(first + u32(u32(line * width) + column)), u32(0))
        for c in range(len(has.channels)):
            plain = value(has, F, tables.curves, colour, c, j)
            seen = primaries(has, F, tables, tables.paint, pixel, PRIMARIES, c, j)
            F[PAINT + c * LANES + j] = sel(painted, seen, plain)
