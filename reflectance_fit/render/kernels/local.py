"""A lane's surface seen from its own side: directions in a frame whose z is the normal that faces the path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    AX,
    AY,
    AZ,
    DX,
    DY,
    DZ,
    EMIT,
    LANES,
    NX,
    NY,
    NZ,
    Q_LIGHT,
    Has,
    row,
    row_count,
)
from reflectance_fit.render.kernels.polarization import sampled_state
from reflectance_fit.render.kernels.values import frame
from reflectance_fit.render.lobes.mueller import across, double_angle, reflect, turn
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


class Side(NamedTuple):
    """Axes x, y and z of the frame in the world; v, the direction the path came from, in the frame; which side it is."""

    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float
    vx: float
    vy: float
    vz: float
    front: bool


@stage
def side(F: np.ndarray, j: int) -> Side:
    """The side of the surface that lane j meets."""
    dx, dy, dz = F[u32(u32(DX) + j)], F[u32(u32(DY) + j)], F[u32(u32(DZ) + j)]
    nx, ny, nz = F[u32(u32(NX) + j)], F[u32(u32(NY) + j)], F[u32(u32(NZ) + j)]
    front = dx * nx + dy * ny + dz * nz < like(0.0, dx)
    nx, ny, nz = sel(front, nx, -nx), sel(front, ny, -ny), sel(front, nz, -nz)
    xx, xy, xz, yx, yy, yz = frame(nx, ny, nz)
    return Side(
        xx, xy, xz, yx, yy, yz, nx, ny, nz,
        -(dx * xx + dy * xy + dz * xz), -(dx * yx + dy * yy + dz * yz),
        max(-(dx * nx + dy * ny + dz * nz), like(1e-6, dx)), front,
    )  # fmt: skip


@stage
def to_local(s: Side, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the world in the frame."""
    return (
        x * s.xx + y * s.xy + z * s.xz,
        x * s.yx + y * s.yy + z * s.yz,
        x * s.zx + y * s.zy + z * s.zz,
    )


@stage
def to_world(s: Side, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the frame in the world."""
    return (
        x * s.xx + y * s.yx + z * s.zx,
        x * s.xy + y * s.yy + z * s.zy,
        x * s.xz + y * s.yz + z * s.zz,
    )


@stage
def plane_of(
    has: Has, F: np.ndarray, j: int, hx: float, hy: float, hz: float
) -> tuple[float, float, float, float, float]:
    """The s axis of lane j's ray and a facet's normal, and the turn of its rows to it (cosine and sine of twice the angle)."""
    one, zero = like(1.0, hx), like(0.0, hx)
    if len(has.rows) == 0:
        return one, zero, zero, one, zero
    dx, dy, dz = F[u32(u32(DX) + j)], F[u32(u32(DY) + j)], F[u32(u32(DZ) + j)]
    ax, ay, az = F[u32(u32(AX) + j)], F[u32(u32(AY) + j)], F[u32(u32(AZ) + j)]
    sx, sy, sz = across(dx, dy, dz, hx, hy, hz, ax, ay, az)
    cos, sin = double_angle(ax, ay, az, sx, sy, sz, -dx, -dy, -dz)
    return sx, sy, sz, cos, sin


@stage
def gather_light(
    has: Has, F: np.ndarray, I: np.ndarray, Q: np.ndarray, lamps: np.ndarray,
    c: int, q: int, j: int, weight: float,
    sx: float, sy: float, sz: float, a: float, b: float, e: float, d: float, cos: float, sin: float,
) -> None:  # fmt: skip
    """Adds to Q what a lane's rows have of the sampled light after a block (a, b, e, d) in the plane with s axis s."""
    zero = like(0.0, a)
    for r in range(row_count(has)):
        k = u32(u32(row(has, c, r, 0)) + j)
        seen = F[k] * a
        if len(has.rows) > 0:
            r1, r2 = turn(F[u32(k + u32(LANES))], F[u32(k + u32(2 * LANES))], cos, sin)
            r0, r1, r2, r3 = reflect(F[k], r1, r2, F[u32(k + u32(3 * LANES))], a, b, e, d)
            seen = sampled_state(has, F, I, lamps, j, sx, sy, sz, r0, r1, r2, r3)
        k = Q_LIGHT + (c * row_count(has) + r) * LANES + q
        got = weight * F[u32(u32(EMIT + c * LANES) + j)] * seen
        Q[k] = Q[k] + sel(weight > zero, got, zero)


@stage
def no_light(has: Has, Q: np.ndarray, q: int) -> None:
    for c in range(len(has.channels)):
        for r in range(row_count(has)):
            k = Q_LIGHT + (c * row_count(has) + r) * LANES + q
            Q[k] = like(0.0, Q[0])
