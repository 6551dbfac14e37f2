"""A scene file becomes the scene that it describes, and every mistake in it one line with its place."""

import math
import os
import time
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.material import Material
from reflectance_fit.materials import library
from reflectance_fit.render import scene
from reflectance_fit.render.colour import GRID_NM, index
from reflectance_fit.render.scene_file import read_scene

YAML = """schema: reflectance_fit/scene/1
camera: {position: [0, -5, 2], target: [0, 0, 1], size_px: [320, 200], fov_deg: 35}
materials:
  glass: {type: dielectric, material: N-BK7}
  gold: {type: conductor, material: gold, roughness: 0.1}
  wax: {type: plastic, eta: 1.45, reflectance: [0.8, 0.5, 0.1]}
  grey: {type: lambertian, reflectance: 0.5}
  ramp: {type: lambertian, reflectance: {wavelength_nm: [400, 700], values: [0.1, 0.9]}}
  film: {type: polarizer, axis_deg: 30}
surfaces:
  - {sphere: {center: [0, 0, 1], radius: 1}, material: glass}
  - {sphere: {center: [2, 0, 1], radius: 1}, material: gold, name: ball}
  - {plane: {point: [0, 0, 0], normal: [0, 0, 1]}, material: grey}
  - {disk: {center: [0, -3, 1], radius: 0.5, normal: [0, -1, 0]}, material: film}
  - {rectangle: {center: [0, 3, 1], u: [1, 0, 0], v: [0, 0, 1]}, material: {type: retarder, fast_axis_deg: 45, retardance_deg: 90}}
lights:
  - {type: rectangle, center: [0, 0, 5], u: [1, 0, 0], v: [0, -1, 0], radiance: 10}
  - {type: environment, radiance: [0.1, 0.1, 0.2]}
  - {type: point, position: [1, 1, 4], intensity: 3, linear_deg: 45, axis: [1, 0, 0]}
"""
REPORT = Material(
    name="mirror",
    source="",
    channels=("R", "B", "G"),
    wavelength_nm=np.array([600.0, 450.0, 550.0]),
    eta=np.array([0.2, 1.4, 0.4]),
    k=np.array([3.1, 1.9, 2.5]),
)


def fitted(path: Path) -> Material:
    if path.name != "report.yaml":
        raise ReflectanceFitError("is no report")
    return REPORT


def read(folder: Path, text: str = YAML) -> scene.Scene:
    (folder / "s.yaml").write_text(text)
    return read_scene(folder / "s.yaml", fitted).scene


def with_(old: str, new: str) -> str:
    assert YAML.count(old) >= 1, old
    return YAML.replace(old, new, 1)


def errors(folder: Path, text: str) -> list[str]:
    with pytest.raises(ReflectanceFitError) as caught:
        read(folder, text)
    return [line.replace(f"{folder}{os.sep}", "") for line in caught.value.lines()]


def test_the_scene_is_what_the_file_says(tmp_path):
    found = read(tmp_path)
    assert found.camera == scene.Camera(
        position=(0, -5, 2), target=(0, 0, 1), up=(0, 0, 1), size_px=(320, 200), width=35
    )
    assert (found.exterior_ior, found.max_depth) == (1.000277, 8)
    glass, gold, ground, sheet, wave_plate = found.surfaces
    assert glass.shape == scene.Sphere((0, 0, 1), 1)
    assert gold.name == "ball"
    assert gold.material.roughness == 0.1
    assert ground.shape == scene.Plane((0, 0, 0), (0, 0, 1))
    assert sheet.material == scene.PolarizerSheet(30)
    assert wave_plate.material == scene.RetarderSheet(45, 90)
    area, around, point = found.lights
    assert area.shape == scene.Rectangle((0, 0, 5), (1, 0, 0), (0, -1, 0))
    assert area.radiance.values == pytest.approx([10])
    assert not area.polarization.is_polarized
    assert around.radiance.values == pytest.approx([0.1, 0.1, 0.2])
    assert point.polarization.stokes == pytest.approx((1, 0, 1, 0))
    assert point.polarization.axis == (1, 0, 0)


def test_surfaces_of_one_material_share_it(tmp_path):
    found = read(tmp_path, with_("material: gold, name: ball", "material: glass"))
    assert found.surfaces[0].material is found.surfaces[1].material


def test_a_built_in_glass_is_relative_to_vacuum_at_every_wavelength(tmp_path):
    """Catalogues state glass relative to air; n_d = 1.51680 of N-BK7 is Schott's."""
    eta = read(tmp_path).surfaces[0].material.eta
    assert np.interp(587.5618, eta.wavelength_nm, eta.values) == pytest.approx(1.51680 * 1.000277, abs=2e-5)
    curve = index(eta, "spectral", (600.0, 550.0, 450.0))
    assert curve == pytest.approx(library.get("N-BK7").absolute_index(GRID_NM)[0], abs=1e-12)


def test_channels_of_the_camera_are_read_where_they_are_not_where_the_grid_is(tmp_path):
    text = with_("fov_deg: 35", "channels_nm: [632.8, 543.5, 441.6]")
    eta = index(read(tmp_path, text).surfaces[0].material.eta, "rgb", (632.8, 543.5, 441.6))
    assert eta == pytest.approx(library.get("N-BK7").absolute_index([632.8, 543.5, 441.6])[0], abs=1e-12)


def test_a_fitted_material_keeps_its_channels_in_the_order_of_wavelength(tmp_path):
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "report.yaml").write_text("x")
    text = with_("material: gold, rough", "report: result/report.yaml, rough")
    gold = read(tmp_path, text).surfaces[1].material
    assert gold.eta.wavelength_nm == pytest.approx([450, 550, 600])
    assert gold.eta.values == pytest.approx([1.4, 0.4, 0.2])
    assert gold.k.values == pytest.approx([1.9, 2.5, 3.1])


def test_what_is_not_known_of_a_built_in_material_is_said(tmp_path):
    (tmp_path / "s.yaml").write_text(with_("N-BK7", "ethanol"))
    assert read_scene(tmp_path / "s.yaml", fitted).notes == (
        "ethanol is known from 476.5 to 830 nm; its index is held constant beyond",
    )
    (tmp_path / "s.yaml").write_text(YAML)
    assert read_scene(tmp_path / "s.yaml", fitted).notes == ()


def corners(shape: scene.Rectangle) -> set[tuple[float, ...]]:
    center, u, v = (np.array(x) for x in (shape.center, shape.u, shape.v))
    return {tuple(np.round(center + a * u + b * v, 9)) for a in (-1, 1) for b in (-1, 1)}


def test_a_box_is_closed_and_faces_outward(tmp_path):
    box = "box: {center: [1, 2, 3], size: [2, 1, 4], turn_deg: 30}"
    found = read(tmp_path, with_("sphere: {center: [0, 0, 1], radius: 1}", box))
    faces = [surface.shape for surface in found.surfaces[:6]]
    every = [corner for face in faces for corner in corners(face)]
    assert len(set(every)) == 8
    assert all(every.count(corner) == 3 for corner in every)
    for face in faces:
        normal = np.cross(face.u, face.v)
        assert normal @ (np.array(face.center) - (1, 2, 3)) > 0
    turn = math.radians(30)
    along_x = np.array([math.cos(turn), math.sin(turn), 0])
    assert max((np.array(c) - (1, 2, 3)) @ along_x for c in every) == pytest.approx(1)
    area = sum(4 * np.linalg.norm(np.cross(face.u, face.v)) for face in faces)
    assert area == pytest.approx(2 * (2 * 1 + 1 * 4 + 2 * 4))


@pytest.mark.parametrize("normal", [(0, -1, 0), (0, 0, 1), (1, 2, 3), (0, 0, -2)])
def test_the_frame_of_a_disk(tmp_path, normal):
    text = with_("normal: [0, -1, 0]", f"normal: {list(normal)}")
    disk = read(tmp_path, text).surfaces[3].shape
    assert np.linalg.norm(disk.u) == pytest.approx(0.5)
    assert np.dot(disk.u, disk.normal) == pytest.approx(0, abs=1e-12)
    assert disk.u[2] == pytest.approx(0, abs=1e-12)


def test_a_wall_towards_the_viewer_has_its_angles_from_horizontal_to_up(tmp_path):
    disk = read(tmp_path).surfaces[3].shape
    assert disk.u == pytest.approx((0.5, 0, 0))
    assert np.cross(disk.normal, disk.u) == pytest.approx((0, 0, 0.5))


def test_edges_written_with_few_digits_become_exactly_square(tmp_path):
    text = with_("u: [1, 0, 0], v: [0, -1, 0]", "u: [0.70711, 0.70711, 0], v: [0.70711, -0.7071, 0]")
    shape = read(tmp_path, text).lights[0].shape
    assert np.dot(shape.u, shape.v) == pytest.approx(0, abs=1e-15)


def test_an_orthographic_camera_behind_an_analyzer(tmp_path):
    found = read(tmp_path, with_("fov_deg: 35", "width: 4, analyzer_deg: 56")).camera
    assert (found.projection, found.width, found.analyzer_deg) == ("orthographic", 4, 56)


@pytest.mark.parametrize(
    ("keys", "stokes"),
    [
        ("stokes: [2, 1, 0.5, -1]", (1, 0.5, 0.25, -0.5)),
        ("linear_deg: 90", (1, -1, 0, 0)),
        ("circular: right", (1, 0, 0, 1)),
    ],
)
def test_polarized_light_is_as_bright_as_it_says(tmp_path, keys, stokes):
    light = read(tmp_path, with_("radiance: 10", f"radiance: 10, {keys}")).lights[0]
    assert light.polarization.stokes == pytest.approx(stokes)
    assert light.polarization.axis == (0, 0, 1)
    assert light.radiance.values == pytest.approx([10])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius: 1}, material: glass", "radius: -1}, material: glass", "11: surfaces.0.sphere.radius: must be greater"),
        ("radius: 1}, material: glass", "radius: 0}, material: glass", "11: surfaces.0.sphere.radius: must be greater"),
        ("radius: 1}, material: glass", "radius: .nan}, material: glass", "11: surfaces.0.sphere.radius: must be a finite"),
        ("center: [0, 0, 1]", "center: [0, .inf, 1]", "11: surfaces.0.sphere.center.1: must be a finite"),
        ("center: [0, 0, 1]", "center: [0, 1e300, 1]", "11: surfaces.0.sphere.center.1: must be less"),
        ("sphere: {center: [0, 0, 1], radius: 1}, ", "", "11: surfaces.0: give exactly one shape: sphere, rec"),
        ("{sphere:", "{shpere:", "11: surfaces.0: unknown key 'shpere', did you mean 'sphere'?"),
        ("u: [1, 0, 0], v: [0, 0, 1]", "u: [1, 0, 0.1], v: [0, 0, 1]", "15: surfaces.4.rectangle: u and v must be at right"),
        ("normal: [0, -1, 0]", "normal: [0, 0, 0]", "14: surfaces.3.disk.normal: has no length"),
        ("normal: [0, -1, 0]", "normal: [0, -1, 0], u: [0, 1, 0]", "14: surfaces.3.disk: u must be at right angles"),
        ("material: glass", "material: glas", "11: surfaces.0.material: no material 'glas' under materials, did you mean 'glass'?"),
        ("material: glass", "material: silver", "11: surfaces.0.material: no material 'silver' under materials; for the built-in one write {type: conductor, material: Ag}"),
        ("material: glass", "material: film", "11: surfaces.0.material: polarizers and retarders are sheets"),
        ("N-BK7", "N-BK77", "4: materials.glass: no built-in material 'N-BK77', did you mean 'N-BK7'?"),
        ("N-BK7", "gold", "4: materials.glass: absorbs (k = 3.1), so no light passes; use type: conductor"),
        ("N-BK7", "Sn", "4: materials.glass: Sn is known from 730 to 12000 nm alone"),
        ("material: N-BK7", "eta: 0", "4: materials.glass.eta: must be greater than 0"),
        ("material: N-BK7", "eta: 1.5, k: 0.1", "4: materials.glass: k goes with type: conductor"),
        ("material: N-BK7", "material: N-BK7, eta: 1.5", "4: materials.glass: give exactly one of material"),
        ("material: gold, rough", "eta: 1.5, k: -2, rough", "5: materials.gold.k: must be greater than or equal to 0"),
        ("material: gold, rough", "eta: 1.5, rough", "5: materials.gold: eta and k go together"),
        ("material: gold, rough", "report: none.yaml, rough", "5: materials.gold: none.yaml: there is no such file"),
        ("material: gold, rough", "report: ../r.yaml, rough", "5: materials.gold: '../r.yaml' leads outside the folder"),
        ("material: gold, rough", "report: s.yaml, rough", "5: materials.gold: is no report"),
        ("roughness: 0.1", "roughness: 1.1", "5: materials.gold.roughness: must be less than or equal to 1"),
        ("roughness: 0.1", "roughness: -0.1", "5: materials.gold.roughness: must be greater than or equal to 0"),
        ("roughness", "rougness", "5: materials.gold: unknown key 'rougness', did you mean 'roughness'?"),
        ("reflectance: 0.5", "reflectance: 1.5", "7: materials.grey.reflectance: must be less than or equal to 1"),
        ("reflectance: 0.5", "reflectance: [1, 1, 1.5]", "7: materials.grey.reflectance.2: must be less"),
        ("reflectance: 0.5", "reflectance: [1, 1]", "7: materials.grey.reflectance: must have at least 3 items"),
        ("reflectance: 0.5", "reflectance: 0.5, roughness: 0.1", "7: materials.grey: 'roughness' does not go with the keys"),
        ("[0.1, 0.9]", "[0.1, 2]", "8: materials.ramp.reflectance.values.1: must be less"),
        ("[0.1, 0.9]", "[0.1]", "8: materials.ramp.reflectance: 2 wavelengths but 1 values"),
        ("[400, 700]", "[700, 400]", "8: materials.ramp.reflectance: wavelength_nm must increase"),
        ("type: plastic", "type: plastc", "6: materials.wax: unknown type 'plastc', did you mean 'plastic'?"),
        ("type: plastic, ", "", "6: materials.wax: 'type' is missing; add one of lambertian"),
        ("target: [0, 0, 1]", "target: [0, -5, 2]", "2: camera: target is where the camera stands"),
        ("target: [0, 0, 1]", "target: [0, -5, 1]", "2: camera: up is along the view"),
        ("[320, 200]", "[320, 0]", "2: camera.size_px.1: must be greater"),
        ("[320, 200]", "[320, 100000]", "2: camera.size_px.1: must be less"),
        ("fov_deg: 35", "fov_deg: 180", "2: camera.fov_deg: must be less than 180"),
        ("fov_deg: 35", "fov_deg: 35, width: 3", "2: camera: give fov_deg (perspective) or width"),
        ("fov_deg: 35", "fov: 35", "2: camera: unknown key 'fov', did you mean 'fov_deg'?"),
        ("radiance: 10", "radiance: 0", "17: lights.0: a light of 0 everywhere is none"),
        ("radiance: 10", "radiance: -1", "17: lights.0.radiance: must be greater"),
        ("radiance: 10", "radiance: 10, axis: [1, 0, 0]", "17: lights.0: axis goes with stokes"),
        ("radiance: 10", "radiance: 10, stokes: [1, 1, 1, 0]", "17: lights.0: more polarized than possible"),
        ("{type: environment, radiance: [0.1, 0.1, 0.2]}", "{type: directional, direction: [0, 0, 2], irradiance: 1, linear_deg: 0}", "18: lights.1: axis lies along direction"),
        ("{type: environment, radiance: [0.1, 0.1, 0.2]}", "{type: environment}", "18: lights.1: give exactly one of radiance, image"),
        ("{type: environment, radiance: [0.1, 0.1, 0.2]}", "{type: environment, image: sky.exr}", "18: lights.1: sky.exr: there is no such file"),
        ("point, position: [1, 1, 4], intensity: 3, linear_deg: 45, axis: [1, 0, 0]", "environment, radiance: 1", "19: lights.2: the scene has an environment already"),
        ("lights:", "lightss:", "16: unknown key 'lightss', did you mean 'lights'?"),
        ("scene/1", "scene/2", "1: schema reflectance_fit/scene/2 is not known"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(tmp_path, old, new, message):
    (line,) = errors(tmp_path, with_(old, new))
    assert line.startswith(f"Error: s.yaml:{message}")


def test_an_empty_scene_and_one_without_light(tmp_path):
    (line,) = errors(tmp_path, YAML[: YAML.index("lights:")])
    assert line == "Error: s.yaml:1: no light: the picture would be black; add one under lights"
    camera, light = errors(tmp_path, "schema: reflectance_fit/scene/1\n")
    assert camera == "Error: s.yaml:1: 'camera' is missing; add it"
    assert "no light" in light


def test_every_mistake_is_found_at_once(tmp_path):
    text = (
        YAML.replace("N-BK7", "N-BK77").replace("material: grey", "material: gray").replace("gold,", "good,")
    )
    assert len(errors(tmp_path, text)) == 4


def included(folder: Path, **files: str) -> None:
    for name, body in files.items():
        (folder / f"{name}.yaml").parent.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.yaml").write_text(f"schema: reflectance_fit/scene/1\n{body}\n")


def test_included_files_add_what_they_hold(tmp_path):
    (tmp_path / "lamps").mkdir()
    included(
        tmp_path,
        balls="materials: {red: {type: lambertian, reflectance: [0.5, 0, 0]}}\ninclude: [lamps/one.yaml]\n"
        "surfaces: [{sphere: {center: [0, 9, 1], radius: 2}, material: red}]\nmax_depth: 3",
    )
    (tmp_path / "lamps" / "one.yaml").write_text(
        "schema: reflectance_fit/scene/1\nlights: [{type: point, position: [0, 0, 9], intensity: 1}]\n"
        "surfaces: [{sphere: {center: [0, 8, 1], radius: 3}, material: grey}]\n"
    )
    (tmp_path / "s.yaml").write_text(YAML + "include: [balls.yaml]\n")
    found = read_scene(tmp_path / "s.yaml", fitted)
    assert [s.shape.radius for s in found.scene.surfaces[-2:]] == [2, 3]
    assert len(found.scene.lights) == 4
    assert found.scene.max_depth == 8
    assert [Path(file).name for file, _ in found.inputs] == ["s.yaml", "balls.yaml", "one.yaml"]


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"s2": "include: [s.yaml]"}, "s2.yaml:2: a file that includes itself (s.yaml > s2.yaml > s.yaml); remove this line"),
        ({"s2": "include: [s2.yaml]"}, "s2.yaml:2: a file that includes itself (s2.yaml > s2.yaml); remove this line"),
        ({"s2": "include: [s3.yaml, s3.yaml]", "s3": ""}, "s2.yaml:2: s3.yaml is included twice; once is enough"),
        ({"s2": "include: [s4.yaml]"}, "s2.yaml:2: s4.yaml: there is no such file"),
        ({"s2": "include: [../s.yaml]"}, "s2.yaml:2: '../s.yaml' leads outside the folder of s2.yaml"),
        ({"s2": "materials: {glass: {type: dielectric, eta: 1.5}}"}, "s2.yaml:2: materials.glass: another file has a material of this name"),
        ({"s2": "surfaces: [{material: glass}]"}, "s2.yaml:2: surfaces.0: give exactly one shape"),
    ],
)  # fmt: skip
def test_a_mistake_in_an_included_file_is_one_line_there(tmp_path, files, message):
    included(tmp_path, **files)
    (line,) = errors(tmp_path, YAML + "include: [s2.yaml]\n")
    assert line.startswith(f"Error: {message}")


def test_a_file_that_includes_itself(tmp_path):
    (line,) = errors(tmp_path, YAML + "include: [s.yaml]\n")
    assert line == "Error: s.yaml:20: a file that includes itself (s.yaml > s.yaml); remove this line"


def test_a_link_to_itself_is_itself(tmp_path):
    (tmp_path / "other.yaml").symlink_to("s.yaml")
    (line,) = errors(tmp_path, YAML + "include: [other.yaml]\n")
    assert "a file that includes itself" in line


def test_a_long_chain_of_files_is_read(tmp_path):
    for i in range(1500):
        included(tmp_path, **{f"c{i}": f"include: [c{i + 1}.yaml]" if i < 1499 else ""})
    assert len(read(tmp_path, YAML + "include: [c0.yaml]\n").surfaces) == 5


def test_a_thousand_surfaces_load_in_well_under_a_second(tmp_path):
    """In processor time, so that a busy machine does not count; 0.5 s were measured."""
    ball = "  - {{sphere: {{center: [{}, {}, 1], radius: 0.4}}, material: grey}}\n"
    many = "".join(ball.format(i % 30, i // 30) for i in range(1000))
    start = time.process_time()
    assert len(read(tmp_path, with_("surfaces:\n", f"surfaces:\n{many}")).surfaces) == 1005
    assert time.process_time() - start < 1.5
