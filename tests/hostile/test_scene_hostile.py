"""Whatever a scene file holds: a scene, or lines a user can act on.  Never a traceback."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.render.scene_file import read_scene
from reflectance_fit.report.read import material_of, read_report

YAML = """schema: reflectance_fit/scene/1
camera: {position: [0, -5, 2], target: [0, 0, 1], size_px: [320, 200], fov_deg: 35, analyzer_deg: 10}
include: [more.yaml]
materials:
  glass: {type: dielectric, material: N-BK7}
  gold: {type: conductor, eta: [0.2, 0.4, 1.4], k: [3.1, 2.5, 1.9], roughness: 0.1}
  grey: {type: lambertian, reflectance: {wavelength_nm: [400, 700], values: [0.1, 0.9]}}
  film: {type: polarizer, axis_deg: 30}
surfaces:
  - {sphere: {center: [0, 0, 1], radius: 1}, material: glass}
  - {disk: {center: [0, -3, 1], radius: 0.5, normal: [0, -1, 0]}, material: film}
  - {box: {center: [2, 0, 1], size: [1, 2, 3], turn_deg: 20}, material: gold}
lights:
  - {type: rectangle, center: [0, 0, 5], u: [1, 0, 0], v: [0, -1, 0], radiance: 10, circular: left}
  - {type: directional, direction: [0, 1, -1], irradiance: 3, linear_deg: 45, axis: [1, 0, 0]}
"""
MORE = """schema: reflectance_fit/scene/1
surfaces:
  - {plane: {point: [0, 0, 0], normal: [0, 0, 1]}, material: grey}
"""


def read(folder: Path, yaml: bytes, more: bytes = MORE.encode()):
    (folder / "s.yaml").write_bytes(yaml)
    (folder / "more.yaml").write_bytes(more)
    return read_scene(folder / "s.yaml", lambda path: material_of(read_report(path), path)).scene


def lines(folder: Path, yaml: str) -> list[str]:
    with pytest.raises(ReflectanceFitError) as caught:
        read(folder, yaml.encode("utf-8", "surrogatepass"))
    return [line.replace(f"{folder}{os.sep}", "") for line in caught.value.lines()]


def test_the_valid_file_is_valid(tmp_path):
    assert len(read(tmp_path, YAML.encode()).surfaces) == 9


@pytest.mark.parametrize("name", ["../m.yaml", "/etc/hostname", "a/../../m.yaml", "link.yaml", "/dev/zero"])
def test_paths_that_lead_outside(tmp_path, name):
    (tmp_path / "m.yaml").write_text(MORE)
    folder = tmp_path / "inside"
    folder.mkdir()
    (folder / "link.yaml").symlink_to(tmp_path / "m.yaml")
    for key, text in (
        ("include.0", YAML.replace("more.yaml", name)),
        ("materials.glass", YAML.replace("material: N-BK7", f"report: {name}")),
        ("materials.grey", re.sub("reflectance: .*}}", f"reflectance: {{texture: {name}}}}}", YAML)),
    ):
        (line,) = lines(folder, text)
        assert f"'{name}' leads outside the folder of s.yaml" in line, key


def test_paths_that_are_no_file(tmp_path):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "loop").symlink_to("loop")
    for name in ("none", "folder", "fifo", '"a\\0b"', "loop", "x" * 999, '"\\uD800"', '"."', '""'):
        for text in (
            YAML.replace("more.yaml", name),
            YAML.replace("material: N-BK7", f"report: {name}"),
            # A function, because a replacement's backslashes would be read.
            re.sub("reflectance: .*}}", lambda _, name=name: f"reflectance: {{texture: {name}}}}}", YAML),
        ):
            (line,) = lines(tmp_path, text)
            assert line.startswith("Error: s.yaml:")
            assert line.isprintable()


def test_a_report_that_is_none_says_so(tmp_path):
    (line,) = lines(tmp_path, YAML.replace("material: N-BK7", "report: more.yaml"))
    assert line == "Error: more.yaml:1: is not a report.yaml (no schema: reflectance_fit/material-report/1)"


def test_a_scene_that_is_no_file(tmp_path):
    for path in (
        tmp_path / "none.yaml",
        tmp_path,
        Path("/dev/zero"),
        tmp_path / "a\0b",
        tmp_path / ("x" * 999),
    ):
        with pytest.raises(ReflectanceFitError) as caught:
            read_scene(path, lambda _: pytest.fail("no report here"))
        assert len(caught.value.lines()) == 1


def finite(values) -> bool:
    return bool(np.all(np.isfinite(np.concatenate([np.ravel(v) for v in values]))))


def outcome(folder: Path, yaml: bytes, more: bytes = MORE.encode()) -> None:
    """A scene of finite numbers, or a ReflectanceFitError whose every line names a file."""
    try:
        found = read(folder, yaml, more)
        camera = found.camera
        assert finite([camera.position, camera.target, camera.up, camera.width, found.exterior_ior])
        assert np.linalg.norm(np.cross(np.subtract(camera.target, camera.position), camera.up)) > 0
        for surface in found.surfaces:
            assert finite([getattr(surface.shape, name) for name in surface.shape.__slots__])
        assert found.lights
    except ReflectanceFitError as error:
        for line in error.lines():
            assert re.match(r"Error: (.*(s\.yaml|more\.yaml)|and \d+ more)", line)
            assert line.isprintable()


NASTY = [
    *"[]{}:?-#,;|>&*!%@`'\"\t\r\x0c\u2028\ud7ffé0",
    *[
        "null",
        "true",
        ".nan",
        "-1",
        "1e999",
        "0x10",
        "0o7",
        "<<",
        "9e9",
        "1e-300",
        "s.yaml",
        "type",
        "sphere",
    ],
]


@st.composite
def mutated(draw: st.DrawFn, text: str) -> bytes:
    """``text`` with up to four pieces cut, doubled, or overwritten by what tends to hurt."""
    raw = text.encode()
    nasty = st.sampled_from(NASTY).map(str.encode)
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(raw)))
        end = min(len(raw), start + draw(st.integers(0, 20)))
        piece = draw(st.one_of(st.just(b""), st.just(raw[start:end] * 2), nasty, st.binary(max_size=5)))
        raw = raw[:start] + piece + raw[end:]
    return raw


@st.composite
def swapped(draw: st.DrawFn) -> bytes:
    """A file whose YAML is good and whose values are not: words of it in each other's places, or odd ones."""
    words = re.findall(r"[\w.]+|\[[^\]]*\]", YAML)
    text = YAML
    for _ in range(draw(st.integers(1, 3))):
        spot = draw(
            st.sampled_from([m.span() for m in re.finditer(r"(?<=: )(?:[\w.-]+|\[[^\]\n]*\])", text)])
        )
        odd = st.sampled_from(
            [*words, "[]", "{}", "[[]]", "'1'", "1e400", "-0.0", "[1, 2]", "[.nan, 0, 0]", "{type: x}"]
        )
        text = text[: spot[0]] + draw(odd) + text[spot[1] :]
    return text.encode()


FUZZ = settings(
    max_examples=400,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@FUZZ
@given(mutated(YAML))
def test_fuzz_scene(tmp_path, yaml):
    outcome(tmp_path, yaml)


@FUZZ
@given(swapped())
def test_fuzz_values(tmp_path, yaml):
    outcome(tmp_path, yaml)


@FUZZ
@given(mutated(MORE))
def test_fuzz_included(tmp_path, more):
    outcome(tmp_path, YAML.encode(), more)


@FUZZ
@given(st.text(max_size=200))
def test_fuzz_any_text(tmp_path, yaml):
    outcome(tmp_path, yaml.encode("utf-8", "surrogatepass"))
