"""Importance sampling and Laplace's approximation against densities that are known."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.inference import importance, ladder, laplace, models, posterior, proposal, search, shear
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances

WIDE = np.array([[-50.0, 50.0], [-50.0, 50.0]])


def normal(centre, covariance):
    """Log density of a normal law, up to a constant."""
    precision = np.linalg.inv(covariance)
    return lambda x: -0.5 * np.einsum("ni,ij,nj->n", x - centre, precision, x - centre)


def one(log_density, x, width, ranges=WIDE):
    mass, component = laplace.at_basin(log_density, np.array(x), np.array(width), ranges)
    return mass, component


def test_laplace_is_exact_for_a_normal_law_however_narrow_its_ridge():
    sd, rho = np.array([1e-4, 3.0]), 0.9999
    covariance = np.outer(sd, sd) * np.array([[1, rho], [rho, 1]])
    # The conditional widths, all that a search along the axes can tell, are 70 times smaller.
    width = sd * np.sqrt(1 - rho**2)
    mass, component = one(normal([1.0, -2.0], covariance), [1.0, -2.0], width)
    np.testing.assert_allclose(component.covariance, covariance, rtol=1e-6)
    assert mass == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1], abs=1e-6)
    assert np.isnan(component.bounds).all()


def test_resampling_takes_each_draw_as_often_as_its_weight_says():
    """Systematic: within one of weight times count, in every chain; in expectation exactly that."""
    generator = np.random.default_rng(8)
    count, n = 50, 4 * 30
    weights = generator.exponential(size=n) ** 3
    weights[:5] = 0.0
    numbers = np.arange(n, dtype=float)
    batch = importance._Batch(numbers[:, None], -numbers, weights / weights.sum(), 0.0)
    expected = count * batch.by_chain
    total, runs = np.zeros_like(expected), 2000
    for _ in range(runs):
        x, density = batch.equal(count, generator)
        assert x.shape == (4, count, 1)
        np.testing.assert_array_equal(density, -x[..., 0])
        assert np.array_equal(
            np.sort(x[..., 0].astype(int) // 30), np.repeat(np.arange(4)[:, None], count, 1)
        )
        times = np.bincount(x.ravel().astype(int), minlength=n).reshape(4, -1)
        assert np.all(np.abs(times - expected) < 1 + 1e-9)
        total += times
    # A fraction r of a draw comes with variance r (1 - r); five standard errors.
    np.testing.assert_allclose(total / runs, expected, atol=5 * 0.5 / np.sqrt(runs))


def test_the_proposal_s_density_integrates_to_one_on_its_side_of_a_bound():
    covariance = np.array([[0.04, 0.01], [0.01, 0.09]])
    ranges = np.array([[0.0, 9.0], [-50.0, 50.0]])
    _, component = one(normal([0.1, 1.0], covariance), [0.1, 1.0], [0.2, 0.3], ranges)
    assert component.bounds[0] == 0.0
    assert np.isnan(component.bounds[1])
    a, b = np.linspace(0, 9, 901), np.linspace(-20, 22, 2101)
    grid = np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1).reshape(-1, 2)
    density = np.exp(proposal.log_pdf([component], grid)[0]).reshape(len(a), len(b))
    # A t with 5 degrees of freedom leaves a part in 1e5 beyond the grid.
    assert np.trapezoid(np.trapezoid(density, b), a) == pytest.approx(1, abs=1e-4)
    drawn = proposal.draw([component], 4000, np.random.default_rng(0))
    assert (drawn[:, 0] >= 0).all()
    # The density of the draws: a share of them in a box.
    box = (grid[:, 0] < 0.2) & (np.abs(grid[:, 1] - 1) < 0.3)
    expected = np.sum(density.ravel()[box]) * (a[1] - a[0]) * (b[1] - b[0])
    found = np.mean((drawn[:, 0] < 0.2) & (np.abs(drawn[:, 1] - 1) < 0.3))
    assert found == pytest.approx(expected, abs=4 * np.sqrt(0.25 / 4000))


@pytest.mark.parametrize("upper", [False, True])
def test_draws_of_a_law_cut_off_at_a_bound(upper):
    """A normal law with its centre on the bound is half of itself: mean sqrt(2 / pi), sd sqrt(1 - 2 / pi)."""
    ranges = np.array([[-50.0, 0.0] if upper else [0.0, 50.0], [-50.0, 50.0]])

    def log_density(x):
        inside = (x >= ranges[:, 0]).all(axis=1) & (x <= ranges[:, 1]).all(axis=1)
        return np.where(inside, -0.5 * np.sum(x**2, axis=1), -np.inf)

    _, component = one(log_density, [0.0, 0.0], [0.7, 1.3], ranges)
    drawn = importance.importance(log_density, [component], ranges, np.random.default_rng(1), min_ess=4000.0)
    assert drawn.trusted
    assert drawn.ess >= 4000
    first, second = np.abs(drawn.x[..., 0]).ravel(), drawn.x[..., 1].ravel()
    error = 4 / np.sqrt(drawn.ess)
    assert first.mean() == pytest.approx(np.sqrt(2 / np.pi), abs=error * 0.6)
    assert first.std() == pytest.approx(np.sqrt(1 - 2 / np.pi), rel=error)
    assert second.mean() == pytest.approx(0, abs=error)
    plain = importance.laplace(log_density, [component], np.random.default_rng(2), count=20_000)
    assert np.abs(plain.x[..., 0]).mean() == pytest.approx(np.sqrt(2 / np.pi), abs=error * 0.6)


def test_both_of_two_basins_get_their_share():
    left, right = normal([-6.0, 0.0], np.eye(2)), normal([6.0, 0.0], 0.25 * np.eye(2))

    def log_density(x):
        return np.logaddexp(left(x), right(x))  # masses 4 to 1

    found = [one(log_density, centre, [0.5, 0.5]) for centre in ([-6.0, 0.0], [6.0, 0.0])]
    components = proposal.mixture([m for m, _ in found], [c for _, c in found])
    drawn = importance.importance(log_density, components, WIDE, np.random.default_rng(3), min_ess=4000.0)
    assert drawn.trusted
    assert np.mean(drawn.x[..., 0] < 0) == pytest.approx(0.8, abs=4 * 0.4 / np.sqrt(drawn.ess))
    assert [chain.shape for chain in drawn.x] == [(2000, 2)] * importance.CHAINS


def test_weights_that_cannot_be_trusted_are_not():
    """A Cauchy law against a proposal that thinks of its peak alone: the tail index tells."""

    def log_density(x):
        return -np.log1p(x**2).sum(axis=1)

    _, component = one(log_density, [0.0, 0.0], [0.2, 0.2])
    narrow = [proposal.component(1.0, component.centre, 0.01 * np.eye(2), WIDE)]
    k = importance._batch(log_density, narrow, 20_000, np.random.default_rng(4)).pareto_k
    assert k > importance.MAX_PARETO_K
    assert not importance.Draws(np.zeros((4, 1, 2)), np.zeros((4, 1)), 100.0, k).trusted


@pytest.fixture(scope="module")
def glass(rows_of, priors):
    """s and p of glass through an unknown angle offset, fitted with k: k is near its bound, eta on a ridge."""
    generator = np.random.default_rng(5)
    theta = np.arange(20.0, 85.0, 5.0)
    r = reflectances(np.cos(np.radians(theta)), 1.5, 0.0)
    parts = [
        rows_of(theta, q, 100 * p + 0.1 * generator.standard_normal(len(theta)), sigma=0.1, gain_group=q)
        for q, p in (("signal_s", r.s), ("signal_p", r.p))
    ]
    o = concatenate(parts)
    rows = pack(o, 1.0)
    model = models.build("conductor", rows, priors, {"angle_offset_deg": 0.5}, [])
    _, basins = search.find(model, rows, gain_names(o))
    return model, rows, basins


def test_importance_agrees_with_emcee(glass):
    drawn = ladder.draw(*glass, "importance", (0, 0), min_ess=4000.0)
    reference = ladder.draw(*glass, "emcee", (0, 0), min_ess=4000.0)
    assert (drawn.method, reference.method) == ("importance", "emcee")
    assert drawn.chains is None
    assert drawn.pareto_k < importance.MAX_PARETO_K
    for name in drawn.names:
        a, b = drawn.flat(name), reference.flat(name)
        # Four Monte Carlo standard errors of the difference.
        error = 4 * np.sqrt(1 / drawn.ess[name] + 1 / reference.ess[name])
        assert a.mean() == pytest.approx(b.mean(), abs=error * b.std())
        assert a.std() == pytest.approx(b.std(), rel=error)
        for share in (0.05, 0.95):
            assert np.mean(a < np.quantile(b, share)) == pytest.approx(share, abs=error)


def test_laplace_agrees_where_the_posterior_is_normal(glass):
    _, rows, _ = glass
    model = models.build("dielectric", rows, {"eta": glass[0].priors[0]}, {"angle_offset_deg": 0.5}, [])
    _, basins = search.find(model, rows, ["signal_p", "signal_s"])
    drawn = ladder.draw(model, rows, basins, "laplace", (0,), min_ess=1000.0)
    reference = ladder.draw(model, rows, basins, "importance", (0,), min_ess=4000.0)
    assert drawn.method == "laplace"
    assert drawn.pareto_k is None
    for name in drawn.names:
        assert drawn.flat(name).std() == pytest.approx(reference.flat(name).std(), rel=0.06)


def test_emcee_takes_over_where_importance_sampling_fails(glass, monkeypatch):
    monkeypatch.setattr(importance, "MAX_PARETO_K", -10.0)
    monkeypatch.setattr(posterior, "MAX_STEPS", 250)
    drawn = ladder.draw(*glass, "importance", (0, 0), min_ess=100.0)
    assert drawn.method == "emcee"
    assert drawn.chains is not None


def test_a_model_driven_into_a_corner_goes_to_emcee(priors, rows_of, monkeypatch):
    """s and p exchanged, millions of sigma off: the optimum lies at corners, where no normal law resembles anything."""
    monkeypatch.setattr(posterior, "MAX_STEPS", 500)
    theta = np.linspace(20.0, 80.0, 9)
    reflected = reflectances(np.cos(np.radians(theta)), 1.9)
    observations = concatenate(
        [
            rows_of(theta, quantity, power, sigma=1e-4, gain_group="lamp")
            for quantity, power in (("signal_s", reflected.p), ("signal_p", reflected.s))
        ]
    )
    rows = pack(observations, 1.0)
    model = models.build("dielectric", rows, priors, {"angle_offset_deg": 0.5, "dark_offset": 0.01}, [])
    _, basins = search.find(model, rows, gain_names(observations))
    for method in ("importance", "laplace"):
        drawn = ladder.draw(model, rows, basins, method, (0,), min_ess=200.0)
        assert drawn.method in ("emcee", method)
        assert np.isfinite(drawn.log_density).all()


def test_equal_seeds_give_equal_draws(glass):
    first, again, other = (
        ladder.draw(*glass, "importance", seed, min_ess=500.0) for seed in ((1,), (1,), (2,))
    )
    np.testing.assert_array_equal(first.samples["eta"], again.samples["eta"])
    assert not np.array_equal(first.samples["eta"], other.samples["eta"])


def test_what_nothing_feels_is_as_wide_as_its_range():
    """A coordinate without any information beside one known to 1e-9 of its range: neither singular nor endless."""
    ranges = np.array([[0.0, 1.0], [-90.0, 90.0]])

    def log_density(x):
        inside = (x >= ranges[:, 0]).all(axis=1) & (x <= ranges[:, 1]).all(axis=1)
        return np.where(inside, -0.5 * ((x[:, 0] - 0.5) / 1e-9) ** 2, -np.inf)

    _, component = one(log_density, [0.5, 10.0], [1e-9, 40.0], ranges)
    drawn = importance.importance(log_density, [component], ranges, np.random.default_rng(6), min_ess=2000.0)
    assert drawn.trusted
    second = drawn.x[..., 1].ravel()
    error = 4 / np.sqrt(drawn.ess)
    assert second.mean() == pytest.approx(0, abs=error * 180 / np.sqrt(12))
    assert second.std() == pytest.approx(180 / np.sqrt(12), rel=error)
    assert drawn.x[..., 0].std() == pytest.approx(1e-9, rel=error)


def test_a_ridge_too_steep_to_straighten_is_not_trusted(rows_of, priors, monkeypatch):
    """Where two equations leave eta, k and sigma on a curve the sheared covariance may be singular to rounding."""

    def singular(_shear, _component):
        raise np.linalg.LinAlgError("Matrix is not positive definite")

    monkeypatch.setattr(shear.Shear, "carried", singular)
    o = rows_of(np.full(3, 50.0), "reflectance", [0.05, 0.06, 0.055], sigma=0.01)
    rows = pack(o, 1.0)
    model = models.build("dielectric", rows, priors, {}, [])
    _, basins = search.find(model, rows, gain_names(o))
    with pytest.raises(ladder.Untrusted, match="too steep"):
        ladder._proposed(model, rows, basins, "laplace", (0,), min_ess=500)
