"""The scenes in docs/scenes are what their comments say: angles of least deviation and of Brewster included."""

import functools
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.materials import library
from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.render import scene
from reflectance_fit.render.scene_file import read_scene

FOLDER = Path(__file__).parents[2] / "docs" / "scenes"
SCENES = sorted(FOLDER.glob("*.yaml"))


@functools.cache
def example(name: str) -> scene.Scene:
    return read_scene(FOLDER / f"{name}.yaml", lambda path: pytest.fail("no report here")).scene


def unit(vector) -> np.ndarray:
    return np.asarray(vector) / np.linalg.norm(vector)


def test_there_are_scenes():
    assert {path.stem for path in SCENES} == {"balls", "polarizers", "prism", "room", "slab"}


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_nothing_is_to_be_said_about_them(path):
    found = read_scene(path, lambda report: pytest.fail("no report here"))
    assert found.notes == ()
    assert found.scene.surfaces


def refracted(direction, normal, eta):
    """Snell in vectors; ``eta`` is behind the surface over before it, the normal on either side."""
    normal = normal if direction @ normal < 0 else -normal
    cos_i = -direction @ normal
    cos_t = np.sqrt(1 - (1 - cos_i**2) / eta**2)
    return direction / eta + (cos_i / eta - cos_t) * normal


def seen_through_the_prism(wavelength_nm: float, start: float) -> np.ndarray:
    """Where the horizontal ray of a direction, radians from +x, is once it is as far out as the bar."""
    found = example("prism")
    eta = library.get("N-SF11").absolute_index(wavelength_nm)[0] / found.exterior_ior
    first, second = (surface.shape for surface in found.surfaces[:2])
    at, direction = np.array(found.camera.position), np.array([np.cos(start), np.sin(start), 0])
    for face, ratio in ((first, eta), (second, 1 / eta)):
        normal = unit(np.cross(face.u, face.v))
        at = at + direction * (normal @ (face.center - at)) / (normal @ direction)
        assert abs((at - face.center) @ unit(face.u)) < np.linalg.norm(face.u)
        direction = refracted(direction, normal, ratio)
    return at + direction * ((found.lights[0].shape.center[0] - at[0]) / direction[0])


def test_the_prism_spreads_the_bar_over_its_face():
    """Each colour meets the bar from a direction of its own, inside the face, red to violet over 6 degrees or more."""
    bar = example("prism").lights[0].shape.center[1]
    starts = np.radians(np.linspace(29.0, 36.7, 771))
    towards = []
    for wavelength in (420.0, 550.0, 680.0):
        misses = [abs(seen_through_the_prism(wavelength, start)[1] - bar) for start in starts]
        assert min(misses) < 0.05
        towards.append(np.degrees(starts[np.argmin(misses)]))
    violet, green, red = towards
    assert violet > green > red or violet < green < red
    assert abs(violet - red) > 6


def test_the_table_is_seen_at_brewsters_angle():
    found = example("slab")
    eta = library.get("N-BK7").absolute_index(550.0)[0] / found.exterior_ior
    view = unit(np.subtract(found.camera.position, found.camera.target))
    assert np.degrees(np.arccos(view[2])) == pytest.approx(np.degrees(brewster_angle(eta)), abs=0.2)


def test_the_window_stands_where_the_table_reflects_to():
    found = example("slab")
    view = unit(np.subtract(found.camera.target, found.camera.position)) * (1, 1, -1)
    panes = [light.shape for light in found.lights if isinstance(light, scene.AreaLight)][:2]
    at = np.array(found.camera.target) + view * (panes[0].center[1] - found.camera.target[1]) / view[1]
    center = np.mean([pane.center for pane in panes], axis=0)
    assert at == pytest.approx(center, abs=1)


def test_sheets_lie_in_order_between_the_crossed_polarizers():
    found = example("polarizers")
    back, front, *plates = found.surfaces
    assert back.material.axis_deg + 90 == front.material.axis_deg
    assert all(front.shape.center[1] < plate.shape.center[1] < back.shape.center[1] for plate in plates)
    assert len(plates) == 10
