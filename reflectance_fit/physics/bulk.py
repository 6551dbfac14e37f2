"""Unpolarized reflectance of one index over many angles, as fast as memory and arithmetic allow.

The rungs are those of ``fresnel``; what depends on the index alone is
computed once, and one division serves both polarisations.  The arithmetic is
strict, without any of the compiler's liberties, and makes no temporaries.
"""

from __future__ import annotations

from typing import cast, get_args

import numba
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.bulk_kernels import SERIAL, THREADED
from reflectance_fit.physics.domain import BAD_COSINE, checked_index
from reflectance_fit.physics.extremes import out_of_range
from reflectance_fit.physics.fresnel import Rung, reflectances
from reflectance_fit.physics.words import warn_without_fma

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
        How many threads to run on, of those the machine has.
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
    c = cast(Floats, np.asarray(cos_theta_i))
    if c.dtype not in (np.float32, np.float64) or c.ndim != 1 or not c.flags.c_contiguous:
        raise ValueError("cos_theta_i must be a contiguous float32 or float64 array of one dimension")
    if out is None:
        out = np.empty_like(c)
    if out.dtype != c.dtype or out.shape != c.shape or not out.flags.c_contiguous:
        raise ValueError("out must be of the type and shape of cos_theta_i, and contiguous")
    if rung != "plain":
        warn_without_fma()
    # At a cosine of 0 the index alone decides whether the kernels have room.
    if out_of_range(*(np.array([x]) for x in (0.0, index, index - 1.0, extinction)))[0]:
        for start in range(0, c.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            out[block] = reflectances(c[block], index, extinction, rung=rung).mean
    elif not _filled(c, index, extinction, rung, threads, out):
        raise ValueError(BAD_COSINE)
    return out


def _filled(c: Floats, eta: float, k: float, rung: Rung, threads: int, out: Floats) -> bool:
    """Whether all cosines are in [0, 1]; their reflectances are then in ``out``."""
    if threads == 1:
        return bool(SERIAL[rung, k > 0.0](c, eta, k, out))
    # Multiples of 64, so that no two threads write to one cache line.
    parts = np.append(c.size * np.arange(threads) // threads // 64 * 64, c.size)
    good = np.empty(threads, dtype=np.bool_)
    before = numba.get_num_threads()
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]
    try:
        THREADED[rung, k > 0.0](c, eta, k, out, parts, good)
    finally:
        numba.set_num_threads(before)
    return bool(np.all(good))
