"""Unpolarized reflectance of one index over many angles, as fast as memory and arithmetic allow.

The rungs are those of ``fresnel``; what depends on the index alone is
computed once, and one division serves both polarisations.  Kernels of strict
arithmetic run side by side on slices of the arrays, one a thread, and make no
temporaries.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

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
from reflectance_fit.physics.domain import BAD_COSINE, checked_index
from reflectance_fit.physics.extremes import out_of_range
from reflectance_fit.physics.fresnel import Rung, reflectances
from reflectance_fit.physics.jit import shared, threadable
from reflectance_fit.physics.pairs import add, multiply, multiply_add, negative, rounded, square
from reflectance_fit.physics.words import Word, fma, select, warn_without_fma

Floats = NDArray[np.float32] | NDArray[np.float64]

_BLOCK = 1 << 16


def unpolarized(
    cos_theta_i: Floats,
    eta: float,
    k: float = 0.0,
    *,
    rung: Rung = "compensated",
    threads: int = 1,
    out: Floats | None = None,
) -> Floats:
    """Return (R_s + R_p) / 2 of one interface at many angles.

    Parameters
    ----------
    cos_theta_i : float32 or float64, shape (N,), contiguous
        Cosines of the angles of incidence, in [0, 1].
    eta, k : float
        Index of the far medium relative to the near one, eta + ik.
    rung : {"plain", "compensated", "double_word"}
        How much arithmetic to spend; see ``fresnel``.
    threads : int
        How many threads to run on.
    out : same type and shape as cos_theta_i, optional
        Where to put the result; a fresh array costs as much as plain arithmetic.

    Returns
    -------
    float32 or float64, shape (N,)
        Within [0, 1]; ``out`` where it was given.  float32 is computed in
        float64 and rounded once.

    Raises
    ------
    ValueError
        If an argument is outside its range, or an array of another kind.

    Examples
    --------
    >>> print(f"{unpolarized(np.array([1.0]), 1.5)[0]:.3f}")
    0.040
    """
    if rung not in get_args(Rung):
        raise ValueError(f"no rung {rung!r}; choose 'plain', 'compensated' or 'double_word'")
    if threads < 1:
        raise ValueError(f"threads must be at least 1, not {threads}")
    index, extinction = (float(x) for x in checked_index(eta, k))
    c = np.asarray(cos_theta_i)
    if c.dtype not in (np.float32, np.float64) or c.ndim != 1 or not c.flags.c_contiguous:
        raise ValueError("cos_theta_i must be a contiguous float32 or float64 array of one dimension")
    if out is None:
        out = np.empty_like(c)
    if out.dtype != c.dtype or out.shape != c.shape or not out.flags.c_contiguous:
        raise ValueError("out must be of the type and shape of cos_theta_i, and contiguous")
    if rung != "plain":
        warn_without_fma()
    kernel = _KERNELS[rung, extinction > 0.0]
    # At a cosine of 0 the index alone decides whether the kernels have room.
    has_room = not out_of_range(*(np.array([x]) for x in (0.0, index, index - 1.0, extinction)))[0]

    def fill(part: slice) -> bool:
        if has_room:
            return bool(kernel(c[part], index, extinction, out[part]))
        for start in range(part.start, part.stop, _BLOCK):
            block = slice(start, min(start + _BLOCK, part.stop))
            out[block] = reflectances(c[block], index, extinction, rung=rung).mean
        return True

    parts = _parts(c.size, threads)
    if threads == 1:
        good = [fill(parts[0])]
    else:
        with ThreadPoolExecutor(threads) as pool:
            good = list(pool.map(fill, parts))
    if not all(good):
        raise ValueError(BAD_COSINE)
    return out


def _parts(size: int, threads: int) -> list[slice]:
    """Slices of nearly equal length, one a thread, that share no cache line."""
    edges = [size * i // threads // 64 * 64 for i in range(threads)] + [size]
    return [slice(a, b) for a, b in pairwise(edges)]


@shared
def _bounded(r: Word, t: Word) -> Word:
    """R from words: above a half its complement is the more exact, and not above 1.  A rounded pair needs none."""
    return select(t < 0.5, 1.0 - t, r)


@threadable
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


@threadable
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


@threadable
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


@threadable
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


@threadable
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


@threadable
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


_KERNELS: dict[tuple[str, bool], Callable[..., bool]] = {
    ("plain", False): _plain_dielectric,
    ("compensated", False): _compensated_dielectric,
    ("double_word", False): _double_word_dielectric,
    ("plain", True): _plain_conductor,
    ("compensated", True): _compensated_conductor,
    ("double_word", True): _double_word_conductor,
}
