"""Twice the digits, for the few differences that would lose all of them.

A `Pair` is the unevaluated sum of two float64, some 32 digits.  Where a formula
subtracts nearly equal squares (Brewster's angle, the critical angle, a double
root), forming that one difference as a pair leaves the result as good as the
input.  Numpy arrays throughout, with operators; `pairs` is for kernels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.words import fast_two_sum, two_prod, two_sum

Floats = NDArray[np.float64]


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
        high, error = two_sum(self.high, other.high)
        low, lowest = two_sum(self.low, other.low)
        high, error = fast_two_sum(high, error + low)
        return Pair(*fast_two_sum(high, lowest + error))

    def __mul__(self, other: Pair | ArrayLike) -> Pair:
        other = pair(other)
        product, error = two_prod(self.high, other.high)
        return Pair(*fast_two_sum(product, error + (self.high * other.low + self.low * other.high)))

    def __truediv__(self, other: Pair | ArrayLike) -> Pair:
        other = pair(other)
        quotient = self.high / other.high
        return Pair(*fast_two_sum(quotient, (self - other * quotient).high / other.high))

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
        return Pair(*fast_two_sum(root, correction))


def pair(value: Pair | ArrayLike) -> Pair:
    """A number as a pair; shape S."""
    if isinstance(value, Pair):
        return value
    high = np.asarray(value, dtype=np.float64)
    return Pair(high, np.zeros_like(high))


def square(value: ArrayLike) -> Pair:
    """The exact square of a float64; shape S."""
    value = np.asarray(value, dtype=np.float64)
    return Pair(*two_prod(value, value))
