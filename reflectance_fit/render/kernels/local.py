"""A lane's surface seen from its own side: directions in a frame whose z is the normal that faces the path."""

from __future__ import annotations

from typing import NamedTuple

from reflectance_fit.physics.jit import vectorised
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
    Floats,
    Has,
    Words,
    row,
    row_count,
)
from reflectance_fit.render.kernels.polarization import sampled_state
from reflectance_fit.render.kernels.values import frame
from reflectance_fit.render.lobes.mueller import across, double_angle, reflect, turn
from reflectance_fit.render.lobes.select import like, sel


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


@vectorised
def side(F: Floats, j: int) -> Side:
    """The side of the surface that lane j meets."""
    dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
    nx, ny, nz = F[NX + j], F[NY + j], F[NZ + j]
    front = dx * nx + dy * ny + dz * nz < like(0.0, dx)
    nx, ny, nz = sel(front, nx, -nx), sel(front, ny, -ny), sel(front, nz, -nz)
    xx, xy, xz, yx, yy, yz = frame(nx, ny, nz)
    return Side(
        xx, xy, xz, yx, yy, yz, nx, ny, nz,
        -(dx * xx + dy * xy + dz * xz), -(dx * yx + dy * yy + dz * yz),
        max(-(dx * nx + dy * ny + dz * nz), like(1e-6, dx)), front,
    )  # fmt: skip


@vectorised
def to_local(s: Side, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the world in the frame."""
    return (
        x * s.xx + y * s.xy + z * s.xz,
        x * s.yx + y * s.yy + z * s.yz,
        x * s.zx + y * s.zy + z * s.zz,
    )


@vectorised
def to_world(s: Side, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A direction of the frame in the world."""
    return (
        x * s.xx + y * s.yx + z * s.zx,
        x * s.xy + y * s.yy + z * s.zy,
        x * s.xz + y * s.yz + z * s.zz,
    )


@vectorised
def plane_of(
    has: Has, F: Floats, j: int, hx: float, hy: float, hz: float
) -> tuple[float, float, float, float, float]:
    """The s axis of lane j's ray and a facet's normal, and the turn of its rows to it (cosine and sine of twice the angle)."""
    one, zero = like(1.0, hx), like(0.0, hx)
    if len(has.rows) == 0:
        return one, zero, zero, one, zero
    dx, dy, dz = F[DX + j], F[DY + j], F[DZ + j]
    ax, ay, az = F[AX + j], F[AY + j], F[AZ + j]
    sx, sy, sz = across(dx, dy, dz, hx, hy, hz, ax, ay, az)
    cos, sin = double_angle(ax, ay, az, sx, sy, sz, -dx, -dy, -dz)
    return sx, sy, sz, cos, sin


@vectorised
def gather_light(
    has: Has, F: Floats, I: Words, Q: Floats, lamps: Floats,
    c: int, j: int, weight: float,
    sx: float, sy: float, sz: float, a: float, b: float, e: float, d: float, cos: float, sin: float,
) -> None:  # fmt: skip
    """Adds to Q what a lane's rows have of the sampled light after a block (a, b, e, d) in the plane with s axis s."""
    zero = like(0.0, a)
    for r in range(row_count(has)):
        k = row(has, c, r, 0) + j
        seen = F[k] * a
        if len(has.rows) > 0:
            r1, r2 = turn(F[k + LANES], F[k + 2 * LANES], cos, sin)
            r0, r1, r2, r3 = reflect(F[k], r1, r2, F[k + 3 * LANES], a, b, e, d)
            seen = sampled_state(has, F, I, lamps, j, sx, sy, sz, r0, r1, r2, r3)
        k = Q_LIGHT + (c * row_count(has) + r) * LANES + j
        got = weight * F[EMIT + c * LANES + j] * seen
        Q[k] = Q[k] + sel(weight > zero, got, zero)


@vectorised
def no_light(has: Has, Q: Floats, j: int) -> None:
    for c in range(len(has.channels)):
        for r in range(row_count(has)):
            k = Q_LIGHT + (c * row_count(has) + r) * LANES + j
            Q[k] = like(0.0, Q[0])
