"""The only differences in Fresnel's equations, plain and exact.

With c = cos(theta_i), s^2 = 1 - c^2 and eps = (eta + ik)^2 they are

    contrast = Re eps - 1,   a = Re eps - s^2 = Re w^2,   d = (Re eps) c^2 - s^2.

Contrast vanishes at an index match, a at the critical and d at Brewster's
angle; whoever subtracts rounded squares loses there every digit that cancels.
``eta_minus_one`` is given apart because 1 + x rounds; where ``sine`` is not
negative it is the sine of theta_i, and leads where 1 - c^2 would lose it.
"""

from __future__ import annotations

from reflectance_fit.physics.jit import shared
from reflectance_fit.physics.pairs import Pair, add, square
from reflectance_fit.physics.words import Word, fast_two_sum, fma, select, two_prod, two_sum

Triple = tuple[Word, Word, Word]


@shared
def plain_squares(c: Word, sine: Word) -> tuple[Word, Word]:
    """c^2 and s^2."""
    return c * c, select(sine < 0, (1 - c) * (1 + c), sine * sine)


@shared
def plain_index(eta: Word, eta_minus_one: Word, k: Word) -> tuple[Word, Word, Word, Word]:
    """Contrast, Re eps, b = Im eps and abs(eps - 1)^2."""
    contrast, b = eta_minus_one * (eta + 1) - k * k, 2 * eta * k
    return contrast, (eta - k) * (eta + k), b, contrast * contrast + b * b


@shared
def plain_differences(c2: Word, s2: Word, contrast: Word, re_eps: Word) -> tuple[Word, Word]:
    """a and d; of the two forms of a the one with the smaller terms."""
    return select(s2 < 0.5, re_eps - s2, contrast + c2), re_eps * c2 - s2


@shared
def exact_squares(c: Word, sine: Word) -> tuple[Triple, Pair]:
    """c^2 in three words and s^2 in two."""
    lead_by_sine = sine >= 0.0
    high, low = two_prod(select(lead_by_sine, sine, c), select(lead_by_sine, sine, c))
    # The square of one, and 1 minus it for the other's.
    rest_high, rest_low = fast_two_sum(1.0, -high)
    rest_low, last = two_sum(rest_low, -low)
    c2 = (
        select(lead_by_sine, rest_high, high),
        select(lead_by_sine, rest_low, low),
        select(lead_by_sine, last, 0.0),
    )
    return c2, (select(lead_by_sine, high, rest_high), select(lead_by_sine, low, rest_low))


@shared
def exact_index(eta: Word, eta_minus_one: Word, k: Word) -> tuple[Triple, Triple, Pair, Pair]:
    """Contrast and Re eps + 1 in three words, b = Im eps and abs(eps - 1)^2 in two."""
    # eps = 1 + 2 m + m^2 where eta is near 1, and there m = eta - 1 is a float.
    near = (eta >= 0.5) & (eta <= 2.0)
    base = select(near, eta_minus_one, eta)
    square_high, square_low = two_prod(base, base)
    k2_high, k2_low = two_prod(k, k)
    high, error_1 = two_sum(select(near, eta_minus_one + eta_minus_one, -1.0), square_high)
    high, error_2 = two_sum(high, -k2_high)
    low, error_3 = two_sum(square_low, -k2_low)
    low, error_4 = two_sum(low, error_1)
    low, error_5 = two_sum(low, error_2)
    contrast = _normalised(high, low, error_3 + (error_4 + error_5))
    high, error_1 = two_sum(contrast[0], 2.0)
    low, error_2 = two_sum(contrast[1], error_1)
    opposite = _normalised(high, low, contrast[2] + error_2)
    b_high, b_low = two_prod(eta + eta, k)
    eta_low = select(near, eta_minus_one - (eta - 1.0), 0.0)
    b = (b_high, fma(eta_low + eta_low, k, b_low))
    return contrast, opposite, b, add(square((contrast[0], contrast[1])), square(b))


@shared
def exact_a(c2: Triple, contrast: Triple) -> Pair:
    """a = c^2 + contrast, good to its last digits.

    Where leading words cancel they do so without an error, and the errors of
    the next words are kept: what is dropped is 2^-159 of the largest term.
    """
    p, q, r = c2
    high, error_1 = two_sum(p, contrast[0])
    low, error_2 = two_sum(q, contrast[1])
    high, error_3 = two_sum(high, low)
    return fast_two_sum(high, error_3 + ((error_1 + r) + (error_2 + contrast[2])))


@shared
def exact_d(c2: Triple, opposite: Triple) -> Pair:
    """d = (Re eps + 1) c^2 - 1, as good as ``exact_a``."""
    p, q, r = c2
    largest, largest_low = two_prod(opposite[0], p)
    next_1, next_1_low = two_prod(opposite[0], q)
    next_2, next_2_low = two_prod(opposite[1], p)
    high, error_1 = two_sum(largest, -1.0)
    low, error_2 = two_sum(next_1, next_2)
    low, error_3 = two_sum(low, largest_low)
    high, error_4 = two_sum(high, low)
    last = fma(opposite[0], r, fma(opposite[1], q, fma(opposite[2], p, next_1_low + next_2_low)))
    return fast_two_sum(high, error_4 + (error_1 + (error_2 + error_3 + last)))


@shared
def brief_a(c: Word, contrast: Triple) -> Word:
    """a as a word: the fused sum is exact where it cancels so far that the next word counts."""
    return (fma(c, c, contrast[0]) + contrast[1]) + contrast[2]


@shared
def brief_d(c2: Triple, s2: Pair, re_eps: Pair) -> Pair:
    """d to 2^-106 of s^2, which is enough beside R_s: only R_p by itself would miss more."""
    product, product_low = two_prod(re_eps[0], c2[0])
    high, error = two_sum(product, -s2[0])
    low = (product_low - s2[1]) + fma(re_eps[0], c2[1], re_eps[1] * c2[0])
    return fast_two_sum(high, error + low)


@shared
def _normalised(high: Word, middle: Word, low: Word) -> Triple:
    high, middle = two_sum(high, middle)
    middle, low = two_sum(middle, low)
    high, middle = fast_two_sum(high, middle)
    return high, middle, low
