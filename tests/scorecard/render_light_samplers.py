"""The renderer's samplers of lights and wavelengths, as `render_chi2.Sampler`: its own kernels, run on their own.

Densities are written down here once more, from the geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from render_chi2 import Sampler

from reflectance_fit.physics.jit import tracer
from reflectance_fit.render import colour
from reflectance_fit.render.kernels import lanes
from reflectance_fit.render.kernels.camera import begin
from reflectance_fit.render.kernels.lights import sample
from reflectance_fit.render.kernels.sky import sky_sample
from reflectance_fit.render.pack import Packed, pack
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Disk,
    ImageEnvironment,
    Light,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    constant,
)
from reflectance_fit.render.settings import Mode, Settings

Floats = NDArray[np.float64]

CAMERA = Camera((0.0, -5.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (8, 8))
HERE = np.array([0.3, -0.2, 0.1])
_LIGHT, _WAVE, _WHICH = 0, 1, 2
_COLUMNS = 4  # of results: direction and density, or wavelengths


@tracer
def _draw(has, with_image, tables, floats, integers, keys, here, kind, out):  # type: ignore[no-untyped-def]
    """One result a key: direction to a light and its density, four wavelengths, or which light."""
    for block in range(len(keys) // lanes.LANES):
        for j in range(lanes.LANES):
            floats[lanes.PX + j], floats[lanes.PY + j], floats[lanes.PZ + j] = here[0], here[1], here[2]
            integers[lanes.KEY + j] = keys[block * lanes.LANES + j]
            integers[lanes.SAMPLE + j] = np.uint32(0x51ED270B)
            integers[lanes.DEPTH + j] = np.uint32(0)
        if kind == _WAVE:
            begin(has, floats, integers, tables, np.uint32(0), np.uint32(8))
        else:
            for j in range(lanes.LANES):
                integers[lanes.DEPTH + j] = np.uint32(1)
            sample(has, floats, integers, tables)
            if with_image is not None:
                sky_sample(has, floats, integers, tables)
        first = lanes.WAVE if kind == _WAVE else lanes.LX
        for j in range(lanes.LANES):
            for c in range(4):
                out[block * lanes.LANES + j, c] = floats[first + c * lanes.LANES + j]
            if kind != _WAVE:
                out[block * lanes.LANES + j, 3] = floats[lanes.LIT + j]
            if kind == _WHICH:
                out[block * lanes.LANES + j, 0] = integers[lanes.LIGHT + j]


def packed(*lights: Light, mode: Mode = "scalar") -> Packed:
    settings = Settings(mode, sampler="independent", precision="double")
    return pack(Scene(CAMERA, (), lights), settings)


def draw(scene: Packed, kind: int, n: int, rng: np.random.Generator) -> Floats:
    whole = -(-n // lanes.LANES) * lanes.LANES
    keys = rng.integers(0, 2**32, whole, dtype=np.uint32)
    out = np.empty((whole, _COLUMNS))
    numbers = np.zeros(lanes.floats(scene.has))
    image = scene.parts.image
    _draw(scene.has, image, scene.tables, numbers, lanes.integers(), keys, HERE, kind, out)
    return out[:n]


def _frame(axis: Floats) -> Floats:
    """Columns x, y, z with z along the axis."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _directions(
    frame: Floats, light: Light, density: Callable[[Floats], Floats], low: float
) -> tuple[Callable[[int, np.random.Generator], Floats], Callable[[Floats, Floats], Floats]]:
    """Samples and density over the cosine to the frame's z axis, at least ``low``, and the azimuth about it."""
    scene = packed(light)

    def drawn(n: int, rng: np.random.Generator) -> Floats:
        l = draw(scene, _LIGHT, n, rng)[:, :3] @ frame
        return np.stack([np.clip(l[:, 2], low, 1.0), np.arctan2(l[:, 1], l[:, 0])], axis=1)

    def over(z: Floats, phi: Floats) -> Floats:
        across = np.sqrt(np.maximum((1.0 - z) * (1.0 + z), 0.0))
        return density(np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1) @ frame.T)

    return drawn, over


def _ball(ball: Sphere, light: Light, density: Callable[[Floats], Floats]) -> Sampler:
    to = np.asarray(ball.center) - HERE
    low = float(np.sqrt(1.0 - ball.radius**2 / (to @ to)))
    name = f"sphere light at {ball.center}"
    return Sampler(name, *_directions(_frame(to), light, density, low), (low, 1.0, -np.pi, np.pi))


def _flat(flat: Rectangle | Disk, light: Light, density: Callable[[Floats], Floats]) -> Sampler:
    """Over what the directions meet: along both edges, or squared radius and azimuth; solid angle turned into area."""
    scene, (u, v, normal) = packed(light), _axes(flat)
    to, round_ = np.asarray(flat.center) - HERE, isinstance(flat, Disk)
    bounds = (0.0, 1.0, -np.pi, np.pi) if round_ else (-1.0, 1.0, -1.0, 1.0)

    def drawn(n: int, rng: np.random.Generator) -> Floats:
        l = draw(scene, _LIGHT, n, rng)[:, :3]
        at = (to @ normal) / (l @ normal)[:, None] * l - to
        p, q = at @ u / (u @ u), at @ v / (v @ v)
        across = np.stack([p * p + q * q, np.arctan2(q, p)] if round_ else [p, q], axis=1)
        # A point of the rim may be beside it by rounding.
        return np.clip(across, bounds[::2], bounds[1::2])

    def over(x: Floats, y: Floats) -> Floats:
        p, q = (np.sqrt(x) * np.cos(y), np.sqrt(x) * np.sin(y)) if round_ else (x, y)
        l = to + p[:, None] * u + q[:, None] * v
        distance2 = np.sum(l * l, axis=1)
        l /= np.sqrt(distance2)[:, None]
        area = (0.5 if round_ else 1.0) * np.linalg.norm(np.cross(u, v))
        return density(l) * -(l @ normal) / distance2 * area

    return Sampler(f"{type(flat).__name__.lower()} light at {flat.center}", drawn, over, bounds)


def _axes(flat: Rectangle | Disk) -> tuple[Floats, Floats, Floats]:
    """Half edges and normal."""
    u = np.asarray(flat.u)
    normal = np.cross(u, flat.v) if isinstance(flat, Rectangle) else np.asarray(flat.normal, float)
    normal = normal / np.linalg.norm(normal)
    return u, np.asarray(flat.v) if isinstance(flat, Rectangle) else np.cross(normal, u), normal


def _picture(light: ImageEnvironment, density: Callable[[Floats], Floats]) -> Sampler:
    height, width = light.pixels.shape[:2]
    breaks = np.cos(np.linspace(0.0, np.pi, height + 1)), np.linspace(-np.pi, np.pi, width + 1)
    drawn, over = _directions(np.eye(3), light, density, -1.0)
    return Sampler("picture of the surroundings", drawn, over, (-1.0, 1.0, -np.pi, np.pi), breaks)


def ball_density(light: Sphere) -> Callable[[Floats], Floats]:
    """Alike over the cone of directions that meet the sphere."""
    to = np.asarray(light.center) - HERE
    cosine = np.sqrt(1.0 - light.radius**2 / (to @ to))

    def density(l: Floats) -> Floats:
        return np.where(
            l @ to >= cosine * np.linalg.norm(to) * (1 - 1e-12), 1 / (2 * np.pi * (1 - cosine)), 0.0
        )

    return density


def flat_density(light: Rectangle | Disk) -> Callable[[Floats], Floats]:
    """Alike over the area: distance squared over cosine and area, in directions that meet it."""
    u, v, normal = _axes(light)
    to = np.asarray(light.center) - HERE
    area = 4.0 * np.linalg.norm(np.cross(u, v)) if isinstance(light, Rectangle) else np.pi * (u @ u)

    def density(l: Floats) -> Floats:
        facing = -(l @ normal)
        distance = -(to @ normal) / np.where(facing > 0, facing, np.inf)
        at = distance[:, None] * l - to
        p, q = at @ u / (u @ u), at @ v / (v @ v)
        inside = (np.abs(p) <= 1) & (np.abs(q) <= 1) if isinstance(light, Rectangle) else p * p + q * q <= 1
        return np.where((facing > 0) & inside, distance**2 / (np.maximum(facing, 1e-12) * area), 0.0)

    return density


def sky_density(light: ImageEnvironment) -> Callable[[Floats], Floats]:
    """By brightness, alike over the solid angle of a pixel; row 0 at the zenith, column 0 at azimuth 180 degrees."""
    height, width = light.pixels.shape[:2]
    weights = light.pixels.mean(axis=2)
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    angles = (edges[:-1] - edges[1:])[:, None] * 2.0 * np.pi / width
    densities = weights / np.sum(weights * angles)

    def density(l: Floats) -> Floats:
        line = np.clip((np.arccos(np.clip(l[:, 2], -1, 1)) / np.pi * height).astype(int), 0, height - 1)
        turn = (np.pi - np.arctan2(l[:, 1], l[:, 0])) / (2.0 * np.pi)
        return densities[line, np.clip((turn * width).astype(int), 0, width - 1)]

    return density


BALLS = (Sphere((0.0, 0.5, 2.0), 1.0), Sphere((3.0, 1.0, 0.0), 0.05))
FLATS = (
    Rectangle((0.0, 0.0, 1.5), (0.0, 1.0, 0.3), (0.7, 0.0, 0.0)),
    Rectangle((2.0, 0.0, 0.3), (0.0, -0.2, 0.0), (0.1, 0.0, 1.5)),
    Disk((0.0, 1.0, 1.0), (0.0, -0.6, -0.8), (0.5, 0.0, 0.0)),
)


def _sky() -> ImageEnvironment:
    """With black pixels and a sun."""
    pixels = np.random.default_rng(5).random((6, 10, 3)) ** 4
    pixels[1, 3], pixels[4, 2] = 30.0, 0.0
    return ImageEnvironment(pixels)


def lights() -> Iterator[tuple[Light, Callable[[Floats], Floats]]]:
    """Each light of some size, and the density over solid angle of its directions, seen from HERE."""
    for ball in BALLS:
        yield AreaLight(ball, constant(1.0)), ball_density(ball)
    for flat in FLATS:
        yield AreaLight(flat, constant(1.0)), flat_density(flat)
    sky = _sky()
    yield sky, sky_density(sky)


def samplers() -> Iterator[Sampler]:
    """Lights of every shape, the choice among lights, and hero wavelengths."""
    for light, density in lights():
        if isinstance(light, AreaLight):
            kind = _ball if isinstance(light.shape, Sphere) else _flat
            yield kind(light.shape, light, density)
        elif isinstance(light, ImageEnvironment):
            yield _picture(light, density)
    yield _choice()
    yield from _wavelengths()


def _choice() -> Sampler:
    scene = packed(*(PointLight((0.0, 0.0, 1.0 + k), constant(10.0**k)) for k in range(5)))
    chosen = scene.tables.lamps.reshape(-1, lanes.LAMPS)[:5, lanes.CHOSEN]

    def drawn(n: int, rng: np.random.Generator) -> Floats:
        # Spread over a cell of width 1, as a density wants it.
        return np.stack([draw(scene, _WHICH, n, rng)[:, 0] + rng.random(n), rng.random(n)], axis=1)

    def density(x: Floats, y: Floats) -> Floats:
        return np.asarray(chosen[np.clip(x.astype(int), 0, 4)])

    return Sampler("choice among lights", drawn, density, (0.0, 5.0, 0.0, 1.0), (range(6), ()))


def _wavelengths() -> Iterator[Sampler]:
    scene = packed(PointLight((0.0, 0.0, 1.0), constant(1.0)), mode="spectral")
    edges = colour.wavelength_quantiles(lanes.QUANTILES)

    def density(x: Floats, y: Floats) -> Floats:
        cell = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, lanes.QUANTILES - 1)
        return np.asarray(1.0 / (np.diff(edges)[cell] * lanes.QUANTILES))

    for c in range(4):

        def drawn(n: int, rng: np.random.Generator, c: int = c) -> Floats:
            return np.stack([draw(scene, _WAVE, n, rng)[:, c], rng.random(n)], axis=1)

        bounds = float(edges[0]), float(edges[-1]), 0.0, 1.0
        yield Sampler(f"wavelength {c} of 4", drawn, density, bounds, (edges, ()))
