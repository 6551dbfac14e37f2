"""report.yaml read back: as a Report, and as the Material it describes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.material import Material
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.report.schema import Report
from reflectance_fit.strict_yaml import load, validate


def read_report(path: Path) -> Report:
    """A report this tool wrote; ReflectanceFitError where it is none."""
    document = load(path)
    data = document.data
    schema = data.get("schema") if isinstance(data, dict) else None
    if not str(schema).startswith("reflectance_fit/material-report/"):
        message = "is not a report.yaml (no schema: reflectance_fit/material-report/1)"
        raise ReflectanceFitError(Problem(str(path), 1, message))
    return validate(document, Report)


def material_of(report: Report, path: Path) -> Material:
    """The fitted material; channels whose eta is not identified are left out."""
    known = [channel for channel in report.channels if channel.eta.median is not None]
    if not known:
        raise ReflectanceFitError(Problem(str(path), None, "eta is identified in no channel of this report"))
    eta = np.array([channel.eta.median for channel in known], dtype=float)
    k = np.array([channel.k.median or 0.0 for channel in known])
    try:
        checked_index(eta / report.exterior_ior, k / report.exterior_ior)
    except ValueError as error:
        raise ReflectanceFitError(Problem(str(path), None, str(error))) from error
    return Material(
        name=report.sample.name,
        source=str(path),
        channels=tuple(channel.channel for channel in known),
        wavelength_nm=np.array([channel.wavelength_nm for channel in known]),
        eta=eta,
        k=k,
        exterior_ior=report.exterior_ior,
    )
