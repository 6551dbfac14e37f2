"""Irradiance as an integral over a light's area, E = int L cos(theta) cos(theta') / r^2 dA.

Where the horizon cuts a light, the integral ends there, so that the integrand
has no edge and Gauss' rule keeps its order; it is never negative, so nothing
cancels, and a height above the horizon is carried along each ray to the
boundary rather than computed anew, so thin slivers keep their digits.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.area_lights import DiskLight, Light, RectangleLight, SphereLight
from reflectance_fit.physics.disk_light import DiskFrame
from reflectance_fit.physics.quadrature import Integral, Integrand, integrate_pieces
from reflectance_fit.physics.radiometry import checked_direction, checked_point

Floats = NDArray[np.float64]
Weight = Callable[[Floats], Floats]

_NOTHING = Integral(0.0, 0.0, True)


class _Piece(NamedTuple):
    """A piece of a boundary, by u in [0, 1]: point from the receiver, derivative, height above the horizon."""

    point: Callable[[Floats], Floats]
    slope: Callable[[Floats], Floats]
    height: Callable[[Floats], Floats]


def irradiance_by_area(
    light: Light, position: ArrayLike, normal: ArrayLike, weight: Weight | None = None
) -> Integral:
    """Irradiance of an area light on one receiver, by quadrature over the light.

    Parameters
    ----------
    light : RectangleLight, DiskLight or SphereLight
    position, normal : float, shape (3,)
        The receiver's; the normal of any length.
    weight : function of float, shape (..., 3), to float, shape (...), optional
        Factor that depends on the unit vector from the receiver to the light.  A BRDF for a
        fixed outgoing direction gives the reflected radiance in place of the irradiance.

    Returns
    -------
    Integral
        Good to 1e-12 of itself where ``converged``, and to what rounding of the coordinates does: the
        receiver moved by an ulp of its distance and tilted by an ulp.

    Raises
    ------
    ValueError
        If an argument is not finite, the normal zero or the receiver inside a sphere light.
    """
    position, normal = checked_point(position, "position"), checked_direction(normal, "normal")
    if isinstance(light, SphereLight):
        return _sphere(light, position, normal, weight)
    facing = checked_direction(light.normal, "normal")
    if isinstance(light, RectangleLight):
        above = float(facing @ (position - light.corners[0]))
        fan = _rectangle(light, position, normal)
    else:
        above = float(facing @ (position - np.asarray(light.center)))
        fan = _disk(light, position, normal)
    if above <= 0.0 or fan is None:
        return _NOTHING
    apex, apex_height, rim = fan
    pieces = [_sector(piece, apex, apex_height, facing, above, weight) for piece in rim]
    return integrate_pieces(pieces, 2).times(light.radiance)


def _sector(
    piece: _Piece, apex: Floats, apex_height: float, facing: Floats, above: float, weight: Weight | None
) -> Integrand:
    """Integrand for what lies between apex and a piece of the boundary, x = apex + s (rim(u) - apex)."""

    # s = core sinh(stretch t) spreads the peak of a near light, of width core, over half of [0, 1].
    reach = float(np.max(np.linalg.norm(piece.point(np.linspace(0.0, 1.0, 9)) - apex, axis=-1)))
    core = float(np.linalg.norm(apex)) / max(reach, np.finfo(np.float64).tiny)
    stretch = float(np.arcsinh(1.0 / core))

    def integrand(x: Floats) -> Floats:
        s, u = core * np.sinh(stretch * x[..., 0]), x[..., 1]
        step = core * stretch * np.cosh(stretch * x[..., 0])
        spoke = piece.point(u) - apex
        point = apex + s[..., None] * spoke
        area = s * np.abs(np.sum(facing * np.cross(spoke, piece.slope(u)), axis=-1))
        height = (1.0 - s) * apex_height + s * piece.height(u)
        r = np.linalg.norm(point, axis=-1)
        value = (height / r) * (above / r) * (area * step / r / r)
        return value if weight is None else value * weight(point / r[..., None])

    return integrand


def _rectangle(
    light: RectangleLight, position: Floats, normal: Floats
) -> tuple[Floats, float, list[_Piece]] | None:
    corners = light.corners - position
    heights = corners @ normal
    clipped: list[tuple[Floats, float]] = []
    for i in range(4):
        (a, ha), (b, hb) = (corners[i - 1], heights[i - 1]), (corners[i], heights[i])
        if (ha >= 0.0) != (hb >= 0.0):
            clipped.append((a + ha / (ha - hb) * (b - a), 0.0))
        if hb >= 0.0:
            clipped.append((b, float(hb)))
    if not any(height > 0.0 for _, height in clipped):
        return None
    sides = list(zip(clipped, clipped[1:] + clipped[:1], strict=True))
    rim = [_segment(a, b, ha, hb) for (a, ha), (b, hb) in sides]
    foot = light.normal * float(light.normal @ corners[0])
    inside = all(float(light.normal @ np.cross(b - a, foot - a)) >= 0.0 for (a, _), (b, _) in sides)
    if inside:
        return foot, max(float(foot @ normal), 0.0), rim
    return *_nearest([_closest(a, b, ha, hb) for (a, ha), (b, hb) in sides]), rim


def _disk(light: DiskLight, position: Floats, normal: Floats) -> tuple[Floats, float, list[_Piece]] | None:
    frame, radius = DiskFrame.of(light, position), light.radius
    n1, n2 = float(normal @ frame.radial), float(normal @ frame.across)
    swing, middle = radius * np.hypot(n1, n2), np.arctan2(n2, n1)
    center = np.asarray(light.center) - position
    depth = -float(normal @ center)
    if depth >= swing:
        return None
    whole = depth <= -swing
    half = np.pi if whole else np.arctan2(np.sqrt((swing - depth) * (swing + depth)), depth)

    def at(phi: Floats) -> Floats:
        across = np.cos(phi)[..., None] * frame.radial + np.sin(phi)[..., None] * frame.across
        return np.asarray(center + radius * across)

    def height(phi: Floats) -> Floats:
        # swing (cos(phi - middle) - cos(half)) as a product, 0 at both ends of the arc.
        turn = phi - middle
        cut = 2.0 * swing * np.sin((half + turn) / 2.0) * np.sin((half - turn) / 2.0)
        return swing * np.cos(turn) - depth if whole else np.asarray(cut)

    edges = middle + half * np.linspace(-1.0, 1.0, 5)
    rim = [
        _Piece(
            lambda u, lo=lo, hi=hi: at(lo + (hi - lo) * u),
            lambda u, lo=lo, hi=hi: (hi - lo) * (at(lo + (hi - lo) * u + np.pi / 2.0) - center),
            lambda u, lo=lo, hi=hi: height(lo + (hi - lo) * u),
        )
        for lo, hi in pairwise(edges)
    ]
    ends = at(edges[[0, -1]])
    if not whole:
        rim.append(_segment(ends[1], ends[0], 0.0, 0.0))
    foot = center + float(frame.rho) * frame.radial
    # The point of the disk nearest to the receiver, or of the chord if that one is below the horizon.
    near = center + min(float(frame.rho), radius) * frame.radial
    near = foot if float(frame.rho) <= radius else near
    if (up := float(near @ normal)) >= 0.0:
        return near, up, rim
    return *_nearest([_closest(ends[1], ends[0], 0.0, 0.0)]), rim


def _segment(a: Floats, b: Floats, height_a: float, height_b: float) -> _Piece:
    return _Piece(
        lambda u: a + u[..., None] * (b - a),
        lambda u: np.broadcast_to(b - a, (*u.shape, 3)),
        lambda u: (1.0 - u) * height_a + u * height_b,
    )


def _closest(a: Floats, b: Floats, height_a: float, height_b: float) -> tuple[Floats, float]:
    """The point of a segment nearest to the receiver, and its height."""
    edge = b - a
    u = float(np.clip(-(a @ edge) / max(float(edge @ edge), np.finfo(np.float64).tiny), 0.0, 1.0))
    return a + u * edge, (1.0 - u) * height_a + u * height_b


def _nearest(candidates: list[tuple[Floats, float]]) -> tuple[Floats, float]:
    return min(candidates, key=lambda candidate: float(np.linalg.norm(candidate[0])))


def _sphere(light: SphereLight, position: Floats, normal: Floats, weight: Weight | None) -> Integral:
    """Over the cap that the receiver sees, by the angle omega from the axis towards it and the azimuth about that."""
    towards, distance = light.checked_distance(position)
    d, radius = float(distance), light.radius
    axis = -towards / d
    n1 = float(normal @ axis)
    sideways = normal - n1 * axis
    n2 = float(np.linalg.norm(sideways))
    sideways = checked_direction(
        sideways if n2 > 0.0 else np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]), "side"
    )
    other = np.cross(axis, sideways)
    limb = np.arctan2(np.sqrt((d - radius) * (d + radius)), radius)

    def middle(omega: Floats) -> Floats:
        """Height above the horizon at azimuth 90 degrees; swing(omega) cos(azimuth) is added to it."""
        return -n1 * ((d - radius) + 2.0 * radius * np.sin(omega / 2.0) ** 2)

    def swing(omega: Floats) -> Floats:
        return n2 * radius * np.sin(omega)

    def reach(omega: Floats) -> Floats:
        """Azimuth at which the circle of omega sets."""
        m, w = middle(omega), swing(omega)
        setting = np.arctan2(np.sqrt(np.maximum((w - m) * (w + m), 0.0)), -m)
        return np.where(m >= w, np.pi, np.where(m <= -w, 0.0, setting))

    def integrand(x: Floats, lo: float, hi: float) -> Floats:
        # sin^2 flattens the square roots with which reach begins and ends.
        omega = lo + (hi - lo) * np.sin(np.pi / 2.0 * x[..., 0]) ** 2
        step = (hi - lo) * np.pi / 2.0 * np.sin(np.pi * x[..., 0])
        limit = reach(omega)
        azimuth = limit * (2.0 * x[..., 1] - 1.0)
        full = limit == np.pi
        height = swing(omega) * np.where(
            full, np.cos(azimuth), 2.0 * np.sin((limit + azimuth) / 2.0) * np.sin((limit - azimuth) / 2.0)
        ) + np.where(full, middle(omega), 0.0)
        r2 = (d - radius) ** 2 + 4.0 * d * radius * np.sin(omega / 2.0) ** 2
        outwards = 2.0 * d * np.sin((limb + omega) / 2.0) * np.sin((limb - omega) / 2.0)
        value = np.maximum(height, 0.0) * outwards / r2 * radius**2 / r2 * np.sin(omega) * step * 2.0 * limit
        if weight is None:
            return value
        around = np.cos(azimuth)[..., None] * sideways + np.sin(azimuth)[..., None] * other
        point = np.cos(omega)[..., None] * axis + np.sin(omega)[..., None] * around
        seen = towards + radius * point
        return value * weight(seen / np.linalg.norm(seen, axis=-1, keepdims=True))

    # The horizon's plane touches a circle of omega where n1 cos(omega) -+ n2 sin(omega) = n1 d / R.
    edges = [0.0, float(limb)]
    if abs(n1) * d <= radius:
        for sign in (-1.0, 1.0):
            for branch in (-1.0, 1.0):
                angle = sign * np.arctan2(n2, n1) + branch * np.arccos(n1 * d / radius)
                edges.append(float(angle % (2.0 * np.pi)))
    edges = sorted({edge for edge in edges if 0.0 <= edge <= limb})
    pieces = [lambda x, lo=lo, hi=hi: integrand(x, lo, hi) for lo, hi in pairwise(edges)]
    return integrate_pieces(pieces, 2).times(light.radiance)
