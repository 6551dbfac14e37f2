"""Twice the digits, for the few differences that would lose all of them.

A `Pair` is the unevaluated sum of two float64, some 32 digits.  Where a formula
subtracts nearly equal squares (Brewster's angle, the critical angle, a double
root), forming that one difference as a pair leaves the result as good as the
input.  Numpy arrays throughout; no fused multiply-add is needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

# Veltkamp: multiplying by 2^27 + 1 splits 53 bits into two halves whose products are exact.
_SPLITTER = 134217729.0


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """high + low with |low| at most half an ulp of high; both of one shape.

    Relative error of an operation: a few 2^-106.  Products must stay within
    1e-290 and 1e299, else the low word is lost or infinite.

    Notes
    -----
    Joldes, Muller & Popescu, ACM Trans. Math. Softw. 44 (2017) 15res: algorithms 6, 10 and 17.
    """

    high: Floats
    low: Floats

    # An array on the left of an operator leaves the operation to this class.
    __array_ufunc__ = None

    def __add__(self, other: Pair | ArrayLike) -> Pair:
        other = pair(other)
        high, error = _two_sum(self.high, other.high)
        low, lowest = _two_sum(self.low, other.low)
        high, error = _fast_two_sum(high, error + low)
        return Pair(*_fast_two_sum(high, lowest + error))

    def __mul__(self, other: Pair | ArrayLike) -> Pair:
        other = pair(other)
        product, error = _two_product(self.high, other.high)
        return Pair(*_fast_two_sum(product, error + (self.high * other.low + self.low * other.high)))

    def __truediv__(self, other: Pair | ArrayLike) -> Pair:
        other = pair(other)
        quotient = self.high / other.high
        return Pair(*_fast_two_sum(quotient, (self - other * quotient).high / other.high))

    def __neg__(self) -> Pair:
        return Pair(-self.high, -self.low)

    def __sub__(self, other: Pair | ArrayLike) -> Pair:
        return self + -pair(other)

    def __rsub__(self, other: ArrayLike) -> Pair:
        return -self + other

    __radd__ = __add__
    __rmul__ = __mul__

    def sqrt(self) -> Pair:
        """The root of a pair that is not negative."""
        root = np.sqrt(self.high)
        # One step of Newton's method from a root that is right to half an ulp.
        correction = (self - square(root)).high / np.where(root > 0.0, 2.0 * root, 1.0)
        return Pair(*_fast_two_sum(root, correction))


def pair(value: Pair | ArrayLike) -> Pair:
    """A number as a pair; shape S."""
    if isinstance(value, Pair):
        return value
    high = np.asarray(value, dtype=np.float64)
    return Pair(high, np.zeros_like(high))


def square(value: ArrayLike) -> Pair:
    """The exact square of a float64; shape S."""
    value = np.asarray(value, dtype=np.float64)
    return Pair(*_two_product(value, value))


def _two_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """a + b rounded, and what rounding took away."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def _fast_two_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """`_two_sum` for |a| >= |b|."""
    total = a + b
    return total, b - (total - a)


def _two_product(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """a * b rounded, and what rounding took away (Dekker, 1971)."""
    product = a * b
    a_high, a_low = _split(a)
    b_high, b_low = _split(b)
    error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return product, error


def _split(a: Floats) -> tuple[Floats, Floats]:
    scaled = _SPLITTER * a
    high = scaled - (scaled - a)
    return high, a - high
