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
from reflectance_fit.physics.jit import kernel, shared
from reflectance_fit.physics.kernels import analyzer_signal, interface
from reflectance_fit.priors import NUISANCES

FloatArray = NDArray[np.float64]

# A full parameter vector: eta, k, Cauchy's slope d eta / d(1 / wavelength^2) in um^2, the nuisances in this
# order, then log(sigma) of each estimated sigma.
ETA, K, SLOPE, FIRST_NUISANCE = 0, 1, 2, 3
FIRST_SIGMA = FIRST_NUISANCE + len(NUISANCES)
OFFSET, DARK, DIFFUSE, SOURCE, AZIMUTH, ANALYZER, DIATTENUATION = range(FIRST_NUISANCE, FIRST_SIGMA)


# What a full parameter vector means for every row: cosine and sine of the angle offset, of
# twice the analyzer's, the source's added S1 and S2 a unit of unpolarized light, the diattenuation.
Turns = tuple[float, float, float, float, float, float, float]
# A row's light, cosine and sine of twice its analyzer's angle, its retarder and its polarizer's own diattenuation.
Optics = tuple[
    tuple[float, float, float, float], tuple[float, float], tuple[float, float, float, float], float
]


@shared
def turns_of(p: FloatArray) -> Turns:
    """The trigonometry of a vector, once for all rows."""
    cos_azimuth, sin_azimuth = _cos_sin(2 * math.radians(p[AZIMUTH]))
    return (
        *_cos_sin(math.radians(p[OFFSET])),
        *_cos_sin(2 * math.radians(p[ANALYZER])),
        p[SOURCE] * cos_azimuth,
        p[SOURCE] * sin_azimuth,
        p[DIATTENUATION],
    )


@shared
def _cos_sin(angle: float) -> tuple[float, float]:
    # Most vectors have most of their angles at 0.
    return (1.0, 0.0) if angle == 0.0 else (math.cos(angle), math.sin(angle))


@shared
def optics_of(rows: Rows, i: int) -> Optics:
    """The optics of row i, for helpers: to hand on ``rows`` itself costs more, in counts of references, than Fresnel."""
    return (
        (rows.light[i, 0], rows.light[i, 1], rows.light[i, 2], rows.light[i, 3]),
        (rows.analyzer[i, 0], rows.analyzer[i, 1]),
        (rows.retarder[i, 0], rows.retarder[i, 1], rows.retarder[i, 2], rows.retarder[i, 3]),
        rows.diattenuation[i],
    )


@shared
def seen_through(optics: Optics, turns: Turns) -> Optics:
    """A row's ``optics`` with the vector's errors: its source slightly polarized, its analyzer turned and leaking."""
    (s0, s1, s2, s3), (cos_2phi, sin_2phi), retarder, ideal = optics
    # The unpolarized part becomes polarized.
    unpolarized = s0 - math.sqrt(s1 * s1 + s2 * s2 + s3 * s3)
    return (
        (s0, s1 + unpolarized * turns[4], s2 + unpolarized * turns[5], s3),
        (cos_2phi * turns[2] - sin_2phi * turns[3], sin_2phi * turns[2] + cos_2phi * turns[3]),
        retarder,
        ideal * turns[6],
    )


@shared
def reading(code: int, optics: Optics, reflection: tuple[float, float, float, float], turns: Turns) -> float:
    """What a row of ``code`` reads of a surface with R_s, R_p and r_s conj(r_p) = ``reflection``; gain 1, no background."""
    r_s, r_p, cross_re, cross_im = reflection
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
    light, analyzer, retarder, diattenuation = seen_through(optics, turns)
    signal = analyzer_signal(reflection, light, analyzer, retarder, diattenuation)
    # signal_s and signal_p are R_s and R_p times a gain; an analyzer passes half of unpolarized light.
    return signal if code == SIGNAL else 2.0 * signal


@shared
def at_angle(
    rows: Rows, i: int, c: float, s: float, p: FloatArray, turns: Turns, reflected: FloatArray, known: bool
) -> float:
    """Row i's model value at an incidence of cosine ``c`` and sine ``s``: gain 1, no dark, no diffuse light.

    ``known``: the angle is that of ``reflected``, which `reflect_all` has filled.

    A row that averages a range of angles gets the mean of two, one standard
    deviation to either side: exact to the third moment of the range.
    """
    a, b = rows.cos_spread[i], rows.sin_spread[i]
    eta, k = p[ETA] + p[SLOPE] * rows.dispersion[i], p[K]
    optics, code, around = optics_of(rows, i), rows.code[i], rows.exterior_ior
    sides, total = 2 if b > 0 else 1, 0.0
    # One call in a loop, as it is inlined into every kernel.
    for side in range(sides):
        cc, ss = c, s
        if b > 0:
            sign = 1.0 if side == 0 else -1.0
            cc, ss = max(c * a + sign * s * b, 0.0), s * a - sign * c * b
        if known and sides == 1:
            reflection = reflected[2, i], reflected[3, i], reflected[4, i], reflected[5, i]
        else:
            reflection = interface(cc, ss, eta / around, k / around)
        total += reading(code, optics, reflection, turns)
    return total / sides if eta > 0 else math.nan


@shared
def incidence(rows: Rows, i: int, turns: Turns) -> tuple[float, float]:
    """Cosine and sine of row i's angle with the offset applied; a cosine below 0 is beyond grazing.

    A sine below 0 is the other side of the normal, where everything is the same.
    """
    c, s = rows.cos_theta[i], rows.sin_theta[i]
    return c * turns[0] - s * turns[1], s * turns[0] + c * turns[1]


@shared
def reflect_all(rows: Rows, p: FloatArray, turns: Turns, out: FloatArray) -> None:
    """Of each row cosine and sine as `incidence` has them, and what `interface` says there, in ``out`` (6, N).

    Without a branch, so that the compiler makes vector instructions of it: several rows for the price of one.
    """
    cos_theta, sin_theta, dispersion, around = (
        rows.cos_theta,
        rows.sin_theta,
        rows.dispersion,
        rows.exterior_ior,
    )
    eta, slope, k = p[ETA], p[SLOPE], p[K] / around
    for i in range(out.shape[1]):
        c = cos_theta[i] * turns[0] - sin_theta[i] * turns[1]
        s = sin_theta[i] * turns[0] + cos_theta[i] * turns[1]
        found = interface(max(c, 0.0), s, (eta + slope * dispersion[i]) / around, k)
        out[0, i], out[1, i] = c, s
        out[2, i], out[3, i], out[4, i], out[5, i] = found


@shared
def background(rows: Rows, i: int, p: FloatArray) -> float:
    """Dark offset and diffuse light of row i, in its own unit."""
    if rows.code[i] > LAST_POWER:
        return 0.0
    return float(p[DARK] + p[DIFFUSE] * rows.largest[i])


@kernel
def predict_vectors(rows: Rows, vectors: FloatArray, gains: FloatArray) -> FloatArray:
    """Every row's value, gain and background applied, for each full parameter vector: shape (D, N)."""
    n = len(rows.code)
    out, reflected = np.empty((len(vectors), n)), np.empty((6, n))
    for d in range(len(vectors)):
        p = vectors[d]
        turns = turns_of(p)
        reflect_all(rows, p, turns, reflected)
        for i in range(n):
            gain = gains[rows.gain[i]] if rows.gain[i] >= 0 else 1.0
            c, s = max(reflected[0, i], 0.0), reflected[1, i]
            out[d, i] = gain * at_angle(rows, i, c, s, p, turns, reflected, True) + background(rows, i, p)
    return out


def neutral_vector(estimated: int = 0) -> FloatArray:
    """A full parameter vector whose nuisances change nothing; eta 1.5, k 0, no dispersion, sigmas 1."""
    return np.array([1.5, 0.0, 0.0, *(n.neutral for n in NUISANCES.values()), *([0.0] * estimated)])
