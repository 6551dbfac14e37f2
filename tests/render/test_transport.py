"""Whole renders against numbers that are known: furnaces, light on a surface, and what must not change a picture."""

from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.physics.area_lights import DiskLight, RectangleLight, SphereLight
from reflectance_fit.physics.light_irradiance import irradiance
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    DirectionalLight,
    Disk,
    Lambertian,
    Plane,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    Surface,
    constant,
)
from reflectance_fit.render.settings import Settings

ONE = (ConstantEnvironment(constant(1.0)),)
CLOSE = Camera((0.0, -4.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (8, 8), width=20.0)
WHITE = Lambertian(constant(1.0))
GROUND = Surface(Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Lambertian(constant(0.5)))
# Looks straight down at a point of the ground, so closely that it is one point.
DOWN = Camera((0.3, 0.1, 0.02), (0.3, 0.1, 0.0), (0.0, 1.0, 0.0), (4, 4), "orthographic", width=1e-5)


def close(mean, error, expected, sigmas=4.0):
    """Mean over the picture against a number, by the picture's own standard error."""
    sigma = np.sqrt(np.mean(error**2, axis=(0, 1)) / (error.shape[0] * error.shape[1]))
    assert np.all(np.abs(mean.mean(axis=(0, 1)) - expected) < sigmas * sigma + 1e-6 * np.abs(expected))


@pytest.mark.parametrize("shape", [Sphere((0, 0, 0), 1.0), Rectangle((0, 0, 0), (3, 0, 0), (0, 3, 0))])
@pytest.mark.parametrize("mode", ["scalar", "rgb"])
def test_a_white_convex_surface_in_a_furnace_is_not_seen(mode, shape):
    film = render(Scene(CLOSE, (Surface(shape, WHITE),), ONE), Settings(mode, samples=16))
    np.testing.assert_allclose(film.mean, 1.0, atol=2e-6)
    assert film.discarded == 0


@pytest.mark.parametrize("eta", [1.5, 0.7, 2.4])
def test_glass_in_a_furnace_is_not_seen(eta):
    scene = Scene(CLOSE, (Surface(Sphere((0, 0, 0), 1.0), Dielectric(constant(eta))),), ONE, max_depth=1000)
    film = render(scene, Settings("rgb", samples=64))
    # Reflection is drawn by its reflectance, so every path carries exactly what it started with.
    np.testing.assert_allclose(film.mean, 1.0, atol=1e-4)


LIGHTS = {
    "rectangle": (
        Rectangle((0.5, 0.2, 1.0), (0.4, 0, 0), (0, -0.6, 0)),
        RectangleLight([0.1, 0.8, 1.0], [0.8, 0, 0], [0, -1.2, 0], 3.0),
    ),
    "disk": (
        Disk((0.5, 0.2, 1.0), (0, 0, -1), (0.4, 0, 0)),
        DiskLight([0.5, 0.2, 1.0], [0, 0, -1], 0.4, 3.0),
    ),
    "sphere": (Sphere((0.5, 0.2, 1.0), 0.4), SphereLight([0.5, 0.2, 1.0], 0.4, 3.0)),
}


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
@pytest.mark.parametrize("kind", LIGHTS)
def test_direct_light_has_its_irradiance(kind, sampler):
    shape, closed_form = LIGHTS[kind]
    scene = Scene(DOWN, (GROUND,), (AreaLight(shape, constant(3.0)),), max_depth=2)
    film = render(scene, Settings("scalar", samples=4096, sampler=sampler))
    expected = irradiance(closed_form, [0.3, 0.1, 0.0], [0, 0, 1]) * 0.5 / np.pi
    close(film.mean, film.error, expected)
    assert np.mean(film.error) < 0.01 * expected


def test_point_and_directional_lights_have_their_irradiance():
    lights = (
        PointLight((0.3, 0.4, 0.4), constant(2.0)),
        DirectionalLight((0.0, 1.0, -1.0), constant(3.0)),
    )
    film = render(Scene(DOWN, (GROUND,), lights, max_depth=2), Settings("scalar", samples=1024))
    far2 = 0.3**2 + 0.4**2
    expected = (2.0 * 0.4 / far2**1.5 + 3.0 / np.sqrt(2.0)) * 0.5 / np.pi
    close(film.mean, film.error, expected)


def test_lights_shine_to_their_front_only():
    light = AreaLight(Rectangle((0.5, 0.2, 1.0), (0.4, 0, 0), (0, 0.6, 0)), constant(3.0))
    film = render(Scene(DOWN, (GROUND,), (light,)), Settings("scalar", samples=16))
    assert np.all(film.mean == 0.0)


def test_a_shadow_is_dark():
    light = AreaLight(Sphere((0.3, 0.1, 3.0), 0.1), constant(3.0))
    cover = Surface(Disk((0.3, 0.1, 1.0), (0, 0, 1), (0.5, 0, 0)), Lambertian(constant(0.0)))
    film = render(Scene(DOWN, (GROUND, cover), (light,)), Settings("scalar", samples=64))
    assert np.all(film.mean == 0.0)


def small_scene(**changes):
    surfaces = (
        GROUND,
        Surface(Sphere((-0.6, 0, 0.5), 0.5), Dielectric(constant(1.5))),
        Surface(Sphere((0.6, 0, 0.5), 0.5), Conductor(constant(0.2), constant(3.4))),
    )
    lights = (AreaLight(Rectangle((0, 0, 3), (1, 0, 0), (0, -1, 0)), constant(5.0)), *ONE)
    camera = Camera((0, -4, 1.5), (0, 0, 0.4), (0, 0, 1), (24, 20))
    return replace(Scene(camera, surfaces, lights, max_depth=6), **changes)


def test_threads_do_not_change_the_picture():
    films = [render(small_scene(), Settings("scalar", samples=32), threads=n) for n in (1, 2, 5)]
    for film in films[1:]:
        np.testing.assert_array_equal(film.mean, films[0].mean)
        np.testing.assert_array_equal(film.error, films[0].error)


def test_a_seed_changes_the_noise_and_not_the_mean():
    films = [render(small_scene(), Settings("scalar", samples=256, seed=seed)) for seed in (1, 2)]
    assert not np.array_equal(films[0].mean, films[1].mean)
    noisy = films[0].error + films[1].error > 1e-6
    z = ((films[0].mean - films[1].mean) / np.hypot(films[0].error, films[1].error).clip(1e-12))[noisy]
    assert abs(z.mean()) < 4.0 / np.sqrt(z.size)
    # Of 16 groups the error itself is known to a sixth: z is Student's, of variance 15/13 and 30 degrees of freedom.
    assert 0.9 < z.std() < 1.25


def test_another_seed_is_no_rearrangement_of_the_same_numbers():
    light = AreaLight(LIGHTS["rectangle"][0], constant(3.0))
    # All pixels see one point: their numbers alone make them differ.
    camera = replace(DOWN, size_px=(8, 8), width=1e-9)
    scene = Scene(camera, (GROUND,), (light,), max_depth=2)
    first, second = (render(scene, Settings("scalar", samples=16, seed=seed)).mean.ravel() for seed in (0, 1))
    assert np.intersect1d(first.round(6), second.round(6)).size < 5


def test_single_and_double_precision_agree():
    films = [
        render(small_scene(), Settings("scalar", samples=128, precision=p)) for p in ("single", "double")
    ]
    assert np.sqrt(np.mean((films[0].mean - films[1].mean) ** 2)) < 0.1 * np.sqrt(
        np.mean(films[0].error ** 2)
    )


def test_a_target_of_error_stops_early():
    scene = small_scene()
    film = render(scene, Settings("scalar", samples=65536, error=0.05))
    assert np.sqrt(np.mean(film.error**2)) <= 0.05 * film.mean.mean()
    assert film.samples < 4096


def test_a_tiny_sphere_far_away_keeps_its_shape():
    center = (1e4, -3e4, 2e4)
    camera = Camera((1e4, -3e4 - 0.01, 2e4), center, (0, 0, 1), (16, 16), width=20.0)
    ball = Surface(Sphere(center, 1e-3), Dielectric(constant(1.5)))
    film = render(Scene(camera, (ball,), ONE, max_depth=100), Settings("scalar", samples=64))
    np.testing.assert_allclose(film.mean, 1.0, atol=1e-4)
    black = Surface(Sphere(center, 1e-3), Lambertian(constant(0.0)))
    film = render(Scene(camera, (black,), ONE), Settings("scalar", samples=256))
    seen = np.pi * np.tan(np.arcsin(0.1)) ** 2 / (2 * np.tan(np.radians(10.0))) ** 2
    assert abs((1.0 - film.mean.mean()) / seen - 1.0) < 0.01


def test_energy_is_not_made():
    scene = small_scene(lights=ONE)
    film = render(scene, Settings("rgb", samples=256))
    assert np.all(film.mean < 1.0 + 4.0 * film.error)
    assert film.discarded == 0
