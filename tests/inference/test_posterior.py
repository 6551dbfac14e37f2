"""Posterior draws against quadrature, and the judge against chains that must fail it."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.inference import ladder, models, posterior, search
from reflectance_fit.inference.likelihood import log_likelihoods
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances


@pytest.fixture(scope="module")
def absorber(rows_of, priors):
    """s and p of an absorbing plastic: eta and k correlated, k not far from 0."""
    generator = np.random.default_rng(3)
    theta = np.arange(20.0, 85.0, 5.0)
    r = reflectances(np.cos(np.radians(theta)), 1.5, 0.25)
    parts = [
        rows_of(
            theta, q, 100 * p / 2 + 0.15 * generator.standard_normal(len(theta)), sigma=0.15,
            theta_sigma=0.1, gain_group=q,
        )
        for q, p in (("signal_s", r.s), ("signal_p", r.p))
    ]  # fmt: skip
    o = concatenate(parts)
    rows = pack(o, 1.0)
    model = models.build("conductor", rows, priors, {}, [])
    _, basins = search.find(model, rows, gain_names(o))
    return model, rows, basins


def draw(absorber, seed):
    model, rows, basins = absorber
    candidates = ladder.candidates(model, rows, basins, np.random.default_rng(0))
    return posterior.sample(model, rows, candidates, (seed,))


@pytest.fixture(scope="module")
def drawn(absorber):
    return draw(absorber, 0)


def test_emcee_equals_grid_quadrature(absorber, drawn):
    model, rows, _ = absorber
    eta = np.linspace(1.40, 1.60, 301)
    k = np.linspace(0.0, 0.6, 301)
    # Uniform in log(eta), the coordinate of its prior.
    grid = np.stack(np.meshgrid(np.log(eta), k, indexing="ij"), axis=-1).reshape(-1, 2)
    log_density = log_likelihoods(rows, model.full(grid)) + model.log_prior(grid)
    weight = np.exp(log_density - log_density.max()).reshape(len(eta), len(k)) / eta[:, None]
    weight /= weight.sum()
    for name, values, share in (("eta", eta, weight.sum(axis=1)), ("k", k, weight.sum(axis=0))):
        mean = values @ share
        sd = np.sqrt((values - mean) ** 2 @ share)
        draws = drawn.flat(name)
        # Four Monte Carlo standard errors of the mean; of an sd, about the same over sqrt(2).
        error = 4 / np.sqrt(drawn.ess[name])
        assert draws.mean() == pytest.approx(mean, abs=error * sd)
        assert draws.std() == pytest.approx(sd, rel=error)


def test_the_run_says_how_far_to_trust_it(drawn):
    assert drawn.converged
    assert min(drawn.ess.values()) >= posterior.MIN_ESS
    assert max(drawn.chains.rhat_nested.values()) <= posterior.MAX_RHAT
    assert drawn.chains.steps >= posterior.STEPS_PER_TAU * drawn.chains.tau[-1]
    assert (
        drawn.samples["eta"].shape == drawn.log_density.shape == (len(drawn.ensemble), posterior.KEPT_DRAWS)
    )
    assert drawn.ensembles == posterior.ENSEMBLES
    assert np.all(drawn.samples["k"] >= 0)


def test_equal_seeds_give_equal_draws(absorber, drawn):
    again = draw(absorber, 0)
    np.testing.assert_array_equal(again.samples["eta"], drawn.samples["eta"])
    other = draw(absorber, 1)
    assert not np.array_equal(other.samples["eta"], drawn.samples["eta"])


def test_trapped_ensembles_do_not_pass(absorber):
    """Four ensembles in two modes agree within themselves; only nested R-hat sees it."""
    model, *_ = absorber
    chains = np.random.default_rng(1).standard_normal((4 * 32, 400, 2))
    ess, rhat = posterior._diagnose(model, chains)
    assert max(rhat.values()) < posterior.MAX_RHAT
    assert min(ess.values()) > 0.5 * 4 * 32 * 400
    chains[: 2 * 32] += 4.0
    _, trapped = posterior._diagnose(model, chains)
    assert min(trapped.values()) > 1.5
