"""Lights as the kernels read them, and how often each is chosen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render import colour
from reflectance_fit.render.kernels import lanes
from reflectance_fit.render.pack_pictures import alias_table
from reflectance_fit.render.scene import (
    AreaLight,
    ConstantEnvironment,
    DirectionalLight,
    Disk,
    ImageEnvironment,
    Light,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
)

Floats = NDArray[np.float64]
Words = NDArray[np.uint32]


def lamps_of(
    scene: Scene, curves: colour.Curves, origin: Floats, shape_of_light: dict[int, int]
) -> tuple[Floats, Words]:
    """A row for each light that is sampled, then one for the constant surroundings, dark where there are none."""
    sampled = [light for light in scene.lights if not isinstance(light, ConstantEnvironment)]
    around = [light for light in scene.lights if isinstance(light, ConstantEnvironment)]
    if len(around) > 1:
        raise ValueError("a scene has one constant environment at most; add up their radiances")
    if sum(isinstance(light, ImageEnvironment) for light in sampled) > 1:
        raise ValueError("a scene has one picture of its surroundings at most")
    rows = np.zeros((len(sampled) + 1, lanes.LAMPS))
    ids = np.zeros((len(sampled) + 1, lanes.LAMP_IDS), np.uint32)
    powers = np.zeros(len(sampled))
    for place, light in enumerate(sampled):
        row, words = rows[place], ids[place]
        words[lanes.LAMP_SHAPE] = shape_of_light.get(place, lanes.NOTHING)
        powers[place] = _fill(light, row, words, curves, origin)
        _polarize(light, row)
    if sampled:
        known = powers[powers > 0]
        powers[powers <= 0] = known.mean() if known.size else 1.0
        # Half by power, half alike: near a weak light it matters most.
        chosen = 0.5 * powers / powers.sum() + 0.5 / len(sampled)
        rows[:-1, lanes.CHOSEN] = chosen
        rows[:-1, lanes.KEEP], ids[:-1, lanes.LAMP_ALIAS] = alias_table(chosen)
    ids[-1, lanes.LAMP_SHAPE] = lanes.NOTHING
    if around:
        ids[-1, lanes.LAMP_CURVE] = curves.emission(around[0].radiance)
        _polarize(around[0], rows[-1])
    else:
        dark = curves.array()
        ids[-1, lanes.LAMP_CURVE] = curves.add(np.zeros(dark.shape[1]))
    return rows, ids


def _fill(light: Light, row: Floats, words: Words, curves: colour.Curves, origin: Floats) -> float:
    """Writes a light's row; its power, 0 where that depends on how large the scene is."""
    match light:
        case PointLight():
            words[lanes.LAMP_KIND], words[lanes.LAMP_CURVE] = lanes.POINT, curves.emission(light.intensity)
            row[:3] = np.asarray(light.position) - origin
            return 4.0 * math.pi * _mean(curves, words)
        case DirectionalLight():
            words[lanes.LAMP_KIND], words[lanes.LAMP_CURVE] = (
                lanes.DIRECTIONAL,
                curves.emission(light.irradiance),
            )
            direction = np.asarray(light.direction, dtype=np.float64)
            row[:3] = -direction / np.linalg.norm(direction)
            return 0.0
        case AreaLight():
            words[lanes.LAMP_CURVE] = curves.emission(light.radiance)
            return _area(light.shape, row, words, origin) * math.pi * _mean(curves, words)
        case ImageEnvironment():
            words[lanes.LAMP_KIND] = lanes.IMAGE
            return 0.0
    raise ValueError(f"{type(light).__name__} is no light that the renderer knows")


def _area(shape: Sphere | Rectangle | Disk, row: Floats, words: Words, origin: Floats) -> float:
    """Area of a light's bright side."""
    row[:3] = np.asarray(shape.center) - origin
    if isinstance(shape, Sphere):
        words[lanes.LAMP_KIND], row[lanes.SIZE] = lanes.BALL, shape.radius
        return 4.0 * math.pi * shape.radius**2
    u = np.asarray(shape.u, dtype=np.float64)
    if isinstance(shape, Rectangle):
        v = np.asarray(shape.v, dtype=np.float64)
        normal = np.cross(u, v)
        words[lanes.LAMP_KIND], area = lanes.FLAT, 4.0 * float(np.linalg.norm(normal))
    else:
        normal = np.asarray(shape.normal, dtype=np.float64)
        v = np.cross(normal / np.linalg.norm(normal), u)
        words[lanes.LAMP_KIND], area = lanes.ROUND, math.pi * float(u @ u)
    row[lanes.TURNED : lanes.TURNED + 3] = normal / np.linalg.norm(normal)
    row[lanes.HALF_U : lanes.HALF_U + 3], row[lanes.HALF_V : lanes.HALF_V + 3] = u, v
    row[lanes.SIZE] = area
    return area


def _mean(curves: colour.Curves, words: Words) -> float:
    return float(curves.array()[words[lanes.LAMP_CURVE]].mean())


def _polarize(light: Light, row: Floats) -> None:
    row[lanes.POLARIZED : lanes.POLARIZED + 3] = (
        np.asarray(light.polarization.stokes[1:]) / light.polarization.stokes[0]
    )
    axis = np.asarray(light.polarization.axis, dtype=np.float64)
    row[lanes.AXIS : lanes.AXIS + 3] = axis / np.linalg.norm(axis)
