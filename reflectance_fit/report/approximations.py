"""Every approximation against exact Fresnel for one material: error and cost."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.physics.approximations import approximation_error, conductor_approximation, schlick
from reflectance_fit.physics.fresnel import r0, reflectances
from reflectance_fit.report.cost import Approximation, nanoseconds_per_evaluation
from reflectance_fit.report.numbers import short
from reflectance_fit.report.schema import ApproximationError, SchlickError


def schlick_errors(eta: float, k: float, *, timed: bool) -> SchlickError:
    """Schlick's errors for a relative index eta + ik, and a row for every approximation.

    The row ``exact`` is the reference's own, so that its cost stands beside
    the others'.  Costs are measured only if ``timed``.
    """
    normal = float(r0(eta, k))
    functions: dict[str, Approximation] = {
        "r0_constant": lambda c: np.full_like(c, normal),
        "schlick": lambda c: schlick(c, normal),
        "lecture_conductor": lambda c: conductor_approximation(c, eta, k).mean,
        "exact": lambda c: reflectances(c, eta, k).mean,
    }
    costs = nanoseconds_per_evaluation(functions) if timed else {}
    rows = []
    for name, function in functions.items():
        error = approximation_error(eta, k, function)
        rows.append(
            ApproximationError(
                name=name,
                max_abs_error=short(error.max_abs_error),
                at_deg=short(error.at_deg, 4),
                # Infinite where the exact reflectance is zero, as at matched indices.
                max_rel_error=short(error.max_rel_error) if math.isfinite(error.max_rel_error) else None,
                rms_error=short(error.rms_error),
                albedo_error=short(error.albedo_error) if math.isfinite(error.albedo_error) else None,
                ns_per_eval=short(costs[name], 3) if timed else None,
            )
        )
    own = next(row for row in rows if row.name == "schlick")
    return SchlickError(**own.model_dump(exclude={"name", "ns_per_eval"}), approximations=rows)
