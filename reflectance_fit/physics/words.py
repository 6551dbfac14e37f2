"""Error-free transforms: a sum or a product of floats as its rounding and the rounding's error.

Every function runs on floats and numpy arrays as it stands, and inside a
compiled kernel, where ``fma`` is the processor's instruction.

Dekker, Numer. Math. 18 (1971) 224; Knuth, The Art of Computer Programming 2,
4.2.2; Ogita, Rump & Oishi, SIAM J. Sci. Comput. 26 (2005) 1955.
"""

from __future__ import annotations

import math
import platform
import warnings
from functools import cache
from typing import Any

import numpy as np
from numba.core import types
from numba.core.codegen import get_host_cpu_features
from numba.extending import intrinsic, overload

from reflectance_fit.physics.jit import shared

# A float, or an array of floats; in kernels always a float.
Word = Any

_SPLITTER = 134217729  # 2^27 + 1


def fma(a: Word, b: Word, c: Word) -> Word:
    """a b + c rounded once; exact where the result is a float, as in the error of a product."""
    product = a * b
    error = _product_error(a, b, product)
    total, rest = two_sum(product, c)
    return total + (rest + error)


def select(condition: Word, a: Word, b: Word) -> Word:
    """a where the condition holds and b elsewhere, both computed."""
    chosen: Any = np.where(condition, a, b)
    return chosen[()]


def square_root(a: Word) -> Word:
    """The rounded square root."""
    return np.sqrt(a)


@shared
def two_sum(a: Word, b: Word) -> tuple[Word, Word]:
    """a + b exactly, as the rounded sum and its error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@shared
def fast_two_sum(a: Word, b: Word) -> tuple[Word, Word]:
    """a + b exactly where abs(a) >= abs(b) or a = 0."""
    total = a + b
    return total, b - (total - a)


@shared
def two_prod(a: Word, b: Word) -> tuple[Word, Word]:
    """a b exactly, as the rounded product and its error; the error must not underflow."""
    product = a * b
    return product, fma(a, b, -product)


@cache
def warn_without_fma() -> None:
    """Say once where the processor has no fused multiply-add: a library call, right and slow, stands in."""
    # Among the processors numba supports, x86 alone comes without.
    x86 = platform.machine().lower() in ("x86_64", "amd64", "i386", "i686", "x86")
    if x86 and "+fma" not in get_host_cpu_features().split(","):  # type: ignore[no-untyped-call]
        warnings.warn(
            "no FMA instruction here: rungs compensated and double_word are slow, plain is not",
            RuntimeWarning,
            stacklevel=2,
        )


def _product_error(a: Word, b: Word, product: Word) -> Word:
    """a b - product by Dekker's splitting into halves whose products are exact."""
    a_high, b_high = (x * _SPLITTER - (x * _SPLITTER - x) for x in (a, b))
    a_low, b_low = a - a_high, b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


# numba wants stand-ins whose parameters are annotated as those of the function they stand in for.


@intrinsic
def _llvm_fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), code


@overload(fma)
def _fma(a: Word, b: Word, c: Word) -> Any:
    def compiled(a: Word, b: Word, c: Word) -> Word:
        return _llvm_fma(a, b, c)  # type: ignore[call-arg]

    return compiled


@overload(select)
def _select(condition: Word, a: Word, b: Word) -> Any:
    def compiled(condition: Word, a: Word, b: Word) -> Word:
        return a if condition else b

    return compiled


@overload(square_root)
def _square_root(a: Word) -> Any:
    def compiled(a: Word) -> Word:
        return math.sqrt(a)

    return compiled
