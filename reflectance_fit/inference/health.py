"""R_p = R_s^2 at 45 degrees: an absolute scale, and a check that needs no standard.

Azzam's relation r_s^2 - r_p = cos(2 theta) (r_s - r_s r_p) holds for every
interface, whatever its index.  At 45 degrees absolute reflectances of s and p
must obey R_p = R_s^2, and signals c R_s, c R_p of one gain give that gain,
c = (c R_s)^2 / (c R_p).  What breaks it is the calibration or stray light, not
the material.  Rows within a degree of 45 are brought there by the model's own
R_p / R_s^2, which is near 1 and hardly depends on the index.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.examination import Health
from reflectance_fit.inference.point import at_best, background_of
from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

CHECK = "rp_equals_rs_squared"
REACH_DEG = 1.0
_SAME_DEG = 1e-6
_STEP_DEG = 1e-3


def healths(fit: Fit) -> tuple[Health, ...]:
    """One per angle near 45 degrees at which s and p can be told apart on one scale."""
    if not np.any(np.abs(fit.observations.theta_deg - 45.0) <= REACH_DEG):
        return ()
    info = at_best(fit)
    o = fit.observations
    sigma = info.rows.sigma
    value = o.value - background_of(info)
    return tuple(_check(fit, o, value, sigma, s, p, scale) for s, p, scale in _pairs(o))


def _pairs(o: Observations) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp], float]]:
    """Rows of s, rows of p, and what turns them into gain times reflectance; at one angle, of one scale."""
    s, p, factor = _axes(o)
    near = np.abs(o.theta_deg - 45.0) <= REACH_DEG
    for group in np.unique(o.gain_group[near]):
        # A gain of this angle alone follows the model by construction.
        if group and np.ptp(o.theta_deg[o.gain_group == group]) <= 2 * REACH_DEG:
            continue
        for angle in np.unique(o.theta_deg[near & (o.gain_group == group)]):
            here = near & (o.gain_group == group) & (np.abs(o.theta_deg - angle) <= _SAME_DEG)
            for scale in (1.0, 2.0):
                rows_s, rows_p = (np.flatnonzero(here & axis & (factor == scale)) for axis in (s, p))
                if len(rows_s) and len(rows_p):
                    yield rows_s, rows_p, scale


def _axes(o: Observations) -> tuple[NDArray[np.bool_], NDArray[np.bool_], FloatArray]:
    """Which rows see s alone, which p alone, and the factor from a row to gain times reflectance."""
    s = np.isin(o.quantity, [Quantity.REFLECTANCE_S, Quantity.SIGNAL_S])
    p = np.isin(o.quantity, [Quantity.REFLECTANCE_P, Quantity.SIGNAL_P])
    # An analyzer passes half of unpolarized light.
    unpolarized = np.all(o.light[:, 1:] == 0, axis=1) & (o.diattenuation == 1) & np.isnan(o.retarder_deg)
    signal = (o.quantity == Quantity.SIGNAL) & unpolarized & ~np.isnan(o.analyzer_deg)
    turned = np.mod(np.nan_to_num(o.analyzer_deg), 180.0)
    along_s = np.minimum(turned, 180.0 - turned) <= _SAME_DEG
    along_p = np.abs(turned - 90.0) <= _SAME_DEG
    return s | (signal & along_s), p | (signal & along_p), np.where(signal, 2.0, 1.0)


def _check(
    fit: Fit,
    o: Observations,
    value: FloatArray,
    sigma: FloatArray,
    rows_s: NDArray[np.intp],
    rows_p: NDArray[np.intp],
    scale: float,
) -> Health:
    theta = float(o.theta_deg[rows_s[0]])
    offset = fit.optimum.parameters.get("angle_offset_deg", 0.0)
    bend, slope = (_bend(fit, theta + offset + step) for step in (0.0, _STEP_DEG))
    slope = (slope - bend) / _STEP_DEG
    (s, var_s), (p, var_p) = (_mean(value[rows], sigma[rows], scale) for rows in (rows_s, rows_p))
    gain_group = str(o.gain_group[rows_s[0]])
    gain = fit.optimum.gains[gain_group] if gain_group else 1.0
    # Compared as p against s^2: p may be 0, and its noise is normal where that of s^2 / p is not.
    expected = bend * s * s / gain
    shift = slope * s * s / gain * float(o.theta_deg_sigma[rows_s[0]])
    spread = math.sqrt(var_p + (2 * bend * s / gain) ** 2 * var_s + shift**2)
    z = (p - expected) / spread
    if not gain_group:
        return Health(CHECK, theta, p, expected, z)
    return Health(CHECK, theta, bend * s * s / p if p > 0 else math.inf, gain, z)


def _mean(value: FloatArray, sigma: FloatArray, scale: float) -> tuple[float, float]:
    """Weighted mean of equal rows and its variance."""
    weight = 1 / sigma**2
    return scale * float(weight @ value / weight.sum()), scale**2 / float(weight.sum())


def _bend(fit: Fit, theta_deg: float) -> float:
    """R_p / R_s^2 of the fitted index: 1 at 45 degrees."""
    index = fit.optimum.eta / fit.exterior_ior, fit.optimum.k / fit.exterior_ior
    power = reflectances(math.cos(math.radians(theta_deg)), *index)
    return float(power.p / power.s**2)
