"""Descents against minimisers of the same objective that know nothing of its structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from reflectance_fit.inference import models, search
from reflectance_fit.inference.gauss_newton import descend_all
from reflectance_fit.inference.likelihood import deviances
from reflectance_fit.inference.normal_equations import normal_equations
from reflectance_fit.inference.problem import objective, problem_of
from reflectance_fit.inference.rows import estimated_names, gain_names, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances

THETA = np.arange(20.0, 82.0, 4.0)


def table(rows_of, noise, **optics):
    generator = np.random.default_rng(4)
    r = reflectances(np.cos(np.radians(THETA)), 2.0, 1.3)
    parts = []
    for quantity, power, group in (("signal_s", 70 * r.s, "a"), ("signal_p", 90 * r.p, "b")):
        value = power * (1 + noise * generator.standard_normal(len(THETA)))
        parts.append(rows_of(THETA, quantity, value, sigma=0.01 * power.max(), gain_group=group))
    return concatenate(
        [replace(part, **{n: np.full(len(THETA), v) for n, v in optics.items()}) for part in parts]
    )


def case(rows_of, priors, kind):
    o = table(rows_of, 0.01, **({"theta_deg_sigma": 0.3} if kind == "errors of the angle" else {}))
    if kind == "estimated sigmas":
        o = replace(o, sigma=np.full(len(o), np.nan))
    rows = pack(o, 1.0)
    if kind == "censored":
        limit = np.quantile(rows.value, 0.8)
        rows = rows._replace(censored=rows.value > limit, value=np.minimum(rows.value, limit))
    model = models.build("conductor", rows, priors, {"angle_offset_deg": 0.5}, estimated_names(o))
    return model, rows, gain_names(o)


def scalar(rows, problem):
    whitened, gains = np.empty(len(rows.value)), np.empty(rows.gains)
    return lambda x: objective(rows, problem, x, whitened, gains)


@pytest.mark.parametrize("kind", ["stated", "errors of the angle", "censored", "estimated sigmas"])
def test_the_objective_is_the_deviance_and_the_penalties(rows_of, priors, kind):
    """Without the constant of the stated sigmas, so that chi2 alone is left where they are all stated."""
    model, rows, _ = case(rows_of, priors, kind)
    x = np.array([np.log(1.9), 1.2, 0.3, *(0.7 for _ in model.names[3:])])
    expected = deviances(rows, model.full(x[None]))[0] + (0.3 / 0.5) ** 2
    assert scalar(rows, problem_of(model, rows))(x) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("kind", ["stated", "errors of the angle", "censored", "estimated sigmas"])
def test_the_optimum_is_that_of_a_long_simplex_search(rows_of, priors, kind):
    model, rows, gains = case(rows_of, priors, kind)
    problem = problem_of(model, rows)
    assert problem.exact == (kind in ("stated", "estimated sigmas"))
    basin = search.find(model, rows, gains)[1][0]
    assert basin.converged
    f = scalar(rows, problem)
    options = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 20_000, "maxfev": 20_000, "adaptive": True}
    x = np.array([np.log(1.8), 1.0, 0.1, *(0.0 for _ in model.names[3:])])
    for _ in range(4):
        x = minimize(f, x, method="Nelder-Mead", options=options).x
    assert basin.objective == pytest.approx(f(x), abs=1e-6)
    assert basin.x == pytest.approx(x, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("kind", ["errors of the angle", "censored"])
def test_descents_alone_come_to_rest_where_nothing_is_lower(rows_of, priors, kind):
    """Without nlopt: their gradient is then of differences, as the normal equations lack a part of it."""
    model, rows, gains = case(rows_of, priors, kind)
    best = search.find(model, rows, gains)[1][0]
    start = best.x + np.array([[0.05, -0.1, 0.05]])
    values, rested, _, _ = descend_all(rows, problem_of(model, rows), start)
    assert rested[0]
    assert values[0] == pytest.approx(best.objective, abs=1e-6)


def test_a_descent_that_joins_another_is_not_told_twice_and_far_ones_are(rows_of, priors):
    model, rows, _ = case(rows_of, priors, "stated")
    problem = problem_of(model, rows)
    end = np.array([[np.log(2.1), 1.2, 0.0]])
    descend_all(rows, problem, end)
    values, rested, _, _ = descend_all(rows, problem, np.concatenate([end, end + 1e-3]))
    assert rested.tolist() == [True, False]
    assert np.isinf(values[1])


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_the_curvature_of_a_basin_is_half_of_the_second_differences(rows_of, priors, noise):
    """Gauss-Newton leaves out the residuals times second derivatives: nothing where residuals are small."""
    o = table(rows_of, noise)
    rows = pack(o, 1.0)
    model = models.build("conductor", rows, priors, {"angle_offset_deg": 0.5}, [])
    basin = search.find(model, rows, gain_names(o))[1][0]
    f = scalar(rows, problem_of(model, rows))
    step = 1e-2 / np.sqrt(np.diag(basin.curvature))
    found = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b = np.eye(3)[i] * step[i], np.eye(3)[j] * step[j]
            there = f(basin.x + a + b) - f(basin.x + a - b) - f(basin.x - a + b) + f(basin.x - a - b)
            found[i, j] = there / (8 * step[i] * step[j])
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert basin.curvature / scale == pytest.approx(found / scale, abs=2e-3 if noise == 0 else 1e-2)


@pytest.mark.parametrize("squared", [False, True])
def test_the_gradient_is_that_of_differences(rows_of, priors, squared):
    model, rows, _ = case(rows_of, priors, "stated")
    problem = problem_of(model, rows)
    f = scalar(rows, problem)
    x = np.array([np.log(1.7), 0.9, 0.2])
    whitened, gains = np.empty(len(rows.value)), np.empty(rows.gains)
    gradient, curvature = np.empty(3), np.empty((3, 3))
    objective(rows, problem, x, whitened, gains)
    normal_equations(rows, problem, x, squared, whitened, gains, gradient, curvature)
    expected = [(f(x + h) - f(x - h)) / 2e-5 for h in 1e-5 * np.eye(3)]
    if squared:
        expected[1] /= 2 * x[1]
    assert 2 * gradient == pytest.approx(expected, rel=1e-6)
