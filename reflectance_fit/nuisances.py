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


def offered(observations: Observations) -> dict[str, float]:
    """The nuisances that the used rows can feel, with their default sigmas."""
    felt = _felt(observations)
    sigmas = {name: _default_sigma(name, observations) for name in NUISANCES if felt.get(name, (True, ""))[0]}
    return {name: sigma for name, sigma in sigmas.items() if sigma > 0}


def nuisance_sigmas(
    stated: Mapping[str, float | None], document: Document, observations: Observations
) -> dict[str, float]:
    """Name to sigma, inf for flat; where ``stated`` has None the default.

    Raises ReflectanceFitError, with the line in ``document``, for a nuisance
    that no value can feel: the data would return its prior, and the file was
    meant otherwise.
    """
    felt = _felt(observations)
    sigmas: dict[str, float] = {}
    problems: list[Problem] = []
    for name, given in stated.items():
        path = ("nuisances", name)
        acts, what = felt.get(name, (True, ""))
        sigma = given or _default_sigma(name, observations)
        if not acts:
            problems.append(
                document.problem(path, f"{name} acts only on {what}, and there are none; remove it")
            )
        elif sigma == 0:
            problems.append(document.problem(path, f"{name}: every signal is 0; state its sigma"))
        sigmas[name] = sigma
    if problems:
        raise ReflectanceFitError(problems)
    return sigmas


def _felt(observations: Observations) -> dict[str, tuple[bool, str]]:
    """Of each nuisance that not every row can feel: does any, and what it acts on."""
    o = observations.used
    power = np.isin(o.quantity, _POWERS)
    signal = np.isin(o.quantity, _SIGNALS)
    analyzed = signal & ((o.quantity != Quantity.SIGNAL) | np.isfinite(o.analyzer_deg))
    kinds = (
        (power, "signals and reflectances", ("dark_offset", "diffuse")),
        (signal, "signals", ("source_dolp", "source_azimuth_deg")),
        (analyzed, "signals behind an analyzer", ("analyzer_offset_deg", "diattenuation")),
    )
    return {name: (bool(np.any(rows)), what) for rows, what, names in kinds for name in names}


def _default_sigma(name: str, observations: Observations) -> float:
    default = NUISANCES[name].default_sigma
    if default is not None:
        return default
    o = observations.used
    power = np.isin(o.quantity, _POWERS)
    return DARK_FRACTION * float(np.max(np.abs(o.value[power]), initial=0.0))
