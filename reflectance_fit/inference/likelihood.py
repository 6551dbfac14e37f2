"""The likelihood, compiled: gains integrated out, errors in both coordinates.

For the rows of one fit, y = g f(theta) + b + noise, with

* g one unknown gain per gain group (1 where a row is absolute), prior 1/g,
* b dark offset and diffuse light,
* noise of covariance S = diag(sigma^2) + sum_a sigma_theta^2 v_a v_a^T: the
  angle of goniometer setting a is off by one common error, which moves its
  rows by v = dy/dtheta (linearised).

f is linear in g, so for given eta, k and nuisances the gains have a normal
conditional: mean G from generalised least squares, precision N = F^T S^-1 F.
Integrating over them with the prior 1/g leaves

    log L = -1/2 (chi2 + log det S + log det N) + sum_j log E[1/g_j] + const,

E[1/g] = (1 + u^2 + 3 u^4 + 15 u^6) / G with u the gain's relative standard
deviation: the asymptotic series, to 0.05 % at u = 0.2.  v needs g, hence a
short fixed-point iteration; its error is second order in sigma_theta.

A saturated row says y >= L only.  Over its noise and over what the other rows
leave open of its gain, that has the probability

    Phi((G f + b - L) / sqrt(sigma^2 + f^2 var(g) + sigma_theta^2 v^2)),

a factor of the likelihood; several such rows of one gain count as independent.
Rows that are said to be heavy-tailed have the noise of ``student`` instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.censored import log_normal_cdf
from reflectance_fit.inference.cholesky import cholesky_solve, inverse_diagonal
from reflectance_fit.inference.forward import FIRST_SIGMA, at_angle, background, reflect_all, turns_of
from reflectance_fit.inference.rows import DELTA, Rows
from reflectance_fit.inference.student import evaluate_heavy_tailed
from reflectance_fit.physics.jit import kernel, shared

FloatArray = NDArray[np.float64]

_STEP = 1e-6  # radians; central difference, error about 1e-10 relative
_ROUNDS = 4  # of the fixed point in the gains; each gains a factor of order (sigma_theta v / sigma)^2 / N


@shared
def design(
    rows: Rows, p: FloatArray, f: FloatArray, slope: FloatArray, target: FloatArray, sigma: FloatArray
) -> bool:
    """Fill model, slope, target and sigma of every row; False where an angle leaves [0, 90) degrees."""
    code, theta_sigma, value_of = rows.code, rows.theta_sigma, rows.value
    gain_of, estimated, stated = rows.gain, rows.estimated, rows.sigma
    turns, reflected = turns_of(p), np.empty((6, len(f)))
    reflect_all(rows, p, turns, reflected)
    for i in range(len(f)):
        c, s = reflected[0, i], reflected[1, i]
        if not c > 0:
            return False
        f[i], slope[i], below = 0.0, 0.0, 0.0
        # Then a step to either side, whose cosine is 1 but for step^2 / 2, the same on both.
        for side in range(3 if theta_sigma[i] > 0 else 1):
            step = 0.0 if side == 0 else (-_STEP if side == 1 else _STEP)
            value = at_angle(rows, i, max(c - s * step, 0.0), s + c * step, p, turns, reflected, side == 0)
            if side == 0:
                f[i] = value
            elif side == 1:
                below = value
            else:
                rise = value - below
                if code[i] == DELTA:
                    rise = (rise + 180.0) % 360.0 - 180.0
                slope[i] = rise / (2 * _STEP)
        sigma[i] = stated[i] if estimated[i] < 0 else math.exp(p[FIRST_SIGMA + estimated[i]])
        if gain_of[i] >= 0:
            target[i] = value_of[i] - background(rows, i, p)
        else:
            # What is left after the model, as gains do not touch it; Delta is a circle.
            target[i] = value_of[i] - background(rows, i, p) - f[i]
            if code[i] == DELTA:
                target[i] = (target[i] + 180.0) % 360.0 - 180.0
    return True


@shared
def evaluate_normal(
    rows: Rows, p: FloatArray, whitened: FloatArray, spread: FloatArray, gains: FloatArray
) -> tuple[float, float, float]:
    """`evaluate` for normal noise, as kernels call it."""
    n = len(rows.value)
    # Taken out of the tuple once: in a loop each time costs two atomic counts.
    gain_of, censored, setting, theta_sigma = rows.gain, rows.censored, rows.setting, rows.theta_sigma
    # Few arrays, as each costs as much as a row or two.
    of_rows = np.empty((4, n))
    f, slope, target, sigma = of_rows[0], of_rows[1], of_rows[2], of_rows[3]
    if not design(rows, p, f, slope, target, sigma):
        return math.nan, 0.0, 0.0
    of_gains = np.zeros((rows.gains + 2, rows.gains))
    normal, rhs, variance = of_gains[2:], of_gains[0], of_gains[1]
    settings = rows.settings if rows.errors_in_angle else 0
    of_settings = np.zeros((3 + rows.gains, settings))
    pull = of_settings[0]  # sum of v t / sigma^2
    steepness = of_settings[1]  # sum of v^2 / sigma^2
    share = of_settings[2]  # sigma_theta^2 / (1 + sigma_theta^2 steepness)
    coupling = of_settings[3:]  # sum of f v / sigma^2, of each gain
    log_det_normal = 0.0
    for turn in range(_ROUNDS if rows.errors_in_angle else 1):
        for g in range(rows.gains):
            rhs[g] = 0.0
            for h in range(rows.gains):
                normal[g, h] = 0.0
        for a in range(settings if turn > 0 else 0):
            pull[a], steepness[a], share[a] = 0.0, 0.0, 0.0
            for g in range(rows.gains):
                coupling[g, a] = 0.0
        for i in range(n):
            if censored[i]:
                continue
            g, w = gain_of[i], 1 / sigma[i] ** 2
            if g >= 0:
                normal[g, g] += w * f[i] * f[i]
                rhs[g] += w * f[i] * target[i]
            if turn > 0 and theta_sigma[i] > 0:
                a = setting[i]
                v = slope[i] * (gains[g] if g >= 0 else 1.0)
                pull[a] += w * v * target[i]
                steepness[a] += w * v * v
                if g >= 0:
                    coupling[g, a] += w * v * f[i]
        if turn > 0:
            for i in range(n):
                a = setting[i]
                share[a] = theta_sigma[i] ** 2 / (1 + theta_sigma[i] ** 2 * steepness[a])
            for a in range(settings):
                for g in range(rows.gains):
                    rhs[g] -= share[a] * coupling[g, a] * pull[a]
                    for h in range(rows.gains):
                        normal[g, h] -= share[a] * coupling[g, a] * coupling[h, a]
        for g in range(rows.gains):
            gains[g] = rhs[g]
        log_det_normal = cholesky_solve(normal, gains)
        if math.isnan(log_det_normal):
            return math.nan, 0.0, 0.0

    log_integral = 0.0
    for g in range(rows.gains):
        if not gains[g] > 0:
            return math.nan, 0.0, 0.0
        variance[g] = inverse_diagonal(normal, g, rhs)
        u2 = min(variance[g] / gains[g] ** 2, 0.04)
        log_integral += math.log(1 + u2 * (1 + u2 * (3 + 15 * u2))) - math.log(gains[g])
    log_integral -= 0.5 * log_det_normal

    # Residuals, then the square root of the rank-one correction of each setting.
    log_det = 0.0
    for a in range(settings):
        pull[a], steepness[a], share[a] = 0.0, 0.0, 0.0
    for i in range(n):
        g = gain_of[i]
        residual = target[i] - (gains[g] * f[i] if g >= 0 else 0.0)
        v = slope[i] * (gains[g] if g >= 0 else 1.0)
        spread[i] = math.sqrt(sigma[i] ** 2 + (theta_sigma[i] * v) ** 2)
        if censored[i]:
            open_gain = f[i] ** 2 * variance[g] if g >= 0 else 0.0
            log_det -= 2 * log_normal_cdf(-residual / math.sqrt(spread[i] ** 2 + open_gain))
            whitened[i], slope[i] = 0.0, 0.0
            continue
        whitened[i] = residual / sigma[i]
        log_det += 2 * math.log(sigma[i])
        if rows.errors_in_angle:
            slope[i] = v / sigma[i]
            pull[setting[i]] += slope[i] * whitened[i]
            steepness[setting[i]] += slope[i] * slope[i]
    if rows.errors_in_angle:
        for i in range(n):
            a = setting[i]
            widened = theta_sigma[i] ** 2 * steepness[a]
            if widened > 0:
                whitened[i] -= (1 - 1 / math.sqrt(1 + widened)) * pull[a] / steepness[a] * slope[i]
                if share[a] == 0:
                    log_det += math.log1p(widened)
                    share[a] = 1.0  # counted
    chi2 = 0.0
    for i in range(n):
        chi2 += whitened[i] * whitened[i]
    return chi2, log_det, log_integral


@kernel
def _normal_terms(
    rows: Rows, vectors: FloatArray, whitened: FloatArray, spread: FloatArray, gains: FloatArray
) -> FloatArray:
    """The terms of `evaluate` of each vector, shape (D, 3).  ``whitened`` and ``spread`` have a line each, or one for all."""
    out = np.empty((len(vectors), 3))
    for d in range(len(vectors)):
        line = d % len(whitened)
        found = evaluate_normal(rows, vectors[d], whitened[line], spread[line], gains[d])
        out[d, 0], out[d, 1], out[d, 2] = found
    return out


@kernel
def _heavy_tailed_terms(
    rows: Rows, vectors: FloatArray, whitened: FloatArray, spread: FloatArray, gains: FloatArray
) -> FloatArray:
    n = len(rows.value)
    out = np.full((len(vectors), 3), math.nan)
    f, slope, target, sigma = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for d in range(len(vectors)):
        line = d % len(whitened)
        if design(rows, vectors[d], f, slope, target, sigma):
            found = evaluate_heavy_tailed(rows, f, target, sigma, whitened[line], spread[line], gains[d])
            out[d, 0], out[d, 1], out[d, 2] = found
    return out


def terms(rows: Rows, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`evaluate` of D full parameter vectors: its three terms, shape (D, 3), and the gains, shape (D, G)."""
    gains = np.empty((len(vectors), rows.gains))
    scratch = np.empty((2, 1, len(rows.value)))
    return _terms_of(rows)(rows, vectors, scratch[0], scratch[1], gains), gains


def _terms_of(rows: Rows) -> Callable[[Rows, FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]:
    # Apart, as few fits ask for heavy tails and every kernel takes seconds to compile.
    return _heavy_tailed_terms if rows.heavy_tailed else _normal_terms


def whitened_residuals(rows: Rows, vectors: FloatArray) -> FloatArray:
    """The whitened residuals of each full parameter vector, shape (D, N); NaN outside of the model's domain."""
    whitened, spread = np.empty((2, len(vectors), len(rows.value)))
    found = _terms_of(rows)(rows, vectors, whitened, spread, np.empty((len(vectors), rows.gains)))
    whitened[~np.isfinite(found[:, 0])] = np.nan
    return whitened


def evaluate(
    rows: Rows, p: FloatArray, whitened: FloatArray, spread: FloatArray, gains: FloatArray
) -> tuple[float, float, float]:
    """chi2, log det S and the log of the gain integral for one full parameter vector.

    Fills ``whitened`` (N residuals whose squares sum to chi2), ``spread`` (each
    row's standard deviation, its angle's share included) and ``gains``.
    Censored rows have residual 0; minus twice their log probability, which is
    never negative, is added to log det S.  chi2 is NaN where the parameters
    are outside of the model's domain.
    """
    found = _terms_of(rows)(rows, p[None], whitened[None], spread[None], gains[None])
    chi2, log_det, log_integral = found[0].tolist()
    return chi2, log_det, log_integral


def log_likelihoods(rows: Rows, vectors: FloatArray) -> FloatArray:
    """Log marginal likelihood of each full parameter vector, shape (D,); -inf outside of the domain."""
    chi2, log_det, log_integral = terms(rows, vectors)[0].T
    value = log_integral - 0.5 * (chi2 + log_det)
    return np.where(np.isfinite(value), value, -np.inf)


def deviances(rows: Rows, vectors: FloatArray) -> FloatArray:
    """-2 log likelihood at the best gains, up to the constant of the stated sigmas; NaN outside."""
    chi2, log_det, _ = terms(rows, vectors)[0].T
    return np.asarray(chi2 + log_det - stated_log_det(rows))


def stated_log_det(rows: Rows) -> float:
    """log det of the stated sigmas."""
    return 2 * float(np.log(rows.sigma[(rows.estimated < 0) & ~rows.censored]).sum())
