"""The compiled likelihood against slow, literal ones: dense matrices and quadrature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from reflectance_fit.inference.forward import (
    ETA,
    FIRST_NUISANCE,
    FIRST_SIGMA,
    K,
    neutral_vector,
    predict_vectors,
)
from reflectance_fit.inference.likelihood import deviances, evaluate, log_likelihoods
from reflectance_fit.inference.rows import fitted, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.priors import NUISANCES


def vector(eta, k=0.0, offset=0.0, sigmas=()):
    p = neutral_vector(len(sigmas))
    p[[ETA, K, FIRST_NUISANCE + NUISANCES["angle_offset_deg"].index]] = eta, k, offset
    p[FIRST_SIGMA:] = np.log(sigmas)
    return p


def run(rows, p):
    n = len(rows.value)
    whitened, spread, gains = np.empty(n), np.empty(n), np.empty(rows.gains)
    return (*evaluate(rows, p, whitened, spread, gains), whitened, spread, gains)


@pytest.fixture(scope="module")
def scan(rows_of):
    """s and p of one table (shared angle errors), p of another; noise drawn once."""
    generator = np.random.default_rng(5)
    theta = np.array([25.0, 45.0, 60.0, 70.0, 78.0])
    r = reflectances(np.cos(np.radians(theta)), 1.52)
    parts = []
    for quantity, power, gain, name in (
        ("signal_s", r.s, 900.0, "0"),
        ("signal_p", r.p, 700.0, "0"),
        ("signal_p", r.p, 400.0, "1"),
    ):
        signal = gain * power / 2
        parts.append(
            rows_of(
                theta,
                quantity,
                signal + 3.0 * generator.standard_normal(5),
                sigma=3.0,
                theta_sigma=0.4,
                gain_group=f"{name}:{quantity}",
                set_name=name,
            )
        )
    return concatenate(parts)


def dense_covariance(rows, p, gains):
    """diag(sigma^2) + sigma_theta^2 v v^T for every setting, slopes by finite differences."""
    step = 1e-5
    theta = np.arctan2(rows.sin_theta, rows.cos_theta)
    up, down = (
        rows._replace(cos_theta=np.cos(theta + s), sin_theta=np.sin(theta + s)) for s in (step, -step)
    )
    slope = (predict_vectors(up, p[None], gains) - predict_vectors(down, p[None], gains))[0] / (2 * step)
    covariance = np.diag(rows.sigma**2)
    for a in range(rows.settings):
        v = np.where(rows.setting == a, slope * rows.theta_sigma, 0.0)
        covariance += np.outer(v, v)
    return covariance


def test_chi2_and_determinant_equal_dense_linear_algebra(scan):
    rows = pack(scan, 1.0)
    p = vector(1.5, offset=0.3)
    chi2, log_det, _, whitened, spread, gains = run(rows, p)
    covariance = dense_covariance(rows, p, gains)
    residual = rows.value - predict_vectors(rows, p[None], gains)[0]
    assert chi2 == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-6)
    assert log_det == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-7)
    assert whitened @ whitened == pytest.approx(chi2, rel=1e-12)
    assert spread == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-6)


def test_gains_are_the_generalised_least_squares_ones(scan):
    rows = pack(scan, 1.0)
    p = vector(1.5)
    *_, gains = run(rows, p)
    inverse = np.linalg.inv(dense_covariance(rows, p, gains))
    unit = predict_vectors(rows, p[None], np.ones(rows.gains))[0]
    design = np.zeros((len(unit), rows.gains))
    design[np.arange(len(unit)), rows.gain] = unit
    expected = np.linalg.solve(design.T @ inverse @ design, design.T @ inverse @ rows.value)
    # The fixed point's remainder, see the module's docstring.
    assert gains == pytest.approx(expected, rel=1e-5)


def test_gain_integral_equals_quadrature(rows_of):
    """One gain with prior 1/g, no angle errors: the whole integral, done by scipy."""
    o = rows_of([30.0, 50.0, 70.0], "signal_s", [20.0, 31.0, 66.0], sigma=4.0, gain_group="g")
    rows = pack(o, 1.0)

    def literal(eta):
        unit = predict_vectors(rows, vector(eta)[None], np.ones(1))[0]

        def integrand(log_gain):
            return np.exp(norm.logpdf(rows.value, np.exp(log_gain) * unit, rows.sigma).sum())

        return np.log(quad(integrand, 3.0, 9.0, epsabs=0, epsrel=1e-10, points=[5.5, 6.0])[0])

    compiled = log_likelihoods(rows, np.array([vector(1.3), vector(1.9)]))
    # Relative gain error here is 5 %; the series is good to u^8.
    assert compiled[1] - compiled[0] == pytest.approx(literal(1.9) - literal(1.3), abs=1e-5)


def test_angle_errors_equal_the_integral_over_the_true_angle(rows_of):
    """For small sigma_theta the linearised likelihood is the exact marginal one."""
    theta = np.array([50.0, 65.0])
    measured = reflectances(np.cos(np.radians(theta)), 1.5).s + np.array([0.003, -0.004])
    o = rows_of(theta, "reflectance_s", measured, sigma=0.004, theta_sigma=0.05)
    rows = pack(o, 1.0)

    def literal(eta):
        total = 0.0
        for reading, value in zip(o.theta_deg, o.value, strict=True):

            def integrand(theta, reading=reading, value=value):
                model = float(reflectances(np.cos(np.radians(theta)), eta).s)
                return norm.pdf(theta, reading, 0.05) * norm.pdf(value, model, 0.004)

            total += np.log(quad(integrand, reading - 2, reading + 2, points=[reading], epsrel=1e-10)[0])
        return total

    compiled = log_likelihoods(rows, np.array([vector(1.49), vector(1.51)]))
    exact = literal(1.51) - literal(1.49)
    assert abs(exact) > 0.1
    assert compiled[1] - compiled[0] == pytest.approx(exact, abs=1e-3)


def test_absolute_rows_equal_scipys_normal(rows_of):
    o = rows_of([50.0, 65.0], "reflectance_s", [0.09, 0.18], sigma=[0.004, 0.01])
    rows = pack(o, 1.0)
    value = log_likelihoods(rows, vector(1.5)[None])[0] - len(o) / 2 * np.log(2 * np.pi)
    mean = predict_vectors(rows, vector(1.5)[None], np.empty(0))[0]
    assert value == pytest.approx(multivariate_normal.logpdf(o.value, mean, np.diag(o.sigma**2)), rel=1e-12)


def test_delta_is_a_circle(rows_of):
    near = pack(rows_of([40.0], "delta_deg", [359.0], sigma=1.0), 1.0)
    other = pack(rows_of([40.0], "delta_deg", [-1.0], sigma=1.0), 1.0)
    p = vector(1.5, 0.5)
    assert deviances(near, p[None]) == pytest.approx(deviances(other, p[None]))


def test_an_estimated_sigma_has_its_normalisation(rows_of):
    """Without the log(sigma) term a larger sigma would always be better."""
    o = rows_of([50.0, 65.0, 75.0], "reflectance_s", [0.09, 0.18, 0.3])
    rows = pack(o, 1.0)
    grid = np.geomspace(1e-4, 1.0, 400)
    values = log_likelihoods(rows, np.array([vector(1.5, sigmas=(s,)) for s in grid]))
    residual = o.value - predict_vectors(rows, vector(1.5, sigmas=(1.0,))[None], np.empty(0))[0]
    assert grid[np.argmax(values)] == pytest.approx(np.sqrt(np.mean(residual**2)), rel=0.03)


def test_outside_of_the_domain_is_minus_infinity(rows_of):
    rows = pack(rows_of([85.0], "reflectance_s", [0.5], sigma=0.1), 1.0)
    assert log_likelihoods(rows, vector(1.5, offset=6.0)[None])[0] == -np.inf
    # A negative signal has no positive gain.
    dark = pack(rows_of([30.0, 40.0], "signal_s", [-5.0, -6.0], sigma=0.1, gain_group="g"), 1.0)
    assert log_likelihoods(dark, vector(1.5)[None])[0] == -np.inf
    assert np.isnan(deviances(dark, vector(1.5)[None])[0])


@pytest.mark.parametrize("level", [0.5, 0.98, 1.3])
def test_a_saturated_row_is_the_chance_of_reaching_its_value(rows_of, level):
    """Of one unknown gain, normal by the other rows: quadrature over it against the closed form."""
    theta = np.array([30.0, 50.0, 75.0])
    r = reflectances(np.cos(np.radians(theta)), 1.5).s
    signal = 800.0 * r / 2
    clipped = rows_of(75.0, "signal_s", level * signal[2], sigma=4.0, gain_group="g")
    clipped = replace(clipped, flag=np.array(["saturated"]))
    used = rows_of(theta[:2], "signal_s", signal[:2] + np.array([1.0, -1.5]), sigma=4.0, gain_group="g")
    rows, plain = (pack(fitted(concatenate(parts)), 1.0) for parts in ([used, clipped], [used]))
    assert rows.censored.tolist() == [False, False, True]
    for eta in (1.4, 1.6):
        f = reflectances(np.cos(np.radians(theta)), eta).s / 2
        precision = np.sum(f[:2] ** 2) / 16
        mean = np.sum(f[:2] * used.value) / 16 / precision

        def integrand(g, f=f, mean=mean, precision=precision):
            return norm.pdf(g, mean, precision**-0.5) * norm.sf(clipped.value[0], g * f[2], 4.0)

        reach = 10 * precision**-0.5
        expected = np.log(quad(integrand, mean - reach, mean + reach, epsabs=0, epsrel=1e-10)[0])
        both = [log_likelihoods(x, vector(eta)[None])[0] for x in (rows, plain)]
        assert both[0] - both[1] == pytest.approx(expected, rel=1e-8, abs=1e-12)
        assert deviances(rows, vector(eta)[None])[0] - deviances(plain, vector(eta)[None])[
            0
        ] == pytest.approx(-2 * expected, rel=1e-8, abs=1e-11)


def test_a_saturated_row_far_from_its_bound(rows_of):
    """60 standard deviations short, where the normal distribution underflows."""
    o = replace(rows_of(30.0, "reflectance_s", 0.9, sigma=0.01), flag=np.array(["saturated"]))
    other = rows_of(40.0, "reflectance_s", 0.08, sigma=0.01)
    rows, plain = (pack(fitted(concatenate(parts)), 1.0) for parts in ([other, o], [other]))
    short = (0.9 - float(reflectances(np.cos(np.radians(30.0)), 1.5).s)) / 0.01
    found = log_likelihoods(rows, vector(1.5)[None])[0] - log_likelihoods(plain, vector(1.5)[None])[0]
    assert found == pytest.approx(norm.logcdf(-short), rel=1e-6)


def test_saturated_rows_of_which_nothing_is_known_are_left_out(rows_of):
    used = rows_of(40.0, "signal_s", 0.08, sigma=0.01, gain_group="a")
    alone = replace(rows_of(40.0, "signal_s", 0.9, sigma=0.01, gain_group="b"), flag=np.array(["saturated"]))
    assert len(fitted(concatenate([used, alone]))) == 1


def test_the_unit_of_diffuse_light_is_the_largest_reading_not_a_saturated_one(rows_of):
    """A saturated value is a bound, and detectors may say anything there."""
    used = rows_of([20.0, 40.0, 60.0], "signal_s", [0.2, 0.3, 0.5], sigma=0.01, gain_group="a")
    clipped = rows_of([80.0], "signal_s", 4.0, sigma=0.01, gain_group="a")
    clipped = replace(clipped, flag=np.array(["saturated"]))
    rows = pack(fitted(concatenate([used, clipped])), 1.0)
    np.testing.assert_array_equal(rows.largest, np.full(4, 0.5))
