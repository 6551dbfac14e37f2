"""The loops of ``bulk``: (R_s + R_p) / 2 over cosines, for each rung and material, serial and threaded.

A kernel returns whether every cosine was one.  What depends on the index
alone is computed before the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import prange

from reflectance_fit.physics import chain
from reflectance_fit.physics.differences import (
    brief_a,
    brief_d,
    exact_a,
    exact_index,
    exact_squares,
    plain_differences,
    plain_index,
    plain_squares,
)
from reflectance_fit.physics.jit import kernel, shared, threaded
from reflectance_fit.physics.pairs import add, multiply, multiply_add, negative, rounded, square
from reflectance_fit.physics.words import Word, fma, select


@shared
def _bounded(r: Word, t: Word) -> Word:
    """R from words: above a half its complement is the more exact, and not above 1.  A rounded pair needs none."""
    return select(t < 0.5, 1.0 - t, r)


@kernel
def _plain_dielectric(cosines: Any, eta: float, k: float, out: Any) -> bool:
    contrast, re_eps, _, contrast2 = plain_index(eta, eta - 1.0, k)
    good = True
    for i in range(cosines.size):
        c = float(cosines[i])
        c2, s2 = plain_squares(c, -1.0)
        a, d = plain_differences(c2, s2, contrast, re_eps)
        h, u = chain.dielectric_wave(1.0, a)
        r, t = chain.unpolarized(multiply_add, c, 1.0, c2, s2, h, u, contrast2, d * d)
        out[i] = _bounded(r, t)
        good &= (c >= 0.0) & (c <= 1.0)
    return good


@kernel
def _compensated_dielectric(cosines: Any, eta: float, k: float, out: Any) -> bool:
    contrast, _, _, contrast2 = exact_index(eta, eta - 1.0, k)
    re_eps = square((eta, 0.0))
    good = True
    for i in range(cosines.size):
        c = float(cosines[i])
        c2, s2 = exact_squares(c, -1.0)
        h, u = chain.dielectric_wave(1.0, brief_a(c, contrast))
        d = rounded(brief_d(c2, s2, re_eps))
        r, t = chain.unpolarized(fma, c, 1.0, c2[0], rounded(s2), h, u, rounded(contrast2), d * d)
        out[i] = _bounded(r, t)
        good &= (c >= 0.0) & (c <= 1.0)
    return good


@kernel
def _double_word_dielectric(cosines: Any, eta: float, k: float, out: Any) -> bool:
    contrast, _, _, contrast2 = exact_index(eta, eta - 1.0, k)
    re_eps, one = square((eta, 0.0)), (1.0, 0.0)
    good = True
    for i in range(cosines.size):
        c = float(cosines[i])
        words, s2 = exact_squares(c, -1.0)
        c2, d = (words[0], words[1]), brief_d(words, s2, re_eps)
        h, u = chain.dielectric_wave(one, exact_a(words, contrast))
        r, _ = chain.unpolarized(multiply_add, c, one, c2, s2, h, u, contrast2, square(d))
        out[i] = rounded(r)
        good &= (c >= 0.0) & (c <= 1.0)
    return good


@kernel
def _plain_conductor(cosines: Any, eta: float, k: float, out: Any) -> bool:
    contrast, re_eps, b, contrast2 = plain_index(eta, eta - 1.0, k)
    good = True
    for i in range(cosines.size):
        c = float(cosines[i])
        c2, s2 = plain_squares(c, -1.0)
        a, d = plain_differences(c2, s2, contrast, re_eps)
        h, u, _ = chain.wave(a, b, a * a + b * b)
        brewster2 = d * d + (b * c2) * (b * c2)
        r, t = chain.unpolarized(multiply_add, c, 1.0, c2, s2, h, u, contrast2, brewster2)
        out[i] = _bounded(r, t)
        good &= (c >= 0.0) & (c <= 1.0)
    return good


@kernel
def _compensated_conductor(cosines: Any, eta: float, k: float, out: Any) -> bool:
    contrast, _, b_pair, contrast2 = exact_index(eta, eta - 1.0, k)
    re_eps = add(square((eta, 0.0)), negative(square((k, 0.0))))
    b, b2 = rounded(b_pair), rounded(square(b_pair))
    good = True
    for i in range(cosines.size):
        c = float(cosines[i])
        c2, s2 = exact_squares(c, -1.0)
        a, d = brief_a(c, contrast), rounded(brief_d(c2, s2, re_eps))
        h, u, _ = chain.wave(a, b, fma(a, a, b2))
        brewster2 = fma(d, d, b2 * (c2[0] * c2[0]))
        r, t = chain.unpolarized(fma, c, 1.0, c2[0], rounded(s2), h, u, rounded(contrast2), brewster2)
        out[i] = _bounded(r, t)
        good &= (c >= 0.0) & (c <= 1.0)
    return good


@kernel
def _double_word_conductor(cosines: Any, eta: float, k: float, out: Any) -> bool:
    contrast, _, b, contrast2 = exact_index(eta, eta - 1.0, k)
    re_eps = add(square((eta, 0.0)), negative(square((k, 0.0))))
    b2, one = square(b), (1.0, 0.0)
    good = True
    for i in range(cosines.size):
        c = float(cosines[i])
        words, s2 = exact_squares(c, -1.0)
        a, d, c2 = exact_a(words, contrast), brief_d(words, s2, re_eps), (words[0], words[1])
        h, u, _ = chain.wave(a, b, add(square(a), b2))
        brewster2 = add(square(d), multiply(b2, square(c2)))
        r, _ = chain.unpolarized(multiply_add, c, one, c2, s2, h, u, contrast2, brewster2)
        out[i] = rounded(r)
        good &= (c >= 0.0) & (c <= 1.0)
    return good


# Each part of the arrays on a thread of its own; parts[i]:parts[i + 1] are its ends.


@threaded
def _plain_dielectric_threaded(cosines: Any, eta: float, k: float, out: Any, parts: Any, good: Any) -> None:
    for i in prange(good.size):
        part = slice(parts[i], parts[i + 1])
        good[i] = _plain_dielectric(cosines[part], eta, k, out[part])


@threaded
def _compensated_dielectric_threaded(
    cosines: Any, eta: float, k: float, out: Any, parts: Any, good: Any
) -> None:
    for i in prange(good.size):
        part = slice(parts[i], parts[i + 1])
        good[i] = _compensated_dielectric(cosines[part], eta, k, out[part])


@threaded
def _double_word_dielectric_threaded(
    cosines: Any, eta: float, k: float, out: Any, parts: Any, good: Any
) -> None:
    for i in prange(good.size):
        part = slice(parts[i], parts[i + 1])
        good[i] = _double_word_dielectric(cosines[part], eta, k, out[part])


@threaded
def _plain_conductor_threaded(cosines: Any, eta: float, k: float, out: Any, parts: Any, good: Any) -> None:
    for i in prange(good.size):
        part = slice(parts[i], parts[i + 1])
        good[i] = _plain_conductor(cosines[part], eta, k, out[part])


@threaded
def _compensated_conductor_threaded(
    cosines: Any, eta: float, k: float, out: Any, parts: Any, good: Any
) -> None:
    for i in prange(good.size):
        part = slice(parts[i], parts[i + 1])
        good[i] = _compensated_conductor(cosines[part], eta, k, out[part])


@threaded
def _double_word_conductor_threaded(
    cosines: Any, eta: float, k: float, out: Any, parts: Any, good: Any
) -> None:
    for i in prange(good.size):
        part = slice(parts[i], parts[i + 1])
        good[i] = _double_word_conductor(cosines[part], eta, k, out[part])


# By rung and whether the medium absorbs.
SERIAL: dict[tuple[str, bool], Callable[..., bool]] = {
    ("plain", False): _plain_dielectric,
    ("compensated", False): _compensated_dielectric,
    ("double_word", False): _double_word_dielectric,
    ("plain", True): _plain_conductor,
    ("compensated", True): _compensated_conductor,
    ("double_word", True): _double_word_conductor,
}
THREADED: dict[tuple[str, bool], Callable[..., None]] = {
    ("plain", False): _plain_dielectric_threaded,
    ("compensated", False): _compensated_dielectric_threaded,
    ("double_word", False): _double_word_dielectric_threaded,
    ("plain", True): _plain_conductor_threaded,
    ("compensated", True): _compensated_conductor_threaded,
    ("double_word", True): _double_word_conductor_threaded,
}
