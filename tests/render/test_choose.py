"""The mode is the cheapest that gives the picture: what is proved, what is tried, and that doubt chooses the fuller."""

import math
from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.render.choose import LIMIT, choose
from reflectance_fit.render.film import Film
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    DirectionalLight,
    Disk,
    ImageEnvironment,
    Lambertian,
    Plane,
    Plastic,
    PointLight,
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

CAMERA = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (64, 48))
GRAY = Lambertian(constant(0.5))
RED = Lambertian(Spectrum(np.array([0.6, 0.1, 0.05])))
GLASS = Dielectric(constant(1.5))
METAL = Conductor(constant(0.2), constant(3.4))
PLASTIC = Plastic(constant(1.5), constant(0.4))
LINEAR = Polarization((1.0, 0.6, 0.8, 0.0))
CIRCULAR = Polarization((1.0, 0.0, 0.0, 1.0))
TABLE_NM = np.array([400.0, 500.0, 600.0, 700.0])

GROUND = Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
BALL = Sphere((0.0, 0.0, 0.0), 1.0)
SHEET = Rectangle((0.0, -3.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
SKY = ConstantEnvironment(constant(1.0))


def scene(*surfaces, lights=(SKY,), analyzer=None, depth=8):
    camera = replace(CAMERA, analyzer_deg=analyzer)
    return Scene(camera, tuple(Surface(*s) for s in surfaces), tuple(lights), max_depth=depth)


def refuse(scene, settings):
    raise AssertionError("no trial was expected")


class Trial:
    """A pilot whose modes differ by ``off`` of the mean, up and down, with noise of ``sigma`` a sample."""

    def __init__(self, off, sigma=0.0):
        self.off, self.sigma, self.seen = off, sigma, []

    def __call__(self, scene, settings):
        self.seen.append((settings.mode, settings.samples, scene.camera.size_px))
        width, height = scene.camera.size_px
        effort = ("spectral" in settings.mode) + ("polarized" in settings.mode)
        rng = np.random.default_rng((settings.seed, effort))
        mean = np.ones((height, width, 3, 4 if "polarized" in settings.mode else 1))
        mean[:, ::2] += effort * self.off
        mean[:, 1::2] -= effort * self.off
        mean += self.sigma / math.sqrt(settings.samples) * rng.normal(size=mean.shape)
        return Film(settings.mode, mean, np.zeros_like(mean), settings.samples)


PROVED = {
    "diffuse gray": (scene((GROUND, GRAY), (BALL, GRAY)), "scalar"),
    "unpolarized light through an analyzer is one half": (scene((BALL, GRAY), analyzer=30.0), "scalar"),
    "a polarizer sheet alone passes one half": (
        scene((BALL, GRAY), (SHEET, PolarizerSheet(0.0))),
        "scalar",
    ),
    "a retarder alone does nothing": (scene((BALL, GRAY), (SHEET, RetarderSheet(0.0, 90.0))), "scalar"),
    "polarized light on diffuse things": (
        scene((BALL, GRAY), lights=(ConstantEnvironment(constant(1.0), LINEAR),)),
        "scalar",
    ),
    "lights that nobody sees, behind diffuse things": (
        scene((BALL, GRAY), lights=(PointLight((0, 0, 4), constant(1.0), LINEAR),), analyzer=0.0),
        "scalar",
    ),
    "circular light through an analyzer is one half": (
        scene((BALL, GRAY), lights=(ConstantEnvironment(constant(1.0), CIRCULAR),), analyzer=0.0),
        "scalar",
    ),
    "one convex metal": (scene((BALL, METAL)), "scalar"),
    "circular light on one convex metal": (
        scene((BALL, METAL), lights=(ConstantEnvironment(constant(1.0), CIRCULAR),)),
        "scalar",
    ),
    "metal on a diffuse ground": (scene((BALL, METAL), (GROUND, GRAY)), "scalar"),
    "two mirrors in one plane": (
        scene((Disk((0, 0, -1), (0, 0, 1), (1, 0, 0)), METAL), (Plane((5, 3, -1), (0, 0, -2)), METAL)),
        "scalar",
    ),
    "two mirrors, but paths of one reflection": (scene((BALL, METAL), (GROUND, METAL), depth=2), "scalar"),
    "polarized light on metal": (
        scene((BALL, METAL), lights=(ConstantEnvironment(constant(1.0), LINEAR),)),
        "polarized",
    ),
    "polarized light that the analyzer sees": (
        scene((BALL, GRAY), lights=(ConstantEnvironment(constant(1.0), LINEAR),), analyzer=0.0),
        "polarized",
    ),
    "analyzer and glass": (scene((GROUND, GLASS), analyzer=0.0), "polarized"),
    "analyzer and plastic": (scene((BALL, PLASTIC), analyzer=90.0), "polarized"),
    "two sheets": (scene((SHEET, PolarizerSheet(0.0)), (GROUND, PolarizerSheet(90.0))), "polarized"),
    "sheet and analyzer": (scene((SHEET, PolarizerSheet(0.0)), analyzer=90.0), "polarized"),
    "sheet before metal": (scene((SHEET, PolarizerSheet(0.0)), (BALL, METAL)), "polarized"),
    "circular light made linear": (
        scene(
            (SHEET, RetarderSheet(45.0, 90.0)),
            lights=(ConstantEnvironment(constant(1.0), CIRCULAR),),
            analyzer=0.0,
        ),
        "polarized",
    ),
    "one colour": (scene((BALL, RED)), "rgb"),
    "colours that meet once": (scene((BALL, RED), (GROUND, RED), depth=2), "rgb"),
    "coloured light on gray": (
        scene((BALL, GRAY), lights=(ConstantEnvironment(Spectrum(np.array([1.0, 0.5, 0.2]))),)),
        "rgb",
    ),
    "dispersion": (
        scene((GROUND, Dielectric(Spectrum(np.array([1.53, 1.52, 1.51, 1.50]), TABLE_NM)))),
        "spectral",
    ),
    "dispersion by three numbers": (
        scene((GROUND, Dielectric(Spectrum(np.array([1.51, 1.52, 1.53]))))),
        "spectral",
    ),
    "a metal's table": (
        scene(
            (BALL, Conductor(Spectrum(np.array([1.6, 1.0, 0.25, 0.15]), TABLE_NM), constant(3.0))),
        ),
        "spectral",
    ),
    "a lamp's spectrum": (
        scene(
            (BALL, GRAY), lights=(ConstantEnvironment(Spectrum(np.array([0.1, 0.6, 1.0, 1.4]), TABLE_NM)),)
        ),
        "spectral",
    ),
    "equal energy is not white": (
        scene((BALL, GRAY), lights=(ConstantEnvironment(Spectrum(np.ones(4), TABLE_NM)),)),
        "spectral",
    ),
    "a paint's table with a narrow dip": (
        scene((BALL, Lambertian(Spectrum(np.array([0.5, 0.1, 0.5]), np.array([480.0, 500.0, 520.0]))))),
        "spectral",
    ),
    "dispersion and analyzer": (
        scene((GROUND, Dielectric(Spectrum(np.array([1.53, 1.50]), np.array([400.0, 700.0])))), analyzer=0.0),
        "spectral_polarized",
    ),
}


@pytest.mark.parametrize("name", PROVED)
def test_what_is_proved_needs_no_trial(name):
    given, mode = PROVED[name]
    choice = choose(given, refuse)
    assert choice.mode == mode, choice.reason
    assert "\n" not in choice.reason


TRIED = {
    "two mirrors": scene((BALL, METAL), (GROUND, METAL)),
    "crossed plates": scene((GROUND, GLASS), (Plane((3, 0, 0), (1, 0, 0)), GLASS)),
    "inside of a glass ball": scene((BALL, GLASS)),
    "seen from inside a metal ball": scene((Sphere((0, 0, 0), 20.0), METAL)),
    "plastics": scene((BALL, PLASTIC), (GROUND, PLASTIC)),
}


@pytest.mark.parametrize("name", TRIED)
def test_two_interfaces_on_a_path_are_tried(name):
    for off, mode in ((0.0, "scalar"), (0.02, "polarized")):
        trial = Trial(off)
        choice = choose(TRIED[name], trial)
        assert choice.mode == mode, choice.reason
        assert {seen[0] for seen in trial.seen} == {"rgb", "polarized"}


@pytest.mark.parametrize(
    "given",
    [
        scene((BALL, RED), (GROUND, RED)),
        scene((BALL, RED), lights=(ConstantEnvironment(Spectrum(np.array([1.0, 0.5, 0.2]))),)),
        scene((BALL, RED), lights=(ImageEnvironment(np.full((2, 4, 3), (0.2, 0.5, 1.0))),)),
        scene((SHEET, Lambertian(Texture(np.full((2, 2, 3), (0.2, 0.5, 0.7))))), (GROUND, GRAY)),
        scene((BALL, Plastic(constant(1.5), Spectrum(np.array([0.6, 0.1, 0.05]))))),
    ],
)
def test_colours_that_multiply_are_tried(given):
    for off, mode in ((0.0, "rgb"), (0.02, "spectral")):
        trial = Trial(off)
        assert choose(given, trial).mode == mode
        assert {seen[0] for seen in trial.seen} == {"rgb", "spectral"}


def test_the_trial_of_colour_is_polarized_where_the_picture_will_be():
    given = scene((BALL, RED), (GROUND, METAL), analyzer=0.0)
    trial = Trial(0.02)
    assert choose(given, trial).mode == "spectral_polarized"
    assert {seen[0] for seen in trial.seen} == {"polarized", "spectral_polarized"}


@pytest.mark.parametrize("off", [1.05 * LIMIT, 0.02, 0.1])
@pytest.mark.parametrize("sigma", [0.0, 0.3, 3.0])
def test_a_difference_above_the_limit_is_never_called_small(off, sigma):
    assert choose(TRIED["two mirrors"], Trial(off, sigma)).mode == "polarized"


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.3])
def test_noise_alone_is_not_taken_for_a_difference(sigma):
    assert choose(TRIED["two mirrors"], Trial(0.0, sigma)).mode == "scalar"


def test_what_noise_hides_chooses_the_fuller_mode_and_says_so():
    trial = Trial(0.0, 5.0)
    choice = choose(TRIED["two mirrors"], trial)
    assert choice.mode == "polarized"
    assert "for all that a trial tells" in choice.reason
    assert sorted({samples for _, samples, _ in trial.seen}) == [64, 256, 1024]


def test_trials_are_small_and_keep_the_pictures_shape():
    trial = Trial(0.0)
    wide = replace(TRIED["two mirrors"], camera=replace(CAMERA, size_px=(1920, 1080)))
    choose(wide, trial)
    assert {size for _, _, size in trial.seen} == {(64, 36)}


def test_a_picture_that_is_black_with_polarization_only():
    """Crossed mirrors at Brewster's angle: all of the unpolarized picture is wrong."""

    def pilot(scene, settings):
        mean = np.full((2, 2, 3, 1), 0.0 if settings.mode == "polarized" else 0.1)
        return Film(settings.mode, mean, mean, 1)

    assert choose(TRIED["crossed plates"], pilot).mode == "polarized"


def test_stokes_vectors_on_demand_or_not_at_all():
    plain = scene((BALL, GRAY))
    assert choose(plain, refuse, polarized=True).mode == "polarized"
    analyzed = scene((GROUND, GLASS), analyzer=0.0)
    assert choose(analyzed, refuse, polarized=False).mode == "scalar"


def test_a_table_that_three_wavelengths_show_stays_rgb():
    eta = Spectrum(np.array([1.5, 1.5, 1.5]), np.array([400.0, 550.0, 700.0]))
    near = Plastic(
        Spectrum(np.array([1.50001, 1.5, 1.50001]), np.array([400.0, 550.0, 700.0])), constant(0.5)
    )
    sun = (DirectionalLight((0, 0, -1), constant(1.0)), AreaLight(BALL, constant(1.0)))
    assert choose(scene((GROUND, Plastic(eta, constant(0.5))), lights=sun), refuse).mode == "scalar"
    assert choose(scene((GROUND, near), lights=sun), Trial(0.0)).mode == "rgb"
