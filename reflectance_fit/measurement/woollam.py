"""The text export of Woollam ellipsometers (WVASE, CompleteEASE).

Header lines end with a unit (nm, A, eV); then a row each of wavelength,
angle, psi, delta and their sigmas, or a tag and what it announces.  Delta has
the same sense as ours (docs/conventions.md): 180 degrees for glass below Brewster.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.measurement.keys import WOOLLAM_QUANTITIES
from reflectance_fit.measurement.manifest import Table
from reflectance_fit.measurement.tables import MAX_PROBLEMS, Columns, TableText, number

HEADER_LINES = 30

# 1239.84... is hc in eV nm.
TO_NM: Mapping[str, Callable[[float], float]] = {
    "nm": lambda x: x,
    "a": lambda x: x / 10,
    "angstrom": lambda x: x / 10,
    "angstroms": lambda x: x / 10,
    "um": lambda x: x * 1000,
    "ev": lambda x: 1239.8419843320026 / x,
}
# What follows wavelength and angle, by tag; other tags are counted, not read.
_ELLIPSOMETRIC = ("psi_deg", "delta_deg", "psi_deg_sigma", "delta_deg_sigma")
READ: Mapping[str, tuple[str, ...]] = {
    "": _ELLIPSOMETRIC,
    "E": _ELLIPSOMETRIC,
    "AnE": _ELLIPSOMETRIC,
    "pR": ("reflectance_p", "reflectance_p_sigma"),
    "sR": ("reflectance_s", "reflectance_s_sigma"),
}
_TAG = re.compile(r"[A-Za-z]{1,9}\d?")
_COLUMNS = ("wavelength_nm", "theta_deg", *WOOLLAM_QUANTITIES, *(f"{q}_sigma" for q in WOOLLAM_QUANTITIES))


def read_woollam(text: TableText, table: Table) -> Columns:
    """Rows of the quantities that ``table.quantities`` asks for; the other columns of a row are NaN.

    Raises ReflectanceFitError naming up to 5 rows that cannot be read, or
    where no row has a quantity asked for.
    """
    use = set(table.quantities or WOOLLAM_QUANTITIES)
    start, to_nm, warnings = _header(text)
    rows: list[dict[str, float]] = []
    lines: list[int] = []
    skipped: Counter[str] = Counter()
    problems: list[Problem] = []
    for line_number, line in enumerate(text.lines[start:], start + 1):
        fields = line.split()
        if not fields:
            continue
        tag = fields[0] if _is_tag(fields) else ""
        if tag not in READ:
            skipped[tag] += 1
            continue
        try:
            row = _row(fields[1:] if tag else fields, READ[tag], to_nm)
        except ValueError as error:
            problems.append(Problem(text.shown, line_number, str(error)))
            if len(problems) == MAX_PROBLEMS:
                break
            continue
        if use & set(row):
            rows.append(
                {k: v for k, v in row.items() if k.removesuffix("_sigma") in use or k in _COLUMNS[:2]}
            )
            lines.append(line_number)
    tags = ", ".join(f"{count} tagged {tag}" for tag, count in sorted(skipped.items()))
    if not rows and not problems:
        found = f"; there are {tags}" if tags else ""
        problems.append(Problem(text.shown, None, f"holds no rows of {', '.join(sorted(use))}{found}"))
    if problems:
        raise ReflectanceFitError(problems)
    if skipped:
        warnings += (f"{text.shown}: rows left out: {tags}; read are psi and delta, pR and sR",)
    values = {name: np.array([row.get(name, math.nan) for row in rows]) for name in _COLUMNS}
    return Columns(text.shown, values, np.array(lines), warnings)


def _header(text: TableText) -> tuple[int, Callable[[float], float], tuple[str, ...]]:
    """Number of header lines, how its unit becomes nm, and warnings."""
    for i, line in enumerate(text.lines[:HEADER_LINES]):
        if (unit := line.strip().lower()) in TO_NM:
            return i + 1, TO_NM[unit], ()
    warning = f"{text.shown}: no unit line before the data; wavelengths are taken to be in nm"
    for i, line in enumerate(text.lines[:HEADER_LINES]):
        fields = line.split()
        tagged = _is_tag(fields)
        if len(fields) >= 4 + tagged and all(_numeric(t) for t in fields[tagged:]):
            return i, TO_NM["nm"], (warning,)
    message = "is not a woollam_vase export: no unit line (nm, A or eV) and no rows of numbers"
    raise ReflectanceFitError(Problem(text.shown, None, message))


def _is_tag(fields: list[str]) -> bool:
    """Whether a row begins with a tag: a short word before at least three numbers."""
    return (
        len(fields) >= 4
        and _TAG.fullmatch(fields[0]) is not None
        and not _numeric(fields[0])
        and all(_numeric(t) for t in fields[1:4])
    )


def _numeric(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _row(fields: list[str], names: tuple[str, ...], to_nm: Callable[[float], float]) -> dict[str, float]:
    """One row; sigmas may be missing at its end."""
    values_due = len(names) // 2
    if not 2 + values_due <= len(fields) <= 2 + len(names):
        due = ", ".join(("wavelength", "angle", *names[:values_due]))
        raise ValueError(f"has {len(fields)} numbers; due are {due}, then their sigmas")
    row = {
        name: number(text, name)
        for name, text in zip(("wavelength_nm", "theta_deg", *names), fields, strict=False)
    }
    if row["wavelength_nm"] <= 0:
        raise ValueError(f"wavelength_nm must be above 0 (found {row['wavelength_nm']:g})")
    row["wavelength_nm"] = to_nm(row["wavelength_nm"])
    return row
