"""Disk light: closed forms of the irradiance, with the horizon anywhere, and of the solid angle.

In the light's frame the receiver has height h above the disk and distance rho
from its axis.  r_near and r_far are its distances from the nearest and farthest
point of the rim, in the plane of the axis.  On the rim

    |v|^2 = S - 2 R rho cos(phi),  S = R^2 + rho^2 + h^2,  S^2 - (2 R rho)^2 = (r_near r_far)^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprf, elliprj

from reflectance_fit.physics.area_lights import DiskLight
from reflectance_fit.physics.radiometry import checked_direction

Floats = NDArray[np.float64]

# The trapezoidal rule's error on the rim of a cone with tangents up to 1 is exp(-0.88 * 2 * 24).
_RIM = (np.arange(24) + 0.5) * np.pi / 24


@dataclass(frozen=True, slots=True, eq=False)
class DiskFrame:
    """A receiver as the disk sees it; ``radial`` points from the axis to it, ``normal`` to the bright side.

    The light is out of sight for h <= 0.
    """

    h: Floats
    rho: Floats
    radial: Floats
    across: Floats
    normal: Floats

    @classmethod
    def of(cls, light: DiskLight, position: Floats) -> DiskFrame:
        normal = checked_direction(light.normal, "normal")
        offset = position - np.asarray(light.center, dtype=np.float64)
        h = np.sum(offset * normal, axis=-1)
        outward = offset - h[..., None] * normal
        # Once more: close to the axis the first difference is rounding, which need not be perpendicular.
        outward = outward - np.sum(outward * normal, axis=-1)[..., None] * normal
        rho = np.linalg.norm(outward, axis=-1)
        # On the axis any direction will do.
        some = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        on_axis = (rho == 0.0)[..., None]
        radial = checked_direction(np.where(on_axis, some, outward), "radial")
        return cls(h, rho, radial, np.cross(normal, radial), normal)


def disk_contour(light: DiskLight, position: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Irradiance over radiance of the part above the horizon, and the sum of the moduli of its terms.

    Lambert's contour integral 1/2 int n . (v x dv) / |v|^2 along the visible arc and back along the
    horizon.  The error is some ulps of the second value.  Unit normal.

    Notes
    -----
    As `rectangle_contour`.  For a whole disk the result is that of the elements to disks in J. R. Howell,
    A Catalog of Radiation Configuration Factors (1982).  The primitive of 1 / |v|^2 is Kepler's true anomaly,
    written phi + 2 arctan(beta sin(phi) / (1 - beta cos(phi))), which neither jumps nor cancels.
    """
    frame, radius = DiskFrame.of(light, position), light.radius
    front = frame.h > 0.0
    h, rho = np.where(front, frame.h, 1.0), frame.rho
    n1, n2, n3 = (np.sum(normal * axis, axis=-1) for axis in (frame.radial, frame.across, frame.normal))
    s = radius**2 + rho**2 + h**2
    q = np.hypot(h, rho - radius) * np.hypot(h, rho + radius)

    # Height of the rim above the horizon: swing cos(phi - middle) - middle_depth.
    swing, middle, depth = radius * np.hypot(n1, n2), np.arctan2(n2, n1), rho * n1 + h * n3
    whole, none = depth <= -swing, depth >= swing
    lift = s + q - 2.0 * rho**2
    below = rho**2 - radius**2 - h**2
    lift = np.where(below > 0.0, 4.0 * rho**2 * h**2 / (q + np.abs(below)), lift)
    facing = np.pi * radius**2 / q * (lift / (s + q))
    sideways = 2.0 * np.pi * h * radius**2 * rho / q / (s + q)
    whole_value = -n3 * facing - n1 * sideways

    half = np.arctan2(np.sqrt(np.maximum((swing - depth) * (swing + depth), 0.0)), depth)
    start, stop = middle - half, middle + half
    eps, beta = 2.0 * radius * rho / s, 2.0 * radius * rho / (s + q)

    def excess(phi: Floats) -> Floats:
        """Half of true less mean anomaly."""
        return np.asarray(np.arctan2(beta * np.sin(phi), 1.0 - beta * np.cos(phi)))

    gained = 2.0 * (excess(stop) - excess(start))
    true = 2.0 * half + gained
    i0 = true / q
    # (true / sqrt(1 - eps^2) - 2 half) / eps, and its limit on the axis.
    on_axis = eps < 1e-200
    ratio = np.where(on_axis, np.sin(stop) - np.sin(start), gained / np.where(on_axis, 1.0, eps))
    i1 = (ratio + true * eps * s * s / (q * (s + q))) / s
    change = 2.0 * np.sin(middle) * np.sin(half)
    growth = 2.0 * radius * rho * change / (s - 2.0 * radius * rho * np.cos(start))
    i2 = change / (s - 2.0 * radius * rho * np.cos(start)) * _log1p_ratio(growth)

    corner = (
        radius * np.cos(start)[..., None] * frame.radial + radius * np.sin(start)[..., None] * frame.across
    )
    corner = corner - rho[..., None] * frame.radial - h[..., None] * frame.normal
    along = np.sin(middle)[..., None] * frame.radial - np.cos(middle)[..., None] * frame.across
    chord = -2.0 * radius * np.sin(half)[..., None] * along
    turn = np.sum(normal * np.cross(corner, chord), axis=-1)
    back = -np.arctan2(turn, np.sum(corner * (corner + chord), axis=-1))

    terms = np.stack(
        [n3 * radius**2 * i0, -n3 * rho * radius * i1, h * radius * n1 * i1, h * radius * n2 * i2, back]
    )
    part_value, part_size = -0.5 * np.sum(terms, axis=0), 0.5 * np.sum(np.abs(terms), axis=0)
    value = np.where(whole, whole_value, np.where(none, 0.0, part_value))
    size = np.where(whole, np.abs(n3 * facing) + np.abs(n1 * sideways), np.where(none, 0.0, part_size))
    return np.where(front, value, 0.0), np.where(front, size, 0.0)


def disk_solid_angle(light: DiskLight, position: Floats) -> Floats:
    """Solid angle of the elliptic cone with tangents a, b of its half-angles,

        omega = 4 a b int_0^(pi/2) du / (r (1 + r)),    r^2 = 1 + a^2 cos^2 u + b^2 sin^2 u.

    A narrow cone takes the periodic trapezoidal rule, exact to rounding and free
    of cancellation however far the light is; a wide one Carlson's elliptic
    integrals.  0 from behind.

    Notes
    -----
    Half-angles from the triangle of receiver and both ends of the diameter in the axis' plane, whose
    bisector is the cone's axis: sin(beta) = 2 R / (r_near + r_far).  F. Paxton, Rev. Sci. Instrum. 30
    (1959) 254, has the same solid angle from the disk's own axis, as a difference.
    """
    frame, radius = DiskFrame.of(light, position), light.radius
    front = frame.h > 0.0
    h = np.where(front, frame.h, 1.0)
    q = np.hypot(h, frame.rho - radius) * np.hypot(h, frame.rho + radius)
    # q + t and q - t, t = h^2 + rho^2 - R^2, with product (2 h R)^2: the larger directly.
    t = h**2 + (frame.rho - radius) * (frame.rho + radius)
    larger = q + np.abs(t)
    smaller = 4.0 * (h * radius) ** 2 / larger
    plus, minus = np.where(t > 0.0, larger, smaller), np.where(t > 0.0, smaller, larger)
    a2, b2 = minus / plus, 2.0 * radius**2 / plus

    r = np.sqrt(1.0 + a2[..., None] * np.cos(_RIM) ** 2 + b2[..., None] * np.sin(_RIM) ** 2)
    narrow = 2.0 * np.pi * np.sqrt(a2 * b2) * np.mean(1.0 / (r * (1.0 + r)), axis=-1)
    return np.where(front, np.where(np.maximum(a2, b2) < 1.0, narrow, _wide_cone(a2, b2)), 0.0)


def _wide_cone(a2: Floats, b2: Floats) -> Floats:
    """2 pi - 4 a b int_0^(pi/2) du / (r (r^2 - 1)), the same by 1 / (r (1 + r)) = (1 - 1 / r) / (r^2 - 1).

    With cot^2(u) as the variable the integral is Carlson's; the wider half-angle as a leaves a sum of
    positive terms in the bracket.
    """
    wide, slim = np.maximum(a2, b2), np.minimum(a2, b2)
    p, y = slim / wide, (1.0 + slim) / (1.0 + wide)
    bracket = elliprf(0.0, 1.0, y) + (1.0 - p) / 3.0 * elliprj(0.0, 1.0, y, p)
    return np.asarray(2.0 * np.pi - 4.0 * np.sqrt(p / (1.0 + wide)) * bracket)


def _log1p_ratio(x: Floats) -> Floats:
    """log(1 + x) / x, 1 at x = 0."""
    zero = x == 0.0
    return np.where(zero, 1.0, np.log1p(x) / np.where(zero, 1.0, x))
