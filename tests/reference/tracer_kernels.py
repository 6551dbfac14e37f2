"""What makes many scenes one to the compiler: a kernel is compiled for what a scene contains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tracer_scenes import CIRCULAR, GLASS, TINTED
from tracer_shapes import unit

from reflectance_fit.render.scene import (
    AreaLight,
    Dielectric,
    Disk,
    ImageEnvironment,
    Lambertian,
    Light,
    Material,
    Plastic,
    PointLight,
    PolarizerSheet,
    Rectangle,
    Scene,
    Shape,
    Spectrum,
    Sphere,
    Surface,
    Texture,
    Vector,
    constant,
)

_FAR, _SMALL = 1e3, 1e-3


def specked(scene: Scene) -> Scene:
    """The same with a speck of everything far behind the camera, of a solid angle of 1e-12: no path will ever meet one."""
    behind = unit(np.subtract(scene.camera.position, scene.camera.target))
    aside = unit(np.cross(behind, scene.camera.up))

    def at(number: int) -> Vector:
        x, y, z = (float(v) for v in scene.camera.position + _FAR * behind + number * aside)
        return x, y, z

    dispersive = Dielectric(Spectrum(np.array([1.6, 1.5]), np.array([400.0, 700.0])))
    plastic = Plastic(constant(1.5), Spectrum(np.array([0.2, 0.6, 0.3])), 0.3)
    rough = replace(GLASS, roughness=0.3), replace(TINTED, roughness=0.3)
    balls = (GLASS, dispersive, TINTED, *rough, plastic)
    u, v = (float(x) for x in _SMALL * aside), (float(x) for x in _SMALL * np.cross(behind, aside))
    square = Rectangle(at(6), tuple(u), tuple(v))
    paint = Lambertian(Texture(np.full((1, 1, 3), 0.5)))
    surfaces = (
        *(Surface(Sphere(at(number), _SMALL), ball) for number, ball in enumerate(balls)),
        Surface(square, PolarizerSheet(0.0)),
        Surface(replace(square, center=at(7)), paint),
    )
    lights = (
        AreaLight(Sphere(at(8), _SMALL), constant(1e-6)),
        PointLight(at(9), constant(1e-9), CIRCULAR),
    )
    return replace(scene, surfaces=scene.surfaces + surfaces, lights=scene.lights + lights)


def furnished(scene: Scene) -> Scene:
    """The same beside a shelf of small things, so that one compiled kernel a mode serves every scene."""
    coloured = Spectrum(np.array([1.6, 1.52, 1.5]), np.array([400.0, 550.0, 700.0]))
    paint = Lambertian(Texture(np.array([[[0.2, 0.5, 0.8], [0.9, 0.4, 0.1]]])))
    things: tuple[tuple[Shape, Material], ...] = (
        (Sphere((-2.6, -0.4, 2.2), 0.25), Dielectric(coloured)),
        (Sphere((-2.6, 0.2, 2.2), 0.25), replace(TINTED, roughness=0.3)),
        (Sphere((-2.6, 0.8, 2.2), 0.25), Plastic(constant(1.5), Spectrum(np.array([0.2, 0.6, 0.3])), 0.3)),
        (Rectangle((-2.6, 0, 1.9), (0.3, 0, 0), (0, 1.3, 0)), paint),
        (Disk((-2.3, -1.4, 2.2), (0.4, -1, 0), (0, 0, 0.3)), PolarizerSheet(20.0)),
    )
    shelf = tuple(Surface(*thing) for thing in things)
    lights: tuple[Light, ...] = (
        AreaLight(Disk((-3, 0, 3), (0, 0, -1), (0.3, 0, 0)), constant(2.0)),
        PointLight((-2, 1, 4), constant(3.0), CIRCULAR),
    )
    if not any(isinstance(light, ImageEnvironment) for light in scene.lights):
        lights += (ImageEnvironment(np.array([[[0.1, 0.2, 0.3], [0.2, 0.1, 0.1]]])),)
    return replace(scene, surfaces=scene.surfaces + shelf, lights=scene.lights + lights)
