"""Fresnel's equations in their naive form, with so many digits that no cancellation matters, and errors in ulp.

With c = cos(theta_i), s2 = sin^2(theta_i), eps = (eta + ik)^2 and w = sqrt(eps - s2),

    r_s = (c - w) / (c + w),    r_p = (eps c - w) / (eps c + w),    R = |r|^2,    T = 1 - R

in complex arithmetic of p >= 1400 bits (mpmath).  Nothing here is shared with the package.

Why p bits suffice.  Inputs are binary floats, so eps - s2 is a sum of products of two of them; ``bits``
makes p large enough to hold it exactly.  Then w has a relative error below 2^(1-p).  Both parts of w and
of wc + s2 are >= 0, and two numbers of the first quadrant add up to at least 1/sqrt(2) of their moduli;
with eps c + w = (wc + s2)(w + c) this gives

    |c + w| >= (c + |w|) / sqrt(2),    |eps c + w| >= (|eps| c + |w|) / (2 sqrt(2)).

So no denominator cancels, each r has an absolute error of at most 20 * 2^-p, and each R and T one of at
most 60 * 2^-p < 2^-1394.  The smallest ulp of float64 is 2^-1074: the reference is wrong by 2^-320 ulp.
Sines and cosines of an angle are not exact: there a cancellation of more than CANCELLED bits is an error,
which leaves an absolute error below 2^-1180.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import NDArray

BITS, CANCELLED = 1400, 200
POWERS = ("s", "p", "mean", "transmitted_s", "transmitted_p", "transmitted")
AMPLITUDES = ("r_s", "r_p")

Floats = NDArray[np.floating[Any]]
Point = tuple[float, float, float]


class Split(NamedTuple):
    """Exact values (whole + part) 2^exponent, in units of one ulp: |part| <= 1/2; arrays of one shape."""

    exponent: NDArray[np.int64]
    whole: NDArray[np.float64]
    part: NDArray[np.float64]

    def columns(self, which: Any, every: int = 1) -> Split:
        """Of shape (n, outputs): some outputs of every so-manieth point."""
        return Split(*(part[::every, which] for part in self))

    def errors(self, computed: Floats) -> NDArray[np.float64]:
        """|computed - exact| in ulp; infinite for NaN.  Exact up to the last subtraction."""
        with np.errstate(over="ignore", invalid="ignore"):
            scaled = np.ldexp(np.asarray(computed, dtype=np.float64), -self.exponent)
            return np.nan_to_num(np.abs(scaled - self.whole - self.part), nan=np.inf, posinf=np.inf)


@dataclass(frozen=True, slots=True)
class Reference:
    """What n points give: six powers (n, 6), r_s and r_p (n, 2) in units of an ulp of their modulus, and
    ``spread`` (n, 6): the change of each power, in its ulp, by one ulp of the angle; 0 for a cosine."""

    powers: Split
    real: Split
    imag: Split
    spread: NDArray[np.float64]


def reference(entry: str, inputs: Sequence[Floats], dtype: type[np.floating[Any]]) -> Reference:
    """The exact results at the inputs (angle or cosine, index, k), each shape (n,)."""
    points = zip(*(x.astype(np.float64).tolist() for x in inputs), strict=True)
    info = np.finfo(dtype)
    lowest, digits = int(info.minexp) - int(info.nmant), int(info.nmant) + 1
    rows: list[Any] = []
    spread: list[list[float]] = []
    for point in points:
        with mpmath.workprec(bits(point)):
            fields = ENTRIES[entry](*map(mpmath.mpf, point))
            exact = powers(fields)
            units = [_exponent(value, digits, lowest) for value in exact]
            changes = _spread(entry, point, exact, digits)
            spread.append([float(mpmath.ldexp(x, -unit)) for x, unit in zip(changes, units, strict=True)])
            row = [_split(value, unit) for value, unit in zip(exact, units, strict=True)]
            for r, square in zip(fields, exact, strict=False):
                # |r| = 2^(e/2) and more, with e the exponent of R.
                unit = max((_magnitude(square) // 2) - digits + 1, lowest) if square else lowest
                row += [_split(r.real, unit), _split(r.imag, unit)]
        rows.append(row)
    table = np.array(rows, dtype=object).reshape(len(rows), 10, 3)
    splits = [Split(*(columns[..., i].astype(t) for i, t in enumerate((np.int64, float, float)))) for columns in
              (table[:, :6], table[:, 6::2], table[:, 7::2])]  # fmt: skip
    return Reference(*splits, np.array(spread).reshape(len(rows), 6))


def bits(point: Point) -> int:
    """A precision that holds every product of two of the inputs, and their sums, exactly."""
    exponents = [math.frexp(x)[1] for x in point if x] + [1]
    return max(BITS, 2 * (max(exponents) - min(exponents) + 53) + 8)


def naive(c: Any, eps: Any, w2: Any) -> tuple[Any, Any]:
    """r_s and r_p by the textbook formula, in the working precision."""
    w = mpmath.sqrt(w2)  # Im w2 >= 0, so the principal root has Re w >= 0 and Im w >= 0
    return (c - w) / (c + w), (eps * c - w) / (eps * c + w)


def powers(fields: tuple[Any, Any]) -> tuple[Any, ...]:
    """R_s, R_p, F, T_s, T_p and T of r_s and r_p."""
    s, p = (r.real * r.real + r.imag * r.imag for r in fields)
    mean = (s + p) / 2
    return s, p, mean, 1 - s, 1 - p, 1 - mean


def _by_cosine(c: Any, eta: Any, k: Any) -> tuple[Any, Any]:
    return _near_match(c, eta - 1, k)


def _near_match(c: Any, eta_minus_one: Any, k: Any) -> tuple[Any, Any]:
    if not (eta_minus_one or k):
        return _nothing()
    eps = mpmath.mpc(1 + eta_minus_one, k) ** 2
    return naive(c, eps, eps - (1 - c * c))


def _by_angle(theta: Any, eta: Any, k: Any) -> tuple[Any, Any]:
    return _by_sine(mpmath.cos(theta), mpmath.sin(theta), eta, k)


def _by_degrees(theta_deg: Any, eta: Any, k: Any) -> tuple[Any, Any]:
    # In half turns: 90 degrees give a cosine of exactly zero.
    return _by_sine(mpmath.cospi(theta_deg / 180), mpmath.sinpi(theta_deg / 180), eta, k)


def _by_sine(c: Any, s: Any, eta: Any, k: Any) -> tuple[Any, Any]:
    if eta == 1 and not k:
        return _nothing()
    eps = mpmath.mpc(eta, k) ** 2
    # eps and 1 are exact; of sine and cosine the smaller one has the smaller error.
    known, rounded = (eps, -s * s) if s < c else (eps - 1, c * c)
    w2 = known + rounded
    if abs(w2) < mpmath.ldexp(max(abs(known), abs(rounded)), -CANCELLED):
        raise ArithmeticError(f"eps - s2 cancels too many bits for a certain reference at eta = {eta}")
    return naive(c, eps, w2)


def _nothing() -> tuple[Any, Any]:
    """What eta + ik = 1 reflects, also where c = 0 leaves the formula 0/0."""
    return mpmath.mpc(0), mpmath.mpc(0)


ENTRIES: dict[str, Callable[[Any, Any, Any], tuple[Any, Any]]] = {
    "cosine": _by_cosine,
    "bulk": _by_cosine,
    "angle": _by_angle,
    "degrees": _by_degrees,
    "near match": _near_match,
}
RIGHT_ANGLES: dict[str, Callable[[], Any]] = {
    "angle": lambda: mpmath.pi / 2,
    "degrees": lambda: mpmath.mpf(90),
}


def _spread(entry: str, point: Point, exact: tuple[Any, ...], digits: int) -> list[Any]:
    """By how much each power changes when x moves by one of its ulps, to the worse side.

    x is the angle or what it lacks to grazing incidence, whichever is smaller: an angle tells both.
    A difference, not a derivative: T has none at the critical angle.
    """
    if entry not in RIGHT_ANGLES:
        return [0] * len(exact)
    theta = mpmath.mpf(point[0])
    x = min(theta, RIGHT_ANGLES[entry]() - theta)
    if not x:
        return [0] * len(exact)
    step = mpmath.ldexp(1, _magnitude(x) - digits + 1)
    sides = [
        powers(ENTRIES[entry](side, *map(mpmath.mpf, point[1:]))) for side in (theta - step, theta + step)
    ]
    return [max(abs(f - side[i]) for side in sides) for i, f in enumerate(exact)]


def _magnitude(value: Any) -> int:
    """e with 2^e <= |value| < 2^(e+1)."""
    _, _, exponent, bit_count = value._mpf_
    return int(exponent + bit_count - 1)


def _exponent(value: Any, digits: int, lowest: int) -> int:
    """Of one ulp at ``value``; below the smallest normal number that of the subnormal spacing."""
    return max(_magnitude(value) - digits + 1, lowest) if value else lowest


def _split(value: Any, exponent: int) -> tuple[int, float, float]:
    sign, mantissa, shift, _ = value._mpf_
    shift += 64 - exponent  # 64 bits behind the point: more than float64 can tell
    fixed = int(mantissa) << shift if shift >= 0 else int(mantissa) >> -shift
    whole = (fixed + 2**63) >> 64
    part = (fixed - (whole << 64)) / 2**64
    return (exponent, -float(whole), -part) if sign else (exponent, float(whole), part)
