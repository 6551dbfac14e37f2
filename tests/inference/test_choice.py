"""What auto adds and what it leaves out: nuisances, k, heavy tails; and what stops it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from reflectance_fit.inference import choice, robust
from reflectance_fit.inference.candidates import Candidates
from reflectance_fit.inference.cross_check import checked
from reflectance_fit.inference.rows import estimated_names, gain_names, pack
from reflectance_fit.nuisances import offered
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances

BOTH = ("dielectric", "conductor")


def scan(rows_of, eta, k=0.0, *, seed=0, offset=0.0, stray=0.0, plate=False, angles=None, share=0.003):
    """s and p signals; what is wrong with them is done to their physics, not by the code under test."""
    generator = np.random.default_rng(seed)
    theta = np.arange(20.0, 84.0, 4.0) if angles is None else np.asarray(angles)
    r = reflectances(np.cos(np.radians(theta + offset)), eta, k)
    parts = []
    for quantity, power in (("signal_s", r.s), ("signal_p", r.p)):
        if plate:
            power = 2 * power / (1 + power)  # both faces of a clear plate
        signal = power / power.max() + stray
        value = signal + share * generator.standard_normal(len(theta))
        parts.append(rows_of(theta, quantity, value, sigma=share, gain_group=quantity))
    return concatenate(parts)


def spoilt(o, seed):
    """A tenth of the rows, at least two, off by 10 to 40 sigma."""
    generator = np.random.default_rng([seed, 1])
    hit = generator.permutation(len(o))[: max(2, len(o) // 10)]
    value = o.value.copy()
    value[hit] += generator.choice([-1, 1], len(hit)) * generator.uniform(10, 40, len(hit)) * o.sigma[hit]
    return replace(o, value=value)


def chosen(o, priors, *, nuisances=None, names=BOTH):
    offer = offered(o) if nuisances is None else {}
    sigmas = {**(nuisances or {}), **offer}
    candidates = Candidates(pack(o, 1.0), gain_names(o), priors, sigmas, estimated_names(o))
    return choice.choose(names, candidates, nuisances or (), offer, o)


def test_nothing_is_added_to_a_clean_glass(rows_of, priors):
    found = chosen(scan(rows_of, 1.5), priors)
    assert (found.chosen.optimum.model, found.chosen.nuisances) == ("dielectric", ())
    assert found.chosen.noise == "normal"
    assert found.reason.startswith("k adds nothing")
    # All were tried, with both models, and are told by BIC.
    assert {t.nuisances for t in found.tried} >= {(name,) for name in offered(scan(rows_of, 1.5))} - {
        ("source_azimuth_deg",)
    }
    assert [t.optimum.bic for t in found.tried] == sorted(t.optimum.bic for t in found.tried)


def test_sigmas_stated_too_small_are_no_reason_for_a_nuisance(rows_of, priors):
    """Where all residuals are four times too large, so is every fall of chi2 by a parameter without meaning."""
    for seed in range(6):
        o = scan(rows_of, 1.5, seed=seed, share=0.004)
        assert chosen(replace(o, sigma=o.sigma / 4), priors).chosen.nuisances == ()


@pytest.mark.parametrize("fault", ["offset", "stray"])
def test_a_fault_that_looks_like_k_is_found_instead(rows_of, priors, fault):
    """Glass whose angles are 1 degree off, or with 1 % of stray light: alone, the conductor would be taken."""
    o = scan(rows_of, 1.5, **{"offset": {"offset": 1.0}, "stray": {"stray": 0.01}}[fault])
    alone = chosen(o, priors, nuisances={})
    assert alone.chosen.optimum.model == "conductor"
    found = chosen(o, priors)
    assert found.chosen.optimum.model == "dielectric"
    added = {"offset": {"angle_offset_deg"}, "stray": {"dark_offset", "diffuse"}}[fault]
    assert len(found.chosen.nuisances) == 1
    assert set(found.chosen.nuisances) <= added
    assert "needed" in found.reason
    assert found.chosen.optimum.eta == pytest.approx(1.5, abs=0.02)
    assert abs(alone.chosen.optimum.eta - 1.5) > 2 * abs(found.chosen.optimum.eta - 1.5)
    # Leaving rows out agrees.
    check = checked(found, (0,))
    assert check.choice.chosen is found.chosen
    assert check.loo.agrees
    assert check.loo.elpd_difference > 4


def test_an_empty_block_forbids_and_a_named_nuisance_stays(rows_of, priors):
    o = scan(rows_of, 1.5, offset=1.0)
    assert {t.nuisances for t in chosen(o, priors, nuisances={}).tried} == {()}
    found = chosen(scan(rows_of, 1.5), priors, nuisances={"angle_offset_deg": 0.5})
    assert {t.nuisances for t in found.tried} == {("angle_offset_deg",)}


def test_a_nuisance_that_foretells_nothing_is_dropped(rows_of, priors):
    o = scan(rows_of, 1.5, seed=2)
    candidates = Candidates(pack(o, 1.0), gain_names(o), priors, {"angle_offset_deg": 0.5}, [])
    plain, more = candidates("dielectric", ()), candidates("dielectric", ("angle_offset_deg",))
    assert plain.optimum.objective - more.optimum.objective < 2  # no evidence
    check = checked(choice.Choice(more, candidates.tried, plain, "for the test"), (0,))
    assert check.choice.chosen is plain
    assert "no better" in check.choice.reason
    assert check.loo.elpd_difference > 0


def test_only_what_rows_can_feel_is_on_offer(rows_of):
    angles = {"angle_offset_deg"}
    powers = angles | {"dark_offset", "diffuse"}
    assert set(offered(rows_of([60.0], "psi_deg", [20.0], sigma=0.1))) == angles
    assert set(offered(rows_of([60.0], "reflectance", [0.1], sigma=0.1))) == powers
    plain = rows_of([60.0], "signal", [0.1], sigma=0.1, gain_group="g")
    assert set(offered(plain)) == powers | {"source_dolp", "source_azimuth_deg"}
    analyzed = rows_of([60.0], "signal", [0.1], sigma=0.1, gain_group="g", analyzer_deg=30.0)
    assert set(offered(analyzed)) - set(offered(plain)) == {"analyzer_offset_deg", "diattenuation"}
    assert offered(analyzed)["dark_offset"] == pytest.approx(0.001)


@pytest.mark.parametrize("estimated", [False, True])
def test_the_threshold_has_the_chance_that_it_is_named_for(estimated):
    """Least squares of noise on a line: how often one parameter without meaning takes more than that."""
    generator = np.random.default_rng(0)
    n, parameters, scenes, chance = 7, 4, 40_000, 0.05
    q, _ = np.linalg.qr(generator.standard_normal((n, n)))
    c = generator.standard_normal((scenes, n)) @ q
    larger_chi2 = np.sum(c[:, parameters - estimated :] ** 2, axis=1)  # sigma is a parameter, not a direction
    smaller_chi2 = larger_chi2 + c[:, 0] ** 2
    fall = n * np.log(smaller_chi2 / larger_chi2) if estimated else smaller_chi2 - larger_chi2
    rows = SimpleNamespace(estimated=np.full(n, 0 if estimated else -1))
    larger = SimpleNamespace(rows=rows, parameters=parameters, optimum=SimpleNamespace(residuals=np.zeros(n)))
    rate = np.mean(fall > choice.likely_by_chance(larger, chance))
    assert rate == pytest.approx(chance, abs=4 * np.sqrt(chance * (1 - chance) / scenes))


def test_k_is_rarely_seen_where_there_is_none(rows_of, priors):
    """Five rows, where log n alone would take the conductor in a tenth of all cases."""
    theta = np.array([20.0, 35.0, 50.0, 65.0, 80.0])
    taken = 0
    for seed in range(60):
        generator = np.random.default_rng(seed)
        r = reflectances(np.cos(np.radians(theta)), generator.uniform(1.3, 2.5))
        ratio = r.p / r.s + 0.01 * generator.standard_normal(5)
        o = rows_of(theta, "ratio_ps", ratio, sigma=0.01)
        taken += chosen(o, priors, nuisances={}).chosen.optimum.model == "conductor"
    assert taken <= 5  # of 60 at 2.5 %: more has a chance of 0.4 %


@pytest.mark.parametrize("seed", range(4))
def test_outliers_are_told_from_the_rest(rows_of, priors, seed):
    o = spoilt(scan(rows_of, 1.5, seed=seed), seed)
    found = chosen(o, priors, nuisances={})
    assert (found.chosen.optimum.model, found.chosen.noise) == ("dielectric", "student_t")
    assert "outliers" in found.reason
    # chi2 is of the rows that are none.
    best = found.chosen.optimum
    assert chi2.sf(best.chi2, best.dof) > 0.01
    assert best.dof == len(o) - found.chosen.parameters - robust.outliers(best)
    assert best.eta == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize("fault", [{"offset": 1.0}, {"offset": 3.0}, {"stray": 0.02}, {"plate": True}])
@pytest.mark.parametrize("seed", range(2))
def test_a_wrong_model_is_not_taken_for_outliers(rows_of, priors, fault, seed):
    found = chosen(scan(rows_of, 1.5, seed=seed, **fault), priors, nuisances={})
    assert found.chosen.noise == "normal"
    best = found.chosen.optimum
    assert chi2.sf(best.chi2, best.dof) < 0.01


def test_residuals_that_follow_one_another_are_seen(rows_of):
    o = scan(rows_of, 1.5)
    generator = np.random.default_rng(0)
    z = [robust.serial_z(generator.standard_normal(len(o)), o) for _ in range(400)]
    assert abs(np.mean(z)) < 4 / np.sqrt(400) + 0.05
    assert np.std(z) == pytest.approx(1, abs=0.15)
    bent = np.cos(np.radians(4 * o.theta_deg))
    assert robust.serial_z(bent, o) > 3
    # Whatever the order in which rows come.
    order = generator.permutation(len(o))
    assert robust.serial_z(bent[order], o.select(order)) == pytest.approx(robust.serial_z(bent, o))
