"""What the model says each row should read, compiled; the inner part of every likelihood."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.rows import (
    DOLP,
    LAST_POWER,
    PSI,
    RATIO,
    REFLECTANCE,
    REFLECTANCE_P,
    REFLECTANCE_S,
    SIGNAL,
    Rows,
)
from reflectance_fit.physics.jit import inlined, kernel
from reflectance_fit.physics.kernels import analyzer_signal, interface
from reflectance_fit.priors import NUISANCES

FloatArray = NDArray[np.float64]

# A full parameter vector: eta, k, Cauchy's slope d eta / d(1 / wavelength^2) in um^2, the nuisances in this
# order, then log(sigma) of each estimated sigma.
ETA, K, SLOPE, FIRST_NUISANCE = 0, 1, 2, 3
FIRST_SIGMA = FIRST_NUISANCE + len(NUISANCES)
OFFSET, DARK, DIFFUSE, SOURCE, AZIMUTH, ANALYZER, DIATTENUATION = range(FIRST_NUISANCE, FIRST_SIGMA)


# What a full parameter vector means for every row: cosine and sine of the angle offset, of
# twice the analyzer's, and the source's added S1 and S2 a unit of unpolarized light.
Turns = tuple[float, float, float, float, float, float]


@inlined
def turns_of(p: FloatArray) -> Turns:
    """The trigonometry of a vector, once for all rows."""
    offset, analyzer = math.radians(p[OFFSET]), 2 * math.radians(p[ANALYZER])
    azimuth = 2 * math.radians(p[AZIMUTH])
    return (
        math.cos(offset),
        math.sin(offset),
        math.cos(analyzer),
        math.sin(analyzer),
        p[SOURCE] * math.cos(azimuth),
        p[SOURCE] * math.sin(azimuth),
    )


@inlined
def reading(
    rows: Rows, i: int, reflection: tuple[float, float, float, float], p: FloatArray, turns: Turns
) -> float:
    """What row i reads of a surface with R_s, R_p and r_s conj(r_p) = ``reflection``; gain 1, no background."""
    r_s, r_p, cross_re, cross_im = reflection
    code = rows.code[i]
    if code == REFLECTANCE_S:
        return r_s
    if code == REFLECTANCE_P:
        return r_p
    if code == REFLECTANCE:
        return 0.5 * (r_s + r_p)
    if code == RATIO:
        return r_p / r_s
    if code == DOLP:
        return (r_s - r_p) / (r_s + r_p)
    if code == PSI:
        return math.degrees(math.atan2(math.sqrt(r_p), math.sqrt(r_s)))
    if code > PSI:
        # rho = r_p / r_s has the phase of conj(r_s conj(r_p)), and rho = tan(psi) exp(-i Delta).
        return math.degrees(math.atan2(cross_im, cross_re)) % 360.0
    # A source that is slightly polarized: its unpolarized part becomes so.
    s0, s1, s2, s3 = rows.light[i, 0], rows.light[i, 1], rows.light[i, 2], rows.light[i, 3]
    if p[SOURCE] > 0:
        unpolarized = s0 - math.sqrt(s1 * s1 + s2 * s2 + s3 * s3)
        s1 += unpolarized * turns[4]
        s2 += unpolarized * turns[5]
    cos_2phi, sin_2phi = rows.analyzer[i, 0], rows.analyzer[i, 1]
    analyzer = (cos_2phi * turns[2] - sin_2phi * turns[3], sin_2phi * turns[2] + cos_2phi * turns[3])
    retarder = (rows.retarder[i, 0], rows.retarder[i, 1], rows.retarder[i, 2], rows.retarder[i, 3])
    diattenuation = rows.diattenuation[i] * p[DIATTENUATION]
    signal = analyzer_signal(reflection, (s0, s1, s2, s3), analyzer, retarder, diattenuation)
    # signal_s and signal_p are R_s and R_p times a gain; an analyzer passes half of unpolarized light.
    return signal if code == SIGNAL else 2.0 * signal


@inlined
def _at_one_angle(rows: Rows, i: int, c: float, s: float, p: FloatArray, turns: Turns) -> float:
    eta = p[ETA] + p[SLOPE] * rows.dispersion[i]
    if not eta > 0:
        return math.nan
    return reading(rows, i, interface(c, s, eta / rows.exterior_ior, p[K] / rows.exterior_ior), p, turns)


@inlined
def at_angle(rows: Rows, i: int, c: float, s: float, p: FloatArray, turns: Turns) -> float:
    """Row i's model value at an incidence of cosine ``c`` and sine ``s``: gain 1, no dark, no diffuse light.

    A row that averages a range of angles gets the mean of two, one standard
    deviation to either side: exact to the third moment of the range.
    """
    a, b = rows.cos_spread[i], rows.sin_spread[i]
    sides, total = 2 if b > 0 else 1, 0.0
    # One call in a loop, as it is inlined into every kernel.
    for side in range(sides):
        cc, ss = c, s
        if b > 0:
            sign = 1.0 if side == 0 else -1.0
            cc, ss = max(c * a + sign * s * b, 0.0), s * a - sign * c * b
        total += _at_one_angle(rows, i, cc, ss, p, turns)
    return total / sides


@inlined
def incidence(rows: Rows, i: int, turns: Turns) -> tuple[float, float]:
    """Cosine and sine of row i's angle with the offset applied; a cosine below 0 is beyond grazing.

    A sine below 0 is the other side of the normal, where everything is the same.
    """
    c, s = rows.cos_theta[i], rows.sin_theta[i]
    return c * turns[0] - s * turns[1], s * turns[0] + c * turns[1]


@inlined
def background(rows: Rows, i: int, p: FloatArray) -> float:
    """Dark offset and diffuse light of row i, in its own unit."""
    if rows.code[i] > LAST_POWER:
        return 0.0
    return float(p[DARK] + p[DIFFUSE] * rows.largest[i])


@kernel
def predict_vectors(rows: Rows, vectors: FloatArray, gains: FloatArray) -> FloatArray:
    """Every row's value, gain and background applied, for each full parameter vector: shape (D, N)."""
    out = np.empty((len(vectors), len(rows.code)))
    for d in range(len(vectors)):
        p = vectors[d]
        turns = turns_of(p)
        for i in range(len(rows.code)):
            gain = gains[rows.gain[i]] if rows.gain[i] >= 0 else 1.0
            c, s = incidence(rows, i, turns)
            out[d, i] = gain * at_angle(rows, i, max(c, 0.0), s, p, turns) + background(rows, i, p)
    return out


def neutral_vector(estimated: int = 0) -> FloatArray:
    """A full parameter vector whose nuisances change nothing; eta 1.5, k 0, no dispersion, sigmas 1."""
    return np.array([1.5, 0.0, 0.0, *(n.neutral for n in NUISANCES.values()), *([0.0] * estimated)])
