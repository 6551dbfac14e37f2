"""Plastic: its closed form is the sum of what happens inside, and a white one gives back what it gets."""

from itertools import pairwise

import numpy as np
import pytest
from render_chi2 import examine
from render_lanes import over_lanes
from render_samplers import plastic_mixture
from scipy import integrate

from reflectance_fit.physics import approximations
from reflectance_fit.physics.fitted_approximations import lazanyi
from reflectance_fit.physics.fresnel import r0, reflectances
from reflectance_fit.render.lobes import fresnel, ggx, plastic
from reflectance_fit.render.lobes.diffuse import sample_cosine

ETAS = (1.0 + 1e-9, 1.01, 1.33, 1.5, 2.4, 10.0)
FORMS = {
    "exact": approximations.exact,
    "constant": approximations.constant,
    "schlick": approximations.schlick_exact_r0,
    "schlick_f82": approximations.f82,
    "lazanyi": lazanyi,
    "large_index": approximations.lecture_conductor,
}


def external(n):
    """Diffuse light reflected from outside, in closed form (Walsh 1926; Dunkle 1963)."""
    one = 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
    two = n**2 * (n**2 - 1) ** 2 / (n**2 + 1) ** 3 * np.log((n - 1) / (n + 1))
    three = 2 * n**3 * (n**2 + 2 * n - 1) / ((n**2 + 1) * (n**4 - 1))
    four = 8 * n**4 * (n**4 + 1) / ((n**2 + 1) * (n**4 - 1) ** 2) * np.log(n)
    return one + two - three + four


def test_internal_reflectance_has_its_closed_form():
    # Nearer to 1 the closed form has no digits.
    n = np.array([1.05, 1.33, 1.5, 2.4, 10.0])
    assert plastic.internal_reflectance(n) == pytest.approx(1 - (1 - external(n)) / n**2, abs=1e-9)


def test_internal_reflectance_is_the_integral_from_inside():
    for eta in (0.7, 1.01, 1.5, 2.4):
        # sin^2 in steps, with a knot at the critical angle of either side.
        knots = np.unique([0.0, 1.0, min(1.0, eta**-2)])
        x, w = np.polynomial.legendre.leggauss(400)
        x, w = (x + 1) / 2, w / 2
        # Nodes crowd at both ends of each part, where the reflectance is a root.
        crowd, stretch = x * x * (3 - 2 * x), 6 * x * (1 - x)
        total = sum(
            (b - a) * np.sum(w * stretch * reflectances(np.sqrt(1 - (a + (b - a) * crowd)), 1 / eta).mean)
            for a, b in pairwise(knots)
        )
        assert plastic.internal_reflectance(eta) == pytest.approx(total, abs=1e-6)
    assert plastic.internal_reflectance(1.0) == pytest.approx(0.0, abs=1e-12)


def test_forms_of_fresnel_have_their_own():
    """Moments of 1 and (1 - c)^5 under 2c dc: 1 and 1/21."""
    eta = np.array([1.2, 1.5, 2.4])
    normal = r0(eta)
    for form, reflected in ("constant", normal), ("schlick", normal + (1 - normal) / 21):
        inside = plastic.internal_reflectance(eta, FORMS[form])
        assert inside == pytest.approx(1 - (1 - reflected) / eta**2, abs=1e-13)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("eta", [0.7, 1.2, 1.5, 2.4])
def test_a_white_plastic_loses_and_gains_nothing_by_any_form(form, eta):
    """Light from all sides that a smooth coat sends back or lets in, then out again, of a base that keeps none."""

    def mirror(c):
        if eta >= 1:
            return FORMS[form](eta, 0.0)(c)
        sine = np.sqrt(1 - c**2) / eta
        return FORMS[form](1 / eta, 0.0)(np.sqrt(1 - sine**2)) if sine < 1 else 1.0

    corner = np.sqrt(max(1 - eta**2, 0.0))
    into = 2 * integrate.quad(lambda c: c * (1 - mirror(c)), corner, 1, epsabs=1e-11)[0]
    factor = plastic.base_factor(1.0, eta, form=FORMS[form])
    for cosine in corner + 0.01, 0.8, 1.0:
        assert mirror(cosine) + (1 - mirror(cosine)) * factor * into == pytest.approx(1, abs=1e-7)


@pytest.mark.parametrize("form", FORMS)
def test_a_rough_coat_leaves_what_its_form_does_not_reflect(form):
    """Reflected shares by another rule: over the outgoing hemisphere, value by value."""
    alpha, eta = 0.1, 1.5
    z, w = np.polynomial.legendre.leggauss(400)
    z, w = (z + 1) / 2, w / 2
    turn = (np.arange(800) + 0.5) * 2 * np.pi / 800
    lz, phi = np.meshgrid(z, turn, indexing="ij")
    l = np.stack([np.sqrt(1 - lz**2) * np.cos(phi), np.sqrt(1 - lz**2) * np.sin(phi), lz]).reshape(3, -1)
    room = []
    for c in np.linspace(0.05, 1.0, 20):
        v = (np.sqrt(1 - c**2), 0.0, c)
        *h, cosine = over_lanes(ggx.half, *v, *l)
        value = over_lanes(ggx.reflection_value, alpha, c, l[2], over_lanes(ggx.ndf, alpha, *h))
        curve = FORMS[form](eta, 0.0)
        lit = (value * curve(np.minimum(cosine, 1.0))).reshape(lz.shape).mean(axis=1) * 2 * np.pi
        room.append((1 - w @ lit) / (1 - curve(c)))
    assert plastic.share(eta, alpha, FORMS[form]) == pytest.approx(min(1.0, *room), abs=2e-4)


@pytest.mark.parametrize("eta", [1.33, 1.5])
def test_the_base_is_what_light_does_inside(eta):
    """Photons that enter, scatter and bounce inside until they leave: how many, and where to."""
    rng, n, rho, c = np.random.default_rng(3), 400_000, 0.8, 0.6
    entering = 1 - reflectances(c, eta).mean
    alive, out = np.ones(n), []
    while (alive := alive[rng.random(alive.size) < rho]).size:
        inside = over_lanes(sample_cosine, *rng.random((2, alive.size)))[2]
        leaves = rng.random(alive.size) >= reflectances(inside, 1 / eta).mean
        out.append(np.sqrt(1 - eta**2 * (1 - inside[leaves] ** 2)))
        alive = alive[~leaves]
    out = np.concatenate(out)
    z = (np.arange(2000) + 0.5) / 2000
    t_v, t_l = (over_lanes(fresnel.dielectric_transmission, x, eta)[0] for x in (np.array([c]), z))
    value = over_lanes(plastic.diffuse_value, t_v, t_l, z, plastic.base_factor(rho, eta))
    albedo, first = 2 * np.pi * value.mean(), 2 * np.pi * (value * z).mean()
    share = out.size / n
    assert entering * share == pytest.approx(albedo, abs=4 * np.sqrt(share * (1 - share) / n))
    assert out.mean() == pytest.approx(first / albedo, abs=4 * out.std() / np.sqrt(out.size))


@pytest.mark.parametrize("eta", ETAS)
def test_a_smooth_white_plastic_loses_nothing(eta):
    c = np.linspace(0.001, 1.0, 200)
    a, _, _ = over_lanes(fresnel.dielectric_transmission, c, eta)
    through = eta**2 * (1 - plastic.internal_reflectance(eta))
    assert a * plastic.base_factor(1.0, eta) * through + reflectances(c, eta).mean == pytest.approx(
        1, abs=1e-9
    )


def test_a_rough_coat_darkens_the_base_no_more_than_it_must():
    etas = np.array([1.2, 1.5, 2.4, 1.5])
    shares = plastic.share(etas, 0.1)
    assert shares[1] == shares[3]
    assert np.all((shares > 0.998) & (shares <= 1.0))
    assert plastic.share(1.5, 0.0) == 1.0
    assert plastic.share(1.5, 1.0) == 1.0  # single scattering loses more than that
    assert plastic.base_factor(0.5, 1.5, 0.1) == plastic.base_factor(0.5, 1.5) * shares[1]


def test_the_choice_of_lobe_is_a_probability_and_by_energy():
    f = np.linspace(0.0, 1.0, 11)
    chance = over_lanes(plastic.choose_specular, f, 1 - f, 0.3, 0.9)
    assert chance == pytest.approx(f / (f + (1 - f) * 0.27), abs=1e-14)
    assert over_lanes(plastic.choose_specular, [0.04], [0.96], 0.0, 0.9)[0] == 1.0
    assert over_lanes(plastic.choose_specular, [0.0], [1.0], 0.0, 0.9)[0] == 0.0


def test_samples_of_the_mixture_follow_its_density():
    assert examine(plastic_mixture(0.2, 0.7, 0.5), 200_000, seed=1, cells=12).p_value > 0.01


@pytest.mark.parametrize("bad", [-0.1, 1.1, np.nan])
def test_a_reflectance_beyond_1_is_refused(bad):
    with pytest.raises(ValueError, match=r"in \[0, 1\]; is it in percent"):
        plastic.base_factor(bad, 1.5)
