"""Scene files with one mistake each: one line that says where and what."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from card import Figure, Table

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.render.scene_file import read_scene

GOOD = """schema: reflectance_fit/scene/1
camera: {position: [0, -5, 2], target: [0, 0, 1], size_px: [32, 20], fov_deg: 35}
materials:
  gold: {type: conductor, eta: 0.2, k: 3.1, roughness: 0.1}
  glass: {type: dielectric, eta: 1.5}
  grey: {type: lambertian, reflectance: 0.5}
  film: {type: polarizer, axis_deg: 30}
surfaces:
  - {sphere: {center: [0, 0, 1], radius: 1}, material: gold}
  - {rectangle: {center: [0, 0, 0], u: [4, 0, 0], v: [0, 4, 0]}, material: grey}
  - {disk: {center: [0, -3, 1], radius: 0.5, normal: [0, -1, 0]}, material: film}
lights:
  - {type: environment, radiance: 1}
"""
MISTAKES = {
    "negative size": ("radius: 1}", "radius: -1}"),
    "no size": ("radius: 0.5", "radius: 0"),
    "negative k": ("k: 3.1", "k: -3.1"),
    "index of 0": ("eta: 1.5", "eta: 0"),
    "roughness above 1": ("roughness: 0.1", "roughness: 1.5"),
    "reflectance above 1": ("reflectance: 0.5", "reflectance: 1.5"),
    "no light": ("lights:\n  - {type: environment, radiance: 1}\n", ""),
    "NaN": ("center: [0, 0, 1]", "center: [0, .nan, 1]"),
    "infinity": ("v: [0, 4, 0]", "v: [0, .inf, 0]"),
    "unknown key": ("fov_deg: 35", "fov_degrees: 35"),
    "unknown material": ("material: grey", "material: gray"),
    "unknown shape": ("- {sphere:", "- {ball:"),
    "camera at its target": ("position: [0, -5, 2]", "position: [0, 0, 1]"),
    "edges not at right angles": ("v: [0, 4, 0]", "v: [1, 4, 0]"),
    "sheet on a sphere": ("material: gold", "material: film"),
    "a picture of no pixels": ("size_px: [32, 20]", "size_px: [0, 20]"),
    "field of view of 180 degrees": ("fov_deg: 35", "fov_deg: 180"),
    "a file that includes itself": ("materials:\n", "include: [scene.yaml]\nmaterials:\n"),
    "a file that is not there": ("materials:\n", "include: [nothing.yaml]\nmaterials:\n"),
    "another schema": ("scene/1", "scene/9"),
}


def figures() -> Iterator[Figure | Table]:
    rows, wrong = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.yaml"
        path.write_text(GOOD, encoding="utf-8")
        read_scene(path, _none)
        for name, (old, new) in MISTAKES.items():
            if GOOD.count(old) != 1:
                raise ValueError(f"{old!r} does not stand once in the scene")
            path.write_text(GOOD.replace(old, new), encoding="utf-8")
            lines = [line.replace(f"{folder}/", "") for line in _lines(path)]
            if len(lines) != 1 or not re.match(r"Error: (scene|nothing)\.yaml(:\d+)?: .", lines[0]):
                wrong.append(name)
            rows.append((name, " / ".join(lines)))
    value = f"{len(rows) - len(wrong)}" + (f" (not {', '.join(wrong)})" if wrong else "")
    yield Figure.judged(f"bad scenes with one line each, N = {len(rows)}", value, f"{len(rows)}", not wrong)
    yield Table("What bad scenes are told", ("mistake", "line"), tuple(rows))


def _lines(path: Path) -> list[str]:
    try:
        read_scene(path, _none)
    except ReflectanceFitError as error:
        return error.lines()
    return []


def _none(path: Path) -> None:
    raise ReflectanceFitError(f"{path}: no report is here")
