"""How each row's model value changes with eta, k and the nuisances: `forward` differentiated, compiled.

With n = eta + ik, eps = n^2, w^2 = eps - s^2, w = u + iv, D = |c + w|^2 and E = |wc + s^2|^2,

    r_s = (1 - eps) / (c + w)^2           rho = r_p / r_s = (s^2 - wc) / (s^2 + wc)
    dr_s/dtheta = 2 s r_s / w             drho/dtheta = 2 s (eps (1 + c^2) - s^2) / (w (s^2 + wc)^2)
    dr_s/dn     = -2 c n / (w (c + w)^2)  drho/dn     = -2 s^2 c n / (w (s^2 + wc)^2)

and (s^2 - wc)(s^2 + wc) = s^2 - eps c^2, by which conj(r_s) dr_s and conj(rho) drho lose their complex
denominators.  Everything a detector sees is made of R_s, R_p = R_s |rho|^2 and r_s conj(r_p) = R_s conj(rho).
The compensated forms of `physics.gradients` are slower and right to the last digits; a Newton step needs a few.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import (
    ANALYZER,
    AZIMUTH,
    DIATTENUATION,
    ETA,
    OFFSET,
    SLOPE,
    SOURCE,
    K,
    Optics,
    Turns,
    optics_of,
    reading,
    seen_through,
)
from reflectance_fit.inference.rows import (
    DOLP,
    PSI,
    RATIO,
    REFLECTANCE,
    REFLECTANCE_P,
    REFLECTANCE_S,
    SIGNAL,
    Rows,
)
from reflectance_fit.physics.jit import inlined, shared
from reflectance_fit.physics.kernels import analyzer_signal, interface, wave

FloatArray = NDArray[np.float64]

Four = tuple[float, float, float, float]

_DEGREE = math.pi / 180
# Stands for |w|^2 at the very critical angle of a transparent medium, where slopes are infinite.
_TINY = 1e-30


@inlined
def interface_gradients(c: float, s: float, eta: float, k: float) -> tuple[Four, Four, Four, Four]:
    """`interface` and its derivatives by the angle of incidence (radians), eta and k.

    At k = 0 the derivative by k is the one towards k > 0.
    """
    r_s, r_p, cross_re, cross_im = interface(c, s, eta, k)
    c2, s2 = c * c, s * s
    epsilon_re, epsilon_im, h, u, v = wave(s2, eta, k)
    h = max(h, _TINY)
    d = max((c + u) ** 2 + v * v, _TINY)
    sum_re, sum_im = s2 + u * c, v * c
    e = sum_re * sum_re + sum_im * sum_im
    # n / w, and what it multiplies.
    n_re, n_im = (eta * u + k * v) / h, (k * u - eta * v) / h
    matched_re = (1 - eta) * (1 + eta) + k * k
    brewster_re, brewster_im = s2 - epsilon_re * c2, -epsilon_im * c2

    # conj(r_s) dr_s/dn = -2 c (n / w) conj(1 - eps) / D^2
    scale = -2 * c / (d * d)
    s_re = scale * (n_re * matched_re - n_im * epsilon_im)
    s_im = scale * (n_re * epsilon_im + n_im * matched_re)
    s_theta, s_eta, s_k = 4 * s * r_s * u / h, 2 * s_re, -2 * s_im

    # drho, of n and of theta, from 1 / (s^2 + wc)^2
    square_re, square_im = (sum_re**2 - sum_im**2) / (e * e), -2 * sum_re * sum_im / (e * e)
    scale = -2 * s2 * c
    by_n_re = scale * (n_re * square_re - n_im * square_im)
    by_n_im = scale * (n_re * square_im + n_im * square_re)
    top_re, top_im = epsilon_re * (1 + c2) - s2, epsilon_im * (1 + c2)
    # times 1 / w
    top_re, top_im = 2 * s * (top_re * u + top_im * v) / h, 2 * s * (top_im * u - top_re * v) / h
    by_theta_re = top_re * square_re - top_im * square_im
    by_theta_im = top_re * square_im + top_im * square_re

    # |rho|^2 by conj(rho) drho, whose complex denominators are gone
    ratio = (brewster_re**2 + brewster_im**2) / (e * e)
    ratio_eta = 2 * scale * (n_re * brewster_re + n_im * brewster_im) / (e * e)
    ratio_k = -2 * scale * (n_im * brewster_re - n_re * brewster_im) / (e * e)
    ratio_theta = 2 * (top_re * brewster_re + top_im * brewster_im) / (e * e)

    # conj(rho)
    rho_re, rho_im = (s2 * s2 - h * c2) / e, 2 * s2 * c * v / e
    return (
        (r_s, r_p, cross_re, cross_im),
        (
            s_theta,
            s_theta * ratio + r_s * ratio_theta,
            s_theta * rho_re + r_s * by_theta_re,
            s_theta * rho_im - r_s * by_theta_im,
        ),
        (
            s_eta,
            s_eta * ratio + r_s * ratio_eta,
            s_eta * rho_re + r_s * by_n_re,
            s_eta * rho_im - r_s * by_n_im,
        ),
        (
            s_k,
            s_k * ratio + r_s * ratio_k,
            s_k * rho_re - r_s * by_n_im,
            s_k * rho_im - r_s * by_n_re,
        ),
    )


@shared
def _slope(code: int, value: Four, change: Four) -> float:
    """Derivative of a quantity that needs no light, given the derivative of the interface."""
    r_s, r_p = value[0], value[1]
    if code == REFLECTANCE_S:
        return change[0]
    if code == REFLECTANCE_P:
        return change[1]
    if code == REFLECTANCE:
        return 0.5 * (change[0] + change[1])
    if code == RATIO:
        return (change[1] - r_p / r_s * change[0]) / r_s
    turned = r_p * change[0] - r_s * change[1]
    if code == DOLP:
        return 2 * turned / (r_s + r_p) ** 2
    if code == PSI:
        # At R_p = 0 psi is a modulus, with a corner and no slope.
        product = r_s * r_p
        return -turned / (2 * math.sqrt(product) * (r_s + r_p)) / _DEGREE if product > 0 else 0.0
    modulus = value[2] ** 2 + value[3] ** 2
    return (value[2] * change[3] - value[3] * change[2]) / modulus / _DEGREE if modulus > 0 else 0.0


@shared
def _of_light(
    optics: Optics,
    turns: Turns,
    source: tuple[float, float],
    jet: tuple[Four, Four, Four, Four],
    errors: bool,
) -> tuple[float, float, float, float, float, float, float]:
    """Derivatives of the signal of a row with light and perhaps an analyzer, which is linear in nearly everything.

    By the angle of incidence, eta and k; with ``errors`` also by degree (``source`` has it and the azimuth), azimuth,
    analyzer's offset and diattenuation.  Per radian.
    """
    reflection, by_theta, by_eta, by_k = jet
    light, analyzer, retarder, d = seen_through(optics, turns)
    slopes = (
        analyzer_signal(by_theta, light, analyzer, retarder, d),
        analyzer_signal(by_eta, light, analyzer, retarder, d),
        analyzer_signal(by_k, light, analyzer, retarder, d),
    )
    by_degree, by_azimuth, by_analyzer, by_diattenuation = 0.0, 0.0, 0.0, 0.0
    if errors:
        s0, s1, s2, s3 = optics[0]
        unpolarized = s0 - math.sqrt(s1 * s1 + s2 * s2 + s3 * s3)
        azimuth = 2 * math.radians(source[1])
        ahead, aside = unpolarized * math.cos(azimuth), unpolarized * math.sin(azimuth)
        by_degree = analyzer_signal(reflection, (0.0, ahead, aside, 0.0), analyzer, retarder, d)
        moved = (0.0, -source[0] * aside, source[0] * ahead, 0.0)
        by_azimuth = 2 * analyzer_signal(reflection, moved, analyzer, retarder, d)
        if not math.isnan(analyzer[0]):
            # What passes unpolarized is the signal without diattenuation.
            across = (-analyzer[1], analyzer[0])
            half = analyzer_signal(reflection, light, across, retarder, 0.0)
            by_analyzer = 2 * (analyzer_signal(reflection, light, across, retarder, d) - half)
            whole = analyzer_signal(reflection, light, analyzer, retarder, 1.0)
            by_diattenuation = optics[3] * (whole - half)
    return (*slopes, by_degree, by_azimuth, by_analyzer, by_diattenuation)


@shared
def gradient_at_angle(
    rows: Rows, i: int, c: float, s: float, p: FloatArray, turns: Turns, optics: bool, out: FloatArray
) -> float:
    """`at_angle`, and ``out``, shape (FIRST_SIGMA,), filled with its derivatives by each part of ``p``.

    Without ``optics`` those by source, analyzer and diattenuation are left 0.  Per unit of the parameter, so per degree of the offsets; by the angle
    offset is by the angle of incidence.  The background's (dark offset and
    diffuse light) are 0: they are no part of `at_angle`.
    """
    for j in range(len(out)):
        out[j] = 0.0
    a, b = rows.cos_spread[i], rows.sin_spread[i]
    sides = 2 if b > 0 else 1
    eta, k, source = p[ETA] + p[SLOPE] * rows.dispersion[i], p[K], (p[SOURCE], p[AZIMUTH])
    through, code, around = optics_of(rows, i), rows.code[i], rows.exterior_ior
    value = 0.0
    for side in range(sides):
        cc, ss = c, s
        if b > 0:
            sign = 1.0 if side == 0 else -1.0
            cc, ss = max(c * a + sign * s * b, 0.0), s * a - sign * c * b
        jet = interface_gradients(cc, ss, eta / around, k / around)
        value += reading(code, through, jet[0], turns)
        if code in (REFLECTANCE_S, REFLECTANCE_P, REFLECTANCE) or code > SIGNAL:
            out[OFFSET] += _slope(code, jet[0], jet[1]) * _DEGREE
            out[ETA] += _slope(code, jet[0], jet[2]) / around
            out[K] += _slope(code, jet[0], jet[3]) / around
        else:
            share = 1.0 if code == SIGNAL else 2.0
            slopes = _of_light(through, turns, source, jet, optics)
            out[OFFSET] += share * slopes[0] * _DEGREE
            out[ETA] += share * slopes[1] / around
            out[K] += share * slopes[2] / around
            out[SOURCE] += share * slopes[3]
            out[AZIMUTH] += share * slopes[4] * _DEGREE
            out[ANALYZER] += share * slopes[5] * _DEGREE
            out[DIATTENUATION] += share * slopes[6]
    if sides == 2:
        for j in range(len(out)):
            out[j] *= 0.5
        value *= 0.5
    out[SLOPE] = out[ETA] * rows.dispersion[i]
    return value
