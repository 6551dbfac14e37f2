"""Rays against the shapes of a scene, one shape at a time, by the textbook."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.render.scene import Disk, Plane, Rectangle, Shape, Sphere

Floats = NDArray[np.float64]

# Of the hits of a ray, one nearer than this is the surface that it leaves.
NEAREST = 1e-7


def dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.sum(a * b, axis=-1))


def unit(a: ArrayLike) -> Floats:
    vector = np.asarray(a, dtype=np.float64)
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def distances(shape: Shape, origin: Floats, direction: Floats) -> Floats:
    """To the nearest hit of each ray (N, 3), infinite where there is none, shape (N,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if isinstance(shape, Sphere):
            towards = np.asarray(shape.center) - origin
            along = dot(towards, direction)
            across = towards - along[:, None] * direction
            half = np.sqrt(shape.radius**2 - dot(across, across))  # NaN where the ray passes by
            near, far = along - half, along + half
            found = np.where(near > NEAREST, near, far)
            return np.where(found > NEAREST, found, np.inf)
        point, n = _plane(shape)
        t = ((point - origin) @ n) / (direction @ n)
        inside = t > NEAREST
        at = origin + np.where(inside, t, 0.0)[:, None] * direction - point
    if isinstance(shape, Rectangle):
        for edge in (np.asarray(shape.u), np.asarray(shape.v)):
            inside &= np.abs(at @ edge) <= edge @ edge
    elif isinstance(shape, Disk):
        inside &= dot(at, at) <= float(np.dot(shape.u, shape.u))
    return np.where(inside, t, np.inf)


def normals(shape: Shape, at: Floats) -> Floats:
    """Unit normals, outwards of a sphere, shape (N, 3)."""
    if isinstance(shape, Sphere):
        return unit(at - np.asarray(shape.center))
    return np.broadcast_to(_plane(shape)[1], at.shape)


def axes(shape: Shape) -> tuple[Floats, Floats]:
    """Unit vectors u and v of a rectangle or disk."""
    if isinstance(shape, Rectangle):
        return unit(shape.u), unit(shape.v)
    if isinstance(shape, Disk):
        return unit(shape.u), unit(np.cross(shape.normal, shape.u))
    raise TypeError(f"a {type(shape).__name__} has no axes")


def texels(shape: Shape, pixels: Floats, at: Floats) -> Floats:
    """The texels of a picture laid over a rectangle, (N, 1 or 3)."""
    assert isinstance(shape, Rectangle)
    away = at - np.asarray(shape.center)
    u, v = (away @ np.asarray(edge) / np.dot(edge, edge) for edge in (shape.u, shape.v))
    return _looked_up(pixels, (1.0 - v) / 2.0, (1.0 + u) / 2.0)


def sky_texels(pixels: Floats, direction: Floats) -> Floats:
    """The texels of a latitude-longitude picture in some directions, (N, 3)."""
    polar = np.arccos(np.clip(direction[:, 2], -1.0, 1.0)) / np.pi
    azimuth = np.arctan2(direction[:, 1], direction[:, 0]) / (2.0 * np.pi)
    return _looked_up(pixels, polar, 0.5 - azimuth)


def _looked_up(pixels: Floats, down: Floats, right: Floats) -> Floats:
    height, width = pixels.shape[:2]
    row = np.clip((down * height).astype(int), 0, height - 1)
    return np.asarray(pixels[row, np.clip((right * width).astype(int), 0, width - 1)])


def _plane(shape: Shape) -> tuple[Floats, Floats]:
    if isinstance(shape, Rectangle):
        return np.asarray(shape.center), unit(np.cross(shape.u, shape.v))
    if isinstance(shape, Disk):
        return np.asarray(shape.center), unit(shape.normal)
    assert isinstance(shape, Plane)
    return np.asarray(shape.point), unit(shape.normal)
