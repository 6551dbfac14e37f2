"""The heavy-tailed likelihood against scipy's t law and quadrature, and what choosing it does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.stats import norm, t

from reflectance_fit.inference import leave_one_out
from reflectance_fit.inference.forward import FIRST_SIGMA, neutral_vector, predict_vectors
from reflectance_fit.inference.likelihood import deviances, evaluate, log_likelihoods
from reflectance_fit.inference.rows import pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances


def vector(eta, k=0.0, sigmas=()):
    p = neutral_vector(len(sigmas))
    p[:2] = eta, k
    p[FIRST_SIGMA:] = np.log(sigmas)
    return p


def heavy(o):
    return pack(o, 1.0)._replace(heavy_tailed=True)


@pytest.fixture(scope="module")
def spoilt(rows_of):
    """A scan of one signal with two gross outliers."""
    generator = np.random.default_rng(1)
    theta = np.arange(20.0, 80.0, 5.0)
    signal = 400.0 * reflectances(np.cos(np.radians(theta)), 1.5).s
    value = signal + 4.0 * generator.standard_normal(len(theta))
    value[[3, 9]] += [60.0, -90.0]
    return rows_of(theta, "signal_s", value, sigma=4.0, gain_group="g")


def unit(rows, p):
    return predict_vectors(rows, p[None], np.ones(rows.gains))[0]


def test_the_gain_is_the_mode_of_the_t_likelihood(spoilt):
    rows, p = heavy(spoilt), vector(1.52)
    n = len(spoilt)
    rooted, spread, gains = np.empty(n), np.empty(n), np.empty(1)
    chi2, *_ = evaluate(rows, p, rooted, spread, gains)
    f = unit(rows, p)

    def misfit(gain):
        return -t.logpdf(spoilt.value, 4, gain * f, spoilt.sigma).sum()

    best = minimize_scalar(misfit, (0.9 * gains[0], 1.1 * gains[0]), tol=1e-12)
    assert gains[0] == pytest.approx(best.x, rel=1e-6)
    assert np.sum(rooted**2) == pytest.approx(chi2)
    u = (spoilt.value - gains[0] * f) / spoilt.sigma
    assert chi2 == pytest.approx(-2 * np.sum(t.logpdf(u, 4) - t.logpdf(0, 4)))
    assert np.array_equal(np.sign(rooted), np.sign(u))


def test_absolute_rows_equal_scipys_t_and_compare_with_normal_noise(rows_of):
    o = rows_of([50.0, 65.0], "reflectance_s", [0.09, 0.21], sigma=[0.004, 0.01])
    p = vector(1.5)
    mean = predict_vectors(heavy(o), p[None], np.empty(0))[0]
    expected = t.logpdf(o.value, 4, mean, o.sigma).sum() - norm.logpdf(o.value, mean, o.sigma).sum()
    both = [log_likelihoods(rows, p[None])[0] for rows in (heavy(o), pack(o, 1.0))]
    assert both[0] - both[1] == pytest.approx(expected, rel=1e-12)
    both = [deviances(rows, p[None])[0] for rows in (heavy(o), pack(o, 1.0))]
    assert both[0] - both[1] == pytest.approx(-2 * expected, rel=1e-12)


def test_an_estimated_scale_is_the_ts(rows_of):
    o = rows_of([50.0, 65.0, 75.0], "reflectance_s", [0.09, 0.18, 0.9])
    mean = predict_vectors(heavy(o), vector(1.5, sigmas=(1.0,))[None], np.empty(0))[0]
    values = log_likelihoods(heavy(o), np.array([vector(1.5, sigmas=(s,)) for s in (0.01, 0.1)]))
    literal = [t.logpdf(o.value, 4, mean, s).sum() for s in (0.01, 0.1)]
    assert values[1] - values[0] == pytest.approx(literal[1] - literal[0], rel=1e-12)


def test_the_gain_integral_is_close_to_quadrature(spoilt):
    """Laplace's integral over the gain: differences between eta to a few hundredths."""
    rows = heavy(spoilt)

    def literal(eta):
        f = unit(rows, vector(eta))

        def integrand(log_gain):
            return np.exp(t.logpdf(spoilt.value, 4, np.exp(log_gain) * f, 4.0).sum() + 50)

        return np.log(
            quad(integrand, 5.7, 6.3, epsabs=0, epsrel=1e-9, points=[5.9, 5.95, 6.0, 6.05], limit=200)[0]
        )

    found = log_likelihoods(rows, np.array([vector(1.45), vector(1.55)]))
    assert found[1] - found[0] == pytest.approx(literal(1.55) - literal(1.45), abs=0.05)


def test_outliers_hardly_move_the_gain(spoilt):
    """Within a standard deviation of what the other rows say; normal noise is two off."""
    sound = spoilt.select(np.delete(np.arange(len(spoilt)), [3, 9]))
    gains = []
    for rows in (pack(sound, 1.0), heavy(spoilt), pack(spoilt, 1.0)):
        n = len(rows.value)
        gains.append(np.empty(1))
        evaluate(rows, vector(1.5), np.empty(n), np.empty(n), gains[-1])
    sd = 4.0 / np.sqrt(np.sum(unit(pack(sound, 1.0), vector(1.5)) ** 2))
    assert abs(gains[1] - gains[0]) < sd
    assert abs(gains[2] - gains[0]) > 2 * sd


def test_a_row_is_foretold_by_the_t_law_of_the_others(spoilt):
    """Against the integral over the gain, whose law is the others'."""
    rows, p = heavy(spoilt), vector(1.5)
    found = leave_one_out.pointwise(rows, p[None])[0]
    f = unit(rows, p)
    log_gain = np.linspace(np.log(350), np.log(450), 20001)
    for i in range(len(spoilt)):
        others = np.delete(np.arange(len(spoilt)), i)
        log_law = t.logpdf(spoilt.value[others, None], 4, np.exp(log_gain) * f[others, None], 4.0).sum(axis=0)
        weight = np.exp(log_law - log_law.max())
        density = t.pdf(spoilt.value[i], 4, np.exp(log_gain) * f[i], 4.0)
        expected = np.log(np.sum(weight * density) / weight.sum())
        # The others' law of the gain is taken as normal, which an outlier 22 sigma away notices.
        assert found[i] == pytest.approx(expected, rel=0.02, abs=0.05)


def test_saturated_rows_keep_their_law(rows_of, spoilt):
    o = replace(rows_of(30.0, "reflectance_s", 0.1, sigma=0.01), flag=np.array(["saturated"]))
    other = rows_of(40.0, "reflectance_s", 0.08, sigma=0.01)
    p = vector(1.5)
    short = (0.1 - float(reflectances(np.cos(np.radians(30.0)), 1.5).s)) / 0.01
    values = [log_likelihoods(heavy(concatenate(parts)), p[None])[0] for parts in ([other, o], [other])]
    assert values[0] - values[1] == pytest.approx(norm.logcdf(-short), rel=1e-9)
