"""How soon the command line answers."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from card import Figure

COMMAND = Path(sys.executable).with_name("reflectance-fit")
MOST = 1.5


def about(*, full: bool) -> str:
    return f"Wall time of whole processes, in turns; the median of {_runs(full)} each, after one that does not count."


def figures(*, full: bool) -> Iterator[Figure]:
    name, target = "reflectance-fit --help over python -c 'import click'", f"{MOST} at most"
    if not COMMAND.exists():
        yield Figure.not_run(name, target, "the package is not installed beside this Python")
        return
    lines = ([str(COMMAND), "--help"], [sys.executable, "-c", "import click"])
    times = [[seconds(line) for line in lines] for _ in range(_runs(full) + 1)][1:]
    ours, least = (statistics.median(column) for column in zip(*times, strict=True))
    value = f"{ours / least:.2f} ({1000 * ours:.0f} ms over {1000 * least:.0f} ms)"
    yield Figure.judged(name, value, target, ours / least <= MOST)


def _runs(full: bool) -> int:
    return 101 if full else 21


def seconds(line: list[str]) -> float:
    """Wall time of a process."""
    started = time.perf_counter()
    subprocess.run(line, capture_output=True, check=True)
    return time.perf_counter() - started
