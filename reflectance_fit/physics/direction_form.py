"""Irradiance of an area light in spherical coordinates about the receiver's normal.

    E = int int L cos(theta) sin(theta) dtheta dphi

The half-plane of azimuth phi cuts a convex light in a chord, and theta runs
between its ends, or to the horizon.  A sphere is seen as the disk that its limb
bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.area_lights import DiskLight, Light, RectangleLight, SphereLight
from reflectance_fit.physics.quadrature import Integral, integrate_pieces
from reflectance_fit.physics.radiometry import checked_direction, checked_point

Floats = NDArray[np.float64]
# From azimuths to both ends of the chord in the plane of azimuth and normal; both zero where there is none.
Chord = Callable[[Floats], tuple[Floats, Floats]]

_TINY = np.finfo(np.float64).tiny


def irradiance_by_direction(light: Light, position: ArrayLike, normal: ArrayLike) -> Integral:
    """Irradiance of an area light on one receiver, by quadrature over theta and phi.

    Arguments and errors as for `area_form.irradiance_by_area`.  The limits of theta
    are known to an ulp of 1, so a light of angular size sigma is good to 1e-16 / sigma at best,
    and one seen edge-on, which a thin part of the azimuths holds, may not converge.
    """
    position, normal = checked_point(position, "position"), checked_direction(normal, "normal")
    x_axis = checked_direction(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]), "x")
    frame = np.stack([x_axis, np.cross(normal, x_axis), normal])
    if isinstance(light, RectangleLight):
        front = float(light.normal @ (position - light.corners[0])) > 0.0
        chord, edges = _rectangle((light.corners - position) @ frame.T)
    else:
        disk = light if isinstance(light, DiskLight) else _limb(light, position)
        facing = frame @ checked_direction(disk.normal, "normal")
        center = frame @ (np.asarray(disk.center, dtype=np.float64) - position)
        front = float(facing @ center) < 0.0
        chord, edges = _disk(center, facing, disk.radius)
    if not front:
        return Integral(0.0, 0.0, True)

    def integrand(x: Floats, low: float, high: float) -> Floats:
        # sin^2 flattens the square roots with which a chord begins and ends.
        phi = low + (high - low) * np.sin(np.pi / 2.0 * x[..., 0]) ** 2
        step = (high - low) * np.pi / 2.0 * np.sin(np.pi * x[..., 0])
        theta_1, theta_2 = _limits(phi, *chord(phi))
        theta = theta_1 + (theta_2 - theta_1) * x[..., 1]
        return np.asarray(np.cos(theta) * np.sin(theta) * (theta_2 - theta_1) * step)

    turns = np.unique(np.concatenate([edges, [-np.pi, 0.0, np.pi]])).tolist()
    pieces = [lambda x, low=low, high=high: integrand(x, low, high) for low, high in pairwise(turns)]
    return integrate_pieces(pieces, 2).times(light.radiance)


def _limits(phi: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """theta at both ends of a chord, kept to [0, pi/2]; equal where there is no chord."""
    x_1, x_2 = (end[..., 0] * np.cos(phi) + end[..., 1] * np.sin(phi) for end in (first, second))
    z_1, z_2 = first[..., 2], second[..., 2]
    theta = np.arctan2(x_1, z_1)
    # By the turn from one end to the other, which may pass pi.
    turn = np.arctan2(x_2 * z_1 - z_2 * x_1, x_2 * x_1 + z_2 * z_1)
    low, high = np.minimum(theta, theta + turn), np.maximum(theta, theta + turn)
    return np.clip(low, 0.0, np.pi / 2.0), np.clip(high, 0.0, np.pi / 2.0)


def _across(phi: Floats) -> Floats:
    """Normal of the half-plane of azimuth phi."""
    return np.stack([-np.sin(phi), np.cos(phi), np.zeros_like(phi)], axis=-1)


def _azimuths(points: Floats) -> Floats:
    return np.asarray(np.arctan2(points[..., 1], points[..., 0]))


def _rectangle(corners: Floats) -> tuple[Chord, Floats]:
    """Chords and the azimuths where they change their form: of corners and of the horizon's crossings."""
    after = np.roll(corners, -1, axis=0)

    def crossing(side: Floats, leaving: bool) -> Floats:
        side_after = np.roll(side, -1, axis=-1)
        here = (side >= 0.0) & (side_after < 0.0) if leaving else (side < 0.0) & (side_after >= 0.0)
        fraction = np.where(here, side / np.where(here, side - side_after, 1.0), 0.0)
        points = np.where(here[..., None], corners + fraction[..., None] * (after - corners), 0.0)
        # A plane cuts a convex outline at most twice, so this sum has one term or none.
        return np.asarray(np.sum(points, axis=-2))

    def chord(phi: Floats) -> tuple[Floats, Floats]:
        side = _across(phi) @ corners.T
        return crossing(side, True), crossing(side, False)

    setting = [crossing(corners[:, 2], leaving) for leaving in (True, False)]
    return chord, _azimuths(np.concatenate([corners, setting]))


def _disk(center: Floats, facing: Floats, radius: float) -> tuple[Chord, Floats]:
    """As `_rectangle`; a disk's chords begin and end with half-planes that touch it."""

    def chord(phi: Floats) -> tuple[Floats, Floats]:
        across = _across(phi)
        off = across @ center
        # By this sine a distance in the disk's plane is more than one from the half-plane.
        sine = np.maximum(np.linalg.norm(np.cross(across, facing), axis=-1), _TINY)
        half = np.sqrt(np.maximum((radius * sine - off) * (radius * sine + off), 0.0)) / sine
        along = half[..., None] * np.cross(facing, across) / sine[..., None]
        inward = (across - (across @ facing)[..., None] * facing) / sine[..., None]
        middle = center - (off / sine)[..., None] * inward
        hit = (np.abs(off) < radius * sine)[..., None]
        return np.where(hit, middle - along, 0.0), np.where(hit, middle + along, 0.0)

    # (R sine)^2 - off^2 is a quadratic form in across, m + a cos(2 phi) + b sin(2 phi); its zeros touch.
    form = radius**2 * (np.eye(2) - np.outer(facing[:2], facing[:2])) - np.outer(center[:2], center[:2])
    m, a, b = np.trace(form) / 2.0, (form[1, 1] - form[0, 0]) / 2.0, -form[0, 1]
    ratio = -m / max(float(np.hypot(a, b)), _TINY)
    edges = []
    if abs(ratio) <= 1.0:
        swing = np.arccos(ratio)
        edges = [(np.arctan2(b, a) + s * swing) / 2.0 + turn for s in (-1, 1) for turn in (0.0, np.pi)]
    # Where the rim meets the horizon.
    slope = float(np.hypot(facing[0], facing[1]))
    if slope > 0.0 and abs(climb := -float(center[2]) / slope) < radius:
        uphill = (np.array([0.0, 0.0, 1.0]) - facing[2] * facing) / slope
        level = np.array([facing[1], -facing[0], 0.0]) / slope
        reach = np.sqrt((radius - climb) * (radius + climb)) * level
        edges += [float(_azimuths(center + climb * uphill + side * reach)) for side in (-1.0, 1.0)]
    return chord, np.asarray(np.arctan2(np.sin(edges), np.cos(edges)))


def _limb(light: SphereLight, position: Floats) -> DiskLight:
    """The disk inside the sphere's limb as seen from position."""
    towards, distance = light.checked_distance(position)
    d, radius = float(distance), light.radius
    cosine = float(np.sqrt((d - radius) * (d + radius))) / d
    center = np.asarray(light.center, dtype=np.float64) - towards * (radius / d) ** 2
    return DiskLight(center, -towards, radius * cosine, light.radiance)
