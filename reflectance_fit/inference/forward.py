"""What the model says each row should read, compiled; the inner part of every likelihood."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.priors import NUISANCES
from reflectance_fit.inference.rows import CODES, LAST_POWER, Rows
from reflectance_fit.observations import Quantity
from reflectance_fit.physics.jit import inlined, kernel
from reflectance_fit.physics.kernels import analyzer_signal, interface

FloatArray = NDArray[np.float64]

# A full parameter vector: eta, k, the nuisances in this order, then log(sigma) of each estimated sigma.
ETA, K, FIRST_NUISANCE = 0, 1, 2
FIRST_SIGMA = FIRST_NUISANCE + len(NUISANCES)
_OFFSET, _DARK, _DIFFUSE, _DOLP, _AZIMUTH, _ANALYZER, _DIATTENUATION = range(FIRST_NUISANCE, FIRST_SIGMA)

_REFLECTANCE_S = CODES[Quantity.REFLECTANCE_S]
_REFLECTANCE_P = CODES[Quantity.REFLECTANCE_P]
_REFLECTANCE = CODES[Quantity.REFLECTANCE]
_SIGNAL_S = CODES[Quantity.SIGNAL_S]
_SIGNAL_P = CODES[Quantity.SIGNAL_P]
_SIGNAL = CODES[Quantity.SIGNAL]
_RATIO = CODES[Quantity.RATIO_PS]
_DOLP_VALUE = CODES[Quantity.DOLP]
_PSI = CODES[Quantity.PSI_DEG]


@inlined
def _at_one_angle(rows: Rows, i: int, theta: float, p: FloatArray) -> float:
    reflection = interface(theta, p[ETA] / rows.exterior_ior, p[K] / rows.exterior_ior)
    r_s, r_p, cross_re, cross_im = reflection
    code = rows.code[i]
    if code == _REFLECTANCE_S:
        return r_s
    if code == _REFLECTANCE_P:
        return r_p
    if code == _REFLECTANCE:
        return 0.5 * (r_s + r_p)
    if code == _RATIO:
        return r_p / r_s
    if code == _DOLP_VALUE:
        return (r_s - r_p) / (r_s + r_p)
    if code == _PSI:
        return math.degrees(math.atan2(math.sqrt(r_p), math.sqrt(r_s)))
    if code > _PSI:
        # rho = r_p / r_s has the phase of conj(r_s conj(r_p)), and rho = tan(psi) exp(-i Delta).
        return math.degrees(math.atan2(cross_im, cross_re)) % 360.0
    # A source that is slightly polarized: its unpolarized part becomes so.
    s0, s1, s2, s3 = rows.light[i, 0], rows.light[i, 1], rows.light[i, 2], rows.light[i, 3]
    if p[_DOLP] > 0:
        polarized = p[_DOLP] * (s0 - math.sqrt(s1 * s1 + s2 * s2 + s3 * s3))
        s1 += polarized * math.cos(2 * math.radians(p[_AZIMUTH]))
        s2 += polarized * math.sin(2 * math.radians(p[_AZIMUTH]))
    analyzer = 0.0 if code == _SIGNAL_S else 0.5 * math.pi if code == _SIGNAL_P else rows.analyzer[i]
    analyzer += math.radians(p[_ANALYZER])
    diattenuation = rows.diattenuation[i] * p[_DIATTENUATION]
    signal = analyzer_signal(
        reflection, (s0, s1, s2, s3), analyzer, rows.retarder[i], rows.retardance[i], diattenuation
    )
    # signal_s and signal_p are R_s and R_p times a gain; an analyzer passes half of unpolarized light.
    return signal if code == _SIGNAL else 2.0 * signal


@inlined
def at_angle(rows: Rows, i: int, theta: float, p: FloatArray) -> float:
    """Row i's model value at incidence ``theta`` (radians): gain 1, no dark, no diffuse light.

    A row that averages a range of angles gets the mean of two, one standard
    deviation to either side: exact to the third moment of the range.
    """
    spread = rows.theta_spread[i]
    if spread > 0:
        return 0.5 * (_at_one_angle(rows, i, theta - spread, p) + _at_one_angle(rows, i, theta + spread, p))
    return _at_one_angle(rows, i, theta, p)


@inlined
def incidence(rows: Rows, i: int, p: FloatArray) -> float:
    """Row i's angle with the offset applied; beyond the normal is the other side of it."""
    return float(abs(rows.theta[i] + math.radians(p[_OFFSET])))


@inlined
def background(rows: Rows, i: int, p: FloatArray) -> float:
    """Dark offset and diffuse light of row i, in its own unit."""
    if rows.code[i] > LAST_POWER:
        return 0.0
    return float(p[_DARK] + p[_DIFFUSE] * rows.largest[i])


@kernel
def predict_vectors(rows: Rows, vectors: FloatArray, gains: FloatArray) -> FloatArray:
    """Every row's value, gain and background applied, for each full parameter vector: shape (D, N)."""
    out = np.empty((len(vectors), len(rows.code)))
    for d in range(len(vectors)):
        p = vectors[d]
        for i in range(len(rows.code)):
            gain = gains[rows.gain[i]] if rows.gain[i] >= 0 else 1.0
            theta = min(incidence(rows, i, p), 0.5 * math.pi)
            out[d, i] = gain * at_angle(rows, i, theta, p) + background(rows, i, p)
    return out


def neutral_vector(estimated: int = 0) -> FloatArray:
    """A full parameter vector whose nuisances change nothing; eta 1.5, k 0, sigmas 1."""
    return np.array([1.5, 0.0, *(n.neutral for n in NUISANCES.values()), *([0.0] * estimated)])
