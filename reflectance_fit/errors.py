"""The one exception that means: the user can mend this.

The command line turns it into lines ``Error: FILE:LINE: what, and what to do``
and exit code 1.  Every other exception is a bug of ours.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

MAX_LINES = 20


@dataclass(frozen=True, slots=True, order=True)
class Problem:
    """One thing wrong, where it is and what to do about it.

    ``file`` is the path as the user wrote it; ``line`` counts from 1.  Both
    are None where the problem is in no file.
    """

    file: str | None
    line: int | None
    message: str

    def __str__(self) -> str:
        where = [part for part in (self.file, None if self.line is None else str(self.line)) if part]
        return printable(": ".join([":".join(where), self.message] if where else [self.message]))


class ReflectanceFitError(Exception):
    """Something the user can mend: one or more problems, in file order."""

    def __init__(self, problems: str | Problem | Iterable[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem(None, None, problems)
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(p) for p in self.problems))

    def lines(self) -> list[str]:
        """At most 20 lines for the terminal, the last counting what was cut."""
        lines = [f"Error: {problem}" for problem in self.problems]
        if len(lines) > MAX_LINES:
            cut = len(lines) - MAX_LINES + 1
            lines = [*lines[: MAX_LINES - 1], f"Error: and {cut} more problems"]
        return lines


def suggestion(word: str, known: Iterable[str]) -> str:
    """``", did you mean 'x'?"``, or an empty string when nothing known is near."""
    import difflib

    near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f", did you mean '{near[0]}'?" if near else ""


def printable(text: str) -> str:
    """``text`` with control and bidirectional characters from files spelt out: they must not reach a terminal."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
