"""Arithmetic on numbers of one word or two, so that one formula serves both precisions.

A number is a float, or a pair (high, low) of floats that stands for their
sum; arrays do for floats outside compiled code.  The operands of one
operation are all of one kind.  Pairs are good to some 2^-100 of their value
as long as nothing cancels, which is why they need not be renormalised between
operations.

Joldes, Muller & Popescu, ACM Trans. Math. Softw. 44 (2017) 15, whose
algorithms these shorten.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from numba.core import types
from numba.extending import overload

from reflectance_fit.physics.jit import shared
from reflectance_fit.physics.words import Word, fma, select, square_root, two_prod, two_sum

Pair = tuple[Word, Word]
Number = Any


def _on_numbers(on_words: Callable[..., Any], on_pairs: Callable[..., Any]) -> Callable[..., Any]:
    """One operation; which of the two it is depends on its last operand, in compiled code on that one's type."""

    @wraps(on_pairs)
    def operation(*operands: Number) -> Any:
        return (on_pairs if isinstance(operands[-1], tuple) else on_words)(*operands)

    # numba compares the parameters, which ``wraps`` takes over.
    @overload(operation, jit_options={"error_model": "numpy", "forceinline": True})
    @wraps(on_pairs)
    def _compiled(*operands: Any) -> Any:
        return on_pairs if isinstance(operands[-1], types.BaseTuple) else on_words

    return operation


@shared
def _add(a: Pair, b: Pair) -> Pair:
    high, low = two_sum(a[0], b[0])
    return high, low + (a[1] + b[1])


@shared
def _multiply(a: Pair, b: Pair) -> Pair:
    high, low = two_prod(a[0], b[0])
    return high, fma(a[0], b[1], fma(a[1], b[0], low))


@shared
def _scale(factor: Word, a: Pair) -> Pair:
    high, low = two_prod(factor, a[0])
    return high, fma(factor, a[1], low)


@shared
def _square(a: Pair) -> Pair:
    high, low = two_prod(a[0], a[0])
    return high, fma(a[0] + a[0], a[1], low)


@shared
def _divide(a: Pair, b: Pair) -> Pair:
    # Newton's correction of the float quotient; the first remainder is exact.
    reciprocal = 1 / b[0]
    quotient = a[0] * reciprocal
    remainder = fma(-quotient, b[0], a[0]) + fma(-quotient, b[1], a[1])
    return quotient, remainder * reciprocal


@shared
def _root(a: Pair) -> Pair:
    root = square_root(a[0])
    remainder = fma(-root, root, a[0]) + a[1]
    return root, remainder / select(root > 0, root + root, 1)


add = _on_numbers(lambda a, b: a + b, lambda a, b: _add(a, b))
multiply = _on_numbers(lambda a, b: a * b, lambda a, b: _multiply(a, b))
scale = _on_numbers(lambda factor, a: factor * a, lambda factor, a: _scale(factor, a))  # the factor is a word
square = _on_numbers(lambda a: a * a, lambda a: _square(a))
divide = _on_numbers(lambda a, b: a / b, lambda a, b: _divide(a, b))
root = _on_numbers(lambda a: square_root(a), lambda a: _root(a))
negative = _on_numbers(lambda a: -a, lambda a: (-a[0], -a[1]))
halve = _on_numbers(lambda a: a / 2, lambda a: (a[0] / 2, a[1] / 2))
multiply_add = _on_numbers(lambda a, b, c: a * b + c, lambda a, b, c: _add(_multiply(a, b), c))
choose = _on_numbers(
    lambda condition, a, b: select(condition, a, b),
    lambda condition, a, b: (select(condition, a[0], b[0]), select(condition, a[1], b[1])),
)
leading = _on_numbers(lambda a: a, lambda a: a[0])  # the sign and size of a number
rounded = _on_numbers(lambda a: a, lambda a: a[0] + a[1])
