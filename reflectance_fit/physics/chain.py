"""Fresnel's equations from their differences on: sums of positive terms, which no precision spoils.

With the names of ``differences`` and w^2 = eps - s^2, w = u + iv, u and v >= 0:

    h = |w|^2 = sqrt(a^2 + b^2),   tau = 2 c u,
    D = |c + w|^2 = c^2 + h + tau,   E = |w c + s^2|^2 = h c^2 + s^4 + tau s^2,
    R_s = |eps - 1|^2 / D^2,                T_s = 2 tau / D,
    R_p = R_s |eps c^2 - s^2|^2 / E^2,      T_p = T_s (h + s^2) / E,

because eps - 1 = (w - c)(w + c) and eps c + w = (w c + s^2)(w + c).  The
larger of u and v is sqrt((h + |a|) / 2), the other b / 2 over it.

Every function serves all rungs: numbers are words or pairs (``pairs``), ``one``
is 1 as such a number, and ``fused`` is how the rung multiplies and adds.
"""

from __future__ import annotations

from collections.abc import Callable

from reflectance_fit.physics.jit import shared
from reflectance_fit.physics.pairs import (
    Number,
    add,
    choose,
    divide,
    halve,
    leading,
    multiply,
    negative,
    root,
    rounded,
    scale,
    square,
)
from reflectance_fit.physics.words import Word, select

Fused = Callable[[Number, Number, Number], Number]


@shared
def wave(a: Number, b: Number, wave2: Number) -> tuple[Number, Number, Number]:
    """h, u and v; wave2 = a^2 + b^2."""
    h = root(wave2)
    below = leading(a) < 0
    larger = root(halve(add(h, choose(below, negative(a), a))))
    # k = 0 has none, and a rounded a may then be 0 too.
    smaller = choose(leading(b) == 0, b, divide(halve(b), larger))
    return h, choose(below, smaller, larger), choose(below, larger, smaller)


@shared
def denominators(
    fused: Fused, c: Word, c2: Number, s2: Number, h: Number, u: Number
) -> tuple[Number, Number, Number]:
    """D, E and tau."""
    tau = scale(c + c, u)
    return add(add(c2, h), tau), fused(tau, s2, fused(h, c2, square(s2))), tau


@shared
def powers(
    fused: Fused,
    c: Word,
    one: Number,
    c2: Number,
    s2: Number,
    a: Number,
    b: Number,
    wave2: Number,
    contrast2: Number,
    brewster2: Number,
) -> tuple[Word, Word, Word, Word]:
    """R_s, R_p, T_s and T_p; contrast2 = |eps - 1|^2, brewster2 = |eps c^2 - s^2|^2."""
    h, u, _ = wave(a, b, wave2)
    denominator_s, denominator_p, tau = denominators(fused, c, c2, s2, h, u)
    both = multiply(denominator_s, denominator_p)
    r_s = divide(contrast2, square(denominator_s))
    r_p = divide(multiply(contrast2, brewster2), square(both))
    t_s = divide(scale(2, tau), denominator_s)
    t_p = divide(multiply(scale(2, tau), add(h, s2)), both)
    r_s, t_s = _complementary(one, r_s, t_s)
    r_p, t_p = _complementary(one, r_p, t_p)
    return r_s, r_p, t_s, t_p


@shared
def dielectric_wave(one: Number, a: Number) -> tuple[Number, Number]:
    """h and u where k = 0: no wave enters beyond the critical angle."""
    below = leading(a) < 0
    return choose(below, negative(a), a), root(choose(below, scale(0, one), a))


@shared
def unpolarized(
    fused: Fused,
    c: Word,
    one: Number,
    c2: Number,
    s2: Number,
    h: Number,
    u: Number,
    contrast2: Number,
    brewster2: Number,
) -> tuple[Number, Number]:
    """(R_s + R_p) / 2 and (T_s + T_p) / 2 with one division: R_s and R_p are over (D E)^2, T_s and T_p over D E."""
    denominator_s, denominator_p, tau = denominators(fused, c, c2, s2, h, u)
    inverse = divide(one, multiply(denominator_s, denominator_p))
    transmitted = multiply(multiply(tau, inverse), add(denominator_p, add(h, s2)))
    sums = fused(denominator_p, denominator_p, brewster2)
    reflected = halve(multiply(multiply(contrast2, square(inverse)), sums))
    return reflected, transmitted


@shared
def _complementary(one: Number, r: Number, t: Number) -> tuple[Word, Word]:
    """R and T as words with R + T = 1, from the smaller of the two: neither is negative or above 1."""
    transmits_less = leading(t) < leading(r)
    smaller = choose(transmits_less, t, r)
    larger = rounded(add(one, negative(smaller)))
    return select(transmits_less, larger, rounded(smaller)), select(transmits_less, rounded(smaller), larger)


@shared
def amplitude_parts(
    fused: Fused,
    c: Word,
    c2: Number,
    s2: Number,
    a: Number,
    d: Number,
    b: Number,
    contrast: Number,
    wave2: Number,
) -> tuple[Word, Word, Word, Word]:
    """Real and imaginary part of r_s and of r_p.

    r_s = (c - w) / (c + w) and r_p = -r_s (w c - s^2) / (w c + s^2) over D and E have
    the numerators c^2 - h - 2 i c v and h c^2 - s^4 + 2 i s^2 c v.  Their real parts, differences of
    large terms, become sums when multiplied by c^2 + h and s^4 + h c^2:
    c^4 - h^2 = -(contrast (contrast + 2 c^2) + b^2), h^2 c^4 - s^8 = d (d + 2 s^4) + (b c^2)^2.
    """
    h, u, v = wave(a, b, wave2)
    denominator_s, denominator_p, _ = denominators(fused, c, c2, s2, h, u)
    s4 = square(s2)
    real_s = divide(fused(contrast, add(contrast, scale(2, c2)), square(b)), add(c2, h))
    real_p = divide(fused(d, add(d, scale(2, s4)), square(multiply(b, c2))), fused(h, c2, s4))
    imag_s = scale(c + c, v)
    imag_p = multiply(s2, imag_s)
    both = multiply(denominator_s, denominator_p)
    return (
        rounded(negative(divide(real_s, denominator_s))),
        rounded(negative(divide(imag_s, denominator_s))),
        rounded(divide(fused(real_s, real_p, negative(multiply(imag_s, imag_p))), both)),
        rounded(divide(fused(real_s, imag_p, multiply(imag_s, real_p)), both)),
    )
