"""Every approximation against exact Fresnel for one material: error, its spread, and cost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.approximation_error import approximation_error, max_abs_errors
from reflectance_fit.physics.approximation_ladder import LADDER
from reflectance_fit.report.cost import nanoseconds_per_evaluation
from reflectance_fit.report.numbers import short
from reflectance_fit.report.schema import ApproximationError, SchlickError, Spread

Draws = tuple[NDArray[np.float64], NDArray[np.float64]]

# The end of a 95 % interval is then known to a fifth of a standard deviation, and a channel takes 50 ms.
DRAWS = 200


def schlick_errors(eta: float, k: float, *, timed: bool, draws: Draws | None = None) -> SchlickError:
    """Schlick's errors for a relative index eta + ik, and a row for every approximation.

    The row ``exact`` is the reference's own, so that its cost stands beside
    the others'.  Costs are measured only if ``timed``.  ``draws`` of eta and k
    (relative, one-dimensional) give the posterior of the largest error.
    """
    curves = {rung.name: rung.curve(eta, k) for rung in LADDER}
    costs = nanoseconds_per_evaluation(curves) if timed else {}
    errors = {name: approximation_error(eta, k, curve) for name, curve in curves.items()}
    spreads = {} if draws is None else _spreads(draws, [error.at_deg for error in errors.values()])
    rows = []
    for name, error in errors.items():
        rows.append(
            ApproximationError(
                name=name,
                max_abs_error=short(error.max_abs_error),
                at_deg=short(error.at_deg, 6),
                # Infinite where the exact reflectance is zero, as at matched indices.
                max_rel_error=short(error.max_rel_error) if math.isfinite(error.max_rel_error) else None,
                rms_error=short(error.rms_error),
                albedo_error=short(error.albedo_error) if math.isfinite(error.albedo_error) else None,
                max_abs_error_posterior=spreads.get(name),
                ns_per_eval=short(costs[name], 3) if timed else None,
            )
        )
    own = next(row for row in rows if row.name == "schlick")
    return SchlickError(**own.model_dump(exclude={"name", "ns_per_eval"}), approximations=rows)


def _spreads(draws: Draws, at_deg: Sequence[float]) -> dict[str, Spread]:
    size = draws[0].size
    pick = np.linspace(0, size - 1, min(size, DRAWS)).astype(int)
    errors = max_abs_errors(draws[0][pick], draws[1][pick], [rung.curve for rung in LADDER], at_deg)
    return {rung.name: _spread(values) for rung, values in zip(LADDER, errors, strict=True)}


def _spread(values: NDArray[np.float64]) -> Spread:
    low95, low68, median, high68, high95 = (
        short(float(q)) for q in np.quantile(values, (0.025, 0.16, 0.5, 0.84, 0.975))
    )
    return Spread(median=median, sd=short(float(values.std())), ci68=[low68, high68], ci95=[low95, high95])
