"""One interface in as many digits as it takes, by definitions instead of our formulas.

The special angles by a search over all angles with the textbook's Fresnel
equations; derivatives by a complex step through the powers in real arithmetic.
Slow: some 50 ms an index.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import mpmath
from mpmath import mpc, mpf

# A derivative by difference costs digits: 70 leave more than 40.
DIGITS = 70
# The narrowest minimum, that of an index of 1e-8, is 1e-16 wide in log tan(theta).
STEP = mpf(10) ** -28
COMPLEX_STEP = mpf(10) ** -60


def amplitudes(x: mpf, index: mpc) -> tuple[mpc, mpc]:
    """r_s and r_p of the textbook, at x = log tan(theta)."""
    tangent = mpmath.exp(x)
    c = 1 / mpmath.sqrt(1 + tangent**2)
    w = mpmath.sqrt(index**2 - (tangent * c) ** 2)
    return (c - w) / (c + w), (index**2 * c - w) / (index**2 * c + w)


Quantity = Callable[[mpc, mpc], mpf]


def power_p(r_s: mpc, r_p: mpc) -> mpf:
    return abs(r_p) ** 2


def power_ratio(r_s: mpc, r_p: mpc) -> mpf:
    return abs(r_p / r_s) ** 2


def real_ratio(r_s: mpc, r_p: mpc) -> mpf:
    return (r_p / r_s).real


class Search:
    """Every angle of one index, on a grid that gets ever finer towards tan(theta) = |index|, then by bisection."""

    def __init__(self, eta: float, k: float) -> None:
        self.index = mpc(float(eta), float(k))
        with mpmath.workdps(DIGITS):
            tangents = [mpmath.tan(mpmath.radians(degrees)) for degrees in range(1, 90)]
            tangents += [mpf(10) ** (mpf(n) / 4) for n in range(-40, 41)]
            near = [mpf(m) / 10**j for j in range(1, 19) for m in (1, 1.5, 2, 3, 5, 7)]
            tangents += [abs(self.index) * (1 + sign * d) for d in near for sign in (1, -1)]
            self.points = sorted(mpmath.log(tangent) for tangent in tangents)
            self.fields = [amplitudes(x, self.index) for x in self.points]

    def minimum(self, quantity: Quantity) -> mpf:
        """Where the quantity is smallest."""
        with mpmath.workdps(DIGITS):
            values = [quantity(*fields) for fields in self.fields]
            best = min(range(1, len(values) - 1), key=values.__getitem__)
            return mpmath.atan(mpmath.exp(self._turn(quantity, best, 1)))

    def zeros(self, quantity: Quantity) -> list[mpf]:
        """Where the quantity changes its sign, ascending."""
        with mpmath.workdps(DIGITS):
            known = [(x, quantity(*fields)) for x, fields in zip(self.points, self.fields, strict=True)]
            values = [value for _, value in known]
            for i in range(1, len(values) - 1):
                sign = mpmath.sign(values[i])
                if all(0 < sign * values[i] < sign * values[j] for j in (i - 1, i + 1)):
                    # Two zeros may lie between the points.
                    x = self._turn(quantity, i, sign)
                    known.append((x, self._at(quantity, x)))
            known.sort()
            found = [
                _bisected(lambda x, was=a > 0: (self._at(quantity, x) > 0) == was, low, high)
                for (low, a), (high, b) in pairwise(known)
                if (a > 0) != (b > 0)
            ]
            return [mpmath.atan(mpmath.exp(x)) for x in found]

    def _at(self, quantity: Quantity, x: mpf) -> mpf:
        return quantity(*amplitudes(x, self.index))

    def _turn(self, quantity: Quantity, i: int, sign: int) -> mpf:
        """The minimum of sign * quantity between the neighbours of point i."""

        def falls(x: mpf) -> bool:
            return sign * (self._at(quantity, x + STEP) - self._at(quantity, x - STEP)) < 0

        return _bisected(falls, self.points[i - 1], self.points[i + 1])


def _bisected(before: Callable[[mpf], bool], low: mpf, high: mpf) -> mpf:
    while high - low > 1e-16:
        middle = (low + high) / 2
        low, high = (middle, high) if before(middle) else (low, middle)
    return low


def powers(theta: mpc, eta: mpc, k: mpc) -> tuple[mpc, mpc]:
    """R_s and R_p in real arithmetic, so that each argument may take a complex step."""
    c, s2 = mpmath.cos(theta), mpmath.sin(theta) ** 2
    a, b = eta**2 - k**2 - s2, 2 * eta * k
    h = mpmath.sqrt(a**2 + b**2)
    u = mpmath.sqrt((h + a) / 2) if a.real > 0 else b / mpmath.sqrt(2 * (h - a))
    d, e = c**2 + h + 2 * c * u, h * c**2 + s2**2 + 2 * c * u * s2
    r_s = ((eta - 1) ** 2 + k**2) * ((eta + 1) ** 2 + k**2) / d**2
    return r_s, r_s * (((eta**2 - k**2) * c**2 - s2) ** 2 + (b * c**2) ** 2) / e**2


def stepped(cosine: float, eta: float, k: float) -> list[mpf]:
    """Derivatives by theta, eta and k of R_s, then of R_p."""
    with mpmath.workdps(2 * DIGITS):
        at = [mpmath.acos(mpf(float(cosine))), mpf(float(eta)), mpf(float(k))]
        by = [
            powers(*(mpc(x, COMPLEX_STEP) if i == j else mpc(x) for j, x in enumerate(at))) for i in range(3)
        ]
        return [by[i][p].imag / COMPLEX_STEP for p in range(2) for i in range(3)]
