"""A card: figures with targets, measured by one command and published on one page.

A card NAME is a module NAME.py beside the script that runs it, with

* ``about(full) -> str``: what was measured over how much, seeds and N included
* ``figures(full) -> Iterator[Figure | Table]``: the figures, each as soon as it is known, and the tables
  that belong beside them on the page

A module whose name has an underscore is a part of a card.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import reflectance_fit
from reflectance_fit.files import write_whole

PAGE = Path(__file__).parents[2] / "docs" / "validation.md"
_NO_CARDS = {"card", "run"}
_HEAD = """\
# Validation

Written by `python tests/scorecard/run.py NAME --write` and `python tests/benchmarks/run.py NAME --write`; never edited by hand.
A section holds the last run of one command: what was promised, what was found, and where.
`short` misses its target, `not run` says why.
Seeds are fixed before a run and never changed after one; every figure is of all seeds.
"""


@dataclass(frozen=True, slots=True)
class Figure:
    """One promise and what became of it; ``why`` is for those not run."""

    name: str
    value: str
    target: str
    verdict: Literal["ok", "short", "not run"]
    why: str = ""

    @classmethod
    def judged(cls, name: str, value: str, target: str, good: bool) -> Figure:
        return cls(name, value, target, "ok" if good else "short")

    @classmethod
    def not_run(cls, name: str, target: str, why: str) -> Figure:
        return cls(name, "-", target, "not run", why)

    @classmethod
    def reported(cls, name: str, value: str) -> Figure:
        """For information: nothing was promised."""
        return cls(name, value, "none", "ok")

    @property
    def outcome(self) -> str:
        return f"{self.verdict}: {self.why}" if self.why else self.verdict

    def __str__(self) -> str:
        return f"{self.name}: {self.value} (target {self.target}) {self.outcome}"


@dataclass(frozen=True, slots=True)
class Table:
    """What the figures are the extremes of; goes to the page only."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __str__(self) -> str:
        return "\n".join([f"### {self.title}", "", *_table(self.header, self.rows)])


def main(kind: str, folder: Path, arguments: Sequence[str] | None = None, page: Path = PAGE) -> int:
    """Run the card that the arguments name; returns the exit code.

    ``kind`` (scorecard or benchmarks) and the name are the title of its section on ``page``.
    """
    parser = argparse.ArgumentParser(description=f"Run one of the {kind} and print a line a figure.")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("--full", action="store_true", help="as long as it takes, not within 10 minutes")
    parser.add_argument("--write", action="store_true", help=f"put the results into {page.name}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results to FILE, too")
    options = parser.parse_args(arguments)
    known = names(folder)
    if options.name not in known:
        print(f"there is no '{options.name}'; choose one of: {', '.join(known)}", file=sys.stderr)
        return 2
    module = importlib.import_module(options.name)
    started = time.perf_counter()
    found: list[Figure] = []
    tables: list[Table] = []
    for item in module.figures(full=options.full):
        if isinstance(item, Table):
            tables.append(item)
            continue
        print(item, flush=True)
        found.append(item)
    seconds = time.perf_counter() - started
    print(summary(found))
    title = f"{kind} {options.name}" + (" --full" if options.full else "")
    about = module.about(full=options.full)
    if options.write:
        write_section(page, title, section(about, found, seconds, tables))
    if options.json:
        data = {
            "title": title,
            "version": reflectance_fit.__version__,
            "date": _today(),
            "machine": machine(),
            "about": about,
            "seconds": round(seconds, 1),
            "figures": [asdict(figure) for figure in found],
        }
        options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return 1 if any(figure.verdict == "short" for figure in found) else 0


def names(folder: Path) -> list[str]:
    """The cards in ``folder``."""
    return sorted(
        path.stem for path in folder.glob("*.py") if path.stem not in _NO_CARDS and "_" not in path.stem
    )


def summary(found: Sequence[Figure]) -> str:
    verdicts = [figure.verdict for figure in found]
    return ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in ("ok", "short", "not run"))


def machine() -> str:
    """Cores, CPU and Python."""
    model = platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        stated = re.search(r"^model name\s*:\s*(.+)$", cpuinfo.read_text(encoding="utf-8"), re.MULTILINE)
        model = stated[1] if stated else model
    return f"{os.cpu_count()} cores, {model}, {platform.system()}, Python {platform.python_version()}"


def section(about: str, found: Sequence[Figure], seconds: float, tables: Sequence[Table] = ()) -> str:
    """What stands below a title: circumstances, then a row a figure, then tables."""
    rows = [(figure.name, figure.value, figure.target, figure.outcome) for figure in found]
    lines = [
        f"reflectance_fit {reflectance_fit.__version__}, {_today()}, {machine()}; took {seconds:.0f} s.",
        about,
        "",
        *_table(("figure", "value", "target", "verdict"), rows),
        "",
        f"{summary(found)}.",
        *(f"\n{table}" for table in tables),
    ]
    return "\n".join(lines)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    cells = [[text.replace("|", r"\|") for text in row] for row in (header, *rows)]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    return [lines[0], "|" + "---|" * len(header), *lines[1:]]


def write_section(page: Path, title: str, text: str) -> None:
    """Put ``text`` below ``title``; the other sections of ``page`` stay as they are."""
    earlier = page.read_text(encoding="utf-8") if page.exists() else ""
    sections = dict(re.findall(r"^## ([^\n]+)\n\n(.*?)\s*(?=^## |\Z)", earlier, re.MULTILINE | re.DOTALL))
    sections[title] = text
    parts = [_HEAD, *(f"## {name}\n\n{sections[name]}\n" for name in sorted(sections))]
    write_whole(page, lambda part: part.write_text("\n".join(parts), encoding="utf-8"))


def _today() -> str:
    return datetime.now(UTC).date().isoformat()
