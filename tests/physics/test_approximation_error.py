"""How far off an approximation is: against published rows, closed forms, and slow scans."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from reflectance_fit.physics.approximation_error import (
    approximation_error,
    max_abs_errors,
    panels,
    quadrature,
)
from reflectance_fit.physics.approximation_ladder import LADDER
from reflectance_fit.physics.brewster import critical_angle
from reflectance_fit.physics.fresnel import r0, reflectances

RUNGS = {rung.name: rung for rung in LADDER}

# Computed once by other code on a dense scan, and printed with these digits: Schlick's largest error, its
# largest relative error and its bias of the hemispherical albedo in percent.
PRINTED = {
    1.05: (".3175", "668", "+247"),
    1.1: (".2105", "187", "+98"),
    1.2: (".113", "47", "+25"),
    1.33: (".060", "22.7", "+1.2"),
    1.5: (".036", "23.2", "-6.6"),
    1.7: (".032", "20", "-7.2"),
    2.0: (".044", "14", "-4.5"),
    2.42: (".076", "14", "-0.3"),
    3.0: (".125", "25", "+3.4"),
    4.0: (".201", "41", "+6.5"),
}


def error_of(name, eta, k=0.0):
    return approximation_error(eta, k, RUNGS[name].curve(eta, k))


def rounds_to(value, printed):
    return round(value, len(printed.partition(".")[2])) == float(printed)


@pytest.mark.parametrize("eta", PRINTED)
def test_schlick_for_dielectrics(eta):
    error = error_of("schlick", eta)
    absolute, relative, bias = PRINTED[eta]
    assert rounds_to(error.max_abs_error, absolute)
    assert error.max_abs_error == error.error  # too bright where it is worst
    assert rounds_to(100 * error.max_rel_error, relative)
    assert rounds_to(100 * error.albedo_error, bias)
    if eta == 1.5:
        assert rounds_to(error.at_deg, "85")


def diffuse_reflectance(n):
    """Walsh (1926), as in Duntley, J. Opt. Soc. Am. 32 (1942) 61: the albedo of a dielectric, n > 1, from outside."""
    square, fourth = n**2, n**4
    return (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + square * (square - 1) ** 2 / (square + 1) ** 3 * np.log((n - 1) / (n + 1))
        - 2 * n**3 * (square + 2 * n - 1) / ((square + 1) * (fourth - 1))
        + 8 * fourth * (fourth + 1) / ((square + 1) * (fourth - 1) ** 2) * np.log(n)
    )


@pytest.mark.parametrize("n", [1.1, 1.33, 1.5, 2.0, 4.0, 10.0])
def test_albedo_has_its_closed_form(n):
    """From inside, too, where all of it beyond the critical angle is reflected: (1 - inside) n^2 = 1 - outside."""
    for eta, exact in ((n, diffuse_reflectance(n)), (1 / n, 1 - (1 - diffuse_reflectance(n)) / n**2)):
        beta, weights = quadrature(panels(eta, 0.0))
        found = weights @ (np.sin(2 * beta) * reflectances(np.sin(beta), eta, 0.0).mean)
        assert found == pytest.approx(exact, rel=1e-11)
        # Schlick's is R0 + (1 - R0) / 21, since 2 int (1 - c)^5 c dc = 1 / 21.
        schlick = r0(eta) + (1 - r0(eta)) / 21
        assert error_of("schlick", eta).albedo_error == pytest.approx(schlick / exact - 1, abs=1e-11)
        assert error_of("r0_constant", eta).albedo_error == pytest.approx(r0(eta) / exact - 1, abs=1e-11)


@pytest.mark.parametrize(
    ("eta", "k"), [(0.7, 0.02), (0.7, 1e-4), (0.3, 0.1), (0.99, 0.01), (0.18, 3.4), (1.001, 0.0)]
)
def test_albedo_of_absorbing_media(eta, k):
    """Where eta < 1 and k is small both sides of the critical angle bend sharply."""
    inside = 1 - eta**2 + k**2

    def flux(beta):
        return np.sin(2 * beta) * float(reflectances(np.sin(beta), eta, k).mean)

    kink = [np.arcsin(np.sqrt(inside))] if 0 < inside < 1 else None
    expected, _ = quad(flux, 0, np.pi / 2, points=kink, limit=2000, epsabs=1e-13, epsrel=1e-12)
    beta, weights = quadrature(panels(eta, k))
    found = weights @ (np.sin(2 * beta) * reflectances(np.sin(beta), eta, k).mean)
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("eta", "k"), [(1.5, 0.0), (0.7, 0.0), (0.7, 1e-6), (1 + 1e-7, 0.0), (0.1, 9.0), (1e5, 1e5)]
)
def test_weights_are_those_of_angles(eta, k):
    beta, weights = quadrature(panels(eta, k))
    assert beta[0] == 0
    assert beta[-1] == np.pi / 2
    assert np.all(np.diff(beta) >= 0)
    for power in range(8):
        assert weights @ beta**power == pytest.approx((np.pi / 2) ** (power + 1) / (power + 1), rel=1e-13)


def scan(eta, k):
    """Angles from grazing incidence, dense everywhere, denser at grazing incidence and at the critical angle."""
    parts = [np.linspace(0, np.pi / 2, 300_001), np.geomspace(1e-12, 0.1, 30_001)]
    inside = 1 - eta**2 + k**2
    if 0 < inside < 1:
        kink = np.arcsin(np.sqrt(inside))
        away = np.geomspace(1e-14, 0.1, 30_001)
        parts += [kink - away, kink + away, [kink]]
    beta = np.unique(np.concatenate(parts))
    return beta[(beta >= 0) & (beta <= np.pi / 2)]


@pytest.mark.parametrize("name", RUNGS)
@pytest.mark.parametrize(
    ("eta", "k"),
    [
        *((1.5, 0.0), (0.7, 0.0), (0.183, 3.43), (1.05, 0.001), (1 + 1e-7, 0.0)),
        *((1 - 1e-7, 0.0), (0.5, 1e-7), (40.0, 90.0), (0.05, 0.05), (3.2, 3.3)),
        *((1 + 1e-13, 0.0), (1e8, 1e8)),  # all of it within 1e-5 degrees of grazing incidence
    ],
)
def test_errors_are_those_of_a_slow_scan(name, eta, k):
    beta = scan(eta, k)
    exact = reflectances(np.sin(beta), eta, k).mean
    off = RUNGS[name](np.sin(beta), eta, k) - exact
    error = error_of(name, eta, k)
    worst, relative = np.abs(off).max(), (np.abs(off) / exact).max()
    # A kink's neighbours on the scan are 1e-7 of the error apart.
    assert error.max_abs_error == pytest.approx(worst, rel=2e-6, abs=1e-12)
    assert error.max_rel_error == pytest.approx(relative, rel=2e-6, abs=1e-12)
    assert abs(error.error) == error.max_abs_error
    at = np.sin(np.radians(90 - error.at_deg))
    there = abs(RUNGS[name](at, eta, k) - reflectances(at, eta, k).mean)
    assert there == pytest.approx(worst, rel=2e-2, abs=1e-12)
    assert error.rms_error == pytest.approx(
        np.sqrt(np.trapezoid(off**2, beta) * 2 / np.pi), rel=1e-5, abs=1e-12
    )
    flux = [np.trapezoid(np.sin(2 * beta) * f, beta) for f in (off, exact)]
    assert error.albedo_error == pytest.approx(flux[0] / flux[1], rel=1e-4, abs=1e-8)


@settings(max_examples=60)
@given(eta=st.floats(0.05, 10.0), k=st.one_of(st.just(0.0), st.floats(1e-6, 10.0)))
def test_nothing_larger_was_missed(eta, k):
    beta = np.concatenate([np.linspace(0, np.pi / 2, 4001), np.geomspace(1e-9, 0.01, 500)])
    exact = reflectances(np.sin(beta), eta, k).mean
    for name in ("r0_constant", "schlick", "f82", "lazanyi", "lecture_conductor"):
        off = np.abs(RUNGS[name](np.sin(beta), eta, k) - exact)
        error = error_of(name, eta, k)
        assert error.max_abs_error >= off.max() * (1 - 1e-9) - 1e-15
        if exact.min() > 0:
            assert error.max_rel_error >= (off / exact).max() * (1 - 1e-9) - 1e-15
        assert error.rms_error <= error.max_abs_error * (1 + 1e-12)


def test_total_reflection_is_missed_from_the_critical_angle_on():
    """The kink itself is the worst place, and the first of many that are as bad for a constant."""
    critical = np.degrees(critical_angle(1 / 1.5))
    error = error_of("r0_constant", 1 / 1.5)
    assert error.error == pytest.approx(-0.96, abs=1e-12)
    assert error.at_deg == pytest.approx(critical, abs=1e-3)
    error = error_of("schlick", 1 / 1.5)
    c = np.cos(np.radians(critical))
    assert error.error == pytest.approx(0.04 + 0.96 * (1 - c) ** 5 - 1, abs=1e-7)
    assert error.at_deg == pytest.approx(critical, abs=1e-6)


def test_an_index_match_has_no_relative_error():
    error = error_of("schlick", 1.0)
    assert error.max_rel_error == np.inf
    assert error.albedo_error == np.inf
    exact = error_of("exact", 1.0)
    assert (exact.max_abs_error, exact.max_rel_error, exact.albedo_error) == (0, 0, 0)


@settings(max_examples=60)
@given(
    log_eta=st.floats(-100.0, 100.0),
    log_k=st.one_of(st.just(-np.inf), st.floats(-100.0, 100.0)),
    name=st.sampled_from(sorted(RUNGS)),
)
def test_every_material_has_errors(log_eta, log_k, name):
    error = error_of(name, 10.0**log_eta, 10.0**log_k)
    for value in (error.max_abs_error, error.max_rel_error, error.rms_error, error.albedo_error):
        assert not np.isnan(value)
    assert 0 <= error.at_deg <= 90
    assert 0 <= error.rms_error <= error.max_abs_error * (1 + 1e-12)


@pytest.mark.parametrize(
    ("eta", "k", "sd"), [(1.5, 0.0, 0.002), (0.18, 3.4, 0.02), (0.67, 0.0, 0.002), (1.2, 0.3, 0.05)]
)
def test_many_materials_at_once_have_the_errors_of_each_alone(eta, k, sd):
    rng = np.random.default_rng(0)
    eta_draws, k_draws = eta + sd * rng.standard_normal(40), k + (sd * rng.random(40) if k else np.zeros(40))
    at_deg = [error_of(rung.name, eta, k).at_deg for rung in LADDER]
    found = max_abs_errors(eta_draws, k_draws, [rung.curve for rung in LADDER], at_deg)
    for rung, values in zip(LADDER, found, strict=True):
        alone = [error_of(rung.name, *each).max_abs_error for each in zip(eta_draws, k_draws, strict=True)]
        if rung.name == "table":
            # Its worst cell, and where in it the critical angle lies, differ from draw to draw.
            assert values == pytest.approx(alone, rel=0.2 if eta < 1 else 0.02)
        elif eta < 1:
            # A kink that moves with the draws stands between the angles that they share.
            assert values == pytest.approx(alone, rel=2e-3)
        else:
            assert np.max(np.abs(values - alone)) <= 0.1 * np.std(alone)
