"""Normal scores of the priors, and the shear that straightens ridges in them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from reflectance_fit.inference import ladder, models, search
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.inference.scores import Scores
from reflectance_fit.inference.shear import shear_at
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances

ALL = {
    "angle_offset_deg": 0.5,
    "dark_offset": 0.01,
    "diffuse": 0.01,
    "source_dolp": 0.02,
    "source_azimuth_deg": np.inf,
    "analyzer_offset_deg": 1.0,
    "diattenuation": 0.005,
}


@pytest.fixture(scope="module")
def scene(rows_of, priors):
    """Glass through an analyzer at four angles, every nuisance free; the source is a little polarized."""
    generator = np.random.default_rng(11)
    theta = np.linspace(25.0, 80.0, 12)
    r = reflectances(np.cos(np.radians(theta)), 1.5, 0.0)
    parts = []
    for analyzer in (0.0, 45.0, 90.0, 135.0):
        share = np.cos(np.radians(analyzer)) ** 2
        value = 0.5 * (1.01 * r.s * share + 0.99 * r.p * (1 - share)) + 0.004
        sigma = 0.005 * value
        parts.append(
            rows_of(
                theta, "signal", value + sigma * generator.standard_normal(len(theta)), sigma=sigma,
                gain_group="lamp", analyzer_deg=analyzer,
            )
        )  # fmt: skip
    o = concatenate(parts)
    rows = pack(o, 1.0)
    model = models.build("conductor", rows, priors, ALL, [])
    return model, rows, search.find(model, rows, gain_names(o))[1]


def nuisance_draws(model, count=20_000):
    scores = Scores(model)
    z = np.random.default_rng(3).standard_normal((count, len(model.names)))
    z[:, :2] = [0.4, 0.1]
    return scores, z


def test_standard_normal_scores_are_draws_of_the_priors(scene):
    model, *_ = scene
    scores, z = nuisance_draws(model)
    x = scores.to_model(z)
    for j, prior in enumerate(model.priors):
        if not scores.scored[j]:
            np.testing.assert_array_equal(x[:, j], z[:, j])
            continue
        low, high = (prior.low - prior.mean) / prior.sigma, (prior.high - prior.mean) / prior.sigma
        law = (
            stats.uniform(prior.low, prior.high - prior.low)
            if prior.kind == "uniform"
            else stats.truncnorm(low, high, prior.mean, prior.sigma)
        )
        assert stats.kstest(x[:, j], law.cdf).pvalue > 1e-3, model.names[j]


def test_scores_come_back_far_into_the_tails(scene):
    model, *_ = scene
    scores, z = nuisance_draws(model, 2000)
    z[:, 2:] = np.clip(2 * z[:, 2:], -5, 5)
    back = scores.from_model(scores.to_model(z))
    # Near a half-normal's bound x keeps an absolute error of 1e-16, its score a larger one.
    np.testing.assert_allclose(back, z, atol=1e-6)


def test_the_log_density_of_scores_is_that_of_the_coordinates_with_the_jacobian(scene):
    """One score at a time: dx/dz by differences."""
    model, *_ = scene
    scores, z = nuisance_draws(model, 50)
    for j in range(2, len(model.names)):
        if model.names[j] in ("source_dolp", "source_azimuth_deg"):
            continue  # a pair: its law is tested above
        step = np.zeros(z.shape[1])
        step[j] = 1e-5
        rate = (scores.to_model(z + step)[:, j] - scores.to_model(z - step)[:, j]) / 2e-5
        rise = model.priors[j].log_density(scores.to_model(z)[:, j]) + np.log(rate)
        moved = z + 0.3 * np.eye(z.shape[1])[j]
        rate = (scores.to_model(moved + step)[:, j] - scores.to_model(moved - step)[:, j]) / 2e-5
        rise = model.priors[j].log_density(scores.to_model(moved)[:, j]) + np.log(rate) - rise
        np.testing.assert_allclose(rise, scores.log_prior(moved) - scores.log_prior(z), atol=1e-4)


def test_a_shear_keeps_volumes_and_inverts_its_component(scene):
    model, rows, basins = scene
    scores = Scores(model)
    log_density = ladder._log_density_of_scores(scores, rows)
    (c, *_) = ladder._components(scores, log_density, basins)
    shear = shear_at(scores, log_density, c)
    assert len(shear.slopes)
    y = np.random.default_rng(0).standard_normal((20, len(model.names)))
    y[:, 1] = np.abs(y[:, 1])
    for point in y:
        step = 1e-5 * np.eye(len(point))
        jacobian = (shear.plain(point + step) - shear.plain(point - step)) / 2e-5
        assert np.linalg.det(jacobian) == pytest.approx(1, rel=1e-3)
    carried = shear.carried(c)
    np.testing.assert_allclose(shear.plain(carried.centre[None])[0], c.centre, atol=1e-9)


def test_the_mode_of_scores_is_a_maximum(scene):
    model, rows, basins = scene
    scores = Scores(model)
    log_density = ladder._log_density_of_scores(scores, rows)
    (c, *_) = ladder._components(scores, log_density, basins)
    # Where the ridge is straight: in scores it is bent, and steps along a normal law's axes leave it.
    shear = shear_at(scores, log_density, c)
    c = shear.carried(c)
    size = len(c.centre)
    near = c.fold(c.centre + 0.25 * np.random.default_rng(1).standard_normal((2000, size)) @ c.factor.T)
    gains = log_density(shear.plain(near)) - log_density(shear.plain(c.centre[None]))
    assert gains.max() < 0.5
    # A quarter of a standard deviation in nine directions costs 0.28 on average.  On what is left of the bend, widths
    # taken over a standard deviation are up to twice those at the mode: a proposal may be too wide, but not too narrow.
    assert -1.0 < np.median(gains) < -0.1


def test_every_nuisance_free_needs_no_chains(scene):
    drawn = ladder.draw(*scene, "importance", (0,), min_ess=1000.0)
    assert drawn.method == "importance"
    assert min(drawn.ess.values()) >= 1000
    for name, prior in zip(drawn.names, scene[0].priors, strict=True):
        values = drawn.samples[name]
        assert values.min() >= prior.low
        assert values.max() <= prior.high


def test_importance_with_every_nuisance_agrees_with_emcee(scene):
    drawn = ladder.draw(*scene, "importance", (0,), min_ess=4000.0)
    reference = ladder.draw(*scene, "emcee", (0,), min_ess=1500.0)
    assert (drawn.method, reference.method) == ("importance", "emcee")
    for name in drawn.names:
        a, b = (d.flat(name) for d in (drawn, reference))
        if name == "source_azimuth_deg":  # a circle of 180 degrees
            a, b = np.cos(2 * np.radians(a)), np.cos(2 * np.radians(b))
        error = 4 * np.sqrt(1 / drawn.ess[name] + 1 / reference.ess[name])
        assert a.mean() == pytest.approx(b.mean(), abs=error * b.std()), name
        assert a.std() == pytest.approx(b.std(), rel=error), name
