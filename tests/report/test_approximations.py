"""The table of approximations: errors against exact Fresnel, and what each costs."""

import numpy as np
import pytest

from reflectance_fit.physics.fresnel import r0, reflectances
from reflectance_fit.report import cost
from reflectance_fit.report.approximations import schlick_errors

NAMES = ["r0_constant", "schlick", "lecture_conductor", "exact"]
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
            now[0] += seconds * (100 if len(calls) == 5 else 1)

        return function

    monkeypatch.setattr(cost.time, "perf_counter", lambda: now[0])
    costs = cost.nanoseconds_per_evaluation({"a": takes("a", 2e-4), "b": takes("b", 1e-3)})
    assert costs == pytest.approx({"a": 10.0, "b": 50.0})
    # Interleaved, so that a machine that slows down slows both.
    assert calls[:4] == ["a", "b", "a", "b"]


def test_real_costs_are_positive():
    costs = {row.name: row.ns_per_eval for row in schlick_errors(1.5, 0.0, timed=True).approximations}
    assert set(costs) == set(NAMES)
    assert all(value > 0 for value in costs.values())
