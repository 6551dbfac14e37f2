"""Reads the YAML files of refractiveindex.info, a user's or the built-in ones.

The format: https://github.com/polyanskiy/refractiveindex.info-database, doc/.
``DATA`` lists one source of n (a table or a formula) and at most one of k;
tables hold rows ``um n k``.  Wavelengths are taken as they stand: the 0.03 %
between a wavelength in air and in vacuum moves n by less than the tables' own
error.  The files do not say whether n is relative to air or to vacuum, so the
caller does.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.physics.dispersion import index_from_formula
from reflectance_fit.strict_yaml import Document, load

AIR_INDEX = 1.000277
"""Index of standard air in the visible (P. E. Ciddor, Appl. Opt. 35, 1566 (1996))."""

FloatArray = NDArray[np.float64]
RelativeTo = Literal["air", "vacuum"]


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of a file, shape (N,): wavelength strictly increasing in micrometres, and n or k."""

    wavelength_um: FloatArray
    values: FloatArray

    @property
    def range_um(self) -> tuple[float, float]:
        return float(self.wavelength_um[0]), float(self.wavelength_um[-1])

    def at(self, wavelength_um: FloatArray) -> FloatArray:
        """Linear between rows: no peak that the source did not measure."""
        return np.interp(wavelength_um, self.wavelength_um, self.values)


@dataclass(frozen=True, slots=True, eq=False)
class Formula:
    """A dispersion formula for n, and the range in micrometres over which it was fitted."""

    number: int
    coefficients: tuple[float, ...]
    range_um: tuple[float, float]

    def at(self, wavelength_um: FloatArray) -> FloatArray:
        return index_from_formula(self.number, wavelength_um, self.coefficients)


@dataclass(frozen=True, slots=True, eq=False)
class OpticalConstants:
    """eta and k of one material against wavelength, with their source.

    ``n`` and ``k`` each answer inside their own range and nowhere else.  Where a
    file tabulates k over less than n, eta alone is still known (``eta``), but
    asking for both (``index``) is an error: an unknown k is not zero.  A file
    without any k describes a transparent material: k is 0, and ``k_known`` False.
    """

    name: str
    source: str
    comments: str
    relative_to: RelativeTo
    n: Table | Formula
    k: Table | None

    @property
    def k_known(self) -> bool:
        """False where the source gives no k, so that 0 is an assumption."""
        return self.k is not None

    @property
    def range_nm(self) -> tuple[float, float]:
        """The wavelengths ``index`` answers for."""
        low, high = self.n.range_um
        if self.k is not None:
            low, high = max(low, self.k.range_um[0]), min(high, self.k.range_um[1])
        return round(low * 1000, 9), round(high * 1000, 9)

    def eta(self, wavelength_nm: ArrayLike) -> FloatArray:
        """eta as tabulated, at ``wavelength_nm`` of any shape.

        Raises ReflectanceFitError outside the range of n: nothing is extrapolated.
        """
        return self._inside(self.n, "n", wavelength_nm)

    def index(self, wavelength_nm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """eta and k as tabulated (relative to ``relative_to``), in the shape of ``wavelength_nm``.

        Raises ReflectanceFitError outside the range of n, or of k where k is tabulated.
        """
        eta = self.eta(wavelength_nm)
        return eta, eta * 0.0 if self.k is None else self._inside(self.k, "k", wavelength_nm)

    def absolute_index(self, wavelength_nm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """As ``index``, relative to vacuum."""
        eta, k = self.index(wavelength_nm)
        scale = AIR_INDEX if self.relative_to == "air" else 1.0
        return eta * scale, k * scale

    def _inside(self, curve: Table | Formula, what: str, wavelength_nm: ArrayLike) -> FloatArray:
        asked = np.asarray(wavelength_nm, dtype=float) / 1000
        low, high = curve.range_um
        # The slack is rounding only: 436.8 nm must not miss a range that starts at 0.4368 um.
        outside = ~((asked >= low * (1 - 1e-12)) & (asked <= high * (1 + 1e-12)))
        if np.any(outside):
            raise ReflectanceFitError(
                f"{self.name}: {what} is not known at {asked[outside].flat[0] * 1000:g} nm; its source covers"
                f" {low * 1000:g} to {high * 1000:g} nm, choose a wavelength inside"
            )
        return curve.at(np.clip(asked, low, high))


def load_optical_constants(
    path: Path, *, relative_to: RelativeTo = "vacuum", name: str | None = None
) -> OpticalConstants:
    """Read one refractiveindex.info file; ``name`` defaults to the file's stem.

    Raises ReflectanceFitError, with file and line, for a file that is not of
    this format, rows that are malformed, unsorted or unphysical, a formula
    without its range, and n and k that overlap nowhere.
    """
    document = load(path)
    top: dict[str, Any] = document.data if isinstance(document.data, dict) else {}
    entries = top.get("DATA")
    if not isinstance(entries, list) or not entries:
        raise _error(document, (), "has no list DATA; is it a refractiveindex.info file?")
    found: dict[str, Table | Formula] = {}
    for i, entry in enumerate(entries):
        for quantity, curve in _curves(document, ("DATA", i), entry):
            if quantity in found:
                raise _error(document, ("DATA", i), f"{quantity} is given twice; keep one")
            found[quantity] = curve
    n, k = found.get("n"), found.get("k")
    if n is None:
        raise _error(document, ("DATA",), "gives no n; add 'tabulated n' or a formula")
    constants = OpticalConstants(
        name=name or path.stem,
        source=_plain(top.get("REFERENCES")),
        comments=_plain(top.get("COMMENTS")),
        relative_to=relative_to,
        n=n,
        k=k if isinstance(k, Table) else None,
    )
    if constants.range_nm[0] > constants.range_nm[1]:
        raise _error(document, ("DATA",), "n and k have no wavelength in common")
    return constants


def _curves(
    document: Document, path: tuple[str | int, ...], entry: Any
) -> Iterator[tuple[str, Table | Formula]]:
    """("n" or "k", its curve) for every quantity of one entry of DATA."""
    if not isinstance(entry, dict) or "type" not in entry:
        raise _error(document, path, "an entry of DATA needs a 'type'")
    kind = " ".join(str(entry["type"]).split())
    if kind in ("tabulated n", "tabulated k", "tabulated nk"):
        quantities = kind.removeprefix("tabulated ")
        rows = _rows(document, (*path, "data"), entry.get("data"), quantities)
        rows.setflags(write=False)
        for column, quantity in enumerate(quantities, 1):
            yield quantity, Table(rows[:, 0], rows[:, column])
    elif re.fullmatch(r"formula [1-9]", kind):
        yield "n", _formula(document, path, entry, int(kind[-1]))
    else:
        known = "'tabulated n', 'tabulated k', 'tabulated nk' and 'formula 1' to 'formula 9'"
        raise _error(document, (*path, "type"), f"unknown data type '{kind:.40}'; known are {known}")


def _rows(document: Document, path: tuple[str | int, ...], block: Any, quantities: str) -> FloatArray:
    """The numbers of a text block, shape (rows, 1 + quantities), every row checked."""
    if not isinstance(block, str) or not block.strip():
        raise _error(document, path, f"needs a text block 'data: |' of rows 'um {' '.join(quantities)}'")
    # The text of a block starts in the line after its key.
    first = (document.line(path) or 0) + ("\n" in block)
    problems: list[Problem] = []
    rows: list[list[float]] = []
    for line, text in enumerate(block.split("\n"), first):
        if not text.strip():
            continue
        row = _numbers(text)
        message = _row_problem(row, quantities, rows[-1][0] if rows else 0.0)
        if message:
            problems.append(Problem(document.file, line, f"row '{' '.join(text.split()):.60}': {message}"))
        if len(row) == 1 + len(quantities):
            rows.append(row)
    if problems:
        raise ReflectanceFitError(problems)
    return np.array(rows)


def _row_problem(row: list[float], quantities: str, previous_um: float) -> str | None:
    if len(row) != 1 + len(quantities):
        return f"write {1 + len(quantities)} numbers, 'um {' '.join(quantities)}'"
    if not np.all(np.isfinite(row)):
        return "every number must be finite"
    if row[0] <= previous_um:
        return "wavelengths in micrometres must be positive, sorted, and each given once"
    values = dict(zip(quantities, row[1:], strict=True))
    if values.get("n", 1.0) <= 0:
        return "n must be positive"
    if values.get("k", 0.0) < 0:
        return "k must not be negative (the index is n + ik)"
    return None


def _formula(document: Document, path: tuple[str | int, ...], entry: dict[str, Any], number: int) -> Formula:
    limits = _numbers(entry.get("wavelength_range"))
    if not (len(limits) == 2 and 0 < limits[0] < limits[1] < np.inf):
        raise _error(
            document, (*path, "wavelength_range"), "needs 'wavelength_range: LOW HIGH' in micrometres"
        )
    formula = Formula(number, tuple(_numbers(entry.get("coefficients"))), (limits[0], limits[1]))
    try:
        # A wrong digit in a coefficient shows as a pole inside the range; 1000 points meet any wide one.
        formula.at(np.linspace(limits[0], limits[1], 1000))
    except ValueError as error:
        raise _error(document, (*path, "coefficients"), str(error)) from None
    return formula


def _numbers(text: Any) -> list[float]:
    """The numbers of a line, or an empty list where one of the words is none."""
    try:
        return [float(word) for word in str(text).split()]
    except ValueError:
        return []


def _plain(text: Any) -> str:
    """Text without HTML tags and control characters, on one line.

    A tag starts with a letter: the crystal direction <111> is none.
    """
    words = html.unescape(
        re.sub(r"</?[A-Za-z][^>]*>", "", re.sub(r"<br\s*/?>", " ", str(text or "")))
    ).split()
    return "".join(c for c in " ".join(words) if c.isprintable())


def _error(document: Document, path: tuple[str | int, ...], message: str) -> ReflectanceFitError:
    return ReflectanceFitError(document.problem(path, message))
