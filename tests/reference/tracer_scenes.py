"""Small scenes that between them use everything a scene can hold.

Those of `PEERS` keep to what Mitsuba means by the same words: surfaces seen
from their fronts, little roughness, sheets as rectangles with their axis along
u, grey where Stokes vectors are compared.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    DirectionalLight,
    Disk,
    ImageEnvironment,
    Lambertian,
    Light,
    Material,
    Plane,
    Plastic,
    PointLight,
    Polarization,
    PolarizerSheet,
    Rectangle,
    RetarderSheet,
    Scene,
    Spectrum,
    Sphere,
    Surface,
    Texture,
    constant,
)
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]


class Case(NamedTuple):
    """A scene and the modes that have something to say about it."""

    name: str
    scene: Scene
    modes: tuple[Mode, ...]


def _rgb(*values: float) -> Spectrum:
    return Spectrum(np.array(values))


def _table(wavelength_nm: ArrayLike, values: ArrayLike) -> Spectrum:
    return Spectrum(np.asarray(values, dtype=np.float64), np.asarray(wavelength_nm, dtype=np.float64))


GREY, GLASS = Lambertian(constant(0.6)), Dielectric(constant(1.5))
METAL = Conductor(constant(0.183), constant(3.43))
TINTED = Conductor(_rgb(0.18, 0.42, 1.37), _rgb(3.42, 2.35, 1.77))
# Johnson and Christy's gold, rounded.
GOLD = Conductor(
    _table([400, 450, 500, 550, 600, 650, 700], [1.66, 1.50, 0.97, 0.43, 0.25, 0.17, 0.16]),
    _table([400, 450, 500, 550, 600, 650, 700], [1.96, 1.88, 1.87, 2.46, 3.02, 3.53, 3.97]),
)
RED, SAND = Lambertian(_rgb(0.7, 0.2, 0.1)), Lambertian(_table([400, 500, 600, 700], [0.1, 0.2, 0.8, 0.5]))
FLOOR = Rectangle((0, 0, 0), (4, 0, 0), (0, 4, 0))
BALL = Sphere((0, 0, 1), 1.0)
PANEL = Rectangle((0, 0, 4), (1.5, 0, 0), (0, -1.5, 0))
SKY = ConstantEnvironment(constant(0.3))
VIEW = Camera((0, -6, 2.5), (0, 0, 0.7), (0, 0, 1), (8, 6))
LINEAR = Polarization((1.0, 0.6, 0.5, 0.0), (0.3, 1.0, 0.2))
CIRCULAR = Polarization((1.0, 0.0, 0.0, -1.0), (0.0, 0.2, 1.0))


def _scene(
    *parts: Surface | Light, camera: Camera = VIEW, max_depth: int = 5, exterior_ior: float = 1.0
) -> Scene:
    surfaces = tuple(part for part in parts if isinstance(part, Surface))
    lights = tuple(part for part in parts if not isinstance(part, Surface))
    return Scene(camera, surfaces, lights, exterior_ior, max_depth)


def _lit(*surfaces: Surface, power: Spectrum | None = None, **how: object) -> Scene:
    return _scene(*surfaces, AreaLight(PANEL, power or constant(3.0)), SKY, **how)  # type: ignore[arg-type]


def _with(scene: Scene, *more: Light) -> Scene:
    return replace(scene, lights=scene.lights + more)


def _mirrors(material: Conductor) -> Scene:
    """Two mirrors askew, so that light that is s at one is neither at the other."""
    u = np.array([2.0, 0.3, 0.0])
    v = -np.cross(u, [0.1, -1.0, -0.2])
    second = Rectangle((0.3, 1.5, 1.5), tuple(u), tuple(v))
    camera = Camera((0, -4, 2.4), (0, 0, 0), (0.2, 0, 1), (8, 6), width=30.0)
    ground = Surface(Rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0)), material)
    return _lit(ground, Surface(second, material), camera=camera)


def _slab() -> Scene:
    """A glass plate at Brewster's angle that mirrors a panel, the picture's top askew."""
    angle = np.arctan(1.5)
    away = np.array([np.sin(angle), 0.0, np.cos(angle)])
    camera = Camera((-5 * away[0], 0, 5 * away[2]), (0, 0, 0), (0, 0.3, 1), (8, 6), "orthographic", 1.5)
    panel = AreaLight(
        Rectangle(tuple(3 * away), tuple(2 * np.cross(away, [0.0, 1.0, 0.0])), (0, 2, 0)), constant(3.0)
    )
    faces = (Rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0)), Rectangle((0, 0, -0.3), (2, 0, 0), (0, -2, 0)))
    return _scene(*(Surface(face, GLASS) for face in faces), panel, SKY, camera=camera, max_depth=8)


def _sheet(z: float, turn_deg: float, material: Material) -> Surface:
    turn = np.radians(turn_deg)
    u = (1.5 * np.cos(turn), 1.5 * np.sin(turn), 0.0)
    return Surface(Rectangle((0, 0, z), u, (-u[1], u[0], 0)), material)


def _crossed() -> Scene:
    """Two polarizers, almost crossed, with a retarder in between, before a panel."""
    camera = Camera((0, 0, 6), (0, 0, 0), (0.3, 1, 0), (8, 6), "orthographic", 4.0)
    sheets = (
        _sheet(1.0, 20.0, PolarizerSheet(0.0)),
        _sheet(0.0, 65.0, RetarderSheet(0.0, 70.0)),
        _sheet(-1.0, 95.0, PolarizerSheet(0.0)),
    )
    return _scene(
        *sheets, AreaLight(Rectangle((0, 0, -3), (4, 0, 0), (0, 4, 0)), constant(1.0)), camera=camera
    )


def _pointed() -> Scene:
    """Lights without extent on what is not smooth."""
    lamp, sun = PointLight((2, -2, 3), constant(20.0)), DirectionalLight((-0.5, 0.7, -1.0), constant(2.0))
    ball = Surface(Sphere((-1, 0, 1), 1.0), Plastic(constant(1.5), constant(0.5), 0.1))
    metal = replace(METAL, roughness=0.1)
    return _scene(Surface(FLOOR, GREY), ball, Surface(Sphere((1.1, 0, 0.9), 0.9), metal), lamp, sun)


def _glass_and_metal() -> Scene:
    spheres = Surface(Sphere((-1, 0, 1), 1.0), METAL), Surface(Sphere((1.1, 0, 1), 0.9), GLASS)
    return _lit(Surface(FLOOR, GREY), *spheres, max_depth=6)


PEERS = (
    Case(
        "panel over a floor",
        _lit(Surface(FLOOR, RED), Surface(BALL, SAND), power=_rgb(3, 2, 1)),
        ("rgb", "spectral"),
    ),
    Case("glass and metal", _glass_and_metal(), ("rgb", "spectral", "polarized")),
    Case(
        "rough metal",
        _lit(Surface(FLOOR, GREY), Surface(BALL, replace(METAL, roughness=0.1))),
        ("rgb", "polarized"),
    ),
    Case(
        "gold",
        _lit(Surface(FLOOR, RED), Surface(BALL, replace(GOLD, roughness=0.1))),
        ("spectral", "spectral_polarized"),
    ),
    Case(
        "plastic",
        _lit(Surface(FLOOR, GREY), Surface(BALL, Plastic(constant(1.5), constant(0.5), 0.1))),
        ("rgb", "polarized", "spectral_polarized"),
    ),
    Case("two mirrors", _mirrors(METAL), ("polarized", "spectral_polarized")),
    Case("slab at Brewster's angle", _slab(), ("rgb", "polarized")),
    Case("crossed polarizers, retarder", _crossed(), ("polarized",)),
    Case("point and sun", _pointed(), ("rgb", "polarized")),
)


def _polarized_lights() -> Scene:
    area = AreaLight(Disk((-1, -2, 4), (0.2, 0.4, -1), (1.5, 0, 0.3)), constant(2.0), LINEAR)
    lamp = PointLight((3, -2, 3), constant(9.0), CIRCULAR)
    sun = DirectionalLight((-0.5, 0.7, -1.0), constant(0.5), replace(LINEAR, stokes=(1.0, -0.5, 0.0, 0.7)))
    sky = ConstantEnvironment(constant(0.4), replace(CIRCULAR, stokes=(1.0, 0.3, -0.4, 0.2)))
    plastic = Surface(Sphere((1.1, 0, 0.9), 0.9), Plastic(constant(1.6), constant(0.5), 0.3))
    camera = replace(VIEW, analyzer_deg=30.0)
    return _scene(
        Surface(FLOOR, GREY),
        Surface(Sphere((-1, 0, 1), 1.0), TINTED),
        plastic,
        area,
        lamp,
        sun,
        sky,
        camera=camera,
    )


def _rough(exterior_ior: float = 1.0) -> Scene:
    glass = Surface(Sphere((1.1, 0, 0.9), 0.9), Dielectric(constant(1.7), 0.4))
    metal = Surface(Sphere((-1.1, 0, 0.9), 0.9), replace(TINTED, roughness=0.6))
    lamp = PointLight((1, -3, 5), constant(9.0))
    return _with(
        _lit(Surface(Plane((0, 0, 0), (0, 0, 1)), GREY), glass, metal, exterior_ior=exterior_ior), lamp
    )


def _backlit() -> Scene:
    """A rough ball in each quarter, lit from beside and behind: facets are met at grazing angles, where forms differ."""
    dull = Conductor(constant(1.5), constant(0.5), 0.6)
    materials = (
        dull,
        Dielectric(constant(1.7), 0.9),
        Dielectric(constant(2.2), 0.5),
        Plastic(constant(1.5), constant(0.95), 0.3),
    )
    centers = ((-1.1, 0, 0.82), (1.1, 0, 0.82), (-1.1, 0, -0.82), (1.1, 0, -0.82))
    balls = (Surface(Sphere(at, 0.8), what) for at, what in zip(centers, materials, strict=True))
    panel = AreaLight(Rectangle((0, 4, 4), (3, 0, 0), (0, -2, 2)), constant(2.0))
    lamp, sky = PointLight((-5, 2, 2), constant(100.0)), ConstantEnvironment(constant(0.7))
    camera = Camera((0, -6, 0), (0, 0, 0), (0, 0, 1), (8, 6), "orthographic", 4.4)
    return _scene(*balls, panel, lamp, sky, camera=camera, max_depth=4)


def _pictures() -> Scene:
    """A texture, seen from either side, under a picture of the surroundings."""
    rng = np.random.default_rng(4)
    pixels = rng.uniform(0.0, 1.0, (4, 6, 3)) ** 3
    texture = Lambertian(Texture(rng.uniform(0.1, 0.9, (3, 5, 3))))
    upright = Rectangle((1.2, 0.5, 1.0), (-0.8, 0.2, 0.0), (0.0, 0.0, 1.0))
    sky = ImageEnvironment(pixels, 1.5, LINEAR)
    return _scene(
        Surface(FLOOR, texture), Surface(Sphere((-1, 0, 1), 1.0), TINTED), Surface(upright, texture), sky
    )


def _lights() -> Scene:
    ball = AreaLight(Sphere((-2, -1, 1.5), 0.8), _rgb(3, 2.5, 2))
    disk = AreaLight(Disk((2, 0, 2), (-1, 0, -0.5), (0.6, 0, -1.2)), _rgb(2, 3, 5))
    far = AreaLight(Sphere((30, -80, 90), 40.0), constant(3.0))
    return _scene(
        Surface(FLOOR, GREY),
        Surface(Disk((0, 0.5, 0.5), (0.1, -1, 0.3), (0.8, 0.08, 0)), RED),
        ball,
        disk,
        far,
    )


def _shaded_sheets() -> Scene:
    """Polarizers and a retarder of both shapes, tilted, between lights and what scatters them."""
    above = Surface(Disk((-0.8, 0, 2), (0.3, 0.2, 1), (1.0, 0, -0.3)), PolarizerSheet(25.0, 0.9))
    below = Surface(Rectangle((-0.6, 0, 1.5), (1, 0, 0.2), (0, 1, 0)), RetarderSheet(70.0, 110.0))
    before = Surface(Rectangle((1.2, -2, 1), (0.7, 0.3, 0), (0, 0, 0.8)), PolarizerSheet(60.0))
    lamp = PointLight((-2, -1, 5), constant(20.0))
    ball = Surface(Sphere((0, 0.3, 0.6), 0.6), TINTED)
    return _with(
        _lit(Surface(FLOOR, Plastic(constant(1.5), constant(0.7), 0.5)), ball, above, below, before), lamp
    )


def _prism() -> Scene:
    """White light through two faces of a dispersive wedge onto a wide picture."""
    glass = Dielectric(_table([360, 450, 550, 650, 830], [1.90, 1.82, 1.79, 1.775, 1.76]))
    front = Rectangle((0, 0, 0), (1, 0, 0), (0, 0, 1))
    tilt = np.array([-np.cos(0.5), np.sin(0.5), 0.0])
    back = Rectangle((0, 0.8, 0), tuple(tilt), (0, 0, 1))
    bar = AreaLight(Rectangle((-2.9, 5, 0), (0.3, 0, 0), (0, 0, 3)), constant(10.0))
    camera = Camera((-0.3, -4, 0), (0, 0, 0), (0, 0, 1), (8, 6), width=14.0)
    return _scene(Surface(front, glass), Surface(back, glass), bar, SKY, camera=camera, max_depth=8)


CASES = (
    *PEERS,
    Case("polarized lights, analyzer", _polarized_lights(), ("scalar", "polarized")),
    Case("strong roughness", _rough(), ("rgb", "polarized")),
    Case("strong roughness under water", _rough(1.33), ("scalar",)),
    Case(
        "smooth plastic",
        _lit(Surface(FLOOR, GREY), Surface(BALL, Plastic(constant(1.5), _rgb(0.8, 0.5, 0.2)))),
        ("rgb", "polarized"),
    ),
    Case("pictures as paint and sky", _pictures(), ("scalar", "rgb", "spectral", "polarized")),
    Case("lights of every shape", _lights(), ("rgb",)),
    Case("shaded by sheets", _shaded_sheets(), ("scalar", "polarized")),
    Case("prism", _prism(), ("rgb", "spectral", "spectral_polarized")),
)
BACKLIT = Case("rough balls before the light", _backlit(), ("scalar",))
