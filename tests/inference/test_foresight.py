"""What a capture is said to tell, against quadrature of the likelihood itself; and what it is said not to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.inference.design import KINDS, Design, Subject, planned
from reflectance_fit.inference.foresight import foresee
from reflectance_fit.inference.forward import neutral_vector
from reflectance_fit.inference.likelihood import log_likelihoods
from reflectance_fit.inference.rows import pack

KIND = {kind.name: kind for kind in KINDS}


def rows_at(kind, angles, eta, k, share, priors):
    subject = Subject(eta, k, 1.0, lambda v: share * np.maximum(v, 1e-3), priors, {})
    return planned(Design(KIND[kind], tuple(angles)), subject)


def look(kind, angles, eta, k, share, priors, **nuisances):
    o = rows_at(kind, angles, eta, k, share, priors)
    return foresee(o, eta, k, exterior_ior=1.0, priors=priors, nuisances=nuisances)


def k_by_quadrature(o, eta, most):
    """Expected marginal posterior of k on a grid over (log eta, k)."""
    grid_eta, grid_k = np.log(eta) + np.linspace(-0.02, 0.02, 1601), np.linspace(0, most, 901)
    vectors = np.tile(neutral_vector(), (len(grid_eta) * len(grid_k), 1))
    vectors[:, 0] = np.exp(np.repeat(grid_eta, len(grid_k)))
    vectors[:, 1] = np.tile(grid_k, len(grid_eta))
    log_density = log_likelihoods(pack(o, 1.0), vectors)
    weight = np.exp(log_density - log_density.max()).reshape(len(grid_eta), len(grid_k)).sum(axis=0)
    weight[0] /= 2  # the trapezoid rule's
    return grid_k, weight / weight.sum()


@pytest.mark.parametrize(
    ("kind", "k"), [("four axes", 0.0), ("lamp at 45, plate, four frames", 0.0), ("four axes", 0.02)]
)
def test_the_limit_of_k_is_that_of_the_likelihood(priors, kind, k):
    """Second order in k without a plate, first with it, and between the two where k is about its own sd."""
    share = 1e-3 if k == 0 else 5e-3
    o = rows_at(kind, (30, 45, 60), 1.5, k, share, priors)
    found = foresee(o, 1.5, k, exterior_ior=1.0, priors=priors, nuisances={})
    grid, weight = k_by_quadrature(o, 1.5, 4 * found.k_limit)
    limit = np.interp(0.95, np.cumsum(weight), grid)
    assert found.k_status == "upper_limit"
    assert found.k_sd is None
    assert found.k_limit == pytest.approx(limit, rel=0.03)
    assert "only an upper limit" in found.cannot[0]


def test_without_a_plate_the_limit_goes_with_the_root_of_the_noise(priors):
    limits = [look("four axes", (30, 45, 60), 1.5, 0.0, share, priors).k_limit for share in (1e-4, 1e-2)]
    assert limits[1] / limits[0] == pytest.approx(10, rel=0.1)
    kind = "lamp at 45, plate, four frames"
    limits = [look(kind, (30, 45, 60), 1.5, 0.0, share, priors).k_limit for share in (1e-4, 1e-3)]
    assert limits[1] / limits[0] == pytest.approx(10, rel=0.1)


def test_a_tiny_noise_beside_wide_nuisances_keeps_its_digits(priors):
    """The normal equations once gave k = 1e-6 +- 1e-7 here, from rounding."""
    wide = {"angle_offset_deg": 0.5, "diffuse": 0.01, "source_dolp": 0.02, "diattenuation": 0.005}
    found = look("s and p", (30, 45, 60), 1.5, 0.0, 1.5e-5, priors, **wide)
    assert found.k_status == "upper_limit"
    assert found.k_limit == pytest.approx(look("s and p", (30, 45, 60), 1.5, 0.0, 1e-4, priors, **wide).k_limit, rel=0.02)  # fmt: skip


def test_a_dielectric_s_angle_is_known_as_its_eta_is(priors):
    """d arctan(eta) = d eta / (1 + eta^2)."""
    found = look("four axes", (30, 45, 60), 1.5, 0.0, 1e-3, priors)
    assert found.brewster_deg == pytest.approx(np.degrees(np.arctan(1.5)))
    assert found.brewster_sd_deg == pytest.approx(np.degrees(found.eta_sd / (1 + 1.5**2)), rel=1e-5)
    assert found.correlation is None


@pytest.mark.parametrize("share", [1e-2, 1e-3, 1e-6])
@pytest.mark.parametrize("index", [(1.5, 0.0), (1.5, 0.3), (3.18, 3.33), (0.4, 2.4)])
@pytest.mark.parametrize("kind", ["s and p", "four axes"])
def test_one_angle_of_unpolarized_light_is_one_equation(priors, index, share, kind):
    found = look(kind, (50,), *index, share, priors)
    assert found.cannot[0].startswith("one equation for two unknowns")
    if index[1] > 0:
        assert (found.eta_sd, found.k_sd) == (None, None)
        assert found.worst == np.inf


@pytest.mark.parametrize("index", [(0.966, 6.43), (0.2, 3.6), (3.04, 4.2)])
def test_a_metal_at_low_angles_is_not_told(priors, index):
    found = look("s and p", (10, 20, 30, 40), *index, 0.01, priors)
    assert found.k_status == "not_identified"
    assert found.cannot


@pytest.mark.parametrize(
    ("kind", "angles", "index"),
    [
        ("four axes", (30, 45, 60), (1.5, 0.5)),
        ("s and p", (60, 70, 80), (3.18, 3.33)),
        ("lamp at 45, four axes", (60, 70, 80), (0.966, 6.43)),
        ("lamp at 45, plate, six frames", (70,), (0.4, 2.4)),
    ],
)
def test_what_can_be_told_is_not_flagged(priors, kind, angles, index):
    found = look(kind, angles, *index, 1e-3, priors, angle_offset_deg=0.05)
    assert found.cannot == ()
    assert found.k_status == found.eta_status == "identified"
    assert 0 < found.worst < 0.1


def test_no_light_at_all_says_nothing(priors):
    o = rows_at("four axes", (30, 45, 60), 1.5, 0.5, 1e-3, priors)
    found = foresee(
        replace(o, sigma=np.full(len(o), 1e3)), 1.5, 0.5, exterior_ior=1.0, priors=priors, nuisances={}
    )
    assert found.cannot == ("neither eta nor k: these rows say next to nothing about the material",)
    assert (found.eta_status, found.k_status) == ("not_identified", "not_identified")
