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

from reflectance_fit.physics.jit import inlined, threaded
from reflectance_fit.pixels.rows import Float32Array, FloatArray
from reflectance_fit.pixels.status import Status

# Lanes of a block: its lines stay in the first level of cache.
_B = 256
# Lines of the buffer, and those that results take over.
_A11, _A12, _A22, _B1, _B2, _C, _COUNT, _SIN2, _COS2, _CODE = (i * _B for i in range(10))
_LINES = 10
_ETA, _SIGMA, _CHI2, _DOF = _A11, _A12, _A22, _B1

# X must stand out of its noise by as many sigma, as a variance.
_LIGHT = 9.0
# Readings whose weighted responses are parallel to this are one reading.
_PARALLEL = 1e-9
# Of eta: sigma beyond which an interval of +- 2 sigma is more than a quarter of the prior's range (in its logarithm).
WIDE = 0.25 * math.log(200.0) / 4

_F32 = np.float32

# As floats, like all else in a block.
_IDENTIFIED, _AMBIGUOUS = float(Status.IDENTIFIED), float(Status.AMBIGUOUS)
_NEAR_BREWSTER, _NOT_IDENTIFIED = float(Status.NEAR_BREWSTER), float(Status.NOT_IDENTIFIED)
_TOO_FEW, _NO_LIGHT, _FIRST_REASON = float(Status.TOO_FEW), float(Status.NO_LIGHT), float(Status.OUTSIDE)


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
    for block in prange((n + _B - 1) // _B):
        first = block * _B
        count = min(_B, n - first)
        f = np.zeros(_LINES * _B)
        for j in range(m):
            v, s2 = values[j, first : first + count], variance[j, first : first + count]
            p, q = responses[j, 0, 0], responses[j, 1, 0]
            if len(cos_2s) > 1:
                pc, ps, qc, qs = (
                    responses[j, 0, 1],
                    responses[j, 0, 2],
                    responses[j, 1, 1],
                    responses[j, 1, 2],
                )
                cos, sin = cos_2s[first : first + count], sin_2s[first : first + count]
                for i in range(count):
                    c, s = np.float64(cos[i]), np.float64(sin[i])
                    _add(f, i, v[i], s2[i], p + pc * c + ps * s, q + qc * c + qs * s)
            else:
                for i in range(count):
                    _add(f, i, v[i], s2[i], p, q)
        if len(theta) > 1:
            angle = theta[first : first + count]
            for i in range(count):
                f[_SIN2 + i], f[_COS2 + i] = _squares(np.float64(angle[i]))
        else:
            one = _squares(np.float64(theta[0]))
            for i in range(count):
                f[_SIN2 + i], f[_COS2 + i] = one
        for i in range(count):
            f[_CODE + i] = np.float64(reason[first + i])
        _solve(f, count, exterior, smallest, largest, expected)
        for i in range(count):
            eta[first + i] = np.float32(f[_ETA + i])
        for i in range(count):
            sigma[first + i] = np.float32(f[_SIGMA + i])
        for i in range(count):
            chi2[first + i] = np.float32(f[_CHI2 + i])
        for i in range(count):
            dof[first + i] = np.uint16(f[_DOF + i])
        for i in range(count):
            status[first + i] = np.uint8(f[_CODE + i])


@inlined
def _squares(theta: float) -> tuple[float, float]:
    s, c = sin_cos(theta)
    return s * s, c * c


@inlined
def _add(f: FloatArray, i: int, value: np.float32, variance: np.float32, p: float, q: float) -> None:
    """One reading into the sums of lane i: its weight times the products of p, q (responses to X and Y) and value."""
    there = not math.isnan(value) and variance > np.float32(0)
    w = np.float64(np.float32(1) / variance) if there else 0.0
    y = np.float64(value) if there else 0.0
    wp, wq = w * p, w * q
    f[_A11 + i] += wp * p
    f[_A12 + i] += wp * q
    f[_A22 + i] += wq * q
    f[_B1 + i] += wp * y
    f[_B2 + i] += wq * y
    f[_C + i] += w * y * y
    f[_COUNT + i] += 1.0 if there else 0.0


@inlined
def _solve(
    f: FloatArray, count: int, exterior: float, smallest: float, largest: float, expected: float
) -> None:
    """From a block's sums to its results, in the same lines.

    Arrays of their own would have to be told apart before every block, more of them than the compiler does.  What
    sigma and status need no more than a few digits of is in single precision.  With a = 1 + rho and b = 1 - rho, u is
    a / b on the higher branch and b / a on the lower.
    """
    limit2, half, one, two, four = _F32(largest * largest), _F32(0.5), _F32(1), _F32(2), _F32(4)
    fourth = _F32(expected**4)
    for i in range(count):
        a11, a12, a22, b1, b2 = f[_A11 + i], f[_A12 + i], f[_A22 + i], f[_B1 + i], f[_B2 + i]
        sin2, cos2, readings = f[_SIN2 + i], f[_COS2 + i], f[_COUNT + i]
        det = a11 * a22 - a12 * a12
        x = a22 * b1 - a12 * b2  # X times det
        inverse = 1 / x
        # An R_p below 0, or above R_s, is noise: the likelihood has its maximum at the edge.
        ratio = min(max((a11 * b2 - a12 * b1) * inverse, 0.0), 1.0)
        normal = a11 + ratio * (2 * a12 + ratio * a22)
        gained = b1 + ratio * b2
        rest = max(f[_C + i] - gained * gained / normal, 0.0)
        root = math.sqrt(ratio)

        # var(Y / X), of which (1, r) A (1, r)^T det / x^2 is the closed form
        spread = np.sqrt(_F32(normal * det * inverse * inverse))
        r, rho, s2, c2 = _F32(ratio), _F32(root), _F32(sin2), _F32(cos2)
        near = r < two * spread
        # Half of what the 95 % interval of r, about +- 2 spread, leaves to one side; near 0 to both signs of rho.
        edge = rho + np.sqrt(r + two * spread if near else r - two * spread)
        error = half * edge if near else spread / edge
        a, b = one + rho, one - rho
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

        top, bottom = (1 - root, 1 + root) if low else (1 + root, 1 - root)
        found = math.sqrt(sin2 + sin2 * sin2 * (top * top) / (cos2 * (bottom * bottom)))
        num, den = (b, a) if low else (a, b)
        deviation = two * (s2 * s2) * num * error / (c2 * (den * den * den) * _F32(found))
        clipped = beyond and not low
        found = largest if clipped else found
        # Below the lower branch all is total reflection, r = 1.
        wide = clipped or (low and r + two * spread > one) or not (deviation <= _F32(WIDE) * _F32(found))
        wide = wide or found < smallest
        parallel = not (det > _PARALLEL * a11 * a22)
        dark = not (x > 0 and x * x >= _LIGHT * det * a22)
        code = _AMBIGUOUS if both and not excluded else _IDENTIFIED
        code = _NEAR_BREWSTER if near else code
        code = _NOT_IDENTIFIED if wide else code
        code = _NO_LIGHT if dark else code
        code = _TOO_FEW if parallel or readings < 2 else code
        code = f[_CODE + i] if f[_CODE + i] > 0 else code
        missing = code >= _FIRST_REASON
        f[_ETA + i] = math.nan if missing else found * exterior
        f[_SIGMA + i] = math.nan if missing else deviation * exterior
        f[_CHI2 + i] = math.nan if missing else rest
        f[_DOF + i] = 0.0 if missing else readings - 2
        f[_CODE + i] = code
