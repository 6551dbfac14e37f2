"""Stokes vectors of lights in the frames of rays, and rows times them."""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    AXIS,
    BX,
    BY,
    BZ,
    LAMPS,
    LIGHT,
    LX,
    LY,
    LZ,
    POLARIZED,
    STATE_1,
    STATE_2,
    STATE_3,
    Floats,
    Has,
    Words,
    u32,
)
from reflectance_fit.render.lobes.mueller import double_angle, turn
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def state_of(
    lamps: Floats, g: int, dx: float, dy: float, dz: float
) -> tuple[float, float, float, float, float, float]:
    """Axis at right angles to a ray along d, and Stokes vector over S0, of the light whose numbers begin at g."""
    zero, one, tiny = like(0.0, dx), like(1.0, dx), like(1e-12, dx)
    bx, by, bz = lamps[g + AXIS], lamps[g + AXIS + 1], lamps[g + AXIS + 2]
    along = bx * dx + by * dy + bz * dz
    bx, by, bz = bx - along * dx, by - along * dy, bz - along * dz
    length2 = bx * bx + by * by + bz * bz
    over = one / math.sqrt(max(length2, tiny))
    known = sel(length2 > tiny, one, zero)
    g = g + POLARIZED
    return (
        bx * over, by * over, bz * over,
        known * lamps[g], known * lamps[g + 1], known * lamps[g + 2],
    )  # fmt: skip


@vectorised
def polarized(
    has: Has, lamps: Floats, g: int, dx: float, dy: float, dz: float,
    ax: float, ay: float, az: float, r0: float, r1: float, r2: float, r3: float,
) -> float:  # fmt: skip
    """A row, of axis a and a ray along d, times the Stokes vector over S0 of the light whose numbers begin at g."""
    if len(has.polarized) == 0:
        return r0
    bx, by, bz, s1, s2, s3 = state_of(lamps, g, dx, dy, dz)
    cos, sin = double_angle(ax, ay, az, bx, by, bz, -dx, -dy, -dz)
    r1, r2 = turn(r1, r2, cos, sin)
    return r0 + r1 * s1 + r2 * s2 + r3 * s3


@vectorised
def sampled_state(
    has: Has, F: Floats, I: Words, lamps: Floats, j: int,
    ax: float, ay: float, az: float, r0: float, r1: float, r2: float, r3: float,
) -> float:  # fmt: skip
    """A row of axis a, of a ray towards lane j's sampled light, times that light's Stokes vector over S0."""
    dx, dy, dz = F[LX + j], F[LY + j], F[LZ + j]
    if len(has.sheets) == 0:
        lamp = I[LIGHT + j] if len(has.lamps) > 1 else u32(0)
        return polarized(has, lamps, lamp * LAMPS, dx, dy, dz, ax, ay, az, r0, r1, r2, r3)
    bx, by, bz = F[BX + j], F[BY + j], F[BZ + j]
    cos, sin = double_angle(ax, ay, az, bx, by, bz, -dx, -dy, -dz)
    r1, r2 = turn(r1, r2, cos, sin)
    s1, s2, s3 = F[STATE_1 + j], F[STATE_2 + j], F[STATE_3 + j]
    return r0 + r1 * s1 + r2 * s2 + r3 * s3
