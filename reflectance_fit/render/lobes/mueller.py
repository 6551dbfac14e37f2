"""Rows times Mueller matrices: r <- r M, for rays that go from the camera to the light.

A row r gives what one Stokes component at the camera has of the light that
would arrive: r . stokes.  Its frame is that of this light: s along a reference axis, a
unit vector at right angles to the ray, p = (direction the light travels) x s.
"""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def double_angle(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, zx: float, zy: float, zz: float
) -> tuple[float, float]:
    """Cosine and sine of twice the angle from axis a to axis b, counter-clockwise for light that travels along z."""
    cosine = ax * bx + ay * by + az * bz
    sine = bx * (zy * az - zz * ay) + by * (zz * ax - zx * az) + bz * (zx * ay - zy * ax)
    # Both divided by cosine^2 + sine^2, which is 1 but for rounding: many turns do not change a row's length.
    scale = like(1.0, ax) / max(cosine * cosine + sine * sine, like(1e-18, ax))
    return (cosine * cosine - sine * sine) * scale, (cosine + cosine) * sine * scale


@vectorised
def across(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, fx: float, fy: float, fz: float
) -> tuple[float, float, float]:
    """Unit vector along a x b, the s axis of two directions; the axis f where they are one (within 1e-6)."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length2 = x * x + y * y + z * z
    scale = like(1.0, ax) / math.sqrt(max(length2, like(1e-12, ax)))
    apart = length2 > like(1e-12, ax)
    return sel(apart, x * scale, fx), sel(apart, y * scale, fy), sel(apart, z * scale, fz)


@vectorised
def turn(r1: float, r2: float, cos_2a: float, sin_2a: float) -> tuple[float, float]:
    """Components 1 and 2 of a row whose frame turns by a: like those of a Stokes vector."""
    return r1 * cos_2a + r2 * sin_2a, r2 * cos_2a - r1 * sin_2a


@vectorised
def reflect(
    r0: float, r1: float, r2: float, r3: float, a: float, b: float, c: float, d: float
) -> tuple[float, float, float, float]:
    """Row times the block (A, B, C, D) of a reflection, or of a transmission with D = 0."""
    return a * r0 + b * r1, b * r0 + a * r1, c * r2 + d * r3, c * r3 - d * r2


@vectorised
def polarize(
    r0: float, r1: float, r2: float, r3: float, diattenuation: float
) -> tuple[float, float, float, float]:
    """Row times a linear polarizer along its axis, which passes half of unpolarized light."""
    half, one = like(0.5, r0), like(1.0, r0)
    rest = half * math.sqrt(max((one - diattenuation) * (one + diattenuation), like(0.0, r0)))
    d = half * diattenuation
    return half * r0 + d * r1, d * r0 + half * r1, rest * r2, rest * r3


@vectorised
def retard(r2: float, r3: float, cosine: float, sine: float) -> tuple[float, float]:
    """Components 2 and 3 of a row times a retarder, its fast axis along s; cosine and sine of the retardance."""
    return cosine * r2 - sine * r3, sine * r2 + cosine * r3


@vectorised
def into_plane(
    r1: float,
    r2: float,
    ax: float,
    ay: float,
    az: float,
    vx: float,
    vy: float,
    vz: float,
    hx: float,
    hy: float,
    hz: float,
) -> tuple[float, float, float, float, float]:
    """Components 1 and 2 of a row turned into the plane of incidence of v and h, and its s axis.

    The row is of light that leaves along v, its axis a.  What the surface does is
    then a block in this plane, and s is also the axis of the light that comes, reflected or transmitted.
    """
    sx, sy, sz = across(vx, vy, vz, hx, hy, hz, ax, ay, az)
    cosine, sine = double_angle(ax, ay, az, sx, sy, sz, vx, vy, vz)
    r1, r2 = turn(r1, r2, cosine, sine)
    return r1, r2, sx, sy, sz
