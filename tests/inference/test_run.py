"""Model choice, upper limits and estimated sigmas, from whole fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.inference import posterior, run
from reflectance_fit.observations import Flag, concatenate
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.physics.inversion import eta_from_r0_given_k
from reflectance_fit.priors import Prior
from reflectance_fit.result import Interval


@pytest.fixture(autouse=True)
def _short_runs(monkeypatch):
    """Verdicts do not need thousands of independent draws."""
    monkeypatch.setattr(posterior, "MIN_ESS", 800.0)
    monkeypatch.setattr(posterior, "MAX_RHAT", 1.05)
    monkeypatch.setattr(posterior, "STEPS_PER_TAU", 20)


def scan(rows_of, eta, k, share, *, stated=True, seed=0):
    generator = np.random.default_rng(seed)
    theta = np.arange(20.0, 85.0, 5.0)
    r = reflectances(np.cos(np.radians(theta)), eta, k)
    parts = []
    for quantity, power in (("signal_s", r.s), ("signal_p", r.p)):
        sigma = share * float(np.max(power)) / 2
        value = power / 2 + sigma * generator.standard_normal(len(theta))
        parts.append(rows_of(theta, quantity, value, sigma=sigma if stated else np.nan, gain_group=quantity))
    return concatenate(parts)


def fit(o, priors, **options):
    return run.fit_channel(
        "550 nm", o, exterior_ior=1.0, priors=priors, nuisances=options.pop("nuisances", {}), **options
    )


def test_glass_is_a_dielectric_with_an_upper_limit_on_k(rows_of, priors):
    found = fit(scan(rows_of, 1.5, 0.0, 0.003), priors)
    assert found.optimum.model == "dielectric"
    assert found.chosen_because.startswith("k adds nothing")
    assert "nlopt" in found.optimum.optimizer  # has had its look at the chosen model
    assert [c.name for c in found.candidates] == ["dielectric", "conductor"]
    assert found.loo.rival == "conductor"
    assert found.loo.agrees
    assert found.loo.elpd_difference == pytest.approx(
        found.candidates[0].elpd_loo - found.candidates[1].elpd_loo, abs=1e-9
    )
    assert found.intervals["k"].status == "upper_limit"
    assert 0 < found.intervals["k"].ci95[1] < 0.3
    assert np.mean(found.k_posterior.samples["k"] < found.intervals["k"].ci95[1]) == pytest.approx(
        0.95, abs=1e-3
    )
    eta = found.intervals["eta"]
    assert abs(eta.median - 1.5) < 4 * eta.sd
    # k = 0: one Brewster angle, arctan(eta), draw by draw.
    assert set(found.derived) == {"r0", "brewster_deg"}
    np.testing.assert_allclose(
        found.derived["brewster_deg"], np.degrees(np.arctan(found.posterior.samples["eta"])), rtol=1e-12
    )


def test_k_0_is_no_finding_where_eta_depends_on_it(rows_of, priors):
    """Near normal incidence chromium's rows are those of a dielectric of eta 6.9, or of anything from 2 to 7 with some k.

    This draw of its noise narrows that to a factor 3.5, which still is no answer.  A glass in such rows is one: its
    eta is known without k = 0.
    """
    theta = np.array([10.0, 20.0, 30.0, 40.0])

    def near_normal(s, p, sigma):
        parts = [
            rows_of(theta, quantity, np.array(value), sigma=sigma, gain_group="lamp")
            for quantity, value in (("signal_s", s), ("signal_p", p))
        ]
        return fit(concatenate(parts), priors, method="importance")

    chromium = near_normal(
        [0.56077, 0.56704, 0.60117, 0.63845], [0.54911, 0.54970, 0.52116, 0.45394], 0.00553
    )
    assert "k is neither needed nor bounded" in chromium.chosen_because
    assert chromium.optimum.model == "conductor"
    eta = chromium.intervals["eta"]
    assert (eta.status, eta.median) == ("not_identified", None)
    assert eta.ci95[0] < 3.18 < eta.ci95[1]
    r = reflectances(np.cos(np.radians(theta)), 1.52)
    glass = near_normal(r.s, r.p, 0.01 * float(np.mean(r.mean)))
    assert glass.optimum.model == "dielectric"
    assert glass.intervals["eta"].status == "identified"


def test_what_auto_adds_is_sampled_and_told(rows_of, priors):
    """Angles 1 degree off, and nothing said of nuisances: eta and its interval come with the offset free."""
    o = scan(rows_of, 1.5, 0.0, 0.003)
    o = replace(o, theta_deg=o.theta_deg - 1.0)
    found = fit(o, priors, nuisances=None, method="importance")
    assert found.candidates[0].nuisances == ("angle_offset_deg",)
    assert found.chosen_because.startswith("angle_offset_deg is needed")
    assert "angle_offset_deg" in found.posterior.samples
    assert "angle_offset_deg" in found.priors
    assert abs(found.intervals["eta"].median - 1.5) < 4 * found.intervals["eta"].sd
    # k's limit is the conductor's with the same nuisances.
    assert "angle_offset_deg" in found.k_posterior.samples
    # Another model than auto adds nothing.
    assert fit(o, priors, nuisances=None, model="dielectric", method="laplace").candidates[0].nuisances == ()


def test_outliers_are_told_and_do_not_move_eta(rows_of, priors):
    o = scan(rows_of, 1.5, 0.0, 0.003)
    value = o.value.copy()
    value[[4, 15, 20]] += np.array([25, -30, 40]) * o.sigma[[4, 15, 20]]
    o = replace(o, value=value)
    found = fit(o, priors, method="importance")
    assert found.noise == found.candidates[0].noise == "student_t"
    assert found.p_value > 0.01
    assert abs(found.intervals["eta"].median - 1.5) < 4 * found.intervals["eta"].sd
    # Outliers are shown as what they are.
    assert np.sum(np.abs(found.optimum.residuals) > 15) == 3


def test_a_metal_is_a_conductor_with_three_angles(rows_of, priors):
    theta = np.array([60.0, 65.0, 70.0, 75.0])
    psi, delta = np.degrees(psi_delta(np.cos(np.radians(theta)), 2.1, 2.7))
    o = concatenate(
        [rows_of(theta, "psi_deg", psi, sigma=0.02), rows_of(theta, "delta_deg", delta, sigma=0.05)]
    )
    found = fit(o, priors)
    assert found.optimum.model == "conductor"
    assert found.k_posterior is None
    assert found.loo is None  # a dielectric is out of the question
    for name, truth in (("eta", 2.1), ("k", 2.7)):
        assert abs(found.intervals[name].median - truth) < 4 * found.intervals[name].sd
    angles = [found.intervals[f"{n}_deg"].median for n in ("brewster", "second_brewster", "principal_angle")]
    assert angles == sorted(angles)


def test_a_forced_model_is_the_only_candidate(rows_of, priors):
    found = fit(scan(rows_of, 1.5, 0.0, 0.003), priors, model="dielectric")
    assert found.chosen_because == "asked for"
    assert len(found.candidates) == 1
    assert found.intervals["k"].status == "fixed"
    assert found.intervals["k"].median == 0.0


def test_an_estimated_sigma_is_the_noise_that_was_put_in(rows_of, priors):
    found = fit(scan(rows_of, 1.5, 0.0, 0.003, stated=False), priors, model="dielectric")
    truth = {"signal_s": 0.003 * 0.5, "signal_p": 0.003 * 0.5}
    assert set(found.estimated_sigma) == set(truth)
    assert found.p_value is None
    for name in truth:
        draws = found.posterior.samples[f"sigma[{name}]"]
        largest = np.max(found.observations.value[found.observations.quantity == name])
        # 13 readings: the sigma's own sd is a fifth of it.
        assert np.quantile(draws, 0.0005) < 0.003 * largest < np.quantile(draws, 0.9995)


def test_saturated_rows_are_counted_and_count_as_bounds(rows_of, priors):
    """A reflectance that two answers fit, and a clipped one at grazing incidence that only one of them can reach."""
    r = reflectances(np.cos(np.radians([0.0, 70.0])), 2.0).mean
    near = rows_of(0.0, "reflectance", r[0], sigma=0.002)
    clipped = rows_of(70.0, "reflectance", 0.9 * r[1], sigma=0.002)
    o = concatenate([near, near, clipped])
    told = replace(o, flag=np.array(["used", "used", str(Flag.SATURATED)]))
    found = fit(told, priors, model="dielectric", method="importance")
    assert found.saturated == 1
    assert len(found.observations) == len(found.optimum.residuals) == 2
    assert found.optimum.dof == 1
    dropped = fit(o.select(np.array([0, 1])), priors, model="dielectric", method="importance")
    assert dropped.intervals["eta"].status == "multimodal"  # 2 and 1 / 2
    # The bound is below what 2 reflects, and total reflection of 1 / 2 is above it: both stay.
    assert found.intervals["eta"].status == "multimodal"
    # Clipped at 40 degrees, where 1 / 2 reflects totally and 2 does not: it must be 1 / 2.
    total = replace(clipped, theta_deg=np.array([40.0]), value=np.array([0.5]))
    told = replace(concatenate([near, near, total]), flag=told.flag)
    eta = fit(told, priors, model="dielectric", method="importance").intervals["eta"]
    assert eta.status == "identified"
    assert abs(eta.median - 0.5) < 4 * eta.sd


@pytest.mark.parametrize("model", ["auto", "conductor"])
@pytest.mark.parametrize("index", [(1.4, 7.6), (1.5, 0.0)])
def test_one_unpolarized_reading_cannot_tell_eta_from_k(rows_of, priors, index, model, monkeypatch):
    """One equation, two unknowns: a curve in (eta, k), whose ends are those of the priors, however low the noise."""
    monkeypatch.setattr(posterior, "MAX_STEPS", 500)
    value = float(reflectances(np.cos(np.radians(30.0)), *index).mean)
    found = fit(rows_of([30.0], "reflectance", [value], sigma=0.02 * value), priors, model=model)
    for name in ("eta", "k"):
        assert found.intervals[name].status == "not_identified"
        assert found.intervals[name].median is None
    if model == "auto":
        assert found.chosen_because.startswith("one equation for two unknowns")
    # With k = 0 taken for granted a glass gives its eta: two of them, on either side of 1.
    if index[1] == 0:
        given = fit(rows_of([30.0], "reflectance", [value], sigma=0.02 * value), priors, model="dielectric")
        assert given.intervals["eta"].status in ("identified", "multimodal")


def test_a_metal_seen_too_steeply_is_not_taken_for_a_dielectric(rows_of, priors, monkeypatch):
    """Chromium from 10 to 40 degrees: k is not needed, a dielectric of eta 7 would do, and k may be anything."""
    monkeypatch.setattr(posterior, "MAX_STEPS", 500)
    theta = np.array([10.0, 20.0, 30.0, 40.0])
    reflected = reflectances(np.cos(np.radians(theta)), 3.18, 3.33)
    generator = np.random.default_rng(0)
    parts = [
        rows_of(theta, q, power * (1 + 0.01 * generator.standard_normal(4)), sigma=0.005, gain_group=q)
        for q, power in (("signal_s", reflected.s), ("signal_p", reflected.p))
    ]
    found = fit(concatenate(parts), priors, method="importance")
    assert found.intervals["eta"].status == "not_identified"
    assert found.optimum.model == "conductor"


def fixed(priors, **values):
    return {**priors, **{name: Prior("fixed", value, value) for name, value in values.items()}}


def test_eta_and_k_each_solved_for_with_the_other_known(rows_of, priors):
    o = scan(rows_of, 0.9, 2.5, 0.003)
    given_k = fit(o, fixed(priors, k=2.5))
    assert given_k.optimum.model == "fixed_k"
    assert given_k.chosen_because == "the priors leave nothing else"
    eta = given_k.intervals["eta"]
    assert abs(eta.median - 0.9) < 4 * eta.sd
    assert given_k.intervals["k"] == Interval(2.5, None, None, None, "fixed")
    assert (given_k.posterior.samples["k"] == 2.5).all()
    given_eta = fit(o, fixed(priors, eta=0.9))
    assert given_eta.optimum.model == "fixed_eta"
    k = given_eta.intervals["k"]
    assert abs(k.median - 2.5) < 4 * k.sd
    assert given_eta.intervals["eta"] == Interval(0.9, None, None, None, "fixed")
    # What is known is worth something.
    both = fit(o, priors)
    assert both.optimum.model == "conductor"
    assert eta.sd < both.intervals["eta"].sd
    assert k.sd < both.intervals["k"].sd


def test_one_reflectance_at_normal_incidence_with_k_known_has_two_answers(rows_of, priors):
    """The circle of equal R0 meets k = 1 twice: both are told, and neither is chosen."""
    r0 = float(reflectances(1.0, 3.0, 1.0).mean)
    roots = eta_from_r0_given_k(r0, 1.0)
    o = concatenate([rows_of(0.0, "reflectance", r0, sigma=0.001)] * 2)
    eta = fit(o, fixed(priors, k=1.0), model="fixed_k").intervals["eta"]
    assert eta.status == "multimodal"
    np.testing.assert_allclose(sorted(eta.modes), [roots.low, roots.high], rtol=0.02)
    assert roots.high == pytest.approx(3.0)
