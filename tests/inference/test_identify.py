"""Verdicts on draws whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.inference.identify import interval
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior

ETA = Prior("log_uniform", *ETA_PRIOR)
K = Prior("uniform", *K_PRIOR)


@pytest.fixture
def generator():
    return np.random.default_rng(8)


def test_a_narrow_posterior_is_identified(generator):
    found = interval(generator.normal(1.5, 0.01, (64, 200)), ETA)
    assert found.status == "identified"
    assert found.median == pytest.approx(1.5, abs=1e-3)
    assert found.sd == pytest.approx(0.01, rel=0.03)
    assert found.ci68 == pytest.approx((1.49, 1.51), abs=1e-3)
    assert found.ci95 == pytest.approx((1.5 - 0.0196, 1.5 + 0.0196), abs=1e-3)


def test_the_prior_itself_is_not_identified(generator):
    eta = np.exp(generator.uniform(*np.log(ETA_PRIOR), 10_000))
    assert interval(eta, ETA).status == "not_identified"
    assert interval(eta, ETA).median is None
    assert interval(generator.uniform(*K_PRIOR, 10_000), K, bounded=True).status == "not_identified"


def test_draws_at_the_bound_give_an_upper_limit(generator):
    found = interval(np.abs(generator.normal(0, 0.01, 20_000)), K, bounded=True)
    assert found.status == "upper_limit"
    assert found.median is None
    assert found.ci95 == (0.0, pytest.approx(0.0196, rel=0.03))
    clear = interval(generator.normal(0.05, 0.005, 20_000), K, bounded=True)
    assert clear.status == "identified"
    # A long tail is no reason: the 2.5 % quantile is 0.15 of the median, if 0.02 of the 97.5 %.
    skew = interval(0.05 * np.exp(generator.normal(0.0, 0.97, 20_000)), K, bounded=True)
    assert skew.status == "identified"


def test_two_clusters_are_two_modes(generator):
    draws = np.concatenate([generator.normal(0.4, 0.01, 3000), generator.normal(1.9, 0.02, 1000)])
    found = interval(draws, ETA)
    assert found.status == "multimodal"
    assert found.modes == pytest.approx((0.4, 1.9), abs=0.01)
    # A few stray draws are no mode.
    strays = np.concatenate([generator.normal(0.4, 0.01, 5000), [1.9]])
    assert interval(strays, ETA).status == "identified"


@pytest.mark.parametrize("centres", [(1.0, 2.0, 3.0), (0.3, 0.5, 3.0), (0.5, 1.0, 1.5, 4.0)])
def test_every_cluster_is_a_mode_however_they_lie(generator, centres):
    """Equally spaced ones, too: no pair of them is narrower than the gap to the third."""
    draws = np.concatenate([generator.normal(c, 0.01, 500 * (i + 1)) for i, c in enumerate(centres)])
    found = interval(generator.permutation(draws), ETA)
    assert found.status == "multimodal"
    assert found.modes == pytest.approx(centres, abs=0.01)


def test_one_broad_cluster_beside_a_narrow_one_is_told_by_the_broad_one_s_width(generator):
    narrow, broad = generator.normal(1.0, 0.001, 1000), generator.uniform(1.1, 2.0, 1000)
    assert interval(np.concatenate([narrow, broad]), ETA).status == "identified"


def test_an_angle_that_does_not_exist_is_not_identified():
    assert interval(np.array([0.5, np.nan])).status == "not_identified"
