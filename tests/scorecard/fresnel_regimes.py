"""Where Fresnel's equations are hard to evaluate: families of inputs, each the image of a unit cube.

A regime turns coordinates u in [0, 1]^d into (cos_theta_i, eta, k); small quantities are spread evenly in
their logarithm.  ``Scale`` says how small and how large a format's numbers can be, so that one text
serves float64 and float32.  The images are rounded to the format afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Points = tuple[Floats, Floats, Floats]


@dataclass(frozen=True, slots=True)
class Scale:
    """Decades: ``digits`` from 1 down to the rounding unit, ``k`` down to the smallest k, ``index`` to the
    smallest and the largest eta, ``large`` to an index called large.  ``smallest``: the least float above 0."""

    digits: float
    k: float
    index: float
    large: float
    smallest: float


SCALES: dict[type[np.floating[Any]], Scale] = {
    np.float64: Scale(digits=16, k=300, index=100, large=8, smallest=5e-324),
    np.float32: Scale(digits=7, k=37, index=37, large=8, smallest=1.4e-45),
}


@dataclass(frozen=True, slots=True)
class Regime:
    """``points(u, scale)`` with u of shape (axes, n); ``near_match``: it gives eta - 1 instead of eta."""

    name: str
    kind: str  # dielectric: k = 0 throughout; conductor
    axes: int
    points: Callable[[Floats, Scale], Points]
    near_match: bool = False


def _between(u: Floats, low: float, high: float) -> Floats:
    return low + (high - low) * u


def _power(u: Floats, low: float, high: float) -> Floats:
    """From 10^low to 10^high."""
    return np.asarray(10.0 ** _between(u, low, high))


def _signed(u: Floats, low: float, high: float) -> Floats:
    """From -10^high to -10^low and from 10^low to 10^high."""
    return np.where(u < 0.5, -1.0, 1.0) * _power(np.abs(2 * u - 1), low, high)


def _choice(u: Floats, *values: Floats | float) -> Floats:
    """One of the values, by equal parts of [0, 1]."""
    which = np.minimum((u * len(values)).astype(int), len(values) - 1)
    return np.choose(which, [np.broadcast_to(value, u.shape) for value in values])


def _any(u: Floats) -> Floats:
    return _between(u, 0.01, 1.0)


def _grazing(u: Floats, scale: Scale) -> Floats:
    return _power(u, -scale.digits, -2)


def _near_normal(u: Floats, scale: Scale) -> Floats:
    return np.asarray(1.0 - _power(u, -scale.digits, -3))


def _matched(u: Floats, scale: Scale) -> Floats:
    return np.asarray(1.0 + _signed(u, 1 - scale.digits, -3))


def _nearby(u: Floats, scale: Scale) -> Floats:
    """A factor close to 1, on both sides."""
    return np.asarray(1.0 + _signed(u, -scale.digits, -3))


def _critical(eta: Floats, factor: Floats) -> Floats:
    return np.minimum(np.sqrt((1 - eta) * (1 + eta)) * factor, 1.0)


def _brewster(eta: Floats, factor: Floats) -> Floats:
    return np.minimum(factor / np.hypot(1.0, eta), 1.0)


def _small_eta(u: Floats, scale: Scale) -> Floats:
    """Down to where a cosine can still tell the critical angle from normal incidence."""
    return _power(u, -scale.digits / 2, -1)


def _edge_cosine(u: Floats, v: Floats, scale: Scale) -> Floats:
    eps = 10**-scale.digits
    return _choice(u, 0.0, 1.0, scale.smallest, 1.0 - eps, eps, v)


def _edge_index(u: Floats, v: Floats, scale: Scale) -> Floats:
    eps, most = 10**-scale.digits, 10**scale.index
    return _choice(u, 1.0, 1.0 - eps, 1.0 + 2.2 * eps, 1 / most, most, 4 * v + 1e-3)


def _edge_k(u: Floats, v: Floats, scale: Scale) -> Floats:
    return _choice(u, 0.0, 1.0, scale.smallest, 10**scale.index, 10.0**-scale.digits, 4 * v)


def _dielectric(
    name: str,
    axes: int,
    points: Callable[[Floats, Scale], tuple[Floats, Floats]],
    *,
    near_match: bool = False,
) -> Regime:
    def with_k(u: Floats, scale: Scale) -> Points:
        c, eta = points(u, scale)
        return c, eta, np.zeros_like(c)

    return Regime(name, "dielectric", axes, with_k, near_match)


def _conductor(
    name: str, axes: int, points: Callable[[Floats, Scale], Points], *, near_match: bool = False
) -> Regime:
    return Regime(name, "conductor", axes, points, near_match)


def _glass(u: Floats) -> Floats:
    return _between(u, 1.05, 4.0)


def _metal(u: Floats, v: Floats) -> tuple[Floats, Floats]:
    return _between(u, 0.05, 4.0), _between(v, 0.5, 9.0)


def _small(u: Floats) -> Floats:
    return _between(u, 0.05, 0.95)


def _root(square: Floats) -> Floats:
    return np.sqrt(np.maximum(square, 1e-30))


DIELECTRIC = (
    _dielectric("generic", 2, lambda u, s: (_any(u[0]), _glass(u[1]))),
    _dielectric("grazing", 2, lambda u, s: (_grazing(u[0], s), _glass(u[1]))),
    _dielectric("near normal", 2, lambda u, s: (_near_normal(u[0], s), _glass(u[1]))),
    _dielectric("index match", 2, lambda u, s: (_any(u[0]), _matched(u[1], s))),
    _dielectric("index match, grazing", 2, lambda u, s: (_grazing(u[0], s), _matched(u[1], s))),
    _dielectric("large eta", 2, lambda u, s: (_any(u[0]), _power(u[1], 1, s.large))),
    _dielectric("large eta, grazing", 2, lambda u, s: (_grazing(u[0], s), _power(u[1], 1, s.large))),
    _dielectric("eta < 1", 2, lambda u, s: (_any(u[0]), _small(u[1]))),
    _dielectric("critical angle", 2, lambda u, s: (_critical(_small(u[0]), _nearby(u[1], s)), _small(u[0]))),
    _dielectric(
        "Brewster's angle",
        2,
        lambda u, s: (_brewster(_power(u[0], -1, 1), _nearby(u[1], s)), _power(u[0], -1, 1)),
    ),
    _dielectric(
        "eta near 0, below critical",
        2,
        lambda u, s: (np.sqrt(1 - (u[1] * _small_eta(u[0], s)) ** 2), _small_eta(u[0], s)),
    ),
    _dielectric(
        "whole domain", 2, lambda u, s: (_power(u[0], -s.k, 0), _power(u[1], -s.index, s.index))
    ),
    _dielectric(
        "edges", 4, lambda u, s: (_edge_cosine(u[0], u[1], s), _edge_index(u[2], u[3], s))
    ),
)  # fmt: skip

CONDUCTOR = (
    _conductor("generic metals", 3, lambda u, s: (_any(u[0]), *_metal(u[1], u[2]))),
    _conductor("grazing", 3, lambda u, s: (_grazing(u[0], s), *_metal(u[1], u[2]))),
    _conductor("near normal", 3, lambda u, s: (_near_normal(u[0], s), *_metal(u[1], u[2]))),
    _conductor("weak k", 3, lambda u, s: (_any(u[0]), _glass(u[1]), _power(u[2], -s.k, -1))),
    _conductor("index match", 3, lambda u, s: (_any(u[0]), _matched(u[1], s), _power(u[2], -s.digits, -3))),
    _conductor(
        "index match, grazing", 3, lambda u, s: (_grazing(u[0], s), _matched(u[1], s), _power(u[2], -s.k / 2, -3))
    ),
    _conductor("eta = 1, any k", 3, lambda u, s: (
        _choice(u[0], _any(u[2]), _grazing(u[2], s)), np.ones_like(u[0]), _power(u[1], -s.k, 0)
    )),
    _conductor("eta, k near 0", 3, lambda u, s: (_any(u[0]), _small_eta(u[1], s), _small_eta(u[2], s))),
    _conductor(
        "eta, k near 0, near normal", 3, lambda u, s: (_near_normal(u[0], s), _small_eta(u[1], s), _small_eta(u[2], s))
    ),
    _conductor("critical angle", 3, lambda u, s: (
        _critical(_small(u[0]), _nearby(u[1], s)), _small(u[0]), _power(u[2], -s.digits - 1, -3)
    )),
    _conductor("Brewster's angle", 3, lambda u, s: (
        _brewster(_power(u[0], -1, 1), _nearby(u[1], s)), _power(u[0], -1, 1), _power(u[2], -s.digits - 1, -3)
    )),
    _conductor("large k", 3, lambda u, s: (_any(u[0]), _between(u[1], 0.05, 4), _power(u[2], 1, s.large))),
    _conductor("large eta and k, grazing", 3, lambda u, s: (
        _grazing(u[0], s), _power(u[1], 1, s.large), _power(u[2], 1, s.large)
    )),
    _conductor("eta^2 - k^2 near sin^2", 3, lambda u, s: (
        _any(u[0]), _root(_power(u[1], -6, 2) + (1 - _any(u[0]) ** 2) * _nearby(u[2], s)), _power(u[1], -3, 1)
    )),
    _conductor("eta^2 - k^2 near tan^2", 3, lambda u, s: (
        _any(u[0]), _root(_power(u[1], -6, 2) + (_any(u[0]) ** -2 - 1) * _nearby(u[2], s)), _power(u[1], -3, 1)
    )),
    _conductor("total reflection, weak k", 3, lambda u, s: (
        _between(u[0], 1e-3, 0.99) * _critical(_small(u[1]), np.ones_like(u[1])), _small(u[1]), _power(u[2], -s.k, -6)
    )),
    _conductor("whole domain", 3, lambda u, s: (
        _power(u[0], -s.k, 0), _power(u[1], -s.index, s.index), _power(u[2], -s.k, s.index)
    )),
    _conductor("edges", 6, lambda u, s: (
        _edge_cosine(u[0], u[1], s), _edge_index(u[2], u[3], s), _edge_k(u[4], u[5], s)
    )),
)  # fmt: skip

NEAR_MATCH = (
    _dielectric("match by eta - 1", 2, lambda u, s: (_any(u[0]), _signed(u[1], -s.k, -0.5)), near_match=True),
    _dielectric(
        "match by eta - 1, grazing", 2, lambda u, s: (_power(u[0], -s.k, -2), _signed(u[1], -s.k, -0.5)),
        near_match=True,
    ),
    _conductor(
        "match by eta - 1", 3, lambda u, s: (_any(u[0]), _signed(u[1], -s.k, -0.5), _power(u[2], -s.k, 0)),
        near_match=True,
    ),
    _conductor(
        "match by eta - 1, grazing", 3,
        lambda u, s: (_power(u[0], -s.k, -2), _signed(u[1], -s.k, -0.5), _power(u[2], -s.k, 0)),
        near_match=True,
    ),
)  # fmt: skip
