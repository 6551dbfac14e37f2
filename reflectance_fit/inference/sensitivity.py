"""The budget of what was not fitted: how far eta, k and the Brewster angle move for a small error of each kind.

Data taken under a disturbance d lie D(d) away from the model, in units of their
noise.  The fit, which knows nothing of d, answers with the step that Gauss
and Newton would take towards them,

    change = C J^T D(d),

J the whitened derivatives of the rows by what is fitted and C its covariance,
priors included (``fisher``).  D is that of first order, except for an
analyzer's zero, which at s and p acts in second order only.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.examination import Sensitivity
from reflectance_fit.inference.fisher import Information
from reflectance_fit.inference.forward import FIRST_NUISANCE
from reflectance_fit.inference.point import at_best, fitted_nuisances
from reflectance_fit.inference.rows import LAST_POWER
from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.priors import NUISANCES
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

# 1000:1 between the axes of a polarizer, against an ideal one.
EXTINCTION = 1000.0
_DIATTENUATION = (EXTINCTION - 1) / (EXTINCTION + 1)
_ANGLE_DEG = 0.1
_BLACK_SHARE = 1e-3
_STEP = 1e-6
_NOTHING = 1e-9  # of a standard deviation: rounding of rows that do not feel a disturbance


def sensitivities(fit: Fit) -> tuple[Sensitivity, ...]:
    """The changes per disturbance that was not fitted and that the rows can feel, largest first.

    Largest by the change relative to eta, or to k where that is more.
    """
    info = at_best(fit)
    fitted = fitted_nuisances(fit)
    found = []
    for name, amount, unit, nuisance, difference in _disturbances(fit, info):
        if nuisance in fitted or np.linalg.norm(difference) < _NOTHING:
            continue
        step = info.covariance() @ (info.columns.T @ difference)
        change = dict(zip(info.names, step, strict=True))
        # The coordinate of eta is its logarithm.
        eta, k = fit.optimum.eta * float(change.get("eta", 0.0)), float(change.get("k", 0.0))
        found.append(Sensitivity(name, amount, unit, eta, k, _brewster(fit, eta, k)))
    return tuple(sorted(found, key=lambda s: -_size(fit, s)))


def _size(fit: Fit, change: Sensitivity) -> float:
    best = fit.optimum
    return max(abs(change.eta) / best.eta, abs(change.k) / best.k if best.k > 0 else 0.0)


def _disturbances(fit: Fit, info: Information) -> list[tuple[str, float, str, str, FloatArray]]:
    """(name, amount, unit, the nuisance it is, change of the rows in units of their noise)."""

    def moved(nuisance: str, to: float) -> FloatArray:
        vector = info.vector.copy()
        vector[FIRST_NUISANCE + NUISANCES[nuisance].index] = to
        return np.asarray(info.difference(vector[None])[0])

    # Dark, diffuse light, diattenuation and the source's polarization act linearly as they are.
    turned = 0.5 * (moved("angle_offset_deg", _ANGLE_DEG) - moved("angle_offset_deg", -_ANGLE_DEG))
    black, amount, unit = _black(fit, info)
    return [
        ("angle_offset", _ANGLE_DEG, "deg", "angle_offset_deg", turned),
        ("extinction_ratio", EXTINCTION, "to 1", "diattenuation", moved("diattenuation", _DIATTENUATION)),
        ("diffuse", 0.001, "of the largest signal", "diffuse", moved("diffuse", 0.001)),
        ("black_level", amount, unit, "dark_offset", info.whitening @ black),
        ("source_polarization", 0.01, "along s", "source_dolp", moved("source_dolp", 0.01)),
        ("analyzer_offset", 1.0, "deg", "analyzer_offset_deg", moved("analyzer_offset_deg", 1.0)),
    ]


def _black(fit: Fit, info: Information) -> tuple[FloatArray, float, str]:
    """Change of each row by an error of the black level, and what that error is.

    One raw count where every row knows what that is worth, else 0.1 % of the
    largest power among the rows.
    """
    per_count = fit.observations.signal_per_dn
    if np.all(np.isfinite(per_count)):
        return per_count, 1.0, "DN"
    power = info.rows.code <= LAST_POWER
    largest = float(np.max(np.abs(info.rows.value[power]), initial=0.0))
    return np.where(power, _BLACK_SHARE * largest, 0.0), _BLACK_SHARE, "of the largest signal"


def _brewster(fit: Fit, eta: float, k: float) -> float:
    """Change of the (pseudo-)Brewster angle, degrees, by its slope at the best point."""
    best, around = fit.optimum, fit.exterior_ior
    values = []
    for sign in (1.0, -1.0):
        at_k = max(best.k + sign * _STEP * k, 0.0)
        values.append(float(brewster_angle((best.eta + sign * _STEP * eta) / around, at_k / around)))
    return math.degrees(values[0] - values[1]) / (2 * _STEP)
