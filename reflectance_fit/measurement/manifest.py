"""``measurement.yaml``: what its keys are, and which of them go together.

The models state each key by itself and print as a JSON Schema that editors
complete from.  What keys say about one another is checked in ``read_manifest``,
where each contradiction still has its line.  docs/formats/measurement.md is
the same in prose.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.manifests import (
    Block,
    Count,
    Light,
    Number,
    Subject,
    Text,
    Wavelength,
    check_schema,
    known_keys,
)
from reflectance_fit.measurement.keys import (
    COORDINATES,
    QUANTITIES,
    SIGMAS,
    WOOLLAM_QUANTITIES,
    ColumnName,
    ColumnRef,
    ConstantName,
    Sense,
    Wavelengths,
)
from reflectance_fit.strict_yaml import Document, load, validate


class ThetaFrom(Block):
    """theta_deg = zero_deg + scale * column."""

    scale: Number = Field(default=1.0, description="0.5 for an arm that turns twice as fast as the sample")
    zero_deg: Number = Field(default=0.0, description="theta_deg where the column reads 0")


class Table(Block):
    file: Text = Field(description="Path inside the folder of this file")
    format: Literal["columns", "woollam_vase"] = Field(
        default="columns", description="How the file is laid out"
    )
    delimiter: Literal["space", "tab", "comma", "semicolon"] | None = Field(
        default=None, description="What separates columns; space is any run of blanks; found out when absent"
    )
    skip_rows: Count = Field(default=0, description="Lines to leave out at the top")
    columns: dict[ColumnName, ColumnRef] = Field(
        default={},
        description="Quantity to column number, from 0, or header text",
        json_schema_extra=known_keys(COORDINATES + QUANTITIES + SIGMAS),
    )
    constants: dict[ConstantName, Number] = Field(
        default={},
        description="Stands for a missing column",
        json_schema_extra=known_keys(COORDINATES + SIGMAS),
    )
    theta_from: ThetaFrom | None = Field(default=None, description="theta_deg = zero_deg + scale * column")
    saturation: Number | None = Field(
        default=None, description="Signals and reflectances from here on are lower bounds"
    )
    gain_group: Text | None = Field(default=None, description="Signals of one group share one unknown gain")
    delta_sense: Sense = Field(default=1, description="-1 for files whose Delta has the other sign")
    light: Light | None = Field(default=None, description="Incident beam of this table")
    wavelength_nm: Wavelength | None = Field(default=None, description="Vacuum wavelength of the whole table")
    wavelengths_nm: Wavelengths | None = Field(
        default=None, description="Use the nearest present, within 2 nm"
    )
    quantities: (
        Annotated[
            tuple[Literal["psi_deg", "delta_deg", "reflectance_s", "reflectance_p"], ...], Field(min_length=1)
        ]
        | None
    ) = Field(default=None, description="woollam_vase: which quantities to use; default all")


class Manifest(Subject):
    """Tables of one sample, measured elsewhere."""

    model_config = ConfigDict(title="reflectance_fit measurement")

    schema_: Literal["reflectance_fit/measurement/1"] = Field(
        alias="schema", description="Format and version"
    )
    wavelength_nm: Wavelength | None = Field(default=None, description="Default for tables that name none")
    wavelengths_nm: Wavelengths | None = Field(
        default=None, description="Default choice for tables of many wavelengths"
    )
    light: Light | None = Field(default=None, description="Incident beam; default: unpolarized")
    tables: Annotated[tuple[Table, ...], Field(min_length=1)] = Field(description="At least one")


def read_manifest(path: Path) -> tuple[Manifest, Document]:
    """The manifest at ``path`` and its lines; ReflectanceFitError with every problem found."""
    document = load(path)
    check_schema(document, "measurement")
    manifest = validate(document, Manifest)
    problems = [
        document.problem(("tables", i, *where), f"tables.{i}: {message}")
        for i, table in enumerate(manifest.tables)
        for where, message in _contradictions(table)
    ]
    if problems:
        raise ReflectanceFitError(sorted(problems, key=lambda p: (p.line or 0, p.message)))
    return manifest, document


def _contradictions(table: Table) -> Iterator[tuple[tuple[str, ...], str]]:
    """(path inside the table, message) for keys that do not go together."""
    woollam = table.format == "woollam_vase"
    given = table.model_fields_set
    if woollam:
        for key in ("delimiter", "skip_rows", "columns", "theta_from", "gain_group"):
            if key in given:
                yield (key,), f"woollam_vase files need no {key}; remove it"
        for name in set(table.constants) - set(SIGMAS):
            yield ("constants", name), f"woollam_vase files state their own {name}; remove it"
    elif "quantities" in given:
        yield ("quantities",), "quantities belongs to woollam_vase; here columns names them"
    stated = set(table.columns) | set(table.constants)
    if not woollam and not stated & set(QUANTITIES):
        yield ("columns",), f"columns names no quantity; add one of {', '.join(QUANTITIES)}"
    if not woollam and "theta_deg" not in stated:
        yield ("columns",), "theta_deg is missing; name its column or give it under constants"
    for name in set(table.columns) & set(table.constants):
        yield ("constants", name), f"{name} is both a column and a constant; keep one"
    measured = {*(table.quantities or WOOLLAM_QUANTITIES)} if woollam else {*table.columns}
    for name in stated & set(SIGMAS) - {"theta_deg_sigma"}:
        if name.removesuffix("_sigma") not in measured:
            block = "columns" if name in table.columns else "constants"
            yield (block, name), f"{name} has no {name.removesuffix('_sigma')} beside it; add that column"
    if table.theta_from is not None and not woollam and "theta_deg" not in table.columns:
        yield ("theta_from",), "theta_from needs a column theta_deg"
    for name in ("analyzer_deg", "retarder_deg"):
        if name in stated and "signal" not in table.columns:
            yield ("columns",), f"{name} goes with the quantity 'signal', which is not among the columns"
    if "retardance_deg" in stated and "retarder_deg" not in stated:
        yield ("columns",), "retardance_deg needs retarder_deg, the direction of its fast axis"
    many = woollam or "wavelength_nm" in table.columns
    if table.wavelengths_nm and not many:
        yield ("wavelengths_nm",), "wavelengths_nm needs a wavelength column to choose from"
    if table.wavelength_nm is not None and (many or "wavelength_nm" in table.constants):
        yield (
            ("wavelength_nm",),
            (
                "the wavelength is stated twice; to pick from a file's own wavelengths use wavelengths_nm: [...]"
            ),
        )
