"""A dielectric's eta from one angle of incidence by closed form, compiled: every pixel in a few nanoseconds.

In light of known S0 and S1 and without S2 and S3 every signal is linear in X = g R_s and Y = g R_p, whatever stands
before the detector, and g is free: all that the readings say of eta is in X and Y, which weighted least squares
gives.  With rho = sqrt(Y / X), sigma = 1 below Brewster's angle and -1 above,

    tan(theta_i) tan(theta_t) = (1 - sigma rho) / (1 + sigma rho) = 1 / u,   eta = sin(theta_i) / sin(theta_t),

hence eta^2 = sin^2(theta_i) (1 + u^2 tan^2(theta_i)), and u turns into 1 / u from one side to the other.  Two
unknowns and as many numbers: this is the maximum of the likelihood with the gain at its best.

Both sides fit equally.  A sample is taken for denser than what is around it where one of them is; where both are,
or neither, the pixel is ambiguous and has the one nearer to the eta that was expected.

Nothing but sums, products, divisions and square roots of one pixel at a time, each rounded as IEEE 754 has it, none
regrouped: a pixel's bits do not depend on its neighbours in a block, on tiles or on threads.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from reflectance_fit.physics.jit import apart, inlined, threaded
from reflectance_fit.pixels.rows import Float32Array, FloatArray
from reflectance_fit.pixels.status import Status

# Lanes of a block: its lines stay in the first level of cache.
_B = 256
# Lines of the buffer.
_A11, _A12, _A22, _B1, _B2, _C, _COUNT, _SIN2, _COS2 = (i * _B for i in range(9))
_LINES = 9

# X must stand out of its noise by as many sigma, as a variance.
_LIGHT = 9.0
# Readings whose weighted responses are parallel to this are one reading.
_PARALLEL = 1e-9
# Of eta: sigma beyond which an interval of +- 2 sigma is more than a quarter of the prior's range (in its logarithm).
WIDE = 0.25 * math.log(200.0) / 4

_F32 = np.float32

# As floats, like all else that a lane computes.
_IDENTIFIED, _AMBIGUOUS, _NEAR_BREWSTER, _NOT_IDENTIFIED, _TOO_FEW, _NO_LIGHT, _FIRST_REASON = (
    _F32(int(status))
    for status in (
        Status.IDENTIFIED,
        Status.AMBIGUOUS,
        Status.NEAR_BREWSTER,
        Status.NOT_IDENTIFIED,
        Status.TOO_FEW,
        Status.NO_LIGHT,
        Status.OUTSIDE,
    )
)


@inlined
def sin_cos(theta: float) -> tuple[float, float]:
    """Sine and cosine for 0 to pi/2 by their series about pi/4: to 1e-11, and in vector instructions."""
    x = theta - 0.7853981633974483
    y = x * x
    sin = x * (1 + y * (-1 / 6 + y * (1 / 120 + y * (-1 / 5040 + y * (1 / 362880 + y * (-1 / 39916800))))))
    cos = 1 + y * (
        -1 / 2 + y * (1 / 24 + y * (-1 / 720 + y * (1 / 40320 + y * (-1 / 3628800 + y * (1 / 479001600)))))
    )
    return 0.7071067811865476 * (cos + sin), 0.7071067811865476 * (cos - sin)


@threaded
def dielectric(
    values: Float32Array,
    variance: Float32Array,
    responses: FloatArray,
    theta: Float32Array,
    cos_2s: Float32Array,
    sin_2s: Float32Array,
    reason: NDArray[np.uint8],
    exterior: float,
    smallest: float,
    largest: float,
    expected: float,
    eta: Float32Array,
    sigma: Float32Array,
    chi2: Float32Array,
    dof: NDArray[np.uint16],
    status: NDArray[np.uint8],
) -> None:
    """Fill ``eta``, ``sigma``, ``chi2``, ``dof`` and ``status``, all of shape (n,).

    ``values``, ``variance`` are (m, n), ``responses`` (m, 2, 3) of R_s and R_p (`PixelRows.responses`), ``theta``,
    ``cos_2s`` and ``sin_2s`` (n,) or (1,); ``smallest`` and ``largest`` eta are the prior's,
    ``expected`` decides between two; all relative to the outside.
    """
    m, n = values.shape
    turned = len(cos_2s) > 1
    for block in prange((n + _B - 1) // _B):
        # Parts of arrays: an index that may be negative for all that numba knows keeps a loop from being vectorised.
        first = block * _B
        count = min(_B, n - first)
        last = first + count
        f = np.zeros(_LINES * _B)
        # Two frames at a time, as the sums' way to memory and back costs as much as their arithmetic.
        for j in range(0, m, 2):
            h = min(j + 1, m - 1)
            both = 1.0 if j + 1 < m else 0.0
            v, s2, v2, s22 = (
                values[j, first:last],
                variance[j, first:last],
                values[h, first:last],
                variance[h, first:last],
            )
            p, q, p2, q2 = responses[j, 0, 0], responses[j, 1, 0], responses[h, 0, 0], responses[h, 1, 0]
            if turned:
                cos, sin = cos_2s[first:last], sin_2s[first:last]
                for i in range(count):
                    c, s = np.float64(cos[i]), np.float64(sin[i])
                    one = _weighed(
                        v[i], s2[i], _turned(responses[j, 0], c, s), _turned(responses[j, 1], c, s), 1.0
                    )
                    other = _weighed(
                        v2[i], s22[i], _turned(responses[h, 0], c, s), _turned(responses[h, 1], c, s), both
                    )
                    _add(f, i, one, other)
            else:
                for i in range(count):
                    _add(f, i, _weighed(v[i], s2[i], p, q, 1.0), _weighed(v2[i], s22[i], p2, q2, both))
        if len(theta) > 1:
            angle = theta[first:last]
            for i in range(count):
                f[_SIN2 + i], f[_COS2 + i] = _squares(np.float64(angle[i]))
        else:
            squares = _squares(np.float64(theta[0]))
            for i in range(count):
                f[_SIN2 + i], f[_COS2 + i] = squares
        _solve(
            f,
            exterior,
            smallest,
            largest,
            expected,
            reason[first:last],
            eta[first:last],
            sigma[first:last],
            chi2[first:last],
            dof[first:last],
            status[first:last],
        )


@inlined
def _squares(theta: float) -> tuple[float, float]:
    s, c = sin_cos(theta)
    return s * s, c * c


@inlined
def _turned(response: FloatArray, cos: float, sin: float) -> float:
    """A response where s is at twice the angle of ``cos`` and ``sin``."""
    return float(response[0] + response[1] * cos + response[2] * sin)


_Reading = tuple[float, float, float, float, float]


@inlined
def _weighed(value: np.float32, variance: np.float32, p: float, q: float, counted: float) -> _Reading:
    """Weight, value, responses to X and Y, and 1; all but the responses 0 of what is missing or not ``counted``."""
    there = not math.isnan(value) and variance > np.float32(0)
    w = np.float64(np.float32(1) / variance) * counted if there else 0.0
    y = np.float64(value) if there else 0.0
    return w, y, p, q, counted if there else 0.0


@inlined
def _add(f: FloatArray, i: int, one: _Reading, other: _Reading) -> None:
    """Two readings into the sums of lane i: weights times the products of responses and values."""
    w, y, p, q, number = one
    w2, y2, p2, q2, number2 = other
    wp, wq, wp2, wq2 = w * p, w * q, w2 * p2, w2 * q2
    f[_A11 + i] += wp * p + wp2 * p2
    f[_A12 + i] += wp * q + wp2 * q2
    f[_A22 + i] += wq * q + wq2 * q2
    f[_B1 + i] += wp * y + wp2 * y2
    f[_B2 + i] += wq * y + wq2 * y2
    f[_C + i] += w * y * y + w2 * y2 * y2
    f[_COUNT + i] += number + number2


@apart
def _solve(
    f: FloatArray,
    exterior: float,
    smallest: float,
    largest: float,
    expected: float,
    reason: NDArray[np.uint8],
    eta: Float32Array,
    sigma: Float32Array,
    chi2: Float32Array,
    dof: NDArray[np.uint16],
    status: NDArray[np.uint8],
) -> None:
    """From a block's sums to its results.

    From rho on single precision does, in which results are kept: nothing is subtracted any more.  With a = 1 + rho
    and b = 1 - rho, u is a / b on the higher branch and b / a on the lower.
    """
    limit2, half, one, two, four = _F32(largest * largest), _F32(0.5), _F32(1), _F32(2), _F32(4)
    fourth, nan, outside = _F32(expected**4), _F32(math.nan), _F32(exterior)
    least, most = _F32(smallest), _F32(largest)
    for i in range(len(eta)):
        a11, a12, a22, b1, b2 = f[_A11 + i], f[_A12 + i], f[_A22 + i], f[_B1 + i], f[_B2 + i]
        readings = f[_COUNT + i]
        det = a11 * a22 - a12 * a12
        x = a22 * b1 - a12 * b2  # X times det
        inverse = 1 / x
        # An R_p below 0, or above R_s, is noise: the likelihood has its maximum at the edge.
        ratio = min(max((a11 * b2 - a12 * b1) * inverse, 0.0), 1.0)
        normal = a11 + ratio * (2 * a12 + ratio * a22)
        gained = b1 + ratio * b2
        rest = max(f[_C + i] - gained * gained / normal, 0.0)

        # var(Y / X), of which (1, r) A (1, r)^T det / x^2 is the closed form
        spread = np.sqrt(_F32(normal * det * inverse * inverse))
        r, s2, c2 = _F32(ratio), _F32(f[_SIN2 + i]), _F32(f[_COS2 + i])
        rho = np.sqrt(r)
        near = r < two * spread
        # Half of what the 95 % interval of r, about +- 2 spread, leaves to one side; near 0 to both signs of rho.
        edge = rho + np.sqrt(r + two * spread if near else r - two * spread)
        error = half * edge if near else spread / edge
        # b by 1 - rho^2: towards normal incidence rho is nearly 1.
        a = one + rho
        b = _F32(1 - ratio) / a
        high2 = s2 + s2 * s2 * (a * a) / (c2 * (b * b))
        low2 = s2 + s2 * s2 * (b * b) / (c2 * (a * a))
        # The higher branch leaves the prior, and by more than the noise: so does u - 2 sigma(u) = (ab - 4 error) / b^2.
        beyond = not (high2 <= limit2)
        left = a * b - four * error
        far = left > _F32(0) and left * left * (s2 * s2) > (limit2 - s2) * c2 * (b * b) * (b * b)
        excluded = beyond and far
        # Both branches above the outside's index, or neither.
        both = a * c2 < b * s2 or a * s2 < b * c2
        # Nearer to the expected in the logarithm is the lower where expected^2 is below the product.
        low = excluded or (both and (beyond or high2 * low2 > fourth))

        found = np.sqrt(low2 if low else high2)
        num, den = (b, a) if low else (a, b)
        deviation = two * (s2 * s2) * num * error / (c2 * (den * den * den) * found)
        clipped = beyond and not low
        found = most if clipped else found
        # Below the lower branch all is total reflection, r = 1.
        wide = clipped or (low and r + two * spread > one) or not (deviation <= _F32(WIDE) * found)
        wide = wide or found < least
        parallel = not (det > _PARALLEL * a11 * a22)
        dark = not (x > 0 and x * x >= _LIGHT * det * a22)
        code = _AMBIGUOUS if both and not excluded else _IDENTIFIED
        code = _NEAR_BREWSTER if near else code
        code = _NOT_IDENTIFIED if wide else code
        code = _NO_LIGHT if dark else code
        code = _TOO_FEW if parallel or readings < 2 else code
        given = _F32(reason[i])
        code = given if given > _F32(0) else code
        missing = code >= _FIRST_REASON
        eta[i] = nan if missing else found * outside
        sigma[i] = nan if missing else deviation * outside
        chi2[i] = nan if missing else _F32(rest)
        dof[i] = np.uint16(0.0 if missing else readings - 2)
        status[i] = np.uint8(code)
