"""Surfaces, sheets, pictures and spectra in whole renders, against closed forms."""

import numpy as np
import pytest

from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.physics.mueller import polarizer, retarder
from reflectance_fit.render.kernels import lanes
from reflectance_fit.render.kernels.path import trace
from reflectance_fit.render.pack import pack
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    ImageEnvironment,
    Lambertian,
    Plastic,
    Polarization,
    PolarizerSheet,
    Rectangle,
    RetarderSheet,
    Scene,
    Spectrum,
    Sphere,
    Surface,
    Texture,
    constant,
)
from reflectance_fit.render.settings import Settings

ONE = (ConstantEnvironment(constant(1.0)),)
CLOSE = Camera((0.0, -4.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (8, 8), width=20.0)
BALL = Sphere((0, 0, 0), 1.0)
LAMP = AreaLight(Rectangle((0, -3, 4), (1, 0, 0), (0, -1, 0)), constant(4.0))


def looking_at_incidence(theta, **camera):
    """Parallel rays that meet the plane z = 0 at theta, in the plane of incidence x = 0."""
    position = (0.0, -np.sin(theta), np.cos(theta))
    return Camera(position, (0, 0, 0), (1, 0, 0), (2, 2), "orthographic", width=1e-3, **camera)


FLOOR = Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))


@pytest.mark.parametrize(
    "material",
    [
        Conductor(constant(0.2), constant(3.4), 0.3),
        Dielectric(constant(1.5), 0.4),
        Plastic(constant(1.5), constant(1.0)),
        Plastic(constant(1.5), constant(1.0), 0.3),
    ],
)
def test_a_furnace_never_glows(material):
    film = render(
        Scene(CLOSE, (Surface(BALL, material),), ONE, max_depth=100), Settings("scalar", samples=256)
    )
    assert np.all(film.mean < 1.0 + 4.0 * film.error + 1e-6)
    assert film.discarded == 0
    if material == Plastic(constant(1.5), constant(1.0)):
        assert abs(film.mean.mean() - 1.0) < 4.0 * np.sqrt(np.mean(film.error**2)) / 8 + 1e-3


@pytest.mark.parametrize(
    "material",
    [
        Conductor(constant(0.2), constant(3.4), 0.3),
        Dielectric(constant(1.5), 0.3),
        Plastic(constant(1.5), constant(0.6)),
        Plastic(constant(1.5), constant(0.6), 0.3),
    ],
)
def test_sampled_light_and_drawn_directions_agree(material):
    """A light found by both ways, and by directions alone: the same light as a picture that is not sampled."""
    surface = Surface(BALL, material)
    # Radiance in a band of directions, once as a picture, once inside a constant environment of directions alone.
    film = render(Scene(CLOSE, (surface,), ONE, max_depth=20), Settings("scalar", samples=1024))
    pictured = (ImageEnvironment(np.ones((4, 8, 3))),)
    other = render(Scene(CLOSE, (surface,), pictured, max_depth=20), Settings("scalar", samples=1024))
    sigma = np.sqrt(np.mean(film.error**2 + other.error**2)) / 8.0
    assert abs(np.mean(film.mean - other.mean)) < 4.0 * sigma + 1e-6


@pytest.mark.parametrize("theta_deg", [10.0, 45.0, 56.309932474020215, 80.0])
def test_a_metal_or_glass_reflects_fresnel_in_both_polarizations(theta_deg):
    theta = np.radians(theta_deg)
    for material, eta, k in (
        (Conductor(constant(0.2), constant(3.4)), 0.2, 3.4),
        (Dielectric(constant(1.5)), 1.5, 0.0),
    ):
        # What is transmitted meets black below.
        black = Surface(Rectangle((0, 0, -0.1), (9, 0, 0), (0, 9, 0)), Lambertian(constant(0.0)))
        scene = Scene(looking_at_incidence(theta), (Surface(FLOOR, material), black), ONE)
        film = render(scene, Settings("polarized", samples=4096))
        r_s, r_p, _ = reflectances(np.cos(theta), eta, k)[:3]
        # up is x, which is s: S1 < 0 is s in the picture.
        expected = np.array([(r_s + r_p) / 2, -(r_s - r_p) / 2, 0.0, 0.0])
        error = np.sqrt(np.mean(film.error**2, axis=(0, 1, 2))) / 2.0
        assert np.all(np.abs(film.mean.mean(axis=(0, 1, 2)) - expected) < 4.0 * error + 2e-6)


def test_brewsters_angle_is_dark_behind_an_analyzer():
    theta = float(brewster_angle(1.5))
    black = Surface(Rectangle((0, 0, -0.1), (9, 0, 0), (0, 9, 0)), Lambertian(constant(0.0)))
    # p lies in the plane of incidence: the picture's horizontal here.
    scene = Scene(
        looking_at_incidence(theta, analyzer_deg=0.0), (Surface(FLOOR, Dielectric(constant(1.5))), black), ONE
    )
    film = render(scene, Settings("polarized", samples=256))
    assert film.mean[..., 0].max() < 1e-6
    s = reflectances(np.cos(theta), 1.5).s
    crossed = Scene(
        looking_at_incidence(theta, analyzer_deg=90.0),
        (Surface(FLOOR, Dielectric(constant(1.5))), black),
        ONE,
    )
    film = render(crossed, Settings("polarized", samples=4096))
    np.testing.assert_allclose(
        film.mean[..., 0].mean(), s / 2.0, atol=4.0 * film.error[..., 0].mean() / np.sqrt(12)
    )


def sheet(z, material):
    return Surface(Rectangle((0, 0, z), (9, 0, 0), (0, 9, 0)), material)


DOWN = Camera((0, 0, 5.0), (0, 0, 0), (0, 1, 0), (2, 2), "orthographic", width=1e-3)


def test_sheets_multiply_as_mueller_matrices():
    """Polarized light through a retarder and two polarizers, seen straight from above: x is right, y is up."""
    sheets = (
        sheet(1.0, PolarizerSheet(20.0, 0.9)),
        sheet(2.0, RetarderSheet(60.0, 70.0)),
        sheet(3.0, PolarizerSheet(100.0)),
    )
    stokes = np.array([1.0, 0.3, -0.5, 0.4])
    light = ConstantEnvironment(constant(2.0), Polarization(tuple(stokes), (1.0, 0.0, 0.0)))
    film = render(Scene(DOWN, sheets, (light,)), Settings("polarized", samples=16))
    turn = np.radians
    through = polarizer(turn(100.0)) @ retarder(turn(60.0), turn(70.0)) @ polarizer(turn(20.0), 0.9)
    np.testing.assert_allclose(film.mean[0, 0, 0], 2.0 * through @ stokes, atol=2e-6)


def test_sampled_light_passes_sheets_as_seen_light_does():
    """A metal lit through two sheets by an area light: sampled, or found by drawn directions alone."""
    metal = Surface(BALL, Conductor(constant(0.2), constant(3.4), 0.4))
    sheets = (
        Surface(Rectangle((0, -1.5, 2.0), (2, 0, 0), (0, 2, 1)), PolarizerSheet(30.0)),
        Surface(Rectangle((0, -1.5, 2.5), (2, 0, 0), (0, 2, 1)), RetarderSheet(80.0, 90.0)),
    )
    lamp = AreaLight(LAMP.shape, constant(4.0), Polarization((1.0, 0.5, 0.5, 0.2), (1.0, 0.0, 0.0)))
    scene = Scene(CLOSE, (metal, *sheets), (lamp,), max_depth=2)
    film = render(scene, Settings("polarized", samples=4096))
    # A second light that is never seen takes half of the samples: another mixture of the two ways, the same answer.
    dummy = AreaLight(Rectangle((0, 0, -9), (1, 0, 0), (0, -1, 0)), constant(4.0))
    other = render(
        Scene(CLOSE, (metal, *sheets), (lamp, dummy), max_depth=2), Settings("polarized", samples=4096)
    )
    sigma = np.sqrt(np.mean(film.error**2 + other.error**2, axis=(0, 1, 2))) / 8.0
    assert np.all(np.abs(np.mean(film.mean - other.mean, axis=(0, 1, 2))) < 4.0 * sigma)
    assert np.all(np.abs(film.mean.mean(axis=(0, 1, 2))[1:]) > 8.0 * sigma[1:])


def test_a_texture_lies_as_it_is_seen():
    picture = np.arange(6.0).reshape(2, 3, 1) / 10.0
    surface = Surface(Rectangle((0, 0, 0), (1.5, 0, 0), (0, 1, 0)), Lambertian(Texture(picture)))
    camera = Camera((0, 0, 5.0), (0, 0, 0), (0, 1, 0), (3, 2), "orthographic", width=3.0)
    film = render(Scene(camera, (surface,), ONE, max_depth=2), Settings("scalar", samples=16))
    np.testing.assert_allclose(film.mean[..., 0, 0], picture[..., 0], atol=1e-6)


def test_a_picture_of_the_surroundings_is_seen_where_it_is():
    """Azimuth 90 degrees, +y, is a quarter from the left; what is right of it in the world is right of it in the picture."""
    pixels = np.zeros((18, 36, 3))
    pixels[8:10, 8:10] = 1.0
    camera = Camera((0, 0, 0), (0, 1, 0), (0, 0, 1), (9, 9), width=40.0)
    ball = Surface(Sphere((0, -50, 0), 1.0), Lambertian(constant(0.5)))
    film = render(Scene(camera, (ball,), (ImageEnvironment(pixels, 2.0),)), Settings("scalar", samples=64))
    seen = film.mean[..., 0, 0]
    assert seen[4, 4] == pytest.approx(2.0)
    assert seen[0, 0] == seen[8, 8] == 0.0
    pixels[8:10, 10:12] = 0.5
    film = render(Scene(camera, (ball,), (ImageEnvironment(pixels, 2.0),)), Settings("scalar", samples=64))
    assert film.mean[4, 8, 0, 0] == pytest.approx(1.0)


def test_a_picture_of_the_surroundings_lights_as_it_integrates():
    random = np.random.default_rng(3)
    pixels = np.repeat(random.uniform(size=(16, 32, 1)) ** 4, 3, axis=2)
    camera = Camera((0, 0, 0.02), (0, 0, 0), (0, 1, 0), (4, 4), "orthographic", width=1e-5)
    ground = Surface(Rectangle((0, 0, 0), (9, 0, 0), (0, 9, 0)), Lambertian(constant(1.0)))
    film = render(
        Scene(camera, (ground,), (ImageEnvironment(pixels),), max_depth=2), Settings("scalar", samples=4096)
    )
    edges = np.linspace(0, np.pi, 17)[:9]
    # cos sin over each row above the horizon
    weights = (np.sin(edges[1:]) ** 2 - np.sin(edges[:-1]) ** 2) / 2.0
    expected = np.sum(weights[:, None] * pixels[:8, :, 0]) * 2 * np.pi / 32 / np.pi
    sigma = np.sqrt(np.mean(film.error**2)) / 4.0
    assert abs(film.mean.mean() - expected) < 4.0 * sigma
    assert sigma < 2e-3 * expected


def test_white_stays_white_in_spectral_renders():
    scene = Scene(CLOSE, (Surface(BALL, Lambertian(Spectrum(np.array([0.8, 0.4, 0.2])))),), ONE)
    film = render(scene, Settings("spectral", samples=1024))
    flat = render(scene, Settings("rgb", samples=64))
    sigma = np.sqrt(np.mean(film.error**2, axis=(0, 1, 3))) / 8.0
    assert np.all(np.abs(np.mean(film.mean - flat.mean, axis=(0, 1, 3))) < 4.0 * sigma + 2e-4)


def test_dispersion_changes_colours_and_not_white():
    """A dispersive ball in a furnace: every wavelength is lossless, whatever way it goes."""
    eta = Spectrum(np.array([1.8, 1.6]), np.array([400.0, 800.0]))
    film = render(
        Scene(CLOSE, (Surface(BALL, Dielectric(eta)),), ONE, max_depth=50), Settings("spectral", samples=1024)
    )
    sigma = np.sqrt(np.mean(film.error**2, axis=(0, 1, 3))) / 8.0
    assert np.all(np.abs(film.mean.mean(axis=(0, 1, 3)) - 1.0) < 4.0 * sigma + 1e-3)


def test_a_scene_without_polarization_has_the_kernel_built_without_it():
    scene = Scene(CLOSE, (Surface(BALL, Conductor(constant(0.2), constant(3.4))),), ONE)
    render(scene, Settings("scalar", samples=1))
    before = set(trace.signatures)
    render(scene, Settings("rgb", samples=1))
    assert set(trace.signatures) == before
    assert pack(scene, Settings("rgb")).has == pack(scene, Settings("scalar")).has
    assert pack(scene, Settings("polarized")).has.rows == (0,) * 4


def test_approximations_have_no_polarization():
    scene = Scene(CLOSE, (Surface(BALL, Conductor(constant(0.2), constant(3.4))),), ONE)
    with pytest.raises(ValueError, match="no s and p"):
        render(scene, Settings("polarized", fresnel="schlick"))


@pytest.mark.parametrize("form", ["constant", "schlick", "schlick_f82", "lazanyi", "large_index"])
def test_forms_of_fresnel_are_those_of_physics(form):
    from reflectance_fit.physics import approximations as forms
    from reflectance_fit.physics.fitted_approximations import lazanyi
    from reflectance_fit.physics.fresnel import r0

    theta = np.radians(75.0)
    scene = Scene(
        looking_at_incidence(theta), (Surface(FLOOR, Conductor(constant(1.5), constant(2.5))),), ONE
    )
    film = render(scene, Settings("scalar", samples=16, fresnel=form))
    curves = {
        "constant": lambda c: r0(1.5, 2.5),
        "schlick": lambda c: forms.schlick(c, r0(1.5, 2.5)),
        "schlick_f82": forms.f82(1.5, 2.5),
        "lazanyi": lazanyi(1.5, 2.5),
        "large_index": forms.lecture_conductor(1.5, 2.5),
    }
    np.testing.assert_allclose(film.mean, curves[form](np.cos(theta)), atol=1e-5)


def test_every_channel_of_a_metal_has_its_own_coefficients():
    """Lazanyi's are fitted to one index at a time."""
    from reflectance_fit.physics.fitted_approximations import lazanyi_coefficients

    eta, k = np.array([0.18, 0.42, 1.37]), np.array([3.42, 2.35, 1.77])
    scene = Scene(CLOSE, (Surface(BALL, Conductor(Spectrum(eta), Spectrum(k))),), ONE)
    tables = pack(scene, Settings("rgb", precision="double", fresnel="lazanyi")).tables
    curves, ids = tables.curves.reshape(-1, 3), tables.shape_ids
    for channel in range(3):
        a, power = lazanyi_coefficients(eta[channel], k[channel])
        assert curves[ids[lanes.OF_A], channel] == pytest.approx(a, rel=1e-12)
        assert curves[ids[lanes.OF_POWER], channel] == pytest.approx(power, rel=1e-12)


def test_what_an_index_cannot_hold_is_refused(monkeypatch):
    gray = Surface(BALL, Lambertian(constant(0.5)))
    with pytest.raises(ValueError, match="65,537 shapes, and a render at most 65,536"):
        pack(Scene(CLOSE, (gray,) * 65536, (*ONE, LAMP)), Settings("scalar"))
    # As many spectra take long to make.  Three fit: the ball's, the lamp's and that of the surroundings.
    monkeypatch.setattr(lanes, "MOST", 2)
    pack(Scene(CLOSE, (gray,), (*ONE, LAMP)), Settings("scalar"))
    darker = Surface(BALL, Lambertian(constant(0.4)))
    with pytest.raises(ValueError, match="4 different spectra, and a render at most 3"):
        pack(Scene(CLOSE, (gray, darker), (*ONE, LAMP)), Settings("scalar"))
