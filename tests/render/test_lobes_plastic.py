"""Plastic: its closed form is the sum of what happens inside, and a white one gives back what it gets."""

from itertools import pairwise

import numpy as np
import pytest
from render_chi2 import examine
from render_lanes import over_lanes
from render_samplers import plastic_mixture

from reflectance_fit.physics import mueller
from reflectance_fit.physics.fresnel import amplitudes, reflectances
from reflectance_fit.render.lobes import fresnel, plastic
from reflectance_fit.render.lobes.diffuse import sample_cosine

ETAS = (1.0 + 1e-9, 1.01, 1.33, 1.5, 2.4, 10.0)


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


def test_rows_are_the_chain_of_mueller_matrices():
    """T_out . depolarizer . T_in with the transmission matrices spelled out."""
    rng, n = np.random.default_rng(4), 200
    c_v, c_l, eta = rng.random(n), rng.random(n), rng.uniform(1.05, 2.5, n)
    rows = rng.normal(size=(4, n))

    def transmission(c):
        r_s, r_p = amplitudes(c, eta)
        # What is not reflected, per polarization: powers along s and p only, for what goes to or comes from a depolarizer.
        return mueller.reflection(np.sqrt(1 - np.abs(r_s) ** 2), np.sqrt(1 - np.abs(r_p) ** 2))

    expected = np.einsum(
        "in,nij,jk,nkl->ln", rows, transmission(c_v), np.diag([1.0, 0, 0, 0]), transmission(c_l)
    )
    a_v, b_v, _ = over_lanes(fresnel.dielectric_transmission, c_v, eta)
    a_l, b_l, _ = over_lanes(fresnel.dielectric_transmission, c_l, eta)
    got = over_lanes(plastic.diffuse_rows, rows[0], rows[1], a_v, b_v, a_l, b_l)
    assert got == pytest.approx(expected[:2], abs=1e-13)
    assert np.all(expected[2:] == 0)


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
