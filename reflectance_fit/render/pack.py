"""A scene as flat arrays, and what it contains, for the kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render import colour
from reflectance_fit.render.kernels import camera as view
from reflectance_fit.render.kernels import lanes
from reflectance_fit.render.pack_lights import lamps_of
from reflectance_fit.render.pack_materials import Looks, look
from reflectance_fit.render.pack_pictures import sky_of, textures_of
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Disk,
    ImageEnvironment,
    Plane,
    PointLight,
    Rectangle,
    Scene,
    Shape,
    Sphere,
)
from reflectance_fit.render.settings import Settings

Floats = NDArray[np.float64]
Words = NDArray[np.uint32]


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """What the kernels need; ``repeat`` is how many channels of the picture one of theirs stands for."""

    has: lanes.Has
    parts: lanes.Parts
    tables: lanes.Tables
    repeat: int


def pack(scene: Scene, settings: Settings) -> Packed:
    """Arrays of the precision asked for; coordinates relative to the camera's target, where digits matter most."""
    polarized = settings.mode in ("polarized", "spectral_polarized")
    if polarized and settings.fresnel != "exact":
        raise ValueError(
            f"the Fresnel form {settings.fresnel!r} has no s and p; use exact, or a mode without polarization"
        )
    if not scene.lights:
        raise ValueError("the scene has no light; add one, or an environment")
    _within_most("shapes", len(scene.surfaces) + sum(isinstance(light, AreaLight) for light in scene.lights))
    curves = colour.Curves(settings.mode, scene.camera.channels_nm)
    origin = np.asarray(scene.camera.target, dtype=np.float64)

    looks = Looks(curves, scene.exterior_ior, settings.fresnel)
    bodies: list[tuple[Shape, Words, Floats]] = [
        (surface.shape, *look(surface, looks)) for surface in scene.surfaces
    ]
    for number, light in enumerate(l for l in scene.lights if not isinstance(l, ConstantEnvironment)):
        if isinstance(light, AreaLight):
            words = np.zeros(lanes.SHAPE_IDS, np.uint32)
            words[lanes.OF_KIND], words[lanes.OF_LIGHT] = lanes.LAMP, number
            bodies.append((light.shape, words, np.zeros(5)))
    order = [
        [k for k, body in enumerate(bodies) if isinstance(body[0], kind)]
        for kind in (Sphere, Rectangle, Disk, Plane)
    ]
    sorted_bodies = [bodies[k] for kind in order for k in kind]
    shape_of_light = {
        int(words[lanes.OF_LIGHT]): place
        for place, (_, words, _) in enumerate(sorted_bodies)
        if words[lanes.OF_KIND] == lanes.LAMP
    }
    length = max(len(bodies), lanes.FEW)
    shapes = np.zeros((length, lanes.SHAPE))
    shapes[:, lanes.PLACE + 2] = 1.0  # what rays without a shape read
    shape_ids = np.zeros((length, lanes.SHAPE_IDS), np.uint32)
    for place, (shape, words, numbers) in enumerate(sorted_bodies):
        shapes[place, : lanes.ALPHA] = _geometry(shape, origin)
        shapes[place, lanes.ALPHA : lanes.ALPHA + 5] = numbers
        shape_ids[place] = words

    lamps, lamp_ids = lamps_of(scene, curves, origin, shape_of_light)
    spectral = settings.mode in colour.SPECTRAL
    counts = np.zeros(lanes.COUNTS, np.int64)
    counts[: lanes.SAMPLED] = [len(kind) for kind in order]
    sampled = [light for light in scene.lights if not isinstance(light, ConstantEnvironment)]
    counts[lanes.SAMPLED] = len(sampled)
    paint, paint_ids = textures_of(looks.textures, settings.mode)
    sky, sky_ids = [np.zeros(1)], [np.zeros(1, np.uint32)]
    for number, light in enumerate(sampled):
        if isinstance(light, ImageEnvironment):
            height, width = light.pixels.shape[:2]
            counts[[lanes.SKY_WIDTH, lanes.SKY_HEIGHT, lanes.SKY_LAMP]] = width, height, number
            sky, sky_ids = sky_of(light, settings.mode)
    pictures = bool(looks.textures) or counts[lanes.SKY_WIDTH] > 0
    spectra = np.zeros(1)
    if spectral:
        spectra = np.concatenate(
            [colour.wavelength_quantiles(lanes.QUANTILES), colour.observer().rgb.ravel()]
        )
        for k in range(3):
            counts[lanes.PRIMARIES + k] = curves.add(colour.basis(settings.mode)[k])
            counts[lanes.SKY_PRIMARIES + k] = curves.add(colour.basis(settings.mode, light=True)[k])
    rows = curves.array()
    _within_most("different spectra", len(rows))
    repeat = 1
    if rows.shape[1] == 3 and not pictures and np.all(rows == rows[:, :1]):
        # Without colours one channel stands for all three.
        rows, repeat = rows[:, :1], 3
    channels = 4 if spectral else rows.shape[1]
    kinds = set(shape_ids[: len(bodies), lanes.OF_KIND].tolist())
    glowing = [light.shape for light in sampled if isinstance(light, AreaLight)]
    analyzed = scene.camera.analyzer_deg is not None

    def flag(condition: bool) -> tuple[int, ...]:
        return (0,) if condition else ()

    def part(condition: bool) -> int | None:
        return 1 if condition else None

    has = lanes.Has(
        channels=(0,) * channels,
        rows=(0,) * (1 if analyzed else 4) if polarized else (),
        spectral=flag(spectral),
        sobol=flag(settings.sampler == "sobol"),
        lamps=(0,) * min(len(sampled), 2),
        area=(0,) * max((1 + isinstance(shape, Sphere) for shape in glowing), default=0),
        points=flag(any(isinstance(light, PointLight | DirectionalLight) for light in sampled)),
        polarized=flag(polarized and any(light.polarization.is_polarized for light in scene.lights)),
        refracting=flag(bool(kinds & {lanes.GLASS, lanes.ROUGH_GLASS})),
        sheets=flag(bool(kinds & {lanes.POLARIZER, lanes.RETARDER})),
        textures=flag(bool(looks.textures)),
        dispersive=flag(looks.dispersive and channels > 1),
        few=flag(len(bodies) <= lanes.FEW),
        approximate=(0,) * {"exact": 0, "large_index": 2, "lazanyi": 3}.get(settings.fresnel, 1),
    )
    parts = lanes.Parts(
        lamps=part(bool(sampled)),
        image=part(counts[lanes.SKY_WIDTH] > 0),
        textures=part(bool(looks.textures)),
        glass=part(lanes.GLASS in kinds),
        metal=part(lanes.MIRROR in kinds),
        rough_metal=part(lanes.ROUGH_MIRROR in kinds),
        rough_glass=part(lanes.ROUGH_GLASS in kinds),
        coat=part(lanes.COAT in kinds),
        sheets=part(bool(kinds & {lanes.POLARIZER, lanes.RETARDER})),
    )
    dtype = np.float32 if settings.precision == "single" else np.float64

    def as_numbers(array: Floats) -> NDArray[Any]:
        return np.ascontiguousarray(array, dtype=dtype).ravel()

    tables = lanes.Tables(
        shapes=as_numbers(shapes),
        shape_ids=shape_ids.ravel(),
        lamps=as_numbers(lamps),
        lamp_ids=lamp_ids.ravel(),
        curves=as_numbers(rows),
        camera=as_numbers(_camera(scene.camera, origin, polarized)),
        spectra=as_numbers(spectra),
        paint=as_numbers(paint),
        paint_ids=paint_ids.ravel(),
        sky=as_numbers(np.concatenate(sky)),
        sky_ids=np.concatenate(sky_ids),
        counts=counts,
    )
    return Packed(has, parts, tables, repeat)


def _within_most(what: str, count: int) -> None:
    """Kernels mask their indices: beyond `lanes.MOST` one shape or curve would be taken for another."""
    if count > lanes.MOST + 1:
        raise ValueError(
            f"the scene has {count:,} {what}, and a render at most {lanes.MOST + 1:,}; leave some out"
        )


def _geometry(shape: Shape, origin: Floats) -> Floats:
    row = np.zeros(lanes.ALPHA)
    if isinstance(shape, Sphere):
        row[:3] = np.asarray(shape.center) - origin
        row[lanes.RADIUS2] = shape.radius**2
        row[lanes.PLACE : lanes.PLACE + 4] = *row[:3], shape.radius
        return row
    row[:3] = np.asarray(shape.point if isinstance(shape, Plane) else shape.center) - origin
    if isinstance(shape, Rectangle):
        u, v = np.asarray(shape.u), np.asarray(shape.v)
        normal = np.cross(u, v)
    else:
        normal = np.asarray(shape.normal, dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    row[lanes.NORMAL : lanes.NORMAL + 3] = normal
    row[lanes.PLACE : lanes.PLACE + 4] = *normal, normal @ row[:3]
    if isinstance(shape, Disk):
        u = np.asarray(shape.u)
        v = np.cross(normal, u)
    if not isinstance(shape, Plane):
        row[lanes.EDGE_U : lanes.EDGE_U + 3] = u / (u @ u)
        row[lanes.EDGE_V : lanes.EDGE_V + 3] = v / (v @ v)
    return row


def _camera(camera: Camera, origin: Floats, polarized: bool) -> Floats:
    position = np.asarray(camera.position, dtype=np.float64) - origin
    axis = -position / np.linalg.norm(position)
    right = np.cross(axis, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, axis)
    width, height = camera.size_px
    numbers = np.zeros(view.FIRST_ROWS + 16)
    numbers[view.AT : view.AT + 3] = position
    numbers[view.AXIS : view.AXIS + 3] = axis
    if camera.projection == "perspective":
        half, across, down = math.tan(math.radians(camera.width) / 2.0), view.TURN_X, view.TURN_Y
    else:
        half, across, down = camera.width / 2.0, view.MOVE_X, view.MOVE_Y
    numbers[across : across + 3] = half * right
    numbers[down : down + 3] = half * height / width * up
    numbers[view.RIGHT : view.RIGHT + 3] = right
    numbers[view.STEP : view.STEP + 2] = 1.0 / width, 1.0 / height
    rows = np.eye(4)
    if camera.analyzer_deg is not None:
        double = 2.0 * math.radians(camera.analyzer_deg)
        rows[0] = 0.5, 0.5 * math.cos(double), 0.5 * math.sin(double), 0.0
    numbers[view.FIRST_ROWS :] = rows.ravel()
    return numbers
