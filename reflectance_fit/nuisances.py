"""The nuisances that a manifest names: each with a sigma, and with data that can feel it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.priors import NUISANCES
from reflectance_fit.strict_yaml import Document

DARK_FRACTION = 0.01  # of the largest signal: the default sigma of dark_offset

_POWERS = tuple(str(q) for q in Quantity if q.is_power)
_SIGNALS = tuple(str(q) for q in Quantity if q.has_gain)


def nuisance_sigmas(
    stated: Mapping[str, float | None], document: Document, observations: Observations
) -> dict[str, float]:
    """Name to sigma, inf for flat; where ``stated`` has None the default.

    Raises ReflectanceFitError, with the line in ``document``, for a nuisance
    that no value can feel: the data would return its prior, and the file was
    meant otherwise.
    """
    o = observations.used
    power = np.isin(o.quantity, _POWERS)
    signal = np.isin(o.quantity, _SIGNALS)
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
    for name, given in stated.items():
        path = ("nuisances", name)
        rows, what = felt.get(name, (np.ones(1, dtype=bool), ""))
        default = NUISANCES[name].default_sigma
        sigma = given or (DARK_FRACTION * largest if default is None else default)
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
