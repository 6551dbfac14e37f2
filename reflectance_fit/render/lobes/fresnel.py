"""Fresnel's equations for one lane, without branches: powers, and the blocks of the Mueller matrices.

``c`` is the cosine of the angle of incidence in [0, 1], eta + ik the index of
the far medium over the near one's.  Twins of ``physics.fresnel`` and
``physics.mueller``, in forms that cancel only where the data do; some ulp of
the type, where ``fresnel.reflectances`` keeps all digits.  eta is at least
0.05, and cosines below 1e-9 at an index match are not told from 0.
Signs: docs/conventions.md.
"""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.lobes.select import like, sel

# What a denominator is kept above; its square is still a float32.
_TINY = 1e-18


@vectorised
def _refracted(c: float, eta: float) -> tuple[float, float, float, float]:
    """eta^2 - 1, sin^2, q^2 = eta^2 - sin^2 (negative: total reflection) and q = eta cos_t, 0 there."""
    one, zero = like(1.0, c), like(0.0, c)
    contrast, s2 = (eta - one) * (eta + one), (one - c) * (one + c)
    q2 = contrast + c * c
    return contrast, s2, q2, math.sqrt(max(q2, zero))


@vectorised
def _dielectric_amplitudes(c: float, eta: float) -> tuple[float, float, float, float, float]:
    """r_s and r_p below the critical angle, then sin^2, q^2 and q of ``_refracted``."""
    contrast, s2, q2, q = _refracted(c, eta)
    # (c - q) / (c + q) times (s2 - q c) / (s2 + q c), each with its difference of squares written out.
    scale = like(1.0, c) / max(c + q, like(_TINY, c))
    total = s2 + q * c
    r_s = -contrast * scale * scale
    r_p = r_s * (s2 - (eta * c) * (eta * c)) / (total * total)
    return r_s, r_p, s2, q2, q


@vectorised
def dielectric_power(c: float, eta: float) -> tuple[float, float, float]:
    """R_s, R_p and the cosine of refraction; 1, 1 and 0 under total reflection."""
    r_s, r_p, _, q2, q = _dielectric_amplitudes(c, eta)
    one = like(1.0, c)
    beyond = q2 < like(0.0, c)
    return sel(beyond, one, min(r_s * r_s, one)), sel(beyond, one, min(r_p * r_p, one)), q / eta


@vectorised
def dielectric_mueller(c: float, eta: float) -> tuple[float, float, float, float]:
    """A, B = (R_s +- R_p) / 2 and the parts of r_s conj(r_p) of ``physics.mueller.reflection``."""
    r_s, r_p, s2, q2, _ = _dielectric_amplitudes(c, eta)
    zero, half, one, two = like(0.0, c), like(0.5, c), like(1.0, c), like(2.0, c)
    beyond = q2 < zero
    # There r_s conj(r_p) = (s2 + i v c)^2 / |s2 + i v c|^2 with v^2 = -q^2.
    vc = math.sqrt(max(-q2, zero)) * c
    scale = one / max(s2 * s2 + vc * vc, like(_TINY, c))
    power_s, power_p = r_s * r_s, r_p * r_p
    return (
        sel(beyond, one, half * (power_s + power_p)),
        sel(beyond, zero, half * (power_s - power_p)),
        sel(beyond, (s2 * s2 - vc * vc) * scale, r_s * r_p),
        sel(beyond, two * s2 * vc * scale, zero),
    )


@vectorised
def dielectric_transmission(c: float, eta: float) -> tuple[float, float, float]:
    """(T_s + T_p) / 2, (T_s - T_p) / 2 and sqrt(T_s T_p), in power: rows (A, B, 0, 0), (B, A, 0, 0), C on the rest.

    0 under total reflection.  The transmitted fields are in phase with the
    incident ones along s and along p = ray x s.
    """
    _, _, _, q = _refracted(c, eta)
    return transmission_between(c, q / eta, eta)


@vectorised
def transmission_between(c: float, cos_t: float, eta: float) -> tuple[float, float, float]:
    """As ``dielectric_transmission``, from the cosines on both sides: the same to all digits from either side."""
    q, half = eta * cos_t, like(0.5, c)
    scale = like(1.0, c) / max(c + q, like(_TINY, c))
    transmitted_s = like(4.0, c) * (c * scale) * (q * scale)
    # t_p / t_s = eta / (sin^2 + q c).
    ratio = eta / ((like(1.0, c) - c) * (like(1.0, c) + c) + q * c)
    transmitted_p = transmitted_s * ratio * ratio
    return (
        half * (transmitted_s + transmitted_p),
        half * (transmitted_s - transmitted_p),
        transmitted_s * ratio,
    )


@vectorised
def conductor_mueller(c: float, eta: float, k: float) -> tuple[float, float, float, float]:
    """A, B = (R_s +- R_p) / 2 and the parts of r_s conj(r_p) of ``physics.mueller.reflection``."""
    power_s, ratio, cross_re, cross_im = _conductor(c, eta, k)
    power_p, half = power_s * ratio, like(0.5, c)
    return half * (power_s + power_p), half * (power_s - power_p), power_s * cross_re, power_s * cross_im


@vectorised
def conductor_power(c: float, eta: float, k: float) -> tuple[float, float]:
    """R_s and R_p."""
    power_s, ratio, _, _ = _conductor(c, eta, k)
    one = like(1.0, c)
    return min(power_s, one), min(power_s * ratio, one)


@vectorised
def _conductor(c: float, eta: float, k: float) -> tuple[float, float, float, float]:
    """R_s, R_p / R_s, and the parts of conj(r_p / r_s); the forms of ``physics.kernels.interface``."""
    zero, half, one, two, tiny = like(0.0, c), like(0.5, c), like(1.0, c), like(2.0, c), like(_TINY, c)
    c2, s2 = c * c, (one - c) * (one + c)
    contrast, loss = (eta - one) * (eta + one) - k * k, two * eta * k
    # q^2 = eps - sin^2 = a + i loss, q = u + iv: the part that does not cancel gives the other.
    a = contrast + c2
    h = math.sqrt(a * a + loss * loss)
    larger = math.sqrt(half * (h + abs(a)))
    smaller = half * loss / max(larger, tiny)
    u, v = sel(a >= zero, larger, smaller), sel(a >= zero, smaller, larger)
    sum_s = one / max((c + u) * (c + u) + v * v, tiny)
    along, across = s2 + u * c, v * c
    sum_p = one / (along * along + across * across)
    difference, lost = (eta - k) * (eta + k) * c2 - s2, loss * c2
    return (
        (contrast * sum_s) * (contrast * sum_s) + (loss * sum_s) * (loss * sum_s),
        (difference * difference + lost * lost) * sum_p * sum_p,
        (s2 * s2 - h * c2) * sum_p,
        two * s2 * across * sum_p,
    )


@vectorised
def approximate(c: float, r0: float, b: float, a: float) -> float:
    """r0 + b (1 - c)^5 - a c (1 - c)^6: constant (b = a = 0), Schlick (b = 1 - r0), F82 with a.

    ``c`` is the cosine on the side of the lower index; nothing is clipped.
    """
    rest = like(1.0, c) - c
    fifth = rest * rest
    fifth = fifth * fifth * rest
    return r0 + fifth * (b - a * (c * rest))


@vectorised
def large_index(c: float, eta: float, k: float) -> float:
    """The mean of ``physics.approximations.conductor_approximation``."""
    one, k2 = like(1.0, c), k * k
    s, s_sum = eta - c, eta + c
    p, p_sum = eta * c - one, eta * c + one
    power_s = (s * s + k2) / (s_sum * s_sum + k2)
    power_p = (p * p + k2 * c * c) / (p_sum * p_sum + k2 * c * c)
    return like(0.5, c) * (power_s + power_p)
