"""Scenes for which a mode is chosen: traps on either side of what needs polarization or spectra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tracer_scenes import CASES, GOLD, METAL, RED, SAND

from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    ConstantEnvironment,
    Dielectric,
    DirectionalLight,
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
    Shape,
    Spectrum,
    Sphere,
    Surface,
    constant,
)

_VIEW = Camera((0, -5, 1.5), (0, 0, 0.5), (0, 0, 1), (64, 48), width=50.0)
_GREY, _GLASS, _COAT = (
    Lambertian(constant(0.5)),
    Dielectric(constant(1.5)),
    Plastic(constant(1.5), constant(0.4)),
)
_GROUND, _BALL = Plane((0, 0, 0), (0, 0, 1)), Sphere((0, 0, 1), 1.0)
_WALL = Plane((0, 2, 0), (0, -1, 0))
_BEFORE = Rectangle((0, -3, 1), (1.5, 0, 0), (0, 0, 1.2))
_SKY = ConstantEnvironment(constant(1.0))
_PANEL = AreaLight(Rectangle((0, 0, 5), (2, 0, 0), (0, -2, 0)), constant(4.0))
_LINEAR, _CIRCULAR = Polarization((1.0, 0.6, 0.8, 0.0)), Polarization((1.0, 0.0, 0.0, 1.0))
_SIDE = Polarization((1.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
# Flint glass, about N-SF11.
_FLINT = Dielectric(
    Spectrum(np.array([1.84, 1.81, 1.785, 1.775, 1.765]), np.array([400.0, 470.0, 560.0, 650.0, 800.0]))
)
_CROWN = Dielectric(Spectrum(np.array([1.53, 1.52, 1.515, 1.51]), np.array([400.0, 500.0, 600.0, 800.0])))
_PEAK = Spectrum(np.array([0.05, 0.9, 0.05]), np.array([520.0, 560.0, 600.0]))


def scenes() -> dict[str, Scene]:
    """By name; 48 by 64 pixels and less."""
    light = AreaLight(Rectangle((0, 0, 5), (2, 0, 0), (0, -2, 0)), _PEAK)
    brewster = replace(_VIEW, position=(0.0, -4.0, 2.7), target=(0.0, 0.0, 0.0))
    made: dict[str, Scene] = {
        "grey walls": _of((_GROUND, _GREY), (_BALL, _GREY)),
        "grey behind an analyzer": _of((_GROUND, _GREY), camera=replace(_VIEW, analyzer_deg=30.0)),
        "a polarizer alone": _of((_GROUND, _GREY), (_BEFORE, PolarizerSheet(20.0))),
        "polarizer and analyzer": _of(
            (_GROUND, _GREY), (_BEFORE, PolarizerSheet(20.0)), camera=replace(_VIEW, analyzer_deg=70.0)
        ),
        "a polarizer before metal": _of((_GROUND, _GREY), (_BALL, METAL), (_BEFORE, PolarizerSheet(0.0))),
        "a retarder alone": _of((_GROUND, _GREY), (_BEFORE, RetarderSheet(20.0, 90.0))),
        "glass ground behind an analyzer": _of(
            (_GROUND, _GLASS), camera=replace(brewster, analyzer_deg=90.0)
        ),
        "glass ground and polarized sky": _of(
            (_GROUND, _GLASS), lights=(ConstantEnvironment(constant(1.0), _SIDE),)
        ),
        "metal ball under circular light": _of(
            (_BALL, METAL), lights=(ConstantEnvironment(constant(1.0), _CIRCULAR),)
        ),
        "two metals under circular light": _of(
            (_BALL, METAL), (_GROUND, METAL), lights=(ConstantEnvironment(constant(1.0), _CIRCULAR),)
        ),
        "grey ball under polarized light": _of(
            (_BALL, _GREY), (_GROUND, _GREY), lights=(PointLight((2, -2, 4), constant(20.0), _LINEAR),)
        ),
        "glass ground and glass wall": _of((_GROUND, _GLASS), (_WALL, _GLASS), lights=(_PANEL, _SKY)),
        "plastic ground and plastic wall": _of((_GROUND, _COAT), (_WALL, _COAT), lights=(_PANEL, _SKY)),
        "metal ball on a metal ground": _of((_GROUND, METAL), (_BALL, METAL), lights=(_PANEL, _SKY)),
        "metal ball on grey": _of((_GROUND, _GREY), (_BALL, METAL), lights=(_PANEL, _SKY)),
        "glass ball on grey": _of((_GROUND, _GREY), (_BALL, _GLASS), lights=(_PANEL, _SKY)),
        "glass ball under a polarized sun": _of(
            (_GROUND, _GREY),
            (_BALL, _GLASS),
            lights=(DirectionalLight((0.5, 1, -1), constant(2.0), _LINEAR), _SKY),
        ),
        "red ball": _of((_GROUND, _GREY), (_BALL, RED)),
        "red walls": _of((_GROUND, RED), (_WALL, RED), (_BALL, RED), lights=(_PANEL,)),
        "sand under a sky": _of((_GROUND, SAND), (_BALL, _GREY)),
        "a narrow light on colours": _of((_GROUND, RED), (_BALL, SAND), lights=(light,)),
        "gold on grey": _of((_GROUND, _GREY), (_BALL, GOLD), lights=(_PANEL, _SKY)),
        "gold on gold": _of((_GROUND, GOLD), (_BALL, GOLD), lights=(_PANEL, _SKY)),
        "flint ball": _of((_GROUND, _GREY), (_BALL, _FLINT), lights=(_PANEL, _SKY)),
        "crown ball on colours": _of((_GROUND, RED), (_BALL, _CROWN), lights=(_PANEL, _SKY)),
        "flint plate, seen through": _of((_GROUND, RED), (_BEFORE, _FLINT)),
    }
    return made | {case.name: case.scene for case in CASES}


def _of(*parts: tuple[Shape, Material], lights: tuple[Light, ...] = (_SKY,), camera: Camera = _VIEW) -> Scene:
    return Scene(camera, tuple(Surface(*part) for part in parts), lights, max_depth=6)
