"""What makes many scenes one to the compiler: a kernel is compiled for what a scene contains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tracer_scenes import CIRCULAR, GLASS, TINTED
from tracer_shapes import unit

from reflectance_fit.render.scene import (
    AreaLight,
    Dielectric,
    Lambertian,
    Plastic,
    PointLight,
    PolarizerSheet,
    Rectangle,
    Scene,
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
    balls = (GLASS, dispersive, replace(TINTED, roughness=0.3), plastic)
    u, v = (float(x) for x in _SMALL * aside), (float(x) for x in _SMALL * np.cross(behind, aside))
    square = Rectangle(at(4), tuple(u), tuple(v))
    paint = Lambertian(Texture(np.full((1, 1, 3), 0.5)))
    surfaces = (
        *(Surface(Sphere(at(number), _SMALL), ball) for number, ball in enumerate(balls)),
        Surface(square, PolarizerSheet(0.0)),
        Surface(replace(square, center=at(5)), paint),
    )
    lights = (
        AreaLight(Sphere(at(6), _SMALL), constant(1e-6)),
        PointLight(at(7), constant(1e-9), CIRCULAR),
    )
    return replace(scene, surfaces=scene.surfaces + surfaces, lights=scene.lights + lights)
