"""Special angles, inversions and gradients, each against 40 digits or more at the exact float64 inputs.

The references are definitions, not our formulas: a search over all angles with
the textbook's Fresnel equations, the inverted equation itself, and a complex
step through the powers written in real arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mpmath
import numpy as np
from card import Figure
from mpmath import mpf
from numpy.typing import NDArray
from oracles.interface import DIGITS, Search, power_p, power_ratio, real_ratio, stepped

from reflectance_fit.physics.brewster import (
    brewster_angle,
    critical_angle,
    critical_glancing_angle,
    principal_angle,
    principal_angles,
    second_brewster_angle,
)
from reflectance_fit.physics.gradients import reflectance_gradients
from reflectance_fit.physics.inversion import (
    eta_from_r0,
    eta_from_r0_given_k,
    eta_minus_one_from_r0,
    k_from_r0_given_eta,
)

Floats = NDArray[np.float64]

SEED = 20250311
ANGLE_TARGET, ULP_TARGET, GRADIENT_TARGET = 1e-12, 2.0, 1e-9


def about(*, full: bool) -> str:
    angles, inversions, gradients = _counts(full)
    return (
        f"Seed {SEED}, all inputs log-uniform. Angles: {angles} indices in each of {len(indices(1))} regimes (eta 1e-8 to "
        f"1e8; k 0 and 1e-300 to 1e8) against a {DIGITS}-digit search of the smallest R_p, the smallest R_p/R_s and all "
        f"zeros of Re(r_p/r_s). Inversions: {inversions} values each. Gradients: {gradients} points in each of "
        f"{len(gradient_points(1))} regimes, six derivatives, against a complex step with {2 * DIGITS} digits."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    angles, inversions, gradients = _counts(full)
    yield from _angles(angles)
    yield from _critical(inversions)
    yield from _inversions(inversions)
    yield from _gradients(gradients)


def _counts(full: bool) -> tuple[int, int, int]:
    return (1000, 200_000, 20_000) if full else (30, 5000, 300)


def _judged(name: str, worst: float, target: float, unit: str) -> Figure:
    return Figure.judged(name, f"{worst:.2g} {unit}", f"{target:g} {unit}", worst <= target)


def _spread(rng: np.random.Generator, low: float, high: float, n: int) -> Floats:
    return 10.0 ** rng.uniform(low, high, n)


# ---- angles


def indices(n: int) -> dict[str, tuple[Floats, Floats]]:
    """eta and k by regime, n of each."""
    rng = np.random.default_rng(SEED)
    return {
        "transparent": (_spread(rng, -8, 8, n), np.zeros(n)),
        "tiny k": (_spread(rng, -8, 8, n), _spread(rng, -300, -8, n)),
        "eta and k from 1e-8 to 1e8": (_spread(rng, -8, 8, n), _spread(rng, -8, 8, n)),
        "ordinary": (_spread(rng, -1.3, 1, n), _spread(rng, -4, 1, n)),
        "near matched": (
            1.0 + rng.choice([-1.0, 1.0], n) * _spread(rng, -15, -2, n),
            _spread(rng, -18, -2, n),
        ),
        "|eta + ik| about 0.3": (_spread(rng, -1, -0.35, n), _spread(rng, -5, -1, n)),
    }


def difference(ours: float, reference: mpf) -> float:
    return abs(float(mpf(float(ours)) - reference))


def _angles(n: int) -> Iterator[Figure]:
    worst = dict.fromkeys(("Brewster", "second Brewster", "every principal", "largest principal"), 0.0)
    miscounted = total = 0
    for eta, k in indices(n).values():
        ours = zip(
            eta, k, brewster_angle(eta, k), second_brewster_angle(eta, k), principal_angle(eta, k),
            principal_angles(eta, k), strict=True,
        )  # fmt: skip
        for one_eta, one_k, first, second, largest, all_principal in ours:
            search = Search(one_eta, one_k)
            principal = search.zeros(real_ratio)
            listed = all_principal[~np.isnan(all_principal)]
            total += 1
            if len(listed) != len(principal):
                miscounted += 1
                continue
            errors = (
                difference(first, search.minimum(power_p)),
                difference(second, search.minimum(power_ratio)),
                max(difference(a, b) for a, b in zip(listed, principal, strict=True)),
                difference(largest, principal[-1]),
            )
            worst = {name: max(w, e) for (name, w), e in zip(worst.items(), errors, strict=True)}
    for name, error in worst.items():
        yield _judged(f"{name} angle, worst difference", error, ANGLE_TARGET, "rad")
    yield Figure.judged(
        "indices with as many principal angles as the search finds",
        f"{total - miscounted} of {total}", "all", miscounted == 0,
    )  # fmt: skip


def _critical(n: int) -> Iterator[Figure]:
    rng = np.random.default_rng(SEED)
    eta = np.concatenate([_spread(rng, -8, 0, n), 1.0 - _spread(rng, -15, 0, n)])
    eta = eta[(eta > 0.0) & (eta < 1.0)]
    delta = _spread(rng, -30, -0.001, n)
    with mpmath.workdps(DIGITS):
        angles = [mpmath.asin(mpf(float(x))) for x in eta]
        glancing = [mpmath.acos(1 - mpf(float(x))) for x in delta]
    worst = max(map(difference, critical_angle(eta), angles))
    yield _judged("critical angle, worst difference", worst, ANGLE_TARGET, "rad")
    yield _judged("critical glancing angle", worst_ulps(critical_glancing_angle(delta), glancing), 2.0, "ulp")


# ---- inversions


def worst_ulps(ours: Floats, reference: list[mpf]) -> float:
    """The largest error in units of the last place of the reference; of those that have one."""
    spacing = np.spacing(np.abs(np.array([float(x) for x in reference])))
    with mpmath.workdps(DIGITS):
        return max(difference(a, b) / u for a, b, u in zip(ours, reference, spacing, strict=True))


def _inversions(n: int) -> Iterator[Figure]:
    rng = np.random.default_rng(SEED)
    r0 = np.concatenate([_spread(rng, -30, 0, n), 1.0 - _spread(rng, -15, 0, n), rng.uniform(0, 1, n)])
    r0 = r0[(r0 >= 1e-30) & (r0 <= 1.0 - 1e-15)]
    with mpmath.workdps(DIGITS):
        roots = [mpmath.sqrt(mpf(float(x))) for x in r0]
        eta = [(1 + s) / (1 - s) for s in roots]
        low = [1 / x for x in eta]
        above = [2 * s / (1 - s) for s in roots]
    yield _judged("eta from R0 of 1e-30 to 1 - 1e-15", worst_ulps(eta_from_r0(r0), eta), ULP_TARGET, "ulp")
    yield _judged("its inverse, the other index", worst_ulps(1.0 / eta_from_r0(r0), low), ULP_TARGET, "ulp")
    yield _judged("eta - 1 from R0", worst_ulps(eta_minus_one_from_r0(r0), above), ULP_TARGET, "ulp")

    k = _spread(rng, -6, 2, n)
    top = (k / (1.0 + np.hypot(1.0, k))) ** 2
    r0, k, rest = _inside(top + (1.0 - top) * top * _spread(rng, -15, 0, n), k, _circle)
    with mpmath.workdps(DIGITS):
        high = [((1 + r) + mpmath.sqrt(x)) / (1 - r) for r, x in zip(map(mpf, r0), rest, strict=True)]
        low = [(1 + mpf(x) ** 2) / h for x, h in zip(k, high, strict=True)]
    found = eta_from_r0_given_k(r0, k)
    worst = max(worst_ulps(found.low, low), worst_ulps(found.high, high))
    yield _judged("eta from R0 with k given", worst, ULP_TARGET, "ulp")

    eta = _spread(rng, -3, 3, n)
    least = ((eta - 1.0) / (eta + 1.0)) ** 2
    r0, eta, rest = _inside(least + (1.0 - least) * least * _spread(rng, -15, 0, n), eta, _excess)
    with mpmath.workdps(DIGITS):
        exact = [mpmath.sqrt(x / (1 - mpf(r))) for r, x in zip(r0, rest, strict=True)]
    yield _judged(
        "k from R0 with eta given", worst_ulps(k_from_r0_given_eta(r0, eta).k, exact), ULP_TARGET, "ulp"
    )


def _circle(r0: mpf, k: mpf) -> tuple[mpf, mpf]:
    """Half the distance of the two eta, times 1 - r0, squared: as a difference."""
    return 4 * r0, (k * (1 - r0)) ** 2


def _excess(r0: mpf, eta: mpf) -> tuple[mpf, mpf]:
    """k^2 times 1 - r0, as a difference."""
    return r0 * (1 + eta) ** 2, (1 - eta) ** 2


def _inside(
    r0: Floats, given: Floats, square: Callable[[mpf, mpf], tuple[mpf, mpf]]
) -> tuple[list[float], list[float], list[mpf]]:
    """Those with solutions, down to where the square is 1e-15 of its terms and the solutions meet."""
    kept = []
    with mpmath.workdps(DIGITS):
        for r, x in zip(map(float, r0), map(float, given), strict=True):
            large, small = square(mpf(r), mpf(x))
            if r < 1.0 and large - small > 1e-15 * large:
                kept.append((r, x, large - small))
    ones, others, squares = map(list, zip(*kept, strict=True))
    return ones, others, squares


# ---- gradients


def gradient_points(n: int) -> dict[str, tuple[Floats, Floats, Floats]]:
    """cos(theta), eta and k by regime, n of each."""
    rng = np.random.default_rng(SEED)
    cosine = rng.uniform(0.0, 1.0, n)
    grazing = _spread(rng, -12, -2, n)
    return {
        "dielectric": (cosine, _spread(rng, -1.3, 1.3, n), np.zeros(n)),
        "conductor": (cosine, _spread(rng, -1.3, 1.3, n), _spread(rng, -12, 1.3, n)),
        "grazing": (grazing, _spread(rng, -3, 3, n), _spread(rng, -3, 3, n)),
        "near normal": (1.0 - _spread(rng, -16, -2, n), _spread(rng, -3, 3, n), _spread(rng, -3, 3, n)),
        "near matched": (cosine, 1.0 + _spread(rng, -15, -2, n), _spread(rng, -12, -2, n)),
        "lossless metal": (cosine, _spread(rng, -8, -3, n), _spread(rng, -1, 1, n)),
    }


def _gradients(n: int) -> Iterator[Figure]:
    for regime, (cosine, eta, k) in gradient_points(n).items():
        ours = np.stack(reflectance_gradients(cosine, eta, k)[:6], axis=-1)
        worst = 0.0
        for i in range(n):
            for one, reference in zip(ours[i], stepped(cosine[i], eta[i], k[i]), strict=True):
                # What is exactly 0 (k = 0 in total reflection, say) the reference misses by its own rounding.
                exact = reference if abs(reference) > mpf(10) ** -50 else mpf(0)
                worst = max(worst, difference(one, exact) / (abs(float(exact)) or 1e-300))
        yield _judged(f"gradients, {regime}, worst relative difference", worst, GRADIENT_TARGET, "relative")
