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
from reflectance_fit.inference.forward import (
    DARK,
    DIATTENUATION,
    DIFFUSE,
    ETA,
    FIRST_SIGMA,
    SOURCE,
    K,
    Optics,
    optics_of,
    reading,
    turns_of,
)
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.rows import DOLP, LAST_POWER, RATIO, Rows
from reflectance_fit.physics.jit import kernel, shared
from reflectance_fit.physics.kernels import interface

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


@shared
def _reflect(c: float, s: float, crossed: bool, block: FloatArray, count: int, out: FloatArray) -> None:
    """`interface` at one angle for every vector of a block, into the lines of ``out``; the last two if ``crossed``."""
    eta, k, cos_offset, sin_offset = block[0], block[1], block[2], block[3]
    # Apart, because what is not asked for is not computed either.
    if crossed:
        for d in range(count):
            turned = c * cos_offset[d] - s * sin_offset[d], s * cos_offset[d] + c * sin_offset[d]
            found = interface(max(turned[0], 0.0), turned[1], eta[d], k[d])
            out[0, d], out[1, d], out[2, d], out[3, d] = found
    else:
        for d in range(count):
            turned = c * cos_offset[d] - s * sin_offset[d], s * cos_offset[d] + c * sin_offset[d]
            r_s, r_p, _, _ = interface(max(turned[0], 0.0), turned[1], eta[d], k[d])
            out[0, d], out[1, d] = r_s, r_p


@shared
def _read(
    code: int,
    optics: Optics,
    share: float,
    reflection: FloatArray,
    block: FloatArray,
    count: int,
    out: FloatArray,
) -> None:
    """Add ``share`` of what a row reads of ``reflection``, for every vector of a block (lines: see ``_lines``)."""
    if code == RATIO:
        for d in range(count):
            out[d] += share * (reflection[1, d] / reflection[0, d])
    elif code > LAST_POWER:
        for d in range(count):
            r_s, r_p = reflection[0, d], reflection[1, d]
            out[d] += share * ((r_s - r_p) / (r_s + r_p))
    else:
        for d in range(count):
            turns = (1.0, 0.0, block[4, d], block[5, d], block[6, d], block[7, d], block[8, d])
            found = reflection[0, d], reflection[1, d], reflection[2, d], reflection[3, d]
            out[d] += share * reading(code, optics, found, turns)


@shared
def _responses(rows: Rows, vectors: FloatArray) -> tuple[FloatArray, bool]:
    """What each row reads of each of the four numbers of a reflection alone, shape (N, 4).

    A power is linear in them; False where vectors differ in the optics and each would have its own.
    """
    found, alone = np.zeros((len(rows.code), 4)), np.eye(4)
    for d in range(1, len(vectors)):
        for j in range(SOURCE, FIRST_SIGMA):
            if vectors[d, j] != vectors[0, j]:
                return found, False
    for i in range(len(rows.code) if len(vectors) > 0 else 0):
        turns = turns_of(vectors[0])
        for part in range(4 if rows.code[i] <= LAST_POWER else 0):
            one = alone[part, 0], alone[part, 1], alone[part, 2], alone[part, 3]
            found[i, part] = reading(rows.code[i], optics_of(rows, i), one, turns)
    return found, True


@shared
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


@shared
def _by_setting(rows: Rows) -> NDArray[np.int64]:
    """The rows in an order in which those of one angle, mostly, follow one another."""
    first = np.zeros(rows.settings + 1, dtype=np.int64)
    setting = rows.setting
    for i in range(len(setting)):
        first[setting[i] + 1] += 1
    for a in range(rows.settings):
        first[a + 1] += first[a]
    order = np.empty(len(setting), dtype=np.int64)
    for i in range(len(setting)):
        order[first[setting[i]]] = i
        first[setting[i]] += 1
    return order


@kernel
def blocks(rows: Rows, vectors: FloatArray) -> FloatArray:
    """``likelihood.log_likelihoods`` for rows that it `serves`."""
    n, estimated = len(rows.value), vectors.shape[1] - FIRST_SIGMA
    # Taken out of their tuple once: in a loop each time costs two atomic counts.
    codes, gain_of, estimated_of, value, largest = (
        rows.code,
        rows.gain,
        rows.estimated,
        rows.value,
        rows.largest,
    )
    sigma, cos, sin, cos_spread, sin_spread = (
        rows.sigma,
        rows.cos_theta,
        rows.sin_theta,
        rows.cos_spread,
        rows.sin_spread,
    )
    order = _by_setting(rows)
    responses, steady = _responses(rows, vectors)
    out = np.empty(len(vectors))
    block, model = np.empty((11, _BLOCK)), np.empty((n, _BLOCK))
    reflections = np.zeros((2, 4, _BLOCK))
    weight = np.ones((estimated + 1, _BLOCK))  # the last line of stated sigmas
    normal, gains = np.empty((rows.gains, _BLOCK)), np.empty((rows.gains, _BLOCK))
    chi2, rest = np.empty(_BLOCK), np.empty(_BLOCK)
    stated, across = 0.0, False
    for i in range(n):
        if estimated_of[i] < 0:
            stated += 2 * math.log(sigma[i])
        across = across or (codes[i] <= LAST_POWER and (rows.light[i, 2] != 0 or rows.light[i, 3] != 0))
    for first in range(0, len(vectors), _BLOCK):
        count = min(_BLOCK, len(vectors) - first)
        part = vectors[first : first + count]
        _lines(rows, part, block)
        crossed = across
        for d in range(count):
            crossed = crossed or block[7, d] != 0
        model[:], normal[:], gains[:], chi2[:], rest[:] = 0.0, 0.0, 0.0, 0.0, -0.5 * stated
        for e in range(estimated):
            for d in range(count):
                weight[e, d] = math.exp(-2 * part[d, FIRST_SIGMA + e])
        before = -1
        for at in range(n):
            i = order[at]
            code, g, e = codes[i], gain_of[i], estimated_of[i]
            c, s, a, b = cos[i], sin[i], cos_spread[i], sin_spread[i]
            sides = 2 if b > 0 else 1
            if before < 0 or c != cos[before] or s != sin[before] or b != sin_spread[before]:
                for side in range(sides):
                    sign = 0.0 if sides == 1 else 1.0 - 2.0 * side
                    cc, ss = (c * a + sign * s * b, s * a - sign * c * b) if sides == 2 else (c, s)
                    _reflect(cc, ss, crossed, block, count, reflections[side])
                for d in range(count):
                    # Beyond grazing there is no reading.
                    rest[d] += 0.0 if c * block[2, d] - s * block[3, d] > 0 else -math.inf
            before = i
            f, share = model[i], 1.0 / sides
            for side in range(sides):
                found = reflections[side]
                if not steady or code > LAST_POWER:
                    _read(code, optics_of(rows, i), share, found, block, count, f)
                    continue
                of_s, of_p = share * responses[i, 0], share * responses[i, 1]
                of_re, of_im = share * responses[i, 2], share * responses[i, 3]
                for d in range(count):
                    f[d] += of_s * found[0, d] + of_p * found[1, d]
                for d in range(count if crossed else 0):
                    f[d] += of_re * found[2, d] + of_im * found[3, d]
            power = 1.0 if code <= LAST_POWER else 0.0
            y, unit = value[i], power * largest[i]
            w, scale = weight[e if e >= 0 else estimated], 1.0 if e >= 0 else 1 / sigma[i] ** 2
            if g >= 0:
                for d in range(count):
                    wf = scale * w[d] * f[d]
                    normal[g, d] += wf * f[d]
                    gains[g, d] += wf * (y - power * block[9, d] - unit * block[10, d])
            if e >= 0:
                for d in range(count):
                    rest[d] -= part[d, FIRST_SIGMA + e]
        for g in range(rows.gains):
            for d in range(count):
                gains[g, d] /= normal[g, d]
                gain = gains[g, d]
                if not gain > 0:
                    rest[d] = -math.inf
                    continue
                u2 = min(1 / (normal[g, d] * gain * gain), 0.04)
                rest[d] += math.log((1 + u2 * (1 + u2 * (3 + 15 * u2))) / (gain * math.sqrt(normal[g, d])))
        for i in range(n):
            g, e, f = gain_of[i], estimated_of[i], model[i]
            power = 1.0 if codes[i] <= LAST_POWER else 0.0
            y, unit = value[i], power * largest[i]
            w, scale = weight[e if e >= 0 else estimated], 1.0 if e >= 0 else 1 / sigma[i] ** 2
            for d in range(count):
                t = y - power * block[9, d] - unit * block[10, d]
                residual = t - (gains[g, d] * f[d] if g >= 0 else f[d])
                chi2[d] += scale * w[d] * residual * residual
        for d in range(count):
            total = rest[d] - 0.5 * chi2[d]
            out[first + d] = total if math.isfinite(total) else -math.inf
    return out
