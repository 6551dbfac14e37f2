"""Compiled twins of the readable physics, scalar, for the hot loops of a fit.

``interface`` is ``fresnel.amplitudes`` reduced to the four numbers that a
detector can see; ``analyzer_signal`` is the Mueller chain source, sample,
retarder, analyzer of ``mueller`` multiplied out.  Tests hold each to its
readable form.  Signs: docs/conventions.md.
"""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import inlined


@inlined
def wave(s2: float, eta: float, k: float) -> tuple[float, float, float, float, float]:
    """epsilon = (eta + ik)^2 by its parts, |q^2| and q = sqrt(epsilon - s2) = u + iv by its parts, u and v >= 0."""
    epsilon_re, epsilon_im = (eta - k) * (eta + k), 2 * eta * k
    a = epsilon_re - s2
    h = math.sqrt(a * a + epsilon_im * epsilon_im)
    # u and v, both from the one square root that does not cancel.
    larger = math.sqrt(0.5 * (h + abs(a)))
    smaller = 0.5 * epsilon_im / larger if larger > 0 else 0.0
    u, v = (larger, smaller) if a >= 0 else (smaller, larger)
    return epsilon_re, epsilon_im, h, u, v


@inlined
def interface(c: float, s: float, eta: float, k: float) -> tuple[float, float, float, float]:
    """R_s, R_p and the real and imaginary part of r_s conj(r_p).

    ``c`` and ``s`` are cosine and sine of the angle of incidence, c >= 0;
    eta + ik relative, eta > 0, k >= 0.
    """
    c2, s2 = c * c, s * s
    epsilon_re, epsilon_im, h, u, v = wave(s2, eta, k)
    d = (c + u) ** 2 + v * v
    e = (u * c + s2) ** 2 + (v * c) ** 2
    contrast_re = (eta - 1) * (eta + 1) - k * k
    reflectance_s = (contrast_re**2 + epsilon_im**2) / (d * d)
    # r_p / r_s = (s2 - q c) / (s2 + q c); |.|^2 by the form that keeps its digits at Brewster.
    ratio = ((epsilon_re * c2 - s2) ** 2 + (epsilon_im * c2) ** 2) / (e * e)
    return (
        reflectance_s,
        reflectance_s * ratio,
        reflectance_s * (s2 * s2 - h * c2) / e,
        reflectance_s * 2 * s2 * c * v / e,
    )


@inlined
def analyzer_signal(
    reflection: tuple[float, float, float, float],
    light: tuple[float, float, float, float],
    analyzer: tuple[float, float],
    retarder: tuple[float, float, float, float],
    diattenuation: float,
) -> float:
    """What a detector behind an analyzer sees of ``light`` reflected by ``reflection``.

    ``reflection`` is what ``interface`` returns, ``light`` an incident Stokes
    vector.  ``analyzer`` is cosine and sine of twice its angle from s, NaN
    without one; ``retarder`` the same of its fast axis, then cosine and sine
    of the retardance, NaN without one.
    """
    r_s, r_p, cross_re, cross_im = reflection
    a, b = 0.5 * (r_s + r_p), 0.5 * (r_s - r_p)
    s0 = a * light[0] + b * light[1]
    if math.isnan(analyzer[0]):
        return s0
    s1 = b * light[0] + a * light[1]
    s2 = cross_re * light[2] - cross_im * light[3]
    if not math.isnan(retarder[0]):
        # Into the retarder's frame, the slow axis delayed, and back.
        s3 = cross_im * light[2] + cross_re * light[3]
        c2, n2, cos_delay, sin_delay = retarder
        along, across = c2 * s1 + n2 * s2, c2 * s2 - n2 * s1
        across = across * cos_delay + s3 * sin_delay
        s1, s2 = c2 * along - n2 * across, n2 * along + c2 * across
    return 0.5 * (s0 + diattenuation * (s1 * analyzer[0] + s2 * analyzer[1]))
