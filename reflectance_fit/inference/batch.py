"""The likelihood of many parameter vectors at once, for samplers.

``likelihood`` takes one vector through all rows.  Here a block of vectors goes
through one row after the other: what a row is decides the branch, once, and
the loop over the block is plain arithmetic that the compiler turns into vector
instructions.  It serves the rows that most tables and photographs consist of
(powers, ratios and degrees of polarization, exact angles, nothing censored);
everything else goes to ``likelihood``, which defines the answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import likelihood
from reflectance_fit.inference.forward import DARK, DIATTENUATION, DIFFUSE, ETA, FIRST_SIGMA, K, turns_of
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.rows import DOLP, LAST_POWER, RATIO, REFLECTANCE, REFLECTANCE_S, SIGNAL, Rows
from reflectance_fit.physics.jit import kernel
from reflectance_fit.physics.kernels import analyzer_signal, interface

FloatArray = NDArray[np.float64]

_BLOCK = 64  # vectors: their model values of a hundred rows stay in the first level of cache
_AGREEMENT = 1e-6  # in log likelihood, absolute and relative


def log_likelihood(model: Model, rows: Rows) -> Callable[[FloatArray], FloatArray]:
    """The function from the full parameter vectors of ``model``, shape (D, M), to log likelihoods, shape (D,).

    The fast way is taken only where it gives ``likelihood``'s answer in the
    middle of the priors.
    """
    if serves(rows):
        probe = model.full(np.array([[prior.centre for prior in model.priors]]))
        expected, found = float(likelihood.log_likelihoods(rows, probe)[0]), float(blocks(rows, probe)[0])
        if math.isfinite(expected) and abs(found - expected) <= _AGREEMENT * (1 + abs(expected)):
            return lambda vectors: blocks(rows, vectors)
    return lambda vectors: likelihood.log_likelihoods(rows, vectors)


def serves(rows: Rows) -> bool:
    """Whether rows are of the kinds that `blocks` knows."""
    if rows.errors_in_angle or rows.heavy_tailed or rows.censored.any() or rows.dispersion.any():
        return False
    return bool(rows.code.max() <= DOLP)


@kernel
def _add_model(
    code: int,
    incidence: tuple[float, float],
    given: tuple[float, float, float, float],
    axis: tuple[float, float],
    retarder: tuple[float, float, float, float],
    diattenuation: float,
    block: FloatArray,
    half: float,
    out: FloatArray,
) -> None:
    """Add ``half`` of one row's reading at one angle, for every vector of a block (lines: see ``_lines``)."""
    count = out.shape[0]
    eta, k, cos_offset, sin_offset = block[0], block[1], block[2], block[3]
    c0, s0 = incidence
    if code > LAST_POWER:
        for d in range(count):
            c, s = c0 * cos_offset[d] - s0 * sin_offset[d], s0 * cos_offset[d] + c0 * sin_offset[d]
            r_s, r_p, _, _ = interface(max(c, 0.0), s, eta[d], k[d])
            out[d] += half * (r_p / r_s if code == RATIO else (r_s - r_p) / (r_s + r_p))
        return
    if code <= REFLECTANCE:
        of_s = half * (1.0 if code == REFLECTANCE_S else 0.5 if code == REFLECTANCE else 0.0)
        for d in range(count):
            c, s = c0 * cos_offset[d] - s0 * sin_offset[d], s0 * cos_offset[d] + c0 * sin_offset[d]
            r_s, r_p, _, _ = interface(max(c, 0.0), s, eta[d], k[d])
            out[d] += of_s * r_s + (half - of_s) * r_p
        return
    # signal_s and signal_p are R_s and R_p times a gain; an analyzer passes half of unpolarized light.
    scale = half if code == SIGNAL else 2.0 * half
    unpolarized = given[0] - math.sqrt(given[1] ** 2 + given[2] ** 2 + given[3] ** 2)
    for d in range(count):
        c, s = c0 * cos_offset[d] - s0 * sin_offset[d], s0 * cos_offset[d] + c0 * sin_offset[d]
        reflection = interface(max(c, 0.0), s, eta[d], k[d])
        light = (
            given[0],
            given[1] + unpolarized * block[6, d],
            given[2] + unpolarized * block[7, d],
            given[3],
        )
        analyzer = (
            axis[0] * block[4, d] - axis[1] * block[5, d],
            axis[1] * block[4, d] + axis[0] * block[5, d],
        )
        passed = analyzer_signal(reflection, light, analyzer, retarder, diattenuation * block[8, d])
        out[d] += scale * passed


@kernel
def _lines(rows: Rows, vectors: FloatArray, block: FloatArray) -> None:
    """What rows need of each vector: relative eta and k; cosine and sine of the angle offset and of twice the
    analyzer's; the source's added S1 and S2; diattenuation, dark offset, diffuse light."""
    for d in range(len(vectors)):
        p = vectors[d]
        turns = turns_of(p)
        block[0, d], block[1, d] = p[ETA] / rows.exterior_ior, p[K] / rows.exterior_ior
        for j in range(6):
            block[2 + j, d] = turns[j]
        block[8, d], block[9, d], block[10, d] = p[DIATTENUATION], p[DARK], p[DIFFUSE]


@kernel
def blocks(rows: Rows, vectors: FloatArray) -> FloatArray:
    """``likelihood.log_likelihoods`` for rows that it `serves`."""
    n, estimated = len(rows.value), vectors.shape[1] - FIRST_SIGMA
    out = np.empty(len(vectors))
    block, model, target = np.empty((11, _BLOCK)), np.empty((n, _BLOCK)), np.empty((n, _BLOCK))
    weight = np.empty((estimated + 1, _BLOCK))
    normal, gains = np.empty((rows.gains, _BLOCK)), np.empty((rows.gains, _BLOCK))
    chi2, rest = np.empty(_BLOCK), np.empty(_BLOCK)
    stated = 0.0
    for i in range(n):
        if rows.estimated[i] < 0:
            stated += 2 * math.log(rows.sigma[i])
    for first in range(0, len(vectors), _BLOCK):
        count = min(_BLOCK, len(vectors) - first)
        part = vectors[first : first + count]
        _lines(rows, part, block)
        model[:], normal[:], gains[:], chi2[:], rest[:] = 0.0, 0.0, 0.0, 0.0, -0.5 * stated
        for e in range(estimated):
            for d in range(count):
                weight[e, d] = math.exp(-2 * part[d, FIRST_SIGMA + e])
        for i in range(n):
            code, g, e = rows.code[i], rows.gain[i], rows.estimated[i]
            c, s, a, b = rows.cos_theta[i], rows.sin_theta[i], rows.cos_spread[i], rows.sin_spread[i]
            given = rows.light[i, 0], rows.light[i, 1], rows.light[i, 2], rows.light[i, 3]
            axis = rows.analyzer[i, 0], rows.analyzer[i, 1]
            retarder = rows.retarder[i, 0], rows.retarder[i, 1], rows.retarder[i, 2], rows.retarder[i, 3]
            ideal = rows.diattenuation[i]
            f, t = model[i, :count], target[i, :count]
            if b > 0:
                below, above = (c * a + s * b, s * a - c * b), (c * a - s * b, s * a + c * b)
                _add_model(code, below, given, axis, retarder, ideal, block, 0.5, f)
                _add_model(code, above, given, axis, retarder, ideal, block, 0.5, f)
            else:
                _add_model(code, (c, s), given, axis, retarder, ideal, block, 1.0, f)
            power = 1.0 if code <= LAST_POWER else 0.0
            value, largest = rows.value[i], rows.largest[i]
            for d in range(count):
                t[d] = value - power * (block[9, d] + block[10, d] * largest)
                # Beyond grazing there is no reading.
                rest[d] += 0.0 if c * block[2, d] - s * block[3, d] > 0 else -math.inf
            if e < 0:
                weight[estimated, :count] = 1 / rows.sigma[i] ** 2
            else:
                for d in range(count):
                    rest[d] -= part[d, FIRST_SIGMA + e]
            w = weight[e if e >= 0 else estimated]
            if g >= 0:
                for d in range(count):
                    normal[g, d] += w[d] * f[d] * f[d]
                    gains[g, d] += w[d] * f[d] * t[d]
        for g in range(rows.gains):
            for d in range(count):
                gains[g, d] /= normal[g, d]
                gain = gains[g, d]
                if not gain > 0:
                    rest[d] = -math.inf
                    continue
                u2 = min(1 / (normal[g, d] * gain * gain), 0.04)
                rest[d] += math.log(1 + u2 * (1 + u2 * (3 + 15 * u2))) - math.log(gain)
                rest[d] -= 0.5 * math.log(normal[g, d])
        for i in range(n):
            g, e = rows.gain[i], rows.estimated[i]
            f, t = model[i], target[i]
            if e < 0:
                weight[estimated, :count] = 1 / rows.sigma[i] ** 2
            w = weight[e if e >= 0 else estimated]
            if g >= 0:
                for d in range(count):
                    chi2[d] += w[d] * (t[d] - gains[g, d] * f[d]) ** 2
            else:
                for d in range(count):
                    chi2[d] += w[d] * (t[d] - f[d]) ** 2
        for d in range(count):
            value = rest[d] - 0.5 * chi2[d]
            out[first + d] = value if math.isfinite(value) else -math.inf
    return out
