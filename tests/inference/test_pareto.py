"""Pareto smoothing against arviz-stats, and the law's own fit against laws of known shape."""

from __future__ import annotations

import numpy as np
import pytest
from arviz_stats.base import array_stats
from scipy import stats

from reflectance_fit.inference import pareto


@pytest.mark.parametrize("count", [25, 100, 225, 226, 1600, 20_000])
@pytest.mark.parametrize("scale", [0.01, 0.3, 1.0, 3.0, 20.0, 200.0])
@pytest.mark.parametrize("shift", [0.0, -4e4])
def test_weights_and_k_are_those_of_arviz(count, scale, shift):
    generator = np.random.default_rng([count, int(100 * scale)])
    log_weights = shift + scale * generator.standard_normal(count)
    expected, k = array_stats.psislw(-log_weights)
    weights, found = pareto.smoothed(log_weights)
    assert found == pytest.approx(float(k), rel=1e-9, abs=1e-9)
    assert weights / weights.sum() == pytest.approx(np.exp(expected), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("shape", [-0.3, 0.0, 0.4, 0.9])
def test_the_law_of_many_draws_is_found(shape):
    draws = np.sort(stats.genpareto.rvs(shape, scale=2.5, size=100_000, random_state=5))
    k, scale = pareto.generalised_pareto(draws)
    assert k == pytest.approx(shape, abs=0.02)
    assert scale == pytest.approx(2.5, rel=0.02)


def test_one_weight_that_is_all_cannot_be_trusted():
    weights, k = pareto.smoothed(np.array([0.0, *np.linspace(-9e3, -8e3, 400)]))
    assert k == np.inf
    assert weights[0] == 1
    assert not weights[1:].any()
