"""Other implementations of Fresnel's reflectances, each as its users call it.

``call(c, eta, k)`` takes arrays of the peer's format, shape (n,), and returns what it has of s, p and
mean.  tmm and pyElli take angles: part of their error is arccos(c), as it would be for their users.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Powers = dict[str, Array]


@dataclass(frozen=True, slots=True)
class Peer:
    """``every``: slow ones get every so-manieth point; ``package``: what must be installed."""

    name: str
    dtype: type[np.floating[Any]]
    call: Callable[[Array, Array, Array], Powers]
    kinds: tuple[str, ...] = ("dielectric", "conductor")
    every: int = 1
    package: str = "numpy"

    @property
    def installed(self) -> bool:
        return importlib.util.find_spec(self.package) is not None


def textbook(c: Array, eta: Array, k: Array) -> Powers:
    """numpy's complex arithmetic and the textbook's formula, in the format of the arrays."""
    eps = (eta + 1j * k) ** 2
    w = np.sqrt(eps - (1 - c * c))
    s, p = np.abs((c - w) / (c + w)) ** 2, np.abs((eps * c - w) / (eps * c + w)) ** 2
    return {"s": s, "p": p, "mean": (s + p) / 2}


def pbrt_dielectric(c: Array, eta: Array, k: Array) -> Powers:
    """FrDielectric: Pharr, Jakob and Humphreys, Physically Based Rendering, 4th ed., 9.3.5."""
    sin2_t = (1 - c * c) / (eta * eta)
    cos_t = np.sqrt(np.maximum(1 - sin2_t, 0))
    parallel = (eta * c - cos_t) / (eta * c + cos_t)
    perpendicular = (c - eta * cos_t) / (c + eta * cos_t)
    total = sin2_t >= 1
    s, p = (np.where(total, c.dtype.type(1), r * r) for r in (perpendicular, parallel))
    return {"s": s, "p": p, "mean": (s + p) / 2}


def pbrt_conductor(c: Array, eta: Array, k: Array) -> Powers:
    """FrConductor in real arithmetic: Physically Based Rendering, 3rd ed., 8.2.1."""
    cos2 = c * c
    sin2 = 1 - cos2
    eta2, k2 = eta * eta, k * k
    t0 = eta2 - k2 - sin2
    a2_plus_b2 = np.sqrt(t0 * t0 + 4 * eta2 * k2)
    a = np.sqrt((a2_plus_b2 + t0) / 2)
    t1, t2 = a2_plus_b2 + cos2, 2 * a * c
    s = (t1 - t2) / (t1 + t2)
    t3, t4 = cos2 * a2_plus_b2 + sin2 * sin2, t2 * sin2
    p = s * (t3 - t4) / (t3 + t4)
    return {"s": s, "p": p, "mean": (p + s) / 2}


def tmm(c: Array, eta: Array, k: Array) -> Powers:
    from tmm import coh_tmm

    def reflected(polarization: str, theta: float, index: complex) -> float:
        return float(coh_tmm(polarization, [1, index], [np.inf, np.inf], theta, 500)["R"])

    pairs = list(zip(np.arccos(c).tolist(), (eta + 1j * k).tolist(), strict=True))
    s, p = (np.array([_or_nan(reflected, name, *pair) for pair in pairs]) for name in "sp")
    return {"s": s, "p": p, "mean": (s + p) / 2}


def pyelli(c: Array, eta: Array, k: Array) -> Powers:
    import elli

    air = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(1.0))

    def reflected(theta_deg: float, index: complex) -> tuple[float, float]:
        far = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(index))
        found = elli.Structure(air, [], far).evaluate(np.array([500.0]), theta_deg, solver=elli.Solver2x2)
        return found.R_ss[0], found.R_pp[0]

    pairs = zip(np.degrees(np.arccos(c)).tolist(), (eta + 1j * k).tolist(), strict=True)
    s, p = np.array([reflected(*pair) for pair in pairs]).reshape(-1, 2).T
    return {"s": s, "p": p, "mean": (s + p) / 2}


def mitsuba_dielectric(c: Array, eta: Array, k: Array) -> Powers:
    mi = _mitsuba()
    return {"mean": _float32(mi.fresnel(*point)[0] for point in zip(c.tolist(), eta.tolist(), strict=True))}


def mitsuba_conductor(c: Array, eta: Array, k: Array) -> Powers:
    mi, indices = _mitsuba(), _complex(eta, k)
    return {"mean": _float32(mi.fresnel_conductor(*p) for p in zip(c.tolist(), indices, strict=True))}


def mitsuba_polarized(c: Array, eta: Array, k: Array) -> Powers:
    mi, indices = _mitsuba(), _complex(eta, k)
    found = [mi.fresnel_polarized(*point)[:2] for point in zip(c.tolist(), indices, strict=True)]
    amplitudes = np.array([[(r.real, r.imag) for r in pair] for pair in found], dtype=np.float32)
    s, p = (amplitudes.reshape(-1, 2, 2) ** 2).sum(axis=2).T
    return {"s": s, "p": p, "mean": (s + p) / 2}


def _mitsuba() -> Any:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def _complex(eta: Array, k: Array) -> list[Any]:
    from drjit.scalar import Complex2f

    return [Complex2f(*pair) for pair in zip(eta.tolist(), k.tolist(), strict=True)]


def _float32(values: Any) -> Array:
    return np.array(list(values), dtype=np.float32)


def _or_nan(function: Callable[..., float], *arguments: object) -> float:
    """NaN where a peer refuses an input; its assertions are about rounding."""
    try:
        return function(*arguments)
    except (AssertionError, ArithmeticError, ValueError):
        return np.nan


PEERS: Sequence[Peer] = (
    Peer("numpy complex", np.float64, textbook),
    Peer("pbrt", np.float64, pbrt_dielectric, ("dielectric",)),
    Peer("pbrt", np.float64, pbrt_conductor, ("conductor",)),
    Peer("tmm", np.float64, tmm, every=10, package="tmm"),
    Peer("pyElli", np.float64, pyelli, every=50, package="elli"),
    Peer("numpy complex", np.float32, textbook),
    Peer("pbrt", np.float32, pbrt_dielectric, ("dielectric",)),
    Peer("pbrt", np.float32, pbrt_conductor, ("conductor",)),
    Peer("Mitsuba fresnel", np.float32, mitsuba_dielectric, ("dielectric",), package="mitsuba"),
    Peer("Mitsuba fresnel_conductor", np.float32, mitsuba_conductor, ("conductor",), package="mitsuba"),
    Peer("Mitsuba fresnel_polarized", np.float32, mitsuba_polarized, package="mitsuba"),
)


def peers_of(kind: str, dtype: type[np.floating[Any]]) -> list[Peer]:
    return [peer for peer in PEERS if kind in peer.kinds and peer.dtype is dtype]
