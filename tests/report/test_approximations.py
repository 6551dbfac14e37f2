"""The table of approximations: errors against exact Fresnel, and what each costs."""

import numpy as np
import pytest

from reflectance_fit.physics.fresnel import r0, reflectances
from reflectance_fit.report import cost
from reflectance_fit.report.approximations import schlick_errors

NAMES = [
    *("r0_constant", "schlick", "schlick_real_r0", "lazanyi", "f82"),
    *("lecture_conductor", "gulbrandsen", "table", "exact"),
]
THETA = np.linspace(0, np.pi / 2, 20_001)


def by_name(eta: float, k: float) -> dict:
    return {row.name: row for row in schlick_errors(eta, k, timed=False).approximations}


@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.0), (1.33, 0.0), (2.4, 0.0), (0.18, 3.43), (3.2, 3.3)])
def test_errors_against_a_plain_scan(eta, k):
    """Largest error, where, and RMS over angle, by the textbook formula on 20,001 angles."""
    cosine = np.cos(THETA)
    exact = reflectances(np.clip(cosine, 0, 1), eta, k).mean
    normal = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    difference = normal + (1 - normal) * (1 - cosine) ** 5 - exact
    errors = schlick_errors(eta, k, timed=False)
    worst = np.argmax(np.abs(difference))
    assert errors.max_abs_error == pytest.approx(abs(difference[worst]), rel=1e-4)
    assert errors.at_deg == pytest.approx(np.degrees(THETA[worst]), abs=0.1)
    assert errors.rms_error == pytest.approx(np.sqrt(np.mean(difference**2)), rel=1e-2)
    assert errors.max_rel_error == pytest.approx(np.max(np.abs(difference) / exact), rel=1e-3)


def test_glass():
    """Schlick is 0.036 too low near 85 degrees for eta = 1.5, and 7 % of its albedo."""
    errors = schlick_errors(1.5, 0.0, timed=False)
    assert errors.max_abs_error == pytest.approx(0.0357, abs=5e-5)
    assert errors.at_deg == pytest.approx(85.0, abs=0.1)
    assert errors.albedo_error == pytest.approx(-0.066, abs=1e-3)


def test_every_approximation_has_a_row_and_exact_is_exact():
    rows = by_name(1.5, 0.2)
    assert list(rows) == NAMES
    assert rows["exact"].max_abs_error == rows["exact"].rms_error == rows["exact"].albedo_error == 0
    assert rows["r0_constant"].max_abs_error == pytest.approx(1 - float(r0(1.5, 0.2)), rel=1e-6)


def test_schlicks_own_figures_are_its_row():
    errors = schlick_errors(1.7, 0.1, timed=False)
    row = next(row for row in errors.approximations if row.name == "schlick")
    assert errors.model_dump(exclude={"approximations"}) == row.model_dump(exclude={"name", "ns_per_eval"})


def test_matched_indices_have_no_relative_error():
    """R = 0 everywhere but at 90 degrees: infinite relative errors are null, never .inf."""
    errors = schlick_errors(1.0, 0.0, timed=False)
    assert errors.max_rel_error is None
    assert np.isfinite(errors.max_abs_error)


# --- the posterior's spread


def normal_draws(eta: float, sd: float, k: float = 0.0, sd_k: float = 0.0) -> tuple:
    rng = np.random.default_rng(1)
    return eta + sd * rng.standard_normal(20_000), k + sd_k * rng.standard_normal(20_000)


def test_without_draws_there_is_no_spread():
    errors = schlick_errors(1.5, 0.0, timed=False)
    assert errors.max_abs_error_posterior is None
    assert {row.max_abs_error_posterior for row in errors.approximations} == {None}


@pytest.mark.parametrize(("eta", "k", "sd"), [(1.5, 0.0, 0.002), (0.2, 3.4, 0.003), (3.2, 3.3, 0.01)])
def test_the_spread_is_the_slope_times_that_of_eta(eta, k, sd):
    """To first order; sd from 200 draws is itself known to 5 %, 20 % is four times that."""
    errors = schlick_errors(eta, k, timed=False, draws=normal_draws(eta, sd, k))
    above, below = (schlick_errors(eta + step, k, timed=False) for step in (sd, -sd))
    for row, up, down in zip(*(e.approximations for e in (errors, above, below)), strict=True):
        spread = row.max_abs_error_posterior
        slope = abs(up.max_abs_error - down.max_abs_error) / 2
        if row.name != "table":  # its worst cell changes
            assert spread.sd == pytest.approx(slope, rel=0.2, abs=1e-9)
            assert spread.median == pytest.approx(row.max_abs_error, abs=0.4 * slope + 1e-9)
            assert spread.ci95[1] - spread.ci95[0] == pytest.approx(3.92 * slope, rel=0.3, abs=1e-9)
        assert spread.ci95[0] <= spread.ci68[0] <= spread.median <= spread.ci68[1] <= spread.ci95[1]


def test_draws_that_are_all_alike_have_the_errors_of_one():
    draws = np.full(50, 0.2), np.full(50, 3.4)
    for row in schlick_errors(0.2, 3.4, timed=False, draws=draws).approximations:
        spread = row.max_abs_error_posterior
        assert spread.sd <= 1e-12
        assert spread.ci95 == pytest.approx([row.max_abs_error] * 2, rel=1e-6)


# --- costs


def test_cost_is_measured_only_when_asked_for():
    assert {row.ns_per_eval for row in schlick_errors(1.5, 0.0, timed=False).approximations} == {None}


def test_costs_are_medians_in_nanoseconds_a_value(monkeypatch):
    """A clock that a call moves on by a known time; one slow round must not matter."""
    now = [0.0]
    calls = []

    def takes(name, seconds):
        def function(cosines):
            calls.append(name)
            assert (cosines.min(), cosines.max()) == (0, 1)
            now[0] += seconds * (100 if len(calls) == 6 else 1)

        return function

    monkeypatch.setattr(cost.time, "perf_counter", lambda: now[0])
    costs = cost.nanoseconds_per_evaluation({"a": takes("a", 1e-4), "b": takes("b", 5e-4)})
    assert costs == pytest.approx({"a": 10.0, "b": 50.0})
    # Interleaved, so that a machine that slows down slows both; each call timed follows one that is not.
    assert calls[:8] == ["a", "a", "b", "b", "a", "a", "b", "b"]


def test_real_costs_are_positive():
    costs = {row.name: row.ns_per_eval for row in schlick_errors(1.5, 0.0, timed=True).approximations}
    assert set(costs) == set(NAMES)
    assert all(value > 0 for value in costs.values())
