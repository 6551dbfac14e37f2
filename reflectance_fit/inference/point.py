"""A finished fit's best point as information: what the checks after a fit stand on."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.fisher import Information, information
from reflectance_fit.inference.forward import DARK, DIFFUSE
from reflectance_fit.inference.models import FREE
from reflectance_fit.inference.rows import LAST_POWER
from reflectance_fit.observations import Observations
from reflectance_fit.priors import NUISANCES
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]


def with_sigma(fit: Fit) -> Observations:
    """The rows of ``fit``, each with its sigma: stated, or the one that the fit estimated."""
    o = fit.observations
    estimated = np.array([fit.estimated_sigma.get(str(q), np.nan) for q in o.quantity])
    return replace(o, sigma=np.where(np.isnan(o.sigma), estimated, o.sigma))


def index_names(fit: Fit) -> tuple[str, ...]:
    """Which of eta and k the fit's model has free."""
    return FREE[fit.optimum.model]


def fitted_nuisances(fit: Fit) -> dict[str, float]:
    """Name to best value of every nuisance that was fitted."""
    return {name: v for name, v in fit.optimum.parameters.items() if name in NUISANCES}


def at_best(
    fit: Fit,
    *,
    eta: float | None = None,
    k: float | None = None,
    names: Iterable[str] | None = None,
    also: Iterable[str] = (),
) -> Information:
    """Information of ``fit`` at its best point, or at another index with all else as it is.

    ``names`` are the coordinates of the index, by default those that were free;
    ``also`` are nuisances besides those that were fitted, with their usual sigma.
    """
    best = fit.optimum
    fitted = fitted_nuisances(fit)
    return information(
        with_sigma(fit),
        best.eta if eta is None else eta,
        best.k if k is None else k,
        exterior_ior=fit.exterior_ior,
        priors={name: fit.priors[name] for name in (index_names(fit) if names is None else names)},
        nuisances={name: NUISANCES[name].default_sigma or math.inf for name in also}
        | {name: fit.priors[name].sigma for name in fitted},
        at=fitted,
        gains=best.gains,
    )


def background_of(info: Information) -> FloatArray:
    """Dark and diffuse light at the point of ``info``, in each row's unit."""
    light = info.vector[DARK] + info.vector[DIFFUSE] * info.rows.largest
    return np.where(info.rows.code <= LAST_POWER, light, 0.0)


def residuals(fit: Fit) -> FloatArray:
    """Value minus model of each row, in its unit."""
    return np.asarray(fit.optimum.residuals * fit.optimum.sigma)
