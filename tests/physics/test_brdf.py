"""The BRDF checks find what is wrong with a BRDF, and nothing where nothing is."""

import numpy as np
import pytest

from reflectance_fit.physics.brdf import blinn_phong, lambertian, mirrored, modified_phong, phong
from reflectance_fit.physics.brdf_checks import check_energy, check_reciprocity
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.physics.hemisphere import direction, hemispherical_irradiance
from reflectance_fit.physics.reflection import directional_albedo, mirror_radiance, outgoing_radiance

GOOD = {
    "matte": lambertian(1.0),
    "modified Phong": modified_phong(1.0, 12.0),
    "sharp modified Phong": modified_phong(1.0, 1e6),
    "Blinn-Phong": blinn_phong(1.0, 50.0),
}


def ones(w):
    return np.ones(w.shape[:-1])


@pytest.mark.parametrize("name", GOOD)
def test_good_brdfs_pass(name):
    assert check_reciprocity(GOOD[name]).violation <= 1e-8
    energy = check_energy(GOOD[name], log2_directions=1)
    assert energy.converged
    assert energy.conserves
    # All of them give back everything at normal incidence, and none more elsewhere.
    assert energy.albedo == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("n", [0.5, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("model", [modified_phong, blinn_phong])
def test_lobes_are_normalised_at_normal_incidence(model, n):
    assert directional_albedo(model(0.7, n), [0, 0, 1]).value == pytest.approx(0.7, rel=1e-10, abs=0)


def test_phong_is_neither_reciprocal_nor_conserving():
    found = check_reciprocity(phong(0.5, 20.0))
    assert not found.reciprocal
    assert found.violation > 0.5
    assert phong(0.5, 20.0)(found.incoming, found.outgoing) == pytest.approx(found.value)
    energy = check_energy(phong(0.5, 20.0), log2_directions=2)
    assert not energy.conserves
    assert energy.albedo > 10.0
    assert energy.incoming[2] < 0.01


def planted(excess, width, at):
    """A matte surface with a reciprocal bump where incoming and outgoing are close to the directions at."""

    def brdf(incoming, outgoing):
        def near(a, b):
            return np.exp(-np.sum((a - at[0]) ** 2 + (b - at[1]) ** 2, axis=-1) / width**2)

        return 0.5 / np.pi + excess * (near(incoming, outgoing) + near(outgoing, incoming))

    return brdf


def test_a_planted_asymmetry_is_found_even_in_a_narrow_lobe():
    sharp = modified_phong(0.9, 1e7)

    def lopsided(incoming, outgoing):
        return sharp(incoming, outgoing) * (1.0 + 0.01 * incoming[..., 0])

    assert check_reciprocity(sharp).reciprocal
    found = check_reciprocity(lopsided)
    assert not found.reciprocal
    assert 0.005 < found.violation < 0.02


def test_planted_energy_is_found():
    assert check_energy(
        planted(0.2, 0.5, (direction(0.6, 1.0), direction(0.9, 4.0))), log2_directions=4
    ).conserves
    bad = check_energy(planted(5.0, 0.5, (direction(0.6, 1.0), direction(0.9, 4.0))), log2_directions=4)
    assert bad.converged
    assert not bad.conserves
    assert bad.albedo > 1.0


def test_negative_values_are_found():
    def brdf(incoming, outgoing):
        return 0.3 + 0.31 * np.sin(3.0 * (incoming[..., 0] + outgoing[..., 0]))

    found = check_energy(brdf, log2_directions=4)
    assert found.least < 0.0
    assert not found.conserves


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("retro", [False, True])
@pytest.mark.parametrize("theta", [0.0, 0.7, 1.4])
def test_lobes_along_mirror_and_back_are_seen_however_sharp(width, retro, theta):
    """A Gaussian over the cosine reflects pi A w^2: 1e-5 rad wide it fills 1e-10 of the hemisphere."""
    beam = direction(theta, 0.4)
    center = beam if retro else mirrored(beam)

    def brdf(incoming, outgoing):
        gap2 = np.sum((outgoing - center) ** 2, axis=-1)
        return np.exp(-gap2 / width**2) / (np.pi * width**2 * outgoing[..., 2])

    def bounded(incoming, outgoing):
        return np.where(outgoing[..., 2] > 0.0, brdf(incoming, outgoing), 0.0)

    found = directional_albedo(bounded, beam)
    # gap^2 = 2 - 2 cos, so the lobe is 1 to exp(-4 / w^2), and the horizon is 17 w off or more.
    assert found.value == pytest.approx(1.0, rel=1e-8, abs=0)
    # Rounding of a direction is 1e-16 / w^2 of the sharpest lobe; what that costs must not pass for exact.
    assert found.converged or (width == 1e-5 and found.error < 1e-7)


def test_a_lobe_elsewhere_is_seen_from_005_rad():
    def brdf(incoming, outgoing):
        return np.exp(-np.sum((outgoing - direction(0.8, 2.0)) ** 2, axis=-1) / 0.05**2) / outgoing[..., 2]

    found = directional_albedo(brdf, direction(0.3, 5.5))
    assert found.value == pytest.approx(np.pi * 0.05**2, rel=1e-8, abs=0)


def test_a_rough_integrand_is_reported():
    def torn(incoming, outgoing):
        return 0.1 + 0.1 * (outgoing[..., 0] + 0.3 * outgoing[..., 1] > 1.0)

    found = directional_albedo(torn, direction(0.5, 0.0))
    assert not found.converged
    assert found.error > 1e-8


def test_a_lobe_is_integrated_alike_in_two_coordinate_systems():
    """The halves around the lobe against plain spherical coordinates about the normal."""
    brdf, outgoing = blinn_phong(0.8, 30.0), direction(0.9, 2.2)

    def incident(w):
        return 1.0 + 0.5 * w[..., 0] - 0.2 * w[..., 1] * w[..., 2]

    def product(theta, phi):
        w = direction(theta, phi)
        return brdf(w, outgoing) * incident(w)

    assert outgoing_radiance(brdf, incident, outgoing).value == pytest.approx(
        hemispherical_irradiance(product).value, rel=1e-10, abs=0
    )


def test_white_furnace_equals_the_albedo_of_reciprocal_brdfs_only():
    w = direction(0.9, 0.3)
    for brdf in GOOD.values():
        furnace = outgoing_radiance(brdf, ones, w).value
        assert furnace == pytest.approx(directional_albedo(brdf, w).value, rel=1e-8, abs=0)
    unfair = phong(0.5, 20.0)
    assert abs(outgoing_radiance(unfair, ones, w).value - directional_albedo(unfair, w).value) > 0.01


def test_emission_adds():
    w = direction(0.9, 0.3)
    assert outgoing_radiance(lambertian(0.25), ones, w, emitted=2.0).value == pytest.approx(
        2.25, rel=1e-12, abs=0
    )


@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.0), (0.2, 3.4)])
def test_a_mirror_reflects_fresnel(eta, k):
    """Its furnace radiance is F, and what it shows is what lies along the mirror direction."""
    w = direction(1.1, 0.4)
    expected = reflectances(np.cos(1.1), eta, k).mean
    assert mirror_radiance(ones, w, eta, k) == pytest.approx(expected, rel=1e-14, abs=0)
    seen = mirror_radiance(lambda d: d[..., 0], w, eta, k)
    assert seen == pytest.approx(-expected * np.sin(1.1) * np.cos(0.4), rel=1e-14, abs=0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: lambertian(50.0), "percent"),
        (lambda: modified_phong(0.5, -1.0), "exponent"),
        (lambda: directional_albedo(lambertian(0.5), [0, 0, -1]), "out of the surface"),
        (lambda: check_reciprocity(lambda a, b: a[..., 0] * np.nan), "NaN"),
    ],
)
def test_bad_input_says_what_to_mend(call, message):
    with pytest.raises(ValueError, match=message):
        call()
