"""What every light sends to a plane, against its closed form."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from card import Figure
from numpy.typing import NDArray

from reflectance_fit.physics.area_lights import DiskLight, RectangleLight, SphereLight
from reflectance_fit.physics.light_irradiance import irradiance
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Disk,
    ImageEnvironment,
    Lambertian,
    Light,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    Surface,
    Vector,
    constant,
)
from reflectance_fit.render.settings import Settings

Floats = NDArray[np.float64]

SEED = 1
SIGMAS, PRECISION = 4.0, 1e-3
KINDS = ("rectangle", "disk", "sphere", "point", "directional", "constant environment", "image environment")
UP = np.array([0.0, 0.0, 1.0])
# The patch of the plane that the camera sees, so small that irradiance is that of its middle.
_PATCH = 1e-3


def figures(*, full: bool) -> Iterator[Figure]:
    scenes = 40 if full else 8
    for kind in KINDS:
        rng = np.random.default_rng([SEED, KINDS.index(kind)])
        pulls, errors = [], []
        for seed in range(scenes):
            light, expected = _light(kind, rng)
            found, error = _measured(light, seed, expected)
            # Rounding is no noise: lights without extent have none at all.
            pulls.append(abs(found - expected) / np.hypot(error, 1e-5 * expected))
            errors.append(error / expected)
        value = f"{max(pulls):.1f} sigma, {max(errors):.2%} wide at most"
        good = max(pulls) <= SIGMAS and max(errors) <= PRECISION
        target = f"{SIGMAS:.0f} sigma of {PRECISION:.1%}"
        yield Figure.judged(f"irradiance, {kind}, N = {scenes}", value, target, good)


def _measured(light: Light, seed: int, expected: float) -> tuple[float, float]:
    """Irradiance of the origin facing up, and its standard error: of as many paths as it takes."""
    camera = Camera((0, 0, 1e-2), (0, 0, 0), (0, 1, 0), (16, 16), "orthographic", _PATCH)
    floor = Surface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), Lambertian(constant(1.0)))
    scene = Scene(camera, (floor,), (light,), max_depth=2)
    samples = 256
    while True:
        film = render(scene, Settings("scalar", samples, seed, precision="double"))
        value = float(np.pi * film.mean.mean())
        error = float(np.pi * np.sqrt((film.error**2).sum()) / film.error.size)
        if error <= PRECISION * expected / 1.5 or samples >= 65536:
            return value, error
        samples *= 4


def _light(kind: str, rng: np.random.Generator) -> tuple[Light, float]:
    """A random light that the origin's upper side sees, and its irradiance there."""
    if kind == "constant environment":
        radiance = rng.uniform(0.5, 2.0)
        return ConstantEnvironment(constant(radiance)), np.pi * radiance
    if kind == "image environment":
        pixels = np.repeat(
            rng.uniform(0.0, 1.0, (int(rng.integers(2, 9)), int(rng.integers(2, 12)), 1)) ** 4, 3, axis=2
        )
        return ImageEnvironment(pixels, 2.0), 2.0 * _below(pixels[..., 0])
    direction = _direction(rng)
    at = rng.uniform(1.5, 4.0) * direction
    if kind == "point":
        intensity = rng.uniform(0.5, 2.0)
        return PointLight(_vector(at), constant(intensity)), intensity * direction[2] / float(at @ at)
    if kind == "directional":
        return DirectionalLight(_vector(-2.0 * direction), constant(3.0)), 3.0 * direction[2]
    radius = rng.uniform(0.1, 1.2)
    while True:
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        if normal @ direction < -0.3:
            break
    u = np.cross(normal, rng.normal(size=3))
    u *= radius / np.linalg.norm(u)
    if kind == "sphere":
        known: SphereLight | DiskLight | RectangleLight = SphereLight(at, radius)
        light = AreaLight(Sphere(_vector(at), radius), constant(1.0))
    elif kind == "disk":
        known = DiskLight(at, normal, radius)
        light = AreaLight(Disk(_vector(at), _vector(normal), _vector(u)), constant(1.0))
    else:
        v = rng.uniform(0.3, 2.0) * np.cross(normal, u)
        known = RectangleLight(at - u - v, 2 * u, 2 * v)
        light = AreaLight(Rectangle(_vector(at), _vector(u), _vector(v)), constant(1.0))
    return light, float(irradiance(known, np.zeros(3), UP))


def _direction(rng: np.random.Generator) -> Floats:
    """Above the horizon, mostly; some lights are cut by it."""
    z, phi = rng.uniform(0.15, 1.0), rng.uniform(0.0, 2.0 * np.pi)
    return np.array([np.sqrt(1.0 - z * z) * np.cos(phi), np.sqrt(1.0 - z * z) * np.sin(phi), z])


def _below(radiance: Floats) -> float:
    """Irradiance from cells of a latitude-longitude picture, facing the zenith: the integral of cos sin over each."""
    rows, columns = radiance.shape
    edges = np.minimum(np.linspace(0.0, np.pi, rows + 1), np.pi / 2.0)
    rings = (np.sin(edges[1:]) ** 2 - np.sin(edges[:-1]) ** 2) / 2.0
    return float(rings @ radiance.sum(axis=1)) * 2.0 * np.pi / columns


def _vector(values: Floats) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
