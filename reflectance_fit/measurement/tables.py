"""One table file to columns of numbers, each row with its line in the file."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError, suggestion
from reflectance_fit.inputs import confined, sha256_of
from reflectance_fit.measurement.manifest import Table
from reflectance_fit.observations import FloatArray
from reflectance_fit.strict_yaml import read_text

MAX_BYTES = 50_000_000
MAX_PROBLEMS = 5  # of one file: the sixth row of a wrong column says nothing new
HEADER_LINES = 100  # a header is looked for in this many lines

DELIMITERS: Mapping[str, str | None] = {"space": None, "tab": "\t", "comma": ",", "semicolon": ";"}
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """What a table file states: columns of equal length N, NaN where a row has no such value.

    ``shown`` is the file's name for messages, ``lines`` the line of each row, from 1.
    """

    shown: str
    values: Mapping[str, FloatArray]
    lines: NDArray[np.int64]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TableText:
    """A table file as text, where it may be read from and what it hashes to."""

    shown: str
    lines: list[str]
    sha256: str


def open_table(manifest: Path, file: str) -> TableText:
    """The text of ``file``, which must lie inside the folder of ``manifest``.

    Raises ReflectanceFitError, with no line and a message that names ``file``,
    for paths that lead outside (absolute, "..", symbolic links), what is not a
    regular file of text, and files above 50 MB.
    """
    path = confined(manifest, file)
    try:
        text = read_text(path, name=file, max_bytes=MAX_BYTES)
        sha256 = sha256_of(path)
    except ReflectanceFitError as error:
        raise ReflectanceFitError(
            [Problem(None, None, str(problem)) for problem in error.problems]
        ) from error
    # Not splitlines(): it also breaks at form feeds and U+2028, where editors count no line.
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return TableText(str(manifest.parent / file), lines, sha256)


def read_columns(text: TableText, table: Table) -> Columns:
    """The columns that ``table.columns`` names, as numbers.

    Raises ReflectanceFitError naming up to 5 rows that cannot be read.
    """
    rows = [(number, line) for number, line in enumerate(text.lines, 1) if number > table.skip_rows]
    wanted, delimiter, start = _columns_and_delimiter(text.shown, rows, table)
    values: dict[str, list[float]] = {name: [] for name in wanted}
    lines: list[int] = []
    problems: list[Problem] = []
    for number, line in _content(rows[start:]):
        try:
            fields = split(line, delimiter)
            row = {name: field(fields, index, name) for name, index in wanted.items()}
        except ValueError as error:
            hint = "; if this is a header, name columns by its texts or set skip_rows" if not lines else ""
            problems.append(Problem(text.shown, number, f"{error}{hint}"))
            if len(problems) == MAX_PROBLEMS:
                break
            continue
        lines.append(number)
        for name, value in row.items():
            values[name].append(value)
    if not lines and not problems:
        problems.append(Problem(text.shown, None, "holds no data rows; is it the right file?"))
    if problems:
        raise ReflectanceFitError(problems)
    return Columns(text.shown, {k: np.array(v, dtype=float) for k, v in values.items()}, np.array(lines))


def split(line: str, delimiter: str | None) -> list[str]:
    """The fields of a line without their blanks; None separates at runs of blanks."""
    if delimiter is None or '"' not in line:
        return [text.strip() for text in line.split(delimiter)]
    try:
        return [text.strip() for text in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    except csv.Error:  # a quoted field longer than the csv module takes; no number and no header either
        return [line]


def field(fields: list[str], index: int, name: str) -> float:
    """Field ``index`` as a number; ValueError says what it is instead."""
    if index >= len(fields):
        raise ValueError(f"has {len(fields)} columns; column {index} ({name}, counted from 0) is missing")
    return number(fields[index], name)


def number(text: str, name: str) -> float:
    """A finite number; ValueError says what ``text`` is instead.  Leading zeros ("09") are no octal."""
    if _DECIMAL_COMMA.fullmatch(text):
        raise ValueError(f"{name}: '{text}' has a decimal comma; write {text.replace(',', '.')}")
    try:
        # float() also takes "1_0" and digits of other scripts, which no instrument writes on purpose.
        value = float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        value = None
    if value is None:
        found = f"'{text:.40}' is not a number" if text else "is empty"
        raise ValueError(f"{name}: {found}; correct it, or remove the row")
    if not math.isfinite(value):
        raise ValueError(f"{name}: '{text:.40}' is not a finite number; remove the row")
    return value


def _content(rows: list[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Rows that are neither blank nor comments."""
    return ((n, line) for n, line in rows if line.strip(" \t,;") and not line.lstrip().startswith("#"))


def _columns_and_delimiter(
    shown: str, rows: list[tuple[int, str]], table: Table
) -> tuple[dict[str, int], str | None, int]:
    """Index of each column, the delimiter, and where in ``rows`` the data begin."""

    def delimiter_of(line: str) -> str | None:
        return DELIMITERS[table.delimiter] if table.delimiter else _sniff(line)

    asked = {ref for ref in table.columns.values() if isinstance(ref, str)}
    if not asked:
        first = next((line for _, line in _content(rows)), "")
        return {name: int(ref) for name, ref in table.columns.items()}, delimiter_of(first), 0
    # Some instruments write their header as a comment.
    lines = [line.lstrip().removeprefix("#") for _, line in rows[:HEADER_LINES]]
    headers = [split(line, delimiter_of(line)) for line in lines]
    i = max(range(len(headers)), key=lambda i: (len(asked & set(headers[i])), len(headers[i])), default=None)
    header = headers[i] if i is not None else []
    if i is None or not asked <= set(header):
        found = ", ".join(header)[:200]
        raise ReflectanceFitError(
            Problem(shown, None, f"no header '{name}'{suggestion(name, header) or f'; found are: {found}'}")
            for name in sorted(asked - set(header))
        )
    if repeated := sorted(name for name in asked if header.count(name) > 1):
        message = f"'{repeated[0]}' stands above several columns; name the column by its number"
        raise ReflectanceFitError(Problem(shown, rows[i][0], message))
    wanted = {k: ref if isinstance(ref, int) else header.index(ref) for k, ref in table.columns.items()}
    return wanted, delimiter_of(lines[i]), i + 1


def _sniff(line: str) -> str | None:
    """The delimiter of a line: tab, semicolon, comma, else blanks."""
    if "\t" in line or ";" in line:
        return "\t" if "\t" in line else ";"
    # "83,5 0,31" is separated by blanks, and its commas deserve their own message.
    blanks = line.split()
    decimal = len(blanks) > 1 and all(_DECIMAL_COMMA.fullmatch(t) or t.isdigit() for t in blanks)
    return "," if "," in line and not decimal else None
