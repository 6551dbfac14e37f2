"""The inference card's own parts: a band that is too wide, or captures that share the fit's mistakes, would hide any fault."""

import math
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import kstest, norm

sys.path.append(str(Path(__file__).parent))

import inference_calibration as calibration
import inference_captures as captures
import inference_families as families
import inference_faults as faults
import inference_grid as grid
import inference_quadrature as quadrature
import inference_ranks as ranks
import inference_recovery as recovery
import inference_reference as reference
import inference_scenes as scenes
import inference_verdicts as verdicts
from card import Figure, Table

from reflectance_fit.inference import models
from reflectance_fit.inference.forward import FIRST_NUISANCE, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import pack
from reflectance_fit.priors import NUISANCES, Prior
from reflectance_fit.result import Posterior

SMALL = 40
READINGS = (
    *captures.WITH_S3,
    *(captures.Reading(q) for q in ("signal_s", "signal_p", "signal", "reflectance", "psi_deg", "delta_deg")),
)


@given(
    eta=st.floats(0.2, 4.0),
    k=st.floats(0.01, 6.0),
    offset=st.floats(-2.0, 2.0),
    analyzer=st.floats(-5.0, 5.0),
    dolp=st.floats(0.0, 0.2),
    azimuth=st.floats(-90.0, 90.0),
    diattenuation=st.floats(0.9, 1.0),
)
def test_captures_are_what_the_fit_takes_them_for(eta, k, offset, analyzer, dolp, azimuth, diattenuation):
    """Two codes, one physics: every quantity with every nuisance that turns light."""
    nuisances = {
        "angle_offset_deg": offset,
        "analyzer_offset_deg": analyzer,
        "source_dolp": dolp,
        "source_azimuth_deg": azimuth,
        "diattenuation": diattenuation,
    }
    o = captures.Design((20.0, 56.0, 80.0), READINGS, (1.0, 0.2, 0.5, 0.1)).rows()
    found = captures.reflected(o, eta, k, nuisances)
    vector = neutral_vector()
    vector[:2] = eta, k
    for name, value in nuisances.items():
        vector[FIRST_NUISANCE + NUISANCES[name].index] = value
    expected = predict_vectors(
        pack(replace(o, value=found[0] + 1.0), captures.EXTERIOR), vector[None], np.ones(1)
    )
    difference = np.where(
        o.quantity == "delta_deg", (found - expected + 180.0) % 360.0 - 180.0, found - expected
    )
    assert np.abs(difference).max() < 1e-9


def test_p_values_of_uniform_ranks_are_uniform():
    generator = np.random.default_rng(0)
    found = [ranks.p_value(generator.integers(0, ranks.BINS, 300)) for _ in range(600)]
    assert kstest(found, "uniform").pvalue > 0.01


@pytest.mark.parametrize("n", [50, 400])
def test_the_band_holds_as_often_as_it_says(n):
    """The recursion against counting."""
    generator = np.random.default_rng(1)
    limit = ranks.critical(n, 0.9)
    inside = [ranks.tightest(generator.integers(0, ranks.BINS, n)) > limit for _ in range(4000)]
    assert np.mean(inside) == pytest.approx(0.9, abs=4 * math.sqrt(0.09 / 4000))


def test_power_grows_with_n_and_is_the_level_without_an_effect(monkeypatch):
    monkeypatch.setattr(ranks, "EFFECTS", (ranks.Effect("none"), *ranks.EFFECTS))
    few, many = (ranks.power(n, 0.95, repeats=300) for n in (200, 2000))
    assert few["none"] == pytest.approx(0.05, abs=0.05)
    assert all(many[effect.name] > few[effect.name] + 0.2 for effect in ranks.EFFECTS[1:])


def test_ties_are_drawn_by_lot():
    generator = np.random.default_rng(2)
    at_bound = [ranks.rank(0.0, np.zeros(ranks.DRAWS), generator) for _ in range(2000)]
    assert ranks.p_value(np.array(at_bound)) > 0.01
    assert ranks.rank(0.5, np.linspace(0.0, 1.0, 4), generator) == 2


@pytest.mark.parametrize("family", families.FAMILIES, ids=lambda one: one.name)
def test_truths_come_from_the_priors_of_the_fit(family):
    """Each coordinate of a truth, put through its prior's distribution, is uniform."""
    generator = np.random.default_rng(3)
    truths, gains = zip(*(family.truth(generator) for _ in range(300)), strict=True)
    low, high = np.log(family.gains)
    assert kstest((np.log(gains) - low) / (high - low), "uniform").pvalue > 1e-3
    rows = pack(family.design.rows(), captures.EXTERIOR)
    model = models.build(family.model, rows, family.priors, family.nuisances, [])
    for name, prior in zip(model.names, model.priors, strict=True):
        x = prior.to_coordinate([truth[name] for truth in truths])
        bottom, top = prior.coordinate_range
        if prior.kind == "normal":
            bottom, top, x = (norm.cdf(y, prior.mean, prior.sigma) for y in (bottom, top, x))
        assert kstest((x - bottom) / (top - bottom), "uniform").pvalue > 1e-3


SPARSE = next(family for family in families.FAMILIES if family.name == "sparse angles")


@pytest.fixture(scope="module")
def healthy():
    return [calibration.trial(SPARSE, "importance", number) for number in range(SMALL)]


def test_a_healthy_fit_passes(healthy):
    assert calibration.caught(SPARSE, healthy) == ""
    found = list(calibration.coverage_figures("importance", {SPARSE.name: healthy}, [SPARSE]))
    assert [figure.verdict for figure in found[:-1]] == ["ok"] * 3
    assert len(found[-1].rows) == 3


@pytest.mark.parametrize("name", ["angles shifted", "two gains", "black level"])
def test_a_planted_fault_is_caught(name):
    (fault,) = (one for one in faults.FAULTS if one.name.startswith(name))
    assert fault.family is SPARSE
    assert calibration.caught(fault.family, [faults.planted(fault, number) for number in range(SMALL)])


def test_handedness_is_felt_by_s3_only():
    """A wrong sign of k shows in the rows behind the quarter-wave plate, nowhere else."""
    o = captures.Design((50.0, 60.0), captures.WITH_S3, captures.LINEAR_45).rows()
    right, wrong = (
        captures.reflected(o, 1.5, 0.5, {}, amplitudes)
        for amplitudes in (captures.fresnel.amplitudes, faults._conjugate)
    )
    np.testing.assert_array_equal((np.abs(right - wrong) > 1e-6)[0], np.isfinite(o.retarder_deg))


def test_intervals_too_narrow_leave_the_coverage_band():
    """The same ranks and intervals from draws that are half as wide as they should be."""
    family = families.Family("normal", SPARSE.design, "conductor", SPARSE.priors)
    generator = np.random.default_rng(4)
    o = SPARSE.design.rows()
    rows = pack(replace(o, value=o.value + 1.0), captures.EXTERIOR)
    model = models.build("conductor", rows, SPARSE.priors, {}, [])
    trials = {}
    for scale in (1.0, 0.5):
        trials[scale] = []
        for _ in range(300):
            centre = 2.0 + 0.1 * generator.standard_normal(2)
            eta, k = centre[:, None] + 0.1 * scale * generator.standard_normal((2, 500))
            judged = calibration.judged(
                family, {"eta": eta, "k": k}, {"eta": 2.0, "k": 2.0}, model, rows, generator, "none", True
            )
            trials[scale].append(judged)
    for scale, verdict in ((1.0, "ok"), (0.5, "short")):
        figures = list(calibration.coverage_figures("x", {"normal": trials[scale]}, [family]))
        assert [figure.verdict for figure in figures[:-1]] == [verdict] * 3


def drawn(marginals, model, n, *, widened=1.0, moved=0.0):
    """A posterior of independent draws from grid marginals, which for one parameter is the joint."""
    generator = np.random.default_rng(5)
    (one,) = marginals
    below = np.concatenate([[0.0], np.cumsum(np.diff(one.grid) * (one.density[1:] + one.density[:-1]) / 2)])
    x = np.interp(generator.random((100, n // 100)) * below[-1], below, one.grid)
    x = one.mean + moved * one.sd + widened * (x - one.mean)
    samples = model.samples(x[..., None])
    return Posterior(model.name, "emcee", model.names, samples, x, np.arange(100), {"eta": float(n)}, True)


@pytest.mark.parametrize(
    ("change", "good"), [({}, True), ({"widened": 1.05}, False), ({"moved": 0.1}, False)]
)
def test_the_grid_judges(change, good):
    scene = next(one for one in quadrature.SCENES if one.name == "two modes")
    scene = replace(scene, design=replace(scene.design, readings=(captures.Reading("reflectance_s"),)))
    o = scene.rows()
    model = models.build(
        "dielectric", pack(o, captures.EXTERIOR), {"eta": Prior("log_uniform", 1.2, 2.0)}, {}, []
    )
    marginals = grid.marginals(o, model, np.log(np.random.default_rng(6).uniform(1.2, 2.0, (1000, 1))))
    comparisons = quadrature.against_grid(o, model, [drawn(marginals, model, 40_000, **change)])
    assert [one.good for one in comparisons] == [good]


def test_the_gain_is_summed_as_by_an_adaptive_rule():
    scene = replace(quadrature.SCENES[1], gain=20.0)
    o = scene.rows()
    model = models.build("conductor", pack(o, captures.EXTERIOR), captures.DEFAULT_PRIORS, {}, [])
    points = np.array([[math.log(1.5), 0.1], [math.log(1.6), 0.3]])
    found = grid.log_posterior(o, model, points)
    f = captures.reflected(o, np.exp(points[:, 0]), points[:, 1], {})

    def integral(f):
        def density(g):
            return math.exp(-0.5 * float(np.sum((o.value - g * f) ** 2)) + 0.5 * len(f)) / g

        best, sd = float(f @ o.value / (f @ f)), 1 / math.sqrt(f @ f)
        return quad(density, best - 7 * sd, best + 7 * sd, epsabs=0.0, epsrel=1e-10)[0]

    assert found[1] - found[0] == pytest.approx(math.log(integral(f[1]) / integral(f[0])), abs=1e-6)


def test_recovery_meets_its_bound_and_a_biased_optimum_does_not():
    cell = ("N-BK7", "psi and Delta, 3 angles")
    errors = [recovery.recovered(*cell, number) for number in range(SMALL)]
    biased = [
        replace(one, errors={name: x + one.bounds[name] for name, x in one.errors.items()}) for one in errors
    ]
    # 40 errors know their RMSE to 11 %: four of that, and 1.41 for a bias of one bound.
    ratios = []
    for some in (errors, biased):
        figure = next(iter(recovery.recovery_figures({cell: some})))
        ratios.append(float(figure.value.split(",")[0]))
    assert ratios[0] < 1.44
    assert ratios[1] > 1.2
    assert figure.verdict == "short"


def test_nuisances_take_the_disturbances_out():
    with_them, without = (
        [recovery.disturbed(nuisances, number) for number in range(3)]
        for nuisances in (recovery.NUISANCES, {})
    )
    errors = [np.mean([abs(one.error) for one in arm]) for arm in (with_them, without)]
    assert errors[0] < errors[1]
    assert all(one.covered for one in with_them)


def test_a_metal_at_steep_angles_is_flagged_and_a_good_capture_is_not():
    assert verdicts.verdict(verdicts.METAL_STEEP, 0).flagged
    for kind in (verdicts.DIELECTRIC, verdicts.METAL, verdicts.GLASS_STEEP):
        said = verdicts.verdict(kind, 0)
        assert not said.flagged
        assert said.k_free == (kind == verdicts.METAL)


def test_verdicts_are_counted():
    def said(k_free, eta, k):
        return verdicts.Verdict("Au", k_free, eta, k, "importance")

    glass, metal = said(False, "identified", "upper_limit"), said(True, "identified", "identified")
    blind = said(True, "not_identified", "identified")
    found = {
        verdicts.DIELECTRIC: [glass] * 95 + [metal] * 5,
        verdicts.METAL: [metal] * 98 + [glass] * 2,
        verdicts.GLASS_STEEP: [glass] * 50,
        **{kind: [blind] * 9 + [metal] * (kind == verdicts.ONE) for kind in verdicts.BLIND},
    }
    figures = list(verdicts.verdict_figures(found))
    assert [figure.verdict for figure in figures[:-1]] == ["ok", "short", "short", "ok", "ok", "ok"]


def test_the_truncated_chain_is_caught():
    assert faults.truncated(0).startswith("total variation")


def test_a_fault_of_a_tenth_of_sigma_is_seen_by_the_log_likelihood():
    """What makes it the most telling rank: each of four coordinates adds to it.  By normal posteriors, no fit."""
    generator = np.random.default_rng(7)

    def p(scale, statistic):
        found = []
        for _ in range(1000):
            centre, draws = generator.standard_normal(4), scale * generator.standard_normal((ranks.DRAWS, 4))
            found.append(ranks.rank(statistic(centre), statistic(draws.T), generator))
        return ranks.p_value(np.array(found))

    likelihood = partial(np.linalg.norm, axis=0)
    assert p(1.0, likelihood) > 0.01
    assert p(1.1, likelihood) < 1 - ranks.sidak(19)


@pytest.mark.parametrize("kind", scenes.KINDS)
def test_the_reference_knows_a_scene_s_truth_and_finds_it_from_anywhere(kind):
    """Its formulas are its own, so they must agree with those that made the rows."""
    generator = np.random.default_rng(3)
    theta = np.linspace(15.0, 80.0, 12)
    for eta, k in ((1.5, 0.3), (0.4, 3.0), (2.5, 0.0)):
        s = scenes.build(eta, k, kind, theta, 0.0, generator)
        assert reference.objective(s, np.array([np.log(eta), k])) < 1e-12
        assert reference.lowest(s, 1) < 1e-9
        assert reference.objective(s, np.array([np.log(1.1 * eta), k + 0.1])) > 1


class Here:
    """In place of a pool of processes."""

    def __init__(self, *_):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    @staticmethod
    def map(job, numbers, chunksize):
        return map(job, numbers)


def test_a_line_for_every_promise(monkeypatch):
    """A card of a few captures has all figures, each once, and tables as wide as their headers."""
    scorecard = pytest.importorskip("inference")
    monkeypatch.setattr(scorecard, "ProcessPoolExecutor", Here)
    for name in scorecard.THREADS:
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(scorecard, "MATERIALS", ("N-BK7",))
    size = scorecard.Size(
        2, 1, ("sparse angles",), fault=1, cell=2, robust=2, good=2, blind=1, least_ess=500.0, scenes=1
    )
    items = list(scorecard.measured(size))
    found = [item for item in items if isinstance(item, Figure)]
    names = [item.name for item in found]
    assert len(set(names)) == len(names)
    words = (
        "ranks", "50% intervals", "80% intervals", "95% intervals", "catches a posterior", "converged",
        "effective sample size", "mean", "sd", "total variation", "faults", "without a fault", "Cramer-Rao",
        "bias of eta", "no nuisance", "k = 0", "k fitted", "one angle", "minimum only", "10 to 40", "identifiable",
    )  # fmt: skip
    assert [word for word in words if not any(word in name for name in names)] == []
    assert all(len(row) == len(item.header) for item in items if isinstance(item, Table) for row in item.rows)
