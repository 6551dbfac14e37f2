"""What values of a table are possible, and which nuisances they can feel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.measurement.keys import SIGMAS, WAVELENGTHS_NM
from reflectance_fit.measurement.manifest import NuisanceEntry
from reflectance_fit.measurement.tables import MAX_PROBLEMS, Columns
from reflectance_fit.observations import FloatArray, Observations, Quantity
from reflectance_fit.priors import NUISANCES
from reflectance_fit.strict_yaml import Document

DARK_FRACTION = 0.01  # of the largest signal: the default sigma of dark_offset

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


def nuisance_sigmas(
    entries: Mapping[str, NuisanceEntry], document: Document, observations: Observations
) -> dict[str, float]:
    """Name to sigma, inf for flat, defaults filled in.

    Raises ReflectanceFitError for a nuisance that no value can feel: the data
    would return its prior, and the file was meant otherwise.
    """
    o = observations.used
    power = np.isin(o.quantity, POWERS)
    signal = np.isin(o.quantity, SIGNALS)
    analyzed = signal & ((o.quantity != Quantity.SIGNAL) | np.isfinite(o.analyzer_deg))
    felt = {
        "dark_offset": (power, "signals and reflectances"),
        "diffuse": (power, "signals and reflectances"),
        "source_dolp": (signal, "signals"),
        "source_azimuth_deg": (signal, "signals"),
        "analyzer_offset_deg": (analyzed, "signals behind an analyzer"),
        "diattenuation": (analyzed, "signals behind an analyzer"),
    }
    largest = float(np.max(np.abs(o.value[power]), initial=0.0))
    sigmas: dict[str, float] = {}
    problems: list[Problem] = []
    for name, entry in entries.items():
        path = ("nuisances", name)
        rows, what = felt.get(name, (np.ones(1, dtype=bool), ""))
        default = NUISANCES[name].default_sigma
        sigma = entry.sigma or (DARK_FRACTION * largest if default is None else default)
        if not np.any(rows):
            problems.append(
                document.problem(path, f"{name} acts only on {what}, and there are none; remove it")
            )
        elif sigma == 0:
            problems.append(document.problem(path, f"{name}: every signal is 0; state its sigma"))
        sigmas[name] = sigma
    if problems:
        raise ReflectanceFitError(problems)
    return sigmas
