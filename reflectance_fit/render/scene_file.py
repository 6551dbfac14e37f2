"""``scene.yaml`` read: a Scene, or a line for each thing that is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from reflectance_fit.errors import Problem, ReflectanceFitError, suggestion
from reflectance_fit.material import Material as FittedMaterial
from reflectance_fit.materials import library
from reflectance_fit.render import scene_build, scene_materials
from reflectance_fit.render.scene import (
    AreaLight,
    ConstantEnvironment,
    Disk,
    ImageEnvironment,
    Lambertian,
    Light,
    Material,
    PolarizerSheet,
    Rectangle,
    RetarderSheet,
    Scene,
    Shape,
    Sphere,
    Surface,
    Texture,
)
from reflectance_fit.render.scene_blocks import Camera, SurfaceEntry
from reflectance_fit.render.scene_include import SceneSource, read_sources


@dataclass(frozen=True, slots=True, eq=False)
class SceneFile:
    """What a scene file comes to.

    ``notes`` are words for the user on what had to be assumed.  ``inputs`` are
    (file as written, sha256) of it and the scenes it includes.
    """

    scene: Scene
    notes: tuple[str, ...]
    inputs: tuple[tuple[str, str], ...]


def read_scene(path: Path, fitted: Callable[[Path], FittedMaterial]) -> SceneFile:
    """The scene at ``path``, with what it includes.

    Parameters
    ----------
    path : Path
        A file of schema reflectance_fit/scene/1, docs/formats/scene.md.
    fitted : callable
        The material of a report.yaml, which may raise ReflectanceFitError.

    Raises
    ------
    ReflectanceFitError
        With every problem found, each with its file and line.
    """
    sources = read_sources(path)
    top = sources[0]
    reading = _Reading(top.block.camera, fitted)
    if top.block.camera is None:
        reading.problems.append(top.document.problem((), "'camera' is missing; add it"))
    for source in sources:
        reading.read_materials(source)
    for source in sources:
        reading.read_surfaces(source)
        reading.read_lights(source)
    if not any(source.block.lights for source in sources):
        reading.problems.append(
            top.document.problem((), "no light: the picture would be black; add one under lights")
        )
    if reading.problems or top.block.camera is None:
        raise ReflectanceFitError(reading.problems)
    return SceneFile(
        scene=Scene(
            camera=scene_build.camera(top.block.camera),
            surfaces=tuple(reading.surfaces),
            lights=tuple(reading.lights),
            exterior_ior=top.block.exterior_ior,
            max_depth=top.block.max_depth,
        ),
        notes=tuple(dict.fromkeys(reading.notes)),
        inputs=tuple((source.document.file, source.sha256) for source in sources),
    )


@dataclass(slots=True)
class _Reading:
    """What was found so far, problems included; ``None`` stands for a material with a problem of its own."""

    camera: Camera | None
    fitted: Callable[[Path], FittedMaterial]
    materials: dict[str, Material | None] = field(default_factory=dict)
    surfaces: list[Surface] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    @contextmanager
    def _at(self, source: SceneSource, *steps: str | int) -> Iterator[None]:
        """Collects problems as those of the value at ``steps``; those in a line of another file stay there."""
        try:
            yield
        except ReflectanceFitError as error:
            where = ".".join(map(str, steps))
            for p in error.problems:
                words = f"{p.file}: {p.message}" if p.file else p.message
                own = p if p.line else source.document.problem(steps, f"{where}: {words}")
                self.problems.append(own)

    def _material(self, source: SceneSource, block: scene_materials.Material) -> Material:
        red, green, blue = self.camera.channels_nm if self.camera else (600.0, 550.0, 450.0)
        files = scene_build.Files(source.path, self.fitted)
        found, note = scene_build.material(block, files, (red, green, blue))
        if note:
            self.notes.append(note)
        return found

    def read_materials(self, source: SceneSource) -> None:
        for name, block in source.block.materials.items():
            with self._at(source, "materials", name):
                if name in self.materials:
                    raise ReflectanceFitError("another file has a material of this name; rename one")
                self.materials[name] = None
                self.materials[name] = self._material(source, block)

    def read_surfaces(self, source: SceneSource) -> None:
        for i, entry in enumerate(source.block.surfaces):
            with self._at(source, "surfaces", i, "material"):
                material = self._material_of(source, entry)
                shapes = entry.shapes()
                if material is not None:
                    _check_together(material, shapes, boxed=entry.box is not None)
                    name = entry.name or (entry.material if isinstance(entry.material, str) else "")
                    self.surfaces += [Surface(shape, material, name) for shape in shapes]

    def _material_of(self, source: SceneSource, entry: SurfaceEntry) -> Material | None:
        if not isinstance(entry.material, str):
            return self._material(source, entry.material)
        if entry.material not in self.materials:
            raise ReflectanceFitError(_unknown(entry.material, tuple(self.materials)))
        return self.materials[entry.material]

    def read_lights(self, source: SceneSource) -> None:
        for i, block in enumerate(source.block.lights):
            with self._at(source, "lights", i):
                light = scene_build.light(block, scene_build.Files(source.path, self.fitted))
                surrounding = ConstantEnvironment | ImageEnvironment
                if isinstance(light, surrounding) and any(isinstance(x, surrounding) for x in self.lights):
                    raise ReflectanceFitError("the scene has an environment already; keep one")
                self.lights.append(light)
                if self.camera and _turned_away(light, self.camera.target):
                    words = "shines away from what the camera looks at; to turn a rectangle, swap u and v"
                    self.notes.append(f"lights.{i} of {source.path.name} {words}")


def _turned_away(light: Light, target: tuple[float, ...]) -> bool:
    """Whether a flat light has ``target`` behind it."""
    if not isinstance(light, AreaLight) or isinstance(light.shape, Sphere):
        return False
    shape = light.shape
    normal = np.cross(shape.u, shape.v) if isinstance(shape, Rectangle) else np.array(shape.normal)
    return bool(np.dot(normal, np.subtract(target, shape.center)) < 0)


def _unknown(name: str, known: tuple[str, ...]) -> str:
    words = f"no material '{name:.40}' under materials"
    if near := suggestion(name, known):
        return words + near
    try:
        built_in = library.entry(name)
    except ReflectanceFitError:
        return f"{words}; known are {', '.join(known)}" if known else f"{words}; add it there"
    kind = "dielectric" if built_in.kind == "dielectric" else "conductor"
    return f"{words}; for the built-in one write {{type: {kind}, material: {built_in.name}}}"


def _check_together(material: Material, shapes: list[Shape], *, boxed: bool) -> None:
    """ReflectanceFitError where the material cannot be laid on the shape."""
    flat = not boxed and all(isinstance(shape, Rectangle | Disk) for shape in shapes)
    if isinstance(material, PolarizerSheet | RetarderSheet) and not flat:
        raise ReflectanceFitError("polarizers and retarders are sheets; use a rectangle or a disk")
    textured = isinstance(material, Lambertian) and isinstance(material.reflectance, Texture)
    if textured and (boxed or not all(isinstance(shape, Rectangle) for shape in shapes)):
        raise ReflectanceFitError("a texture is laid over a rectangle; use one")
