"""A fit with heavy-tailed noise, and whether what it sets aside are outliers or a wrong model.

Heavy tails can hide a model that is wrong: rows it cannot reach count as
outliers.  So chi2 of such a fit is that of the rows within OUTLYING sigma,
which must fit as well as normal ones would; the others must be few; residuals of
neighbouring rows must not go together; and sigmas that are too small by one
factor must explain the rows less well.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import optimize, search
from reflectance_fit.inference.likelihood import deviances, evaluate
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.rows import Rows
from reflectance_fit.observations import Observations
from reflectance_fit.result import Optimum

FloatArray = NDArray[np.float64]

OUTLYING = 4.0  # sigma
MOST = 0.25  # of the rows, that may be outliers
SMOOTH_Z = 2.0
WRONG_P = 0.01  # stricter than the warning WRONG_MODEL, which a refusal leaves standing
_FIRST_CUT = 3.5  # robust standard deviations


def find(
    model: Model, rows: Rows, gains: list[str], normal: Optimum, basins: list[optimize.Basin]
) -> tuple[Optimum, list[optimize.Basin]]:
    """The best point of ``model`` with heavy-tailed noise, and every basin found, best first.

    Starts are the ``basins`` of normal noise and those without the rows that
    stand out there.  As in ``search.find``; chi2 and dof are of the rows that do
    not outlie.
    """
    heavy = rows._replace(heavy_tailed=True)
    starts = [basin.x for basin in basins]
    kept = ~rows.censored
    residuals = np.full(len(kept), np.nan)
    residuals[~rows.censored] = np.abs(normal.residuals)
    for _ in range(2):
        kept = ~(residuals > _FIRST_CUT * np.nanmedian(residuals) / 0.6745)
        try:
            optimum, found = search.find(model, _selected(rows, kept), gains)
        except ValueError:
            break  # a gain has no row left
        starts += [basin.x for basin in found]
        spread = _all_residuals(model, rows, found[0])
        residuals = np.where(rows.censored, np.nan, np.abs(spread))

    def objective(x: FloatArray) -> float:
        return float(deviances(heavy, model.full(x))[0] - 2 * model.log_prior(x[None])[0])

    step = np.array([0.1 if p.kind != "normal" else p.sigma for p in model.priors])
    values = [objective(x) for x in starts]
    tried = []
    for j in np.argsort(values)[:3]:
        tried.append(optimize.minimise(objective, starts[j], model.ranges, 0.3 * step))
    tried = sorted((b for b in tried if math.isfinite(b.objective)), key=lambda b: b.objective)
    if not tried:
        raise ValueError(f"no finite likelihood anywhere for the model {model.name} with heavy-tailed noise")
    ran = "nlopt LN_BOBYQA" if len(model.names) > 1 else "nlopt LN_SBPLX"
    optimum = search.describe(model, heavy, gains, tried[0], f"{ran} from the basins of normal noise")
    inside = np.abs(optimum.residuals) <= OUTLYING
    penalties = -2 * float(model.log_prior(tried[0].x[None])[0])
    return (
        replace(
            optimum,
            chi2=float(np.sum(optimum.residuals[inside] ** 2)) + penalties,
            dof=optimum.dof - int(np.sum(~inside)),
        ),
        tried,
    )


def _selected(rows: Rows, kept: NDArray[np.bool_]) -> Rows:
    parts: dict[str, Any] = {
        name: part[kept] if isinstance(part, np.ndarray) else part for name, part in rows._asdict().items()
    }
    return Rows(**parts)


def _all_residuals(model: Model, rows: Rows, basin: optimize.Basin) -> FloatArray:
    """Residuals of all rows, in standard deviations, with the gains that heavy-tailed noise gives them."""
    n = len(rows.value)
    rooted, spread, gains = np.empty(n), np.empty(n), np.empty(rows.gains)
    evaluate(rows._replace(heavy_tailed=True), model.full(basin.x)[0], rooted, spread, gains)
    # From the signed root of 5 log(1 + u^2 / 4) back to u.
    return np.sign(rooted) * 2 * np.sqrt(np.expm1(rooted**2 / 5))


def bic_of_scaled_sigmas(optimum: Optimum) -> float:
    """BIC of normal noise whose stated sigmas are all too small by one factor, which is a parameter more."""
    n = len(optimum.residuals)
    scaled = n * (math.log(optimum.chi2 / n) + 1) if optimum.chi2 > n else optimum.chi2
    return optimum.bic - optimum.chi2 + scaled + math.log(n)


def outliers(optimum: Optimum) -> int:
    return int(np.sum(np.abs(optimum.residuals) > OUTLYING))


def p_value(optimum: Optimum) -> float:
    """Chance of a chi2 this large where sigmas are stated; 1 without degrees of freedom."""
    from scipy.special import gammaincc

    return float(gammaincc(optimum.dof / 2, optimum.chi2 / 2)) if optimum.dof > 0 else 1.0


def scattered(optimum: Optimum, observations: Observations) -> bool:
    """Few outliers, in rows that fit, whose residuals do not follow one another along the scan."""
    few = outliers(optimum) <= MOST * len(optimum.residuals)
    # A sigma that is itself estimated makes the rows fit.
    stated = not any(name.startswith("sigma[") for name in optimum.parameters)
    fit = not stated or (optimum.dof > 0 and p_value(optimum) >= WRONG_P)
    return bool(few and fit and serial_z(optimum.residuals, observations) < SMOOTH_Z)


def serial_z(residuals: FloatArray, observations: Observations) -> float:
    """How far neighbours' residuals go together: their lag-one products in standard deviations of a random order.

    Neighbours are next to each other in (theta, analyzer) among rows of one quantity, set and gain group.
    Residuals count as at most OUTLYING.
    """
    o = observations
    clipped = np.clip(residuals, -OUTLYING, OUTLYING)
    total, variance = 0.0, 0.0
    names = np.array([f"{q}|{s}" for q, s in zip(o.quantity, o.set, strict=True)])
    for name in np.unique(names):
        mine = np.flatnonzero(names == name)
        x = clipped[mine][np.lexsort((o.analyzer_deg[mine], o.theta_deg[mine]))]
        total += float(np.sum(x[:-1] * x[1:]))
        # Of independent residuals of mean 0, in any order.
        variance += (len(x) - 1) * float(np.mean(x**2)) ** 2
    return total / math.sqrt(variance) if variance > 0 else 0.0
