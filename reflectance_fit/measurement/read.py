"""A measurement.yaml and its tables to ``Measurement``, the input of a fit.

Each value of a table becomes one row of ``Observations``; everything is
checked here, with the line it stands in, so that the fit can trust it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import sha256_of
from reflectance_fit.manifests import Polarization
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.measurement.checks import check_values
from reflectance_fit.measurement.keys import QUANTITIES
from reflectance_fit.measurement.manifest import Manifest, read_manifest
from reflectance_fit.measurement.tables import Columns, open_table, read_columns
from reflectance_fit.measurement.woollam import read_woollam
from reflectance_fit.nuisances import nuisance_sigmas
from reflectance_fit.observations import Flag, FloatArray, Observations, Quantity, concatenate
from reflectance_fit.strict_yaml import Document

WAVELENGTH_REACH_NM = 2.0


def read_measurement(path: str | Path) -> Measurement:
    """Read the manifest at ``path`` and every table it names.

    Raises ReflectanceFitError with every problem found: first those of the
    manifest, then, where it is sound, those of the tables.
    """
    path = Path(path)
    manifest, document = read_manifest(path)
    problems: list[Problem] = []
    parts: list[Observations] = []
    warnings: list[str] = []
    inputs = {path.name: sha256_of(path)}
    for i in range(len(manifest.tables)):
        try:
            columns, sha256 = _columns(manifest, document, i)
            parts.append(_observations(manifest, i, columns))
        except ReflectanceFitError as error:
            problems += error.problems
            continue
        warnings += columns.warnings
        inputs[manifest.tables[i].file] = sha256
    if problems:
        raise ReflectanceFitError(dict.fromkeys(problems))
    observations = concatenate(parts)
    stated = manifest.nuisances_by_name()
    nuisances = None if stated is None else nuisance_sigmas(stated, document, observations)
    return Measurement(
        path=path,
        sample_name=manifest.sample.name,
        exterior_ior=manifest.exterior_ior,
        observations=observations,
        nuisances=nuisances,
        priors=manifest.priors.by_name(),
        warnings=tuple(Note("ROWS_IGNORED", text) for text in dict.fromkeys(warnings)),
        inputs=tuple(inputs.items()),
        sample_note=manifest.sample.note or None,
    )


def _columns(manifest: Manifest, document: Document, i: int) -> tuple[Columns, str]:
    """The checked columns of table ``i``, constants filled in, and the sha256 of its file."""
    table = manifest.tables[i]
    try:
        text = open_table(Path(document.file), table.file)
    except ReflectanceFitError as error:
        raise ReflectanceFitError(
            document.problem(("tables", i, "file"), p.message) for p in error.problems
        ) from error
    columns = read_woollam(text, table) if table.format == "woollam_vase" else read_columns(text, table)
    values = dict(columns.values)
    for name, constant in table.constants.items():
        given = values.get(name, np.full(len(columns.lines), math.nan))
        values[name] = np.where(np.isnan(given), constant, given)
    if table.theta_from is not None:
        scale = table.theta_from.scale
        values["theta_deg"] = table.theta_from.zero_deg + scale * values["theta_deg"]
        if "theta_deg_sigma" in values:
            values["theta_deg_sigma"] = abs(scale) * values["theta_deg_sigma"]
    several = "wavelength_nm" in columns.values
    if "wavelength_nm" not in values:
        wavelength = table.wavelength_nm or manifest.wavelength_nm
        if wavelength is None:
            message = (
                f"tables.{i}: the wavelength is missing; add wavelength_nm, in nm, to the table or to the top"
            )
            raise ReflectanceFitError(document.problem(("tables", i), message))
        values["wavelength_nm"] = np.full(len(columns.lines), wavelength)
    values["wavelength_nm"] = np.round(values["wavelength_nm"], 3)
    columns = replace(columns, values=values)
    check_values(columns)
    asked = table.wavelengths_nm or manifest.wavelengths_nm
    if several and asked:
        place = ("tables", i, "wavelengths_nm") if table.wavelengths_nm else ("wavelengths_nm",)
        columns = _pick(columns, asked, document, place)
    return columns, text.sha256


def _pick(
    columns: Columns, asked: Iterable[float], document: Document, place: tuple[str | int, ...]
) -> Columns:
    """The rows at the wavelengths nearest to those asked for; the same at every angle, never interpolated."""
    present = np.unique(columns.values["wavelength_nm"])
    nearest = {wavelength: present[np.argmin(np.abs(present - wavelength))] for wavelength in asked}
    problems = [
        document.problem(
            place,
            f"{wavelength:g} nm: {columns.shown} has no row within {WAVELENGTH_REACH_NM:g} nm of it; its"
            f" {len(present)} wavelengths span {present[0]:g} to {present[-1]:g} nm, the nearest is {found:g}",
        )
        for wavelength, found in nearest.items()
        if not abs(found - wavelength) <= WAVELENGTH_REACH_NM
    ]
    if problems:
        raise ReflectanceFitError(problems)
    rows = np.isin(columns.values["wavelength_nm"], list(nearest.values()))
    values = {name: column[rows] for name, column in columns.values.items()}
    return replace(columns, values=values, lines=columns.lines[rows])


def _observations(manifest: Manifest, i: int, columns: Columns) -> Observations:
    """One row for each value of the table, in the order of its lines."""
    table = manifest.tables[i]
    parts = [
        (rows, _rows(manifest, i, columns, Quantity(name), rows))
        for name in QUANTITIES
        if name in columns.values and len(rows := np.flatnonzero(~np.isnan(columns.values[name])))
    ]
    if not parts:
        message = f"no row has a quantity of {', '.join(table.quantities or QUANTITIES)}"
        raise ReflectanceFitError(Problem(columns.shown, None, message))
    order = np.argsort(np.concatenate([rows for rows, _ in parts]), kind="stable")
    return concatenate([part for _, part in parts]).select(order)


def _rows(
    manifest: Manifest, i: int, columns: Columns, quantity: Quantity, rows: NDArray[np.intp]
) -> Observations:
    table = manifest.tables[i]
    n = len(rows)

    def column(name: str, absent: float = math.nan) -> FloatArray:
        return columns.values[name][rows] if name in columns.values else np.full(n, absent)

    def label(text: str) -> NDArray[np.str_]:
        return np.full(n, text)

    value = column(quantity)
    if quantity is Quantity.DELTA_DEG:
        value = np.mod(table.delta_sense * value, 360.0)
        value[value == 360.0] = 0.0  # a tiny negative angle rounds up to the excluded end
    theta_sigma = column("theta_deg_sigma", 0.0)
    analyzed = quantity is Quantity.SIGNAL  # signal_s and signal_p say themselves where the analyzer stood
    retarded = analyzed and "retarder_deg" in columns.values
    over = quantity.is_power and table.saturation is not None
    light = table.light or manifest.light or Polarization()
    wavelength = column("wavelength_nm")
    return Observations(
        channel=np.array([f"{w:.10g} nm" for w in wavelength]),
        wavelength_nm=wavelength,
        set=label(str(i)),
        gain_group=label((table.gain_group or f"{i}:{quantity}") if quantity.has_gain else ""),
        theta_deg=column("theta_deg"),
        theta_deg_sigma=np.where(np.isnan(theta_sigma), 0.0, theta_sigma),
        analyzer_deg=column("analyzer_deg") if analyzed else np.full(n, math.nan),
        retarder_deg=column("retarder_deg") if retarded else np.full(n, math.nan),
        retardance_deg=column("retardance_deg", 90.0) if retarded else np.full(n, math.nan),
        theta_deg_spread=np.zeros(n),
        diattenuation=np.ones(n),
        light=np.tile(light.vector(), (n, 1)),
        quantity=label(str(quantity)),
        value=value,
        sigma=column(f"{quantity}_sigma"),
        pixels=np.ones(n, dtype=np.int64),
        flag=np.where(over & (value >= (table.saturation or 0.0)), str(Flag.SATURATED), str(Flag.USED)),
    )
