"""The best point of a scene by other means than the fit's: textbook formulas in numpy, scipy's minimisers.

Nothing of the fit's kernels, derivatives, steps or starts is used, so a fault that they share cannot hide.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from inference_scenes import Scene
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from reflectance_fit.inference.rows import CODES

Floats = NDArray[np.float64]

MULTISTARTS = 200
ROUNDS = 20  # of damped Newton steps, for all starts together
POLISHED = 4  # of the lowest ends, those that are not the same
_NAMES = {code: str(quantity) for quantity, code in CODES.items()}
_FAR = 1e12  # a residual outside of the model's domain


def residuals(s: Scene, points: Floats) -> Floats:
    """(value - model) / sigma of N rows at D points (log eta, k), shape (D, N); gains at their best."""
    rows = s.rows
    n = (np.exp(points[:, 0]) + 1j * points[:, 1])[:, None]
    c, s2 = rows.cos_theta, rows.sin_theta**2
    # The root of a transparent medium beyond its critical angle decays, as any other's does.
    q = np.sqrt(n**2 - s2 + 0j)
    r_s, r_p = (c - q) / (c + q), (n**2 * c - q) / (n**2 * c + q)
    power_s, power_p = np.abs(r_s) ** 2, np.abs(r_p) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        forms = {
            "signal_s": power_s,
            "signal_p": power_p,
            "reflectance_s": power_s,
            "reflectance_p": power_p,
            "reflectance": (power_s + power_p) / 2,
            "ratio_ps": power_p / power_s,
            "dolp": (power_s - power_p) / (power_s + power_p),
            "psi_deg": np.degrees(np.arctan2(np.abs(r_p), np.abs(r_s))),
            "delta_deg": np.degrees(np.angle(r_s * r_p.conj())),
        }
    model = np.empty(power_s.shape)
    for code in np.unique(rows.code):
        model[:, rows.code == code] = forms[_NAMES[code]][:, rows.code == code]
    outside = np.zeros(len(points), dtype=bool)
    for g in range(rows.gains):
        mine = rows.gain == g
        f, w = model[:, mine], rows.sigma[mine] ** -2
        gain = (f * w) @ rows.value[mine] / np.sum(f * f * w, axis=1)
        outside |= ~(gain > 0)
        model[:, mine] *= gain[:, None]
    apart = rows.value - model
    circle = rows.code == CODES["delta_deg"]
    apart[:, circle] = (apart[:, circle] + 180.0) % 360.0 - 180.0
    apart /= rows.sigma
    apart[outside | ~np.isfinite(apart).all(axis=1)] = _FAR
    return apart


def objective(s: Scene, x: Floats) -> float:
    return float(np.sum(residuals(s, x[None]) ** 2))


def lowest(s: Scene, seed: int) -> float:
    """The lowest objective from MULTISTARTS random points, the lowest ends polished by scipy."""
    generator = np.random.default_rng([seed, 6])
    low, high = s.model.ranges.T
    share = generator.random((MULTISTARTS, 2))
    share[:, s.model.names.index("k")] **= 2
    x, value = _descended(lambda points: residuals(s, points), low + (high - low) * share, low, high)
    ends: list[Floats] = []
    for i in np.argsort(value):
        if all(np.any(np.abs(x[i] - other) > 1e-3 * (high - low)) for other in ends):
            ends.append(x[i])
        if len(ends) == POLISHED:
            break
    return min(_polished(s, end, low, high) for end in ends)


def _descended(f: Callable[[Floats], Floats], x: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Levenberg's damped steps by differences, of all points at once: ends (D, 2) and objectives (D,)."""
    step = 1e-6 * (high - low)
    damping = np.full(len(x), 1e-2)
    r = f(x)
    value = np.sum(r**2, axis=1)
    for _ in range(ROUNDS):
        # Away from the bounds, beyond which there is no model.
        sign = np.where(x + step > high, -1.0, 1.0)
        columns = [(f(x + np.eye(2)[j] * sign * step) - r) / (sign * step)[:, j, None] for j in range(2)]
        jacobian = np.stack(columns, axis=2)
        curvature = np.einsum("dnj,dnm->djm", jacobian, jacobian)
        slope = np.einsum("dnj,dn->dj", jacobian, r)
        scale = np.einsum("djj->dj", curvature) + 1e-12
        damped = curvature + (damping[:, None] * scale)[:, :, None] * np.eye(2)
        moved = np.clip(x - np.linalg.solve(damped, slope[..., None])[..., 0], low, high)
        there = f(moved)
        new = np.sum(there**2, axis=1)
        lower = new < value
        x, r = np.where(lower[:, None], moved, x), np.where(lower[:, None], there, r)
        value = np.where(lower, new, value)
        damping = np.clip(np.where(lower, 0.2, 5.0) * damping, 1e-12, 1e12)
    return x, value


def _polished(s: Scene, x: Floats, low: Floats, high: Floats) -> float:
    """scipy's least squares, then its simplex, which needs no slope at the corners of total reflection."""
    found = least_squares(
        lambda y: residuals(s, y[None])[0],
        np.clip(x, low + 1e-9 * (high - low), high - 1e-9 * (high - low)),
        bounds=(low, high),
        x_scale=high - low,
        xtol=1e-13,
        ftol=1e-13,
        gtol=1e-13,
        max_nfev=40,
    )
    around = found.x + 1e-3 * (high - low) * np.array([[0, 0], [1, 0], [0, 1]])
    simplex = minimize(
        lambda y: objective(s, y),
        found.x,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={
            "initial_simplex": np.where(around > high, 2 * found.x - around, around),
            "xatol": 1e-11,
            "fatol": 1e-9,
            "maxfev": 250,
        },
    )
    return min(objective(s, x), 2 * float(found.cost), float(simplex.fun))
