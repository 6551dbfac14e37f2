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

from reflectance_fit.physics.area_lights import DiskLight, Light, RectangleLight, SphereLight, Weight
from reflectance_fit.physics.disk_light import DiskFrame
from reflectance_fit.physics.quadrature import Integral, Integrand, integrate_pieces
from reflectance_fit.physics.radiometry import checked_direction, checked_point
from reflectance_fit.physics.sphere_area import sphere_by_area

Floats = NDArray[np.float64]

_NOTHING = Integral(0.0, 0.0, True)
_TINY = np.finfo(np.float64).tiny

# Points of a light count from its corner or center: from a far receiver they would lose their differences.
_End = tuple[Floats, float]  # a point, and its height above the horizon


class _Piece(NamedTuple):
    """A piece of a boundary, away from the apex, by u in [0, 1]: point, derivative, height."""

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
        return sphere_by_area(light, position, normal, weight)
    facing = checked_direction(light.normal, "normal")
    origin = light.corner if isinstance(light, RectangleLight) else light.center
    base = np.asarray(origin, dtype=np.float64) - position
    above = -float(facing @ base)
    if isinstance(light, RectangleLight):
        fan = _rectangle(light, base, normal)
    else:
        fan = _disk(light, position, normal)
    if above <= 0.0 or fan is None:
        return _NOTHING
    apex, rim = fan
    pieces = [_sector(piece, base, apex, facing, above, weight) for piece in rim]
    return integrate_pieces(pieces, 2).times(light.radiance)


def _sector(
    piece: _Piece, base: Floats, apex: _End, facing: Floats, above: float, weight: Weight | None
) -> Integrand:
    """Integrand for what lies between apex and a piece of the boundary, x = apex + s (rim(u) - apex)."""
    hub, hub_height = apex
    to_hub = base + hub
    ends = piece.point(np.array([0.0, 1.0]))
    distance = float(np.linalg.norm(to_hub))
    near = distance + float(np.linalg.norm(ends[0] - hub))
    graded_u = _graded(near, float(np.linalg.norm(ends[1] - ends[0])))
    graded_s = _graded(distance, float(np.max(np.linalg.norm(ends - hub, axis=-1))))

    def integrand(x: Floats) -> Floats:
        (s, step_s), (u, step_u) = graded_s(x[..., 0]), graded_u(x[..., 1])
        spoke = piece.point(u) - hub
        seen = to_hub + s[..., None] * spoke
        area = s * np.abs(np.sum(facing * np.cross(spoke, piece.slope(u)), axis=-1))
        height = (1.0 - s) * hub_height + s * piece.height(u)
        r = np.linalg.norm(seen, axis=-1)
        value = np.asarray((height / r) * (above / r) * (area * step_s * step_u / r / r))
        return value if weight is None else value * weight(seen / r[..., None])

    return integrand


def _graded(core: float, length: float) -> Callable[[Floats], tuple[Floats, Floats]]:
    """s(t) and ds/dt on [0, 1], c sinh(k t), which spreads a peak of width core / length at 0."""
    # A core wider than a million lengths grades nothing, and a piece without length adds nothing.
    c = max(core / max(length, 1e-6 * core, _TINY), 1e-15)
    k = float(np.arcsinh(1.0 / c))
    return lambda t: (c * np.sinh(k * t), c * k * np.cosh(k * t))


def _rectangle(light: RectangleLight, base: Floats, normal: Floats) -> tuple[_End, list[_Piece]] | None:
    u, v = light.edges[:2]
    corners = [np.zeros(3), u, u + v, v]
    heights = [float(normal @ base + normal @ corner) for corner in corners]
    clipped: list[_End] = []
    for i in range(4):
        (a, ha), (b, hb) = (corners[i - 1], heights[i - 1]), (corners[i], heights[i])
        if (ha >= 0.0) != (hb >= 0.0):
            clipped.append((a + ha / (ha - hb) * (b - a), 0.0))
        if hb >= 0.0:
            clipped.append((b, hb))
    if not any(height > 0.0 for _, height in clipped):
        return None
    sides = list(zip(clipped, clipped[1:] + clipped[:1], strict=True))
    foot = light.normal * float(light.normal @ base) - base
    apex = foot, max(float(normal @ (base + foot)), 0.0)
    if not all(float(light.normal @ np.cross(b - a, foot - a)) >= 0.0 for (a, _), (b, _) in sides):
        nearest = [_closest(-base, *side) for side in sides]
        apex = min(nearest, key=lambda end: float(np.linalg.norm(base + end[0])))
    return apex, [half for side in sides for half in _halves(apex[0], *side)]


def _disk(light: DiskLight, position: Floats, normal: Floats) -> tuple[_End, list[_Piece]] | None:
    frame, radius = DiskFrame.of(light, position), light.radius
    n1, n2 = float(normal @ frame.radial), float(normal @ frame.across)
    swing, middle = radius * np.hypot(n1, n2), np.arctan2(n2, n1)
    base = np.asarray(light.center) - position
    depth = -float(normal @ base)
    if depth >= swing:
        return None
    whole = depth <= -swing
    half = np.pi if whole else np.arctan2(np.sqrt((swing - depth) * (swing + depth)), depth)

    def at(phi: Floats) -> Floats:
        across = np.cos(phi)[..., None] * frame.radial + np.sin(phi)[..., None] * frame.across
        return np.asarray(radius * across)

    def height(phi: Floats) -> Floats:
        # swing (cos(phi - middle) - cos(half)) as a product, 0 at both ends of the arc.
        turn = phi - middle
        cut = 2.0 * swing * np.sin((half + turn) / 2.0) * np.sin((half - turn) / 2.0)
        return swing * np.cos(turn) - depth if whole else np.asarray(cut)

    start, stop = middle - half, middle + half
    chord = (at(np.array(stop)), 0.0), (at(np.array(start)), 0.0)
    # The point of the disk nearest to the receiver, or of the chord if that one is below the horizon.
    near = min(float(frame.rho), radius) * frame.radial
    apex = near, float(normal @ (base + near))
    if apex[1] < 0.0:
        apex = _closest(-base, *chord)
    towards = float(np.arctan2(apex[0] @ frame.across, apex[0] @ frame.radial))
    # Arcs of at most 90 degrees, away from the point nearest to the apex on both sides.
    nearest = float(
        np.clip(middle + np.remainder(towards - middle + np.pi, 2.0 * np.pi) - np.pi, start, stop)
    )
    turns = [nearest + (end - nearest) * share for end in (start, stop) for share in (0.0, 0.25, 0.5, 1.0)]
    rim = [] if whole else _halves(apex[0], *chord)
    for lo, hi in (*pairwise(turns[:4]), *pairwise(turns[4:])):
        rim.append(_arc(at, height, lo, hi))
    return apex, rim


def _halves(apex: Floats, start: _End, stop: _End) -> list[_Piece]:
    """A side in two, each from the point nearest to the apex."""
    nearest = _closest(apex, start, stop)
    return [_segment(*nearest, *end) for end in (start, stop)]


def _arc(
    at: Callable[[Floats], Floats],
    height: Callable[[Floats], Floats],
    start: float,
    stop: float,
) -> _Piece:
    def phi(u: Floats) -> Floats:
        return np.asarray(start + (stop - start) * u)

    return _Piece(
        lambda u: at(phi(u)),
        lambda u: (stop - start) * at(phi(u) + np.pi / 2.0),
        lambda u: height(phi(u)),
    )


def _segment(a: Floats, height_a: float, b: Floats, height_b: float) -> _Piece:
    return _Piece(
        lambda u: a + u[..., None] * (b - a),
        lambda u: np.broadcast_to(b - a, (*u.shape, 3)),
        lambda u: (1.0 - u) * height_a + u * height_b,
    )


def _closest(point: Floats, start: _End, stop: _End) -> _End:
    """The point of a side nearest to another, and its height."""
    (a, height_a), (b, height_b) = start, stop
    edge = b - a
    u = float(np.clip((point - a) @ edge / max(float(edge @ edge), _TINY), 0.0, 1.0))
    return a + u * edge, (1.0 - u) * height_a + u * height_b
