"""Runs the pages: every shell and Python block of docs/*.md and README.md, in order, in one folder a page.

A page is one test, because its blocks build on one another.  What a block may be:

* ``bash`` and ``python``: run; a failing command or an exception fails the page; ``$DOCS`` is this folder
* ``text``: what the block before it printed.  Words must agree, and numbers to 5 units of their last place
* any block below ``<!-- file: PATH -->``: is saved as PATH
* any block below ``<!-- from: PATH -->``: its lines stand in PATH, in this order, numbers to a tenth
* ``<!-- invisible-code-block: bash ... -->``: run, not shown
* a block below ``<!-- skip: next -->``: not run
* any other block is an illustration (tests/docs/test_blocks.py says which languages may be)
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
from sybil import Document, Example, Region, Sybil
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import CodeBlockParser, SkipParser

ROOT = Path(__file__).resolve().parents[1]
SECONDS = 200  # a block at most
LAST_PLACES = 5
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?")
ABOUT_A_FILE = re.compile(
    r"^<!-- (?P<verb>file|from): (?P<path>\S+) -->\n+```\w+\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)


def run_shell(example: Example) -> str | None:
    """Run a block with ``set -e`` in the page's folder; what it says on failure is the message."""
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    done = subprocess.run(
        ["bash", "-e", "-u", "-o", "pipefail", "-c", str(example.parsed)],
        env={**os.environ, "PATH": search, "NO_COLOR": "1", "DOCS": str(ROOT / "docs")},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    example.namespace["printed"] = done.stdout
    if done.returncode == 0:
        return None
    return f"exit code {done.returncode} of\n{example.parsed}\n{done.stdout}{done.stderr}"


def run_python(example: Example) -> str | None:
    """Run a block in the page's namespace, keeping what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        PythonEvaluator()(example)
    example.namespace["printed"] = printed.getvalue()
    return None


def compare_text(example: Example) -> str | None:
    """The block against what the block before it printed."""
    shown, printed = (
        [line for line in text.splitlines() if line.strip()]
        for text in (str(example.parsed), example.namespace["printed"])
    )
    if len(shown) == len(printed) and all(
        same_line(*lines, close_in_print) for lines in zip(shown, printed, strict=True)
    ):
        return None
    return "\n".join(["the page shows", *shown, "but the command prints", *printed])


def same_line(one: str, other: str, close: Callable[[str, str], bool]) -> bool:
    """Equal words, and numbers that are ``close``."""
    if NUMBER.sub("#", one).split() != NUMBER.sub("#", other).split():
        return False
    return all(map(close, NUMBER.findall(one), NUMBER.findall(other)))


def close_in_print(one: str, other: str) -> bool:
    """To some units of the last place shown: the noise of sampling on other processors.  Integers are exact."""
    _, point, places = one.partition(".")
    return (
        abs(float(one) - float(other)) < (LAST_PLACES + 0.5) * 10.0 ** -len(places) if point else one == other
    )


def close_in_file(one: str, other: str) -> bool:
    """To a tenth, for files have more digits than mean anything.  Integers are exact."""
    return abs(float(one) - float(other)) <= 0.1 * abs(float(one)) if "." in one else one == other


def about_a_file(document: Document) -> Iterable[Region]:
    """The blocks below ``file:`` and ``from:``."""
    for match in ABOUT_A_FILE.finditer(document.text):
        use = write_file if match["verb"] == "file" else compare_file
        yield Region(match.start(), match.end(), (match["path"], match["text"]), use)


def write_file(example: Example) -> str | None:
    path, text = example.parsed
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text, encoding="utf-8")
    return None


def compare_file(example: Example) -> str | None:
    path, text = example.parsed
    lines = iter(Path(path).read_text(encoding="utf-8").splitlines())
    for shown in filter(str.strip, text.splitlines()):
        if not any(
            _indent(shown) == _indent(line) and same_line(shown, line, close_in_file) for line in lines
        ):
            return f"not in {path}, or not in this order: {shown}"
    return None


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


PAGES = Sybil(
    parsers=[
        CodeBlockParser("bash", run_shell),
        CodeBlockParser("python", run_python),
        CodeBlockParser("text", compare_text),
        about_a_file,
        SkipParser(),
    ],
)


class PageFile(pytest.File):
    def collect(self) -> Iterator[pytest.Item]:
        document = PAGES.parse(self.path)
        if list(document.examples()):
            page = Page.from_parent(self, name="blocks", document=document)
            # ArviZ says this once a day and user, whatever is imported from it.
            page.add_marker(pytest.mark.filterwarnings(r"ignore:\s*ArviZ is undergoing:FutureWarning"))
            yield page


class Page(pytest.Item):
    """All blocks of one page."""

    def __init__(self, *, document: Document, **about: object) -> None:
        super().__init__(**about)
        self.document = document
        self.line = 0

    def runtest(self) -> None:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            for example in self.document.examples():
                self.line = example.line
                example.evaluate()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: str | None = None) -> str:
        text = str(excinfo.value) or excinfo.type.__name__
        return f"{self.path.name}, line {self.line}: {excinfo.type.__name__}\n{text}"

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, f"the blocks of {self.path.name}"


class PageCollector:
    @staticmethod
    def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> PageFile | None:
        inside = file_path.is_relative_to(ROOT / "docs") or file_path == ROOT / "README.md"
        if inside and file_path.suffix == ".md":
            return PageFile.from_parent(parent, path=file_path)
        return None


def pytest_configure(config: pytest.Config) -> None:
    # As a plugin of its own: the hooks of this file itself are not asked about README.md, which is not in docs/.
    config.pluginmanager.register(PageCollector())
