"""OBS.nc: observations as a NetCDF4 file, with all that a fit needs to know of them.

One dimension ``row``, a variable a column, and the rest as global attributes.
A file from elsewhere is data, or one line that says what is wrong with it.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import h5netcdf
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import write_whole
from reflectance_fit.inputs import check_regular
from reflectance_fit.manifests import (
    WAVELENGTHS_NM,
    Block,
    NuisanceName,
    Positive,
    Priors,
    Text,
    check_schema,
)
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.observations import Flag, Observations, Quantity
from reflectance_fit.observations_columns import ATTRIBUTES, COLUMNS, OPTIONAL, SCHEMA
from reflectance_fit.strict_yaml import Document, validate

MAX_ROWS = 5_000_000  # a file may claim any number without holding one
_JSON = ("nuisances", "common_sigmas", "priors", "warnings", "inputs")
_DTYPES = {"text": np.str_, "float": np.floating, "integer": np.integer}
_WIDE = {"float": np.float64, "integer": np.int64}


class _Warning(Block):
    code: Text
    message: Text


class _Input(Block):
    file: Text
    sha256: Text


class _Attributes(Block):
    schema_: Literal["reflectance_fit/observations/1"] = Field(alias="schema")
    sample: Text
    exterior_ior: Positive
    note: Text | None = None
    nuisances: dict[NuisanceName, Positive | None] | None = None
    common_sigmas: dict[NuisanceName, dict[Text, Positive]] = Field(default_factory=dict)
    priors: Priors
    warnings: tuple[_Warning, ...]
    inputs: Annotated[tuple[_Input, ...], Field(min_length=1)]
    version: Text


def write_observations(measurement: Measurement, path: Path) -> None:
    """Write ``path`` whole or not at all; the same measurement gives the same bytes."""
    nuisances, observations = measurement.nuisances, measurement.observations
    values: dict[str, Any] = {
        "schema": SCHEMA,
        "sample": measurement.sample_name,
        "exterior_ior": measurement.exterior_ior,
        "priors": {name: prior.as_yaml() for name, prior in measurement.priors.items()},
        "warnings": [note._asdict() for note in measurement.warnings],
        "inputs": [{"file": file, "sha256": sha256} for file, sha256 in measurement.inputs],
        "version": version("reflectance_fit"),
    }
    if measurement.sample_note is not None:
        values["note"] = measurement.sample_note
    if nuisances is not None:
        values["nuisances"] = {name: s if np.isfinite(s) else None for name, s in nuisances.items()}
    if measurement.common_sigmas:
        values["common_sigmas"] = {name: dict(by) for name, by in measurement.common_sigmas.items()}

    def fill(part: Path) -> None:
        with h5netcdf.File(part, "w") as file:
            for name, value in values.items():
                file.attrs[name] = json.dumps(value, ensure_ascii=False) if name in _JSON else value
            file.dimensions = {"row": len(observations)}
            for name, (kind, unit, text) in COLUMNS.items():
                data = _column(observations, name)
                dtype = h5netcdf.core.h5py.string_dtype() if kind == "text" else data.dtype
                variable = file.create_variable(name, ("row",), dtype)
                variable[...] = data.astype(object) if kind == "text" else data
                variable.attrs["long_name"] = text
                if unit:
                    variable.attrs["units"] = unit

    write_whole(path, fill)


def _column(observations: Observations, name: str) -> NDArray[Any]:
    if name.startswith("light_s"):
        return observations.light[:, int(name[-1])]
    column: NDArray[Any] = getattr(observations, name)
    return column


def read_observations(path: Path) -> Measurement:
    """What ``write_observations`` wrote; ReflectanceFitError with every problem found for anything else."""
    check_regular(path, str(path))
    try:
        attributes, columns, problems = _raw(path)
    except Exception as error:  # whatever the libraries below make of broken bytes
        # Their messages are long and speak of file handles.
        why = str(error).partition("(")[0].strip() or type(error).__name__
        message = f"cannot be read as observations (NetCDF4): {why:.100}"
        raise ReflectanceFitError(Problem(str(path), None, message)) from error
    document = Document(str(path), attributes, {})
    check_schema(document, "observations")
    if problems:
        raise ReflectanceFitError(Problem(str(path), None, problem) for problem in problems)
    stated = validate(document, _Attributes)
    light = np.column_stack([columns.pop(f"light_s{i}") for i in range(4)])
    observations = Observations(light=light, **columns)
    if not np.all(np.isin(observations.flag, [str(flag) for flag in Flag])):
        raise ReflectanceFitError(Problem(str(path), None, "flag has a name that is not known"))
    if wrong := [message for message, bad in _rules(observations.used) if np.any(bad)]:
        raise ReflectanceFitError(Problem(str(path), None, message) for message in wrong)
    nuisances = stated.nuisances
    return Measurement(
        path=path,
        sample_name=stated.sample,
        exterior_ior=stated.exterior_ior,
        observations=observations,
        nuisances=None
        if nuisances is None
        else {n: np.inf if s is None else s for n, s in nuisances.items()},
        priors=stated.priors.by_name(),
        warnings=tuple(Note(entry.code, entry.message) for entry in stated.warnings),
        inputs=tuple((entry.file, entry.sha256) for entry in stated.inputs),
        sample_note=stated.note,
        common_sigmas=dict(stated.common_sigmas),
    )


def _raw(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]], list[str]]:
    """Attributes, columns, and what is wrong with the columns."""
    _refuse_elsewhere(path)
    with h5netcdf.File(path, "r") as file:
        attributes = {name: _plain(file.attrs[name]) for name in ATTRIBUTES if name in file.attrs}
        for name in _JSON:
            if isinstance(attributes.get(name), str):
                attributes[name] = json.loads(attributes[name])
        if attributes.get("schema") != SCHEMA:
            return attributes, {}, []
        rows = file.dimensions["row"].size
        if rows > MAX_ROWS:
            return attributes, {}, [f"has {rows} rows; at most {MAX_ROWS} are read"]
        columns: dict[str, NDArray[Any]] = {}
        problems = []
        for name, (kind, _, _) in COLUMNS.items():
            if name not in file.variables and name in OPTIONAL:
                continue
            if name not in file.variables:
                problems.append(f"the column {name} is missing; write the file anew with ingest")
            elif file.variables[name].dimensions != ("row",):
                problems.append(f"the column {name} must have the one dimension row")
            else:
                data = file.variables[name][...]
                # Texts arrive as objects, each of them bytes.
                if kind == "text" and all(isinstance(text, bytes) for text in data):
                    data = np.array([text.decode() for text in data], dtype=np.str_)
                if not np.issubdtype(data.dtype, _DTYPES[kind]):
                    problems.append(f"the column {name} must hold {kind} values")
                else:
                    columns[name] = data.astype(_WIDE.get(kind, data.dtype))
        return attributes, columns, problems


def _refuse_elsewhere(path: Path) -> None:
    """HDF5 can present parts of any other file as its own; ours never does."""
    h5py = h5netcdf.core.h5py
    with h5py.File(path, "r") as file:
        for name in COLUMNS.keys() & set(file):
            found = file[name] if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
            if not isinstance(found, h5py.Dataset) or found.external or found.is_virtual:
                raise ValueError(f"{name} is no column of this file")


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def _rules(o: Observations) -> list[tuple[str, NDArray[Any]]]:
    """(what is wrong, rows where it is); NaN breaks a rule unless it stands for something."""
    low, high = WAVELENGTHS_NM
    s0, polarized = o.light[:, 0], np.hypot(np.hypot(o.light[:, 1], o.light[:, 2]), o.light[:, 3])
    angles = (o.analyzer_deg, o.retarder_deg, o.retardance_deg)
    return [
        ("quantity has a name that is not known", ~np.isin(o.quantity, [str(q) for q in Quantity])),
        ("value must be finite", ~np.isfinite(o.value)),
        ("sigma must be above 0 and finite, or NaN", (o.sigma <= 0) | np.isinf(o.sigma)),
        (
            f"wavelength_nm must be {low:g} to {high:g}",
            ~((o.wavelength_nm >= low) & (o.wavelength_nm <= high)),
        ),
        ("theta_deg must be 0 to below 90", ~((o.theta_deg >= 0) & (o.theta_deg < 90))),
        ("theta_deg_sigma must be 0 or above", ~((o.theta_deg_sigma >= 0) & np.isfinite(o.theta_deg_sigma))),
        ("theta_deg_spread must be 0 to 90", ~((o.theta_deg_spread >= 0) & (o.theta_deg_spread <= 90))),
        ("analyzer and retarder angles must be finite, or NaN", np.isinf(angles)),
        ("diattenuation must be above 0 and at most 1", ~((o.diattenuation > 0) & (o.diattenuation <= 1))),
        ("fwhm_nm must be 0 or above", ~((o.fwhm_nm >= 0) & np.isfinite(o.fwhm_nm))),
        (
            "signal_per_dn must be above 0 and finite, or NaN",
            (o.signal_per_dn <= 0) | np.isinf(o.signal_per_dn),
        ),
        ("light_s0 must be above 0", ~((s0 > 0) & np.isfinite(s0))),
        ("light is more polarized than possible", ~(polarized <= s0 * (1 + 1e-9))),
    ]
