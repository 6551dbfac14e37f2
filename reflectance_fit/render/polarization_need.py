"""Whether polarization can change how bright a scene's picture is, as far as that is proved without a trial.

It can only where light that something has polarized meets something that tells
s from p, with no depolarizer in between.  Unpolarized light that meets one such
thing alone is exactly the mean of its s and p: one half, behind an analyzer.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from reflectance_fit.render.scene import (
    AreaLight,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    Disk,
    ImageEnvironment,
    Plane,
    Plastic,
    PolarizerSheet,
    Rectangle,
    RetarderSheet,
    Scene,
    Sphere,
    Surface,
)

# Flat shapes nearer to one plane than this, relative to their distance, cannot see each other.
_COPLANAR = 1e-6


def named(surface: Surface) -> str:
    """For a sentence: the user's name, else what it is."""
    return surface.name or "a " + type(surface.material).__name__.removesuffix("Sheet").lower()


def sees_itself(surface: Surface, scene: Scene) -> bool:
    """Flat shapes cannot; a sphere can from inside, where light enters it or the camera is."""
    shape = surface.shape
    if not isinstance(shape, Sphere):
        return False
    away = float(np.linalg.norm(np.subtract(scene.camera.position, shape.center)))
    return isinstance(surface.material, Dielectric) or away < shape.radius


def shows(scene: Scene) -> str | None:
    """Why polarization matters whatever the numbers, as a clause; None where that is not certain."""
    reflecting = _interfaces(scene)
    sheets = [s for s in scene.surfaces if isinstance(s.material, PolarizerSheet)]
    retarders = any(isinstance(s.material, RetarderSheet) for s in scene.surfaces)
    analyzer = scene.camera.analyzer_deg is not None
    telling = sheets + reflecting
    # Circular light alone is bright alike for every analyzer; a retarder makes it linear.
    polarized = [
        light
        for light in scene.lights
        if any(light.polarization.stokes[1:3]) or (light.polarization.stokes[3] and retarders)
    ]
    if len(sheets) > 1:
        return "light can pass more than one polarizer"
    if polarized and telling:
        return f"polarized light meets {named(telling[0])}"
    visible = (AreaLight, ConstantEnvironment, ImageEnvironment)
    if analyzer and any(isinstance(light, visible) for light in polarized):
        return "polarized light meets the analyzer"
    if analyzer and telling:
        return f"the analyzer sees light from {named(telling[0])}"
    if sheets and reflecting:
        return f"light from {named(reflecting[0])} can pass {named(sheets[0])}"
    return None


def may_show(scene: Scene) -> str | None:
    """Where light can meet two interfaces in a row, as a clause: the first polarizes, the second tells s from p.

    None where that is impossible; then, if `shows` is None as well, unpolarized transport is exact.
    """
    found = _interfaces(scene)
    if scene.max_depth < 3:
        return None
    for surface in found:
        if sees_itself(surface, scene):
            return f"light can meet {named(surface)} twice"
    for one, other in combinations(found, 2):
        if not _coplanar(one, other):
            return _between(one, other)
    return None


def _between(one: Surface, other: Surface) -> str:
    names = named(one), named(other)
    if names[0] != names[1]:
        return f"light can go from {names[0]} to {names[1]}"
    return (
        f"light can meet {names[0]} and another one" if not one.name else f"light can meet {names[0]} twice"
    )


def _interfaces(scene: Scene) -> list[Surface]:
    """Surfaces that reflect s and p differently, where paths reach any surface."""
    if scene.max_depth < 2:
        return []
    return [s for s in scene.surfaces if isinstance(s.material, Dielectric | Conductor | Plastic)]


def _coplanar(one: Surface, other: Surface) -> bool:
    if isinstance(one.shape, Sphere) or isinstance(other.shape, Sphere):
        return False
    (point, normal), (other_point, other_normal) = _plane(one.shape), _plane(other.shape)
    away = np.subtract(other_point, point)
    parallel = np.linalg.norm(np.cross(normal, other_normal)) < _COPLANAR
    return bool(parallel and abs(normal @ away) <= _COPLANAR * np.linalg.norm(away))


def _plane(shape: Rectangle | Disk | Plane) -> tuple[tuple[float, float, float], np.ndarray]:
    """A point of a flat shape and its unit normal."""
    point = shape.point if isinstance(shape, Plane) else shape.center
    normal = np.cross(shape.u, shape.v) if isinstance(shape, Rectangle) else np.asarray(shape.normal)
    return point, normal / np.linalg.norm(normal)
