"""Least squares of any residuals, to the last digits: for references, certified regressions and a fit's last word."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.optimize import Basin

FloatArray = NDArray[np.float64]

_HUGE = 1e15  # a residual, instead of NaN
_RELATIVE_STEP = float(np.finfo(float).eps) ** 0.2


def least_squares(
    residuals: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray] | None = None,
    jacobian: Callable[[FloatArray], FloatArray] | None = None,
) -> Basin:
    """Minimise the sum of squares of ``residuals`` (shape (N,)) from ``start``, to the last digits.

    Trust-region and, without ``bounds``, Levenberg-Marquardt steps in turn
    (scipy), scaled by the Jacobian, each from the best point so far.  NaN
    counts as a wall.  ``jacobian`` (N, P) comes from differences of fourth order by default.
    """
    from scipy.optimize import least_squares as solve

    low, high = bounds if bounds is not None else (np.full_like(start, -np.inf), np.full_like(start, np.inf))
    nan_count = evaluations = 0

    def finite(x: FloatArray) -> FloatArray:
        nonlocal nan_count, evaluations
        evaluations += 1
        with np.errstate(all="ignore"):
            r = residuals(x)
        bad = not np.all(np.abs(r) < _HUGE)
        nan_count += bad
        return np.full(len(r), _HUGE) if bad else r

    start = np.clip(start, low, high)
    best, value, converged = start, float(np.sum(finite(start) ** 2)), False
    for method in ("trf", "lm", "dogbox") if bounds is None else ("trf", "dogbox"):
        inside = np.clip(
            best, low + 1e-12 * np.minimum(high - low, 1), high - 1e-12 * np.minimum(high - low, 1)
        )
        with suppress(
            ValueError, np.linalg.LinAlgError
        ):  # too few residuals for a method, or a singular Jacobian
            found = solve(
                finite,
                inside,
                jac=jacobian or (lambda x: _jacobian(finite, x, low, high)),
                bounds=(low, high) if method != "lm" else (-np.inf, np.inf),
                method=method,
                x_scale="jac",
                ftol=1e-15,
                xtol=1e-15,
                gtol=1e-15,
                max_nfev=2000,
            )
            if 2 * found.cost <= value:
                best, value, converged = found.x, 2 * float(found.cost), found.status > 0
    if value < _HUGE**2:
        best = _last_digits(finite, jacobian or (lambda x: _jacobian(finite, x, low, high)), best, low, high)
        value = float(np.sum(finite(best) ** 2))
    return Basin(best, value, nan_count, converged and value < _HUGE**2, evaluations)


def _last_digits(
    residuals: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray], FloatArray],
    x: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Plain Gauss-Newton for as long as the residuals' part in the span of J falls.

    The sum of squares is flat to the last bit over half of the digits of x; that part, its gradient, is not.
    """
    part = np.inf
    best = x
    for _ in range(20):
        r, j = residuals(x), jacobian(x)
        scale = np.linalg.norm(j, axis=0)
        if not np.all(np.isfinite(j)) or not np.all(scale > 0):
            break
        q, upper = np.linalg.qr(j / scale)
        along = q.T @ r
        if not np.linalg.norm(along) < part:
            break
        best, part = x, float(np.linalg.norm(along))
        if abs(np.diag(upper)).min() < 1e-14:
            break
        x = x - np.linalg.solve(upper, along) / scale
        # A bound, or a step that is none of the last digits: the trust region knew better.
        if np.any((x <= low) | (x >= high)) or np.sum(residuals(x) ** 2) > np.sum(r**2) * (1 + 1e-10):
            break
    return best


def _jacobian(
    residuals: Callable[[FloatArray], FloatArray], x: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """dr/dx, shape (N, P): central differences of fourth order, in steps that roundoff and truncation share.

    Relative steps, so that a parameter of 1e-6 is as welcome as one of 1e6; shorter where a bound is near.
    """
    columns = []
    for j in range(len(x)):
        step = _RELATIVE_STEP * (abs(x[j]) or 1.0)
        step = min(step, max(0.4 * min(x[j] - low[j], high[j] - x[j]), 1e-14 * (abs(x[j]) or 1.0)))
        moved = np.tile(x, (4, 1))
        moved[:, j] += step * np.array([1.0, -1.0, 2.0, -2.0])
        a, b, c, d = (residuals(y) for y in moved)
        columns.append((8 * (a - b) - (c - d)) / (12 * step))
    return np.stack(columns, axis=1)
