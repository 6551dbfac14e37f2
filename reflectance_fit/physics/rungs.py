"""The exact rungs, compiled: how much arithmetic each spends on ``differences`` and ``chain``.

``plain`` is float64 throughout and keeps what does not cancel; ``compensated``
computes the differences exactly and the rest in fused float64;
``double_word`` computes everything in pairs of floats.  Each core also runs
as it stands on numpy arrays: that is the readable form of its kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics import chain
from reflectance_fit.physics.differences import (
    exact_a,
    exact_d,
    exact_index,
    exact_squares,
    plain_differences,
    plain_index,
    plain_squares,
)
from reflectance_fit.physics.jit import kernel, shared
from reflectance_fit.physics.pairs import add, multiply, multiply_add, rounded, square
from reflectance_fit.physics.words import Word, fma, warn_without_fma

Floats = NDArray[np.float64]
Four = tuple[Word, Word, Word, Word]
Core = Callable[[Word, Word, Word, Word, Word], Four]


@shared
def plain_terms(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> tuple[Word, ...]:
    """What ``chain`` needs, in words; c^2, s^2, a, d, b, contrast and the squares of |w^2|, |eps - 1| and |eps c^2 - s^2|."""
    contrast, re_eps, b, contrast2 = plain_index(eta, eta_minus_one, k)
    c2, s2 = plain_squares(c, sine)
    a, d = plain_differences(c2, s2, contrast, re_eps)
    bc2 = b * c2
    return c2, s2, a, d, b, contrast, a * a + b * b, contrast2, d * d + bc2 * bc2


@shared
def exact_terms(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> tuple[Any, ...]:
    """The same in pairs."""
    contrast, opposite, b, contrast2 = exact_index(eta, eta_minus_one, k)
    c2_words, s2 = exact_squares(c, sine)
    a, d = exact_a(c2_words, contrast), exact_d(c2_words, opposite)
    c2 = (c2_words[0], c2_words[1])
    wave2, brewster2 = add(square(a), square(b)), add(square(d), square(multiply(b, c2)))
    return c2, s2, a, d, b, (contrast[0], contrast[1]), wave2, contrast2, brewster2


@shared
def rounded_terms(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> tuple[Word, ...]:
    """The exact terms, each rounded once."""
    c2, s2, a, d, b, contrast, wave2, contrast2, brewster2 = exact_terms(c, sine, eta, eta_minus_one, k)
    return (
        rounded(c2),
        rounded(s2),
        rounded(a),
        rounded(d),
        rounded(b),
        rounded(contrast),
        rounded(wave2),
        rounded(contrast2),
        rounded(brewster2),
    )


@shared
def plain_powers(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> Four:
    """R_s, R_p, T_s and T_p."""
    c2, s2, a, _, b, _, w2, e2, f2 = plain_terms(c, sine, eta, eta_minus_one, k)
    return chain.powers(multiply_add, c, 1, c2, s2, a, b, w2, e2, f2)


@shared
def compensated_powers(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> Four:
    """R_s, R_p, T_s and T_p."""
    c2, s2, a, _, b, _, w2, e2, f2 = rounded_terms(c, sine, eta, eta_minus_one, k)
    return chain.powers(fma, c, 1, c2, s2, a, b, w2, e2, f2)


@shared
def double_word_powers(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> Four:
    """R_s, R_p, T_s and T_p."""
    c2, s2, a, _, b, _, w2, e2, f2 = exact_terms(c, sine, eta, eta_minus_one, k)
    return chain.powers(multiply_add, c, (1.0, 0.0), c2, s2, a, b, w2, e2, f2)


@shared
def plain_amplitudes(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> Four:
    """Real and imaginary part of r_s and of r_p."""
    c2, s2, a, d, b, contrast, w2, _, _ = plain_terms(c, sine, eta, eta_minus_one, k)
    return chain.amplitude_parts(multiply_add, c, c2, s2, a, d, b, contrast, w2)


@shared
def double_word_amplitudes(c: Word, sine: Word, eta: Word, eta_minus_one: Word, k: Word) -> Four:
    """Real and imaginary part of r_s and of r_p."""
    c2, s2, a, d, b, contrast, w2, _, _ = exact_terms(c, sine, eta, eta_minus_one, k)
    return chain.amplitude_parts(multiply_add, c, c2, s2, a, d, b, contrast, w2)


@shared
def _each(
    core: Core, c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats, out: Floats
) -> None:
    for i in range(c.size):
        out[0, i], out[1, i], out[2, i], out[3, i] = core(c[i], sine[i], eta[i], eta_minus_one[i], k[i])


# One function a kernel, because numba keeps no closures.


@kernel
def _plain_powers(
    c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats, out: Floats
) -> None:
    _each(plain_powers, c, sine, eta, eta_minus_one, k, out)


@kernel
def _compensated_powers(
    c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats, out: Floats
) -> None:
    _each(compensated_powers, c, sine, eta, eta_minus_one, k, out)


@kernel
def _double_word_powers(
    c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats, out: Floats
) -> None:
    _each(double_word_powers, c, sine, eta, eta_minus_one, k, out)


@kernel
def _plain_amplitudes(
    c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats, out: Floats
) -> None:
    _each(plain_amplitudes, c, sine, eta, eta_minus_one, k, out)


@kernel
def _double_word_amplitudes(
    c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats, out: Floats
) -> None:
    _each(double_word_amplitudes, c, sine, eta, eta_minus_one, k, out)


_POWERS: dict[str, Callable[..., None]] = {
    "plain": _plain_powers,
    "compensated": _compensated_powers,
    "double_word": _double_word_powers,
}
_AMPLITUDES: dict[str, Callable[..., None]] = {
    "plain": _plain_amplitudes,
    # In words r_p is up to 17 ulp off, and arrays of complex numbers take longer than pairs do.
    "compensated": _double_word_amplitudes,
    "double_word": _double_word_amplitudes,
}


def evaluate(powers: bool, rung: str, *arguments: Floats) -> NDArray[np.float64]:
    """Powers (R_s, R_p, T_s, T_p) or amplitude parts of one rung, shape (4, N).

    ``arguments`` are c, sine, eta, eta_minus_one and k of ``differences``,
    contiguous, shape (N,).  Trusts them.
    """
    if rung != "plain":
        warn_without_fma()
    out = np.empty((4, arguments[0].size))
    (_POWERS if powers else _AMPLITUDES)[rung](*arguments, out)
    return out
