"""What values of a table are possible."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.manifests import WAVELENGTHS_NM
from reflectance_fit.measurement.keys import SIGMAS
from reflectance_fit.measurement.tables import MAX_PROBLEMS, Columns
from reflectance_fit.observations import FloatArray, Quantity

# Noise lifts a true 1 a little; half as much again is another unit or another quantity.
LIMIT = 1.5

POWERS = tuple(str(q) for q in Quantity if q.is_power)
SIGNALS = tuple(str(q) for q in Quantity if q.has_gain)


def check_values(columns: Columns) -> None:
    """ReflectanceFitError with the first 5 rows of the table that hold impossible values."""
    problems = [
        Problem(columns.shown, int(columns.lines[row]), f"{name} {message} (found {values[row]:g})")
        for name, values in columns.values.items()
        for bad, message in _rules(name, values)
        for row in np.flatnonzero(bad)[:MAX_PROBLEMS]
    ]
    if problems:
        raise ReflectanceFitError(sorted(problems, key=lambda p: p.line or 0)[:MAX_PROBLEMS])


def _rules(name: str, x: FloatArray) -> Iterator[tuple[NDArray[np.bool_], str]]:
    """(rows that break a rule, the rule).  NaN, a value not stated, breaks none."""
    if name == "theta_deg":
        yield x >= 90, "must be below 90 degrees from the normal; remove the row"
        yield x < 0, "must be 0 or above, counted from the normal; remove the row"
    elif name == "wavelength_nm":
        low, high = WAVELENGTHS_NM
        yield (x < low) | (x > high), f"must be {low:g} to {high:g}; is it in nanometres?"
    elif name == "theta_deg_sigma":
        yield x < 0, "must be 0 or above"
    elif name in SIGMAS:
        yield x <= 0, "must be above 0; leave sigmas out where they are unknown"
    elif name == Quantity.PSI_DEG:
        yield (x < 0) | (x > 90), "must be 0 to 90 degrees; is it another quantity?"
    elif name == Quantity.DOLP:
        yield np.abs(x) > LIMIT, "must be -1 to 1; is it a percentage?"
    elif name == Quantity.RATIO_PS:
        yield x > LIMIT, "is R_p / R_s, never above 1; is it R_s / R_p, or a percentage?"
    elif name in POWERS and name not in SIGNALS:
        yield x > LIMIT, "must be 0 to 1; is it a percentage, or a signal of unknown gain?"
