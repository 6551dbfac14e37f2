"""The likelihood of rows with outliers, compiled: noise of Student's t with 4 degrees of freedom.

The stated sigma is the t's scale.  Rows are independent, so this is not for
rows with errors in the angle.  The gain of a group is no longer normal given
the rest: its mode G is found by reweighting from the weighted median, and the
integral over it is Laplace's,

    log L = sum_i log t4(u_i) / sigma_i - 1/2 log h + log E[1/g] + const,   u_i = (y_i - b_i - G f_i) / sigma_i,

h the curvature of -sum log t4 in g at G.  A saturated row keeps its normal law.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.censored import log_normal_cdf
from reflectance_fit.inference.rows import Rows
from reflectance_fit.physics.jit import kernel, shared

FloatArray = NDArray[np.float64]

NU = (
    4.0  # heavy tails with a finite variance; Lange, Little and Taylor (JASA 84 (1989) 881) find 4 to do well
)
_LOG_T = math.log(0.375)  # of the density at 0
_ROUNDS = 300


@kernel
def gain_mode(
    rows: Rows, g: int, f: FloatArray, target: FloatArray, sigma: FloatArray, skip: int, start: float
) -> tuple[float, float]:
    """Mode and curvature of gain ``g``'s law, row ``skip`` left out; from the weighted median where start is NaN."""
    gain = start
    if math.isnan(gain):
        # By insertion: numpy's sort would take longer to compile than all of this.
        ratios, weights = np.empty(len(f)), np.empty(len(f))
        count, half, below = 0, 0.0, 0.0
        for i in range(len(f)):
            if rows.gain[i] == g and not rows.censored[i] and i != skip and f[i] > 0:
                ratio, j = target[i] / f[i], count
                while j > 0 and ratios[j - 1] > ratio:
                    ratios[j], weights[j] = ratios[j - 1], weights[j - 1]
                    j -= 1
                ratios[j], weights[j] = ratio, f[i] / sigma[i]
                half += 0.5 * f[i] / sigma[i]
                count += 1
        if count == 0:
            return math.nan, 0.0
        for j in range(count):
            below += weights[j]
            if below >= half:
                gain = ratios[j]
                break
    for _ in range(_ROUNDS):
        top, bottom, curvature = 0.0, 0.0, 0.0
        for i in range(len(f)):
            if rows.gain[i] != g or rows.censored[i] or i == skip:
                continue
            u2 = ((target[i] - gain * f[i]) / sigma[i]) ** 2
            weight, w = (NU + 1) / (NU + u2), (f[i] / sigma[i]) ** 2
            top += weight * f[i] * target[i] / sigma[i] ** 2
            bottom += weight * w
            curvature += (NU + 1) * (NU - u2) / (NU + u2) ** 2 * w
        if not bottom > 0:
            return math.nan, 0.0
        last, gain = gain, top / bottom
        if abs(gain - last) <= 1e-14 * abs(gain):
            break
    return gain, curvature


@shared
def _log_t(u: float) -> float:
    return _LOG_T - 0.5 * (NU + 1) * math.log1p(u * u / NU)


@kernel
def evaluate_heavy_tailed(
    rows: Rows,
    f: FloatArray,
    target: FloatArray,
    sigma: FloatArray,
    whitened: FloatArray,
    spread: FloatArray,
    gains: FloatArray,
) -> tuple[float, float, float]:
    """As ``likelihood.evaluate``: -2 sum log t4(u) / t4(0), log det and the log of the gain integral.

    ``whitened`` are the signed roots of the terms of the first.  What -2 log
    t4(0) exceeds log 2 pi by is in log det, so that deviances of normal and
    heavy-tailed noise compare.
    """
    log_integral = 0.0
    variance = np.empty(rows.gains)
    for g in range(rows.gains):
        gains[g], curvature = gain_mode(rows, g, f, target, sigma, -1, math.nan)
        if not (gains[g] > 0 and curvature > 0):
            return math.nan, 0.0, 0.0
        variance[g] = 1 / curvature
        u2 = min(variance[g] / gains[g] ** 2, 0.04)
        log_integral += math.log(1 + u2 * (1 + u2 * (3 + 15 * u2))) - math.log(gains[g])
        log_integral -= 0.5 * math.log(curvature)
    chi2, log_det = 0.0, 0.0
    for i in range(len(f)):
        g = rows.gain[i]
        residual = target[i] - (gains[g] * f[i] if g >= 0 else 0.0)
        spread[i] = sigma[i]
        if rows.censored[i]:
            open_gain = f[i] ** 2 * variance[g] if g >= 0 else 0.0
            log_det -= 2 * log_normal_cdf(-residual / math.sqrt(sigma[i] ** 2 + open_gain))
            whitened[i] = 0.0
            continue
        term = (NU + 1) * math.log1p((residual / sigma[i]) ** 2 / NU)
        whitened[i] = math.copysign(math.sqrt(term), residual)
        chi2 += term
        log_det += 2 * math.log(sigma[i]) - 2 * _LOG_T - math.log(2 * math.pi)
    return chi2, log_det, log_integral


@kernel
def foretold_heavy_tailed(
    rows: Rows, f: FloatArray, target: FloatArray, sigma: FloatArray, gains: FloatArray, out: FloatArray
) -> None:
    """log p(y_i | the other rows) of each row: the gain's law from the others added to the t's scale."""
    for i in range(len(f)):
        if rows.censored[i]:
            continue
        g = rows.gain[i]
        residual, scale = target[i], sigma[i]
        if g >= 0:
            gain, curvature = gain_mode(rows, g, f, target, sigma, i, gains[g])
            if not curvature > 0:
                continue
            residual -= gain * f[i]
            scale = math.sqrt(sigma[i] ** 2 + f[i] ** 2 / curvature)
        out[i] = _log_t(residual / scale) - math.log(scale)
