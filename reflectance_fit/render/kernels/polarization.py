"""Stokes vectors of lights in the frames of rays, and rows times them."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.jit import stage
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
    Has,
)
from reflectance_fit.render.lobes.mueller import double_angle, turn
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


@stage
def state_of(
    lamps: np.ndarray, g: int, dx: float, dy: float, dz: float
) -> tuple[float, float, float, float, float, float]:
    """Axis at right angles to a ray along d, and Stokes vector over S0, of the light whose numbers begin at g."""
    zero, one, tiny = like(0.0, dx), like(1.0, dx), like(1e-12, dx)
    bx, by, bz = lamps[u32(g + u32(AXIS))], lamps[u32(g + u32(AXIS + 1))], lamps[u32(g + u32(AXIS + 2))]
    along = bx * dx + by * dy + bz * dz
    bx, by, bz = bx - along * dx, by - along * dy, bz - along * dz
    length2 = bx * bx + by * by + bz * bz
    over = one / math.sqrt(max(length2, tiny))
    known = sel(length2 > tiny, one, zero)
    g = u32(g + u32(POLARIZED))
    return (
        bx * over, by * over, bz * over,
        known * lamps[g], known * lamps[u32(g + u32(1))], known * lamps[u32(g + u32(2))],
    )  # fmt: skip


@stage
def polarized(
    has: Has, lamps: np.ndarray, g: int, dx: float, dy: float, dz: float,
    ax: float, ay: float, az: float, r0: float, r1: float, r2: float, r3: float,
) -> float:  # fmt: skip
    """A row, of axis a and a ray along d, times the Stokes vector over S0 of the light whose numbers begin at g."""
    if len(has.polarized) == 0:
        return r0
    bx, by, bz, s1, s2, s3 = state_of(lamps, g, dx, dy, dz)
    cos, sin = double_angle(ax, ay, az, bx, by, bz, -dx, -dy, -dz)
    r1, r2 = turn(r1, r2, cos, sin)
    return r0 + r1 * s1 + r2 * s2 + r3 * s3


@stage
def sampled_state(
    has: Has, F: np.ndarray, I: np.ndarray, lamps: np.ndarray, j: int,
    ax: float, ay: float, az: float, r0: float, r1: float, r2: float, r3: float,
) -> float:  # fmt: skip
    """A row of axis a, of a ray towards lane j's sampled light, times that light's Stokes vector over S0."""
    dx, dy, dz = F[u32(u32(LX) + j)], F[u32(u32(LY) + j)], F[u32(u32(LZ) + j)]
    if len(has.sheets) == 0:
        lamp = I[u32(u32(LIGHT) + j)] if len(has.lamps) > 1 else u32(0)
        return polarized(has, lamps, u32(lamp * u32(LAMPS)), dx, dy, dz, ax, ay, az, r0, r1, r2, r3)
    bx, by, bz = F[u32(u32(BX) + j)], F[u32(u32(BY) + j)], F[u32(u32(BZ) + j)]
    cos, sin = double_angle(ax, ay, az, bx, by, bz, -dx, -dy, -dz)
    r1, r2 = turn(r1, r2, cos, sin)
    s1, s2, s3 = F[u32(u32(STATE_1) + j)], F[u32(u32(STATE_2) + j)], F[u32(u32(STATE_3) + j)]
    return r0 + r1 * s1 + r2 * s2 + r3 * s3
