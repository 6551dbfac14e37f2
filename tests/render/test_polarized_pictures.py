"""Pictures whose Stokes vectors are known in closed form, sign and all; no path of theirs is left to chance."""

from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.physics import mueller
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    DirectionalLight,
    Lambertian,
    Polarization,
    PolarizerSheet,
    Rectangle,
    RetarderSheet,
    Scene,
    Surface,
    constant,
)
from reflectance_fit.render.settings import Settings

METAL = Conductor(constant(0.183), constant(3.43))


def stokes(camera, *parts, samples=4096, max_depth=8):
    """Mean over the picture, one channel."""
    surfaces = tuple(part for part in parts if isinstance(part, Surface))
    lights = tuple(part for part in parts if not isinstance(part, Surface))
    film = render(
        Scene(camera, surfaces, lights, max_depth=max_depth),
        Settings("polarized", samples, precision="double"),
    )
    return film.mean[:, :, -1].mean(axis=(0, 1))


def along(direction, up=(0.0, 1.0, 0.0), **how):
    """A narrow parallel view in a direction, through the origin."""
    position = tuple(-4.0 * np.asarray(direction) / np.linalg.norm(direction))
    return Camera(position, (0.0, 0.0, 0.0), up, (4, 4), "orthographic", 0.02, **how)


def face(center, normal, half=0.4):
    """A square with a side along y, or along x where it faces y."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    u = np.cross([0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [0.0, 0.0, 1.0], normal)
    u /= np.linalg.norm(u)
    return Rectangle(tuple(center), tuple(half * u), tuple(half * np.cross(normal, u)))


def sky(stokes_vector=(1.0, 0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)):
    return ConstantEnvironment(constant(1.0), Polarization(stokes_vector, axis))


def test_two_total_reflections_make_circular_light():
    """Fresnel's rhomb: 45 degrees a reflection in glass of 1.51 at 54 degrees 37 minutes (Born and Wolf, 1.5.4)."""
    eta, angle = 1.51, np.radians(54.0 + 37.0 / 60.0)
    n = np.array([np.cos(angle), 0.0, np.sin(angle)])
    aside = np.array([-np.cos(2.0 * angle), 0.0, -np.sin(2.0 * angle)])
    first = np.array([1.0, 0.0, 0.0])
    second = first + 1.5 * aside
    glass = Dielectric(constant(eta))
    shapes = (
        face((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        face(first, n),
        face(second, -n),
        face(second + np.array([1.0, 0.0, 0.0]), (1.0, 0.0, 0.0)),
    )
    # Diagonal to the plane of incidence, and seen through the rhomb only.
    diagonal = Polarization((1.0, 1.0, 0.0, 0.0), (0.0, 1.0, 1.0))
    panel = AreaLight(face(second + np.array([2.0, 0.0, 0.0]), (-1.0, 0.0, 0.0)), constant(1.0), diagonal)
    parts = [Surface(shape, glass) for shape in shapes]
    # Five rays: straight through, for the ends reflect some of what is on its way.
    found = stokes(along((1.0, 0.0, 0.0), up=(0.0, 0.0, 1.0)), *parts, panel, max_depth=5)
    entering = 1.0 - ((eta - 1.0) / (eta + 1.0)) ** 2
    assert found[0] == pytest.approx(entering**2, rel=0.01)  # by chance, which of a ray goes on
    total = mueller.reflection(*amplitudes(np.cos(angle), 1.0 / eta))
    # s is the picture's horizontal, -y, so that the panel's axis is at -45 degrees from it.
    expected = total @ total @ np.array([1.0, 0.0, -1.0, 0.0])
    np.testing.assert_allclose(found / found[0], expected, atol=1e-6)
    assert abs(expected[3]) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 60.0, 90.0, 140.0])
def test_malus(angle_deg):
    """Half of the light, then the squared cosine, linear along the second axis: counted in the picture, both turned."""
    sheets = [
        Surface(Rectangle((0, 0, z), (0.4, 0, 0), (0, 0.4, 0)), PolarizerSheet(axis))
        for z, axis in ((-0.5, 20.0), (0.5, 20.0 + angle_deg))
    ]
    found = stokes(along((0.0, 0.0, -1.0)), *sheets, sky())
    axis = np.radians(20.0 + angle_deg)
    expected = (
        0.5 * np.cos(np.radians(angle_deg)) ** 2 * np.array([1.0, np.cos(2 * axis), np.sin(2 * axis), 0.0])
    )
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_retarder_between_crossed_polarizers():
    """sin^2(2 beta) sin^2(delta / 2) / 2; and what comes out of the retarder alone, hand included."""
    beta, delta = np.radians(30.0), np.radians(70.0)
    square = Rectangle((0, 0, 0), (0.4, 0, 0), (0, 0.4, 0))
    back = Surface(replace(square, center=(0, 0, -0.5)), PolarizerSheet(0.0))
    middle = Surface(square, RetarderSheet(30.0, 70.0))
    front = Surface(replace(square, center=(0, 0, 0.5)), PolarizerSheet(90.0))
    view = along((0.0, 0.0, -1.0))
    crossed = stokes(view, back, middle, front, sky())
    assert crossed[0] == pytest.approx(0.5 * np.sin(2 * beta) ** 2 * np.sin(delta / 2) ** 2, abs=1e-12)
    found = stokes(view, back, middle, sky())
    np.testing.assert_allclose(found, mueller.retarder(beta, delta) @ [0.5, 0.5, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("analyzer_deg", [0.0, 30.0, 115.0])
def test_angles_are_counted_counter_clockwise_in_the_picture(analyzer_deg):
    """A panel linear at 30 degrees and partly circular, seen plainly and behind an analyzer."""
    tilt = np.radians(30.0)
    state = Polarization((1.0, 0.8, 0.0, 0.6), (np.cos(tilt), np.sin(tilt), 0.0))
    panel = AreaLight(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), constant(2.0), state)
    view = along((0.0, 0.0, -1.0))
    seen = np.array([2.0, 1.6 * np.cos(2 * tilt), 1.6 * np.sin(2 * tilt), 1.2])
    np.testing.assert_allclose(stokes(view, panel), seen, atol=1e-12)
    behind = stokes(replace(view, analyzer_deg=analyzer_deg), panel)
    np.testing.assert_allclose(behind, mueller.polarizer(np.radians(analyzer_deg)) @ seen, atol=1e-12)


def test_gold_turns_diagonal_light_right_circular():
    """The pinned sign of i: +45 degrees off gold at 60 degrees, against the matrix of docs/conventions.md."""
    angle = np.radians(60.0)
    mirror = Surface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), METAL)
    away = np.array([0.0, -np.sin(angle), np.cos(angle)])
    # s is x, the picture's horizontal; for light that falls along `fall`, p = fall x s.
    view = along(-away, up=(0.0, 0.0, 1.0))
    fall = np.array([0.0, -np.sin(angle), -np.cos(angle)])
    axis = np.array([1.0, 0.0, 0.0]) + np.cross(fall, [1.0, 0.0, 0.0])
    found = stokes(view, mirror, sky((1.0, 1.0, 0.0, 0.0), tuple(axis)))
    expected = mueller.reflection(*amplitudes(np.cos(angle), 0.183, 3.43)) @ [1.0, 0.0, 1.0, 0.0]
    assert expected[3] > 0.0
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_light_is_fully_polarized_at_brewsters_angle():
    """Off one face, by a plate too far below to be seen; and p-polarized light is not reflected at all."""
    angle = np.arctan(1.5)
    away = np.array([0.0, -np.sin(angle), np.cos(angle)])
    glass = Surface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), Dielectric(constant(1.5)))
    black = Surface(Rectangle((0, 0, -1), (9, 0, 0), (0, 9, 0)), Lambertian(constant(0.0)))
    view = along(-away, up=(0.0, 0.0, 1.0))
    found = stokes(view, glass, black, sky(), samples=16384)
    np.testing.assert_allclose(found[1:] / found[0], [1.0, 0.0, 0.0], atol=1e-6)
    fall = np.array([0.0, -np.sin(angle), -np.cos(angle)])
    p = tuple(np.cross(fall, [1.0, 0.0, 0.0]))
    assert stokes(view, glass, black, sky((1.0, 1.0, 0.0, 0.0), p))[0] == pytest.approx(0.0, abs=1e-9)


def test_a_depolarizer_forgets():
    """Polarized light on a diffuse plane: half of it behind any analyzer."""
    plane = Surface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), Lambertian(constant(0.5)))
    sun = DirectionalLight(
        (0.3, 0.0, -1.0), constant(1.0), Polarization((1.0, 0.6, 0.0, 0.8), (1.0, 0.2, 0.0))
    )
    plain = stokes(along((0.0, 0.0, -1.0)), plane, sun)
    np.testing.assert_allclose(plain, [0.5 / np.pi / np.sqrt(1.09), 0.0, 0.0, 0.0], rtol=1e-6, atol=1e-12)
    for angle in (0.0, 50.0):
        assert stokes(along((0.0, 0.0, -1.0), analyzer_deg=angle), plane, sun)[0] == pytest.approx(
            plain[0] / 2.0
        )
