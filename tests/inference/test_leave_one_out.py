"""What each row's fellows foretell of it: the compiled form against dense matrices, PSIS against refitting."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from reflectance_fit.inference import leave_one_out, models, search
from reflectance_fit.inference.forward import neutral_vector, predict_vectors
from reflectance_fit.inference.likelihood import evaluate, log_likelihoods
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances


def scan(rows_of, *, theta_sigma=0.0, seed=3, offset=0.0, noise=3.0):
    generator = np.random.default_rng(seed)
    theta = np.arange(25.0, 80.0, 5.0)
    r = reflectances(np.cos(np.radians(theta + offset)), 1.52)
    parts = [
        rows_of(
            theta,
            quantity,
            gain * power / 2 + noise * generator.standard_normal(len(theta)),
            sigma=noise,
            theta_sigma=theta_sigma,
            gain_group=quantity,
        )
        for quantity, power, gain in (("signal_s", r.s, 900.0), ("signal_p", r.p, 700.0))
    ]
    return concatenate(parts)


def vector(eta, k=0.0, offset=0.0):
    p = neutral_vector()
    p[:3] = eta, k, offset
    return p


@pytest.mark.parametrize("theta_sigma", [0.0, 0.3])
def test_the_density_of_a_row_given_the_others_equals_dense_conditioning(rows_of, theta_sigma):
    """Gains with a very wide normal prior instead of none, then the textbook conditional normal law."""
    rows = pack(scan(rows_of, theta_sigma=theta_sigma), 1.0)
    p = vector(1.49, 0.05, 0.2)
    n = len(rows.value)
    gains = np.empty(rows.gains)
    evaluate(rows, p, np.empty(n), np.empty(n), gains)
    unit = predict_vectors(rows, p[None], np.ones(rows.gains))[0]
    design = np.zeros((n, rows.gains))
    design[np.arange(n), rows.gain] = unit
    theta, step = np.arctan2(rows.sin_theta, rows.cos_theta), 1e-5
    up, down = (
        rows._replace(cos_theta=np.cos(theta + s), sin_theta=np.sin(theta + s)) for s in (step, -step)
    )
    slope = (predict_vectors(up, p[None], gains) - predict_vectors(down, p[None], gains))[0] / (2 * step)
    covariance = np.diag(rows.sigma**2) + 1e10 * design @ design.T
    for a in range(rows.settings):
        v = np.where(rows.setting == a, slope * rows.theta_sigma, 0.0)
        covariance += np.outer(v, v)
    found = leave_one_out.pointwise(rows, p[None])[0]
    for i in range(n):
        others = np.arange(n) != i
        weight = np.linalg.solve(covariance[np.ix_(others, others)], covariance[others, i])
        mean = weight @ rows.value[others]
        variance = covariance[i, i] - weight @ covariance[others, i]
        assert found[i] == pytest.approx(norm.logpdf(rows.value[i], mean, np.sqrt(variance)), abs=2e-3)


def test_a_row_that_alone_tells_its_gain_is_left_out(rows_of):
    alone = rows_of(30.0, "signal_s", 55.0, sigma=3.0, gain_group="alone")
    rows = pack(concatenate([scan(rows_of), alone]), 1.0)
    found = leave_one_out.pointwise(rows, vector(1.5)[None])[0]
    assert np.isnan(found[-1])
    assert np.all(np.isfinite(found[:-1]))


def test_smoothed_weights_equal_integrals_over_what_the_others_leave(rows_of, priors):
    """elpd_i = log int p(y_i | y_-i, eta) p(eta | y_-i) deta, on a dense grid, each posterior its own."""
    o = scan(rows_of)
    rows = pack(o, 1.0)
    model = models.build("dielectric", rows, priors, {}, [])
    _, basins = search.find(model, rows, gain_names(o))
    told = leave_one_out.foretell(model, rows, basins, (0,))
    assert told.pareto_k < 0.7
    eta = np.linspace(1.3, 1.8, 4001)
    vectors = np.array([vector(e) for e in eta])
    given = leave_one_out.pointwise(rows, vectors)
    for i in range(len(o)):
        others = pack(o.select(np.delete(np.arange(len(o)), i)), 1.0)
        posterior = log_likelihoods(others, vectors) - np.log(eta)
        weight = np.exp(posterior - posterior.max())
        expected = np.log(np.sum(weight * np.exp(given[:, i])) / weight.sum())
        assert told.elpd[i] == pytest.approx(expected, abs=0.03)


def test_a_comparison_says_which_foretells_better(rows_of, priors):
    """A scan whose angles are 1.5 degrees off: with the offset free the rows are foretold, without it not."""
    o = scan(rows_of, offset=1.5, noise=1.0)
    rows = pack(o, 1.0)
    told = []
    for nuisances in ({"angle_offset_deg": 1.0}, {}):
        model = models.build("dielectric", rows, priors, nuisances, [])
        _, basins = search.find(model, rows, gain_names(o))
        told.append(leave_one_out.foretell(model, rows, basins, (0,)))
    forward = leave_one_out.compare(told[0], told[1], "without")
    backward = leave_one_out.compare(told[1], told[0], "with")
    assert forward.elpd_difference == pytest.approx(-backward.elpd_difference)
    assert forward.agrees
    assert backward.trusted
    assert not backward.agrees
