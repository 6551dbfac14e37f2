"""``batch`` stopped, poisoned, spread over a cluster: what it has done it has done once, and its table is whole."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from card import Figure
from scale_cluster import cluster
from scale_samples import write_samples

SAMPLES, AGAIN, ON_CLUSTER = 1000, 40, 12
WORKERS = ((1, False), (2, False), (4, False), (2, True))  # and whether they are killed
_OPTIONS = ("--no-plots", "--posterior", "laplace")
_COMMAND = (
    sys.executable,
    "-c",
    "from reflectance_fit.cli.main import cli; cli(prog_name='reflectance-fit')",
    "batch",
)
_LIMIT_S = 400.0


def about() -> str:
    return (
        f"`batch`: {SAMPLES} synthetic samples of 40 rows, seed 0, `{' '.join(_OPTIONS)}`, one worker a core, stopped by"
        f" SIGINT after a quarter and by SIGKILL after a half; {AGAIN} of them again without a stop, in one process;"
        f" {ON_CLUSTER} on a Dask scheduler and 1, 2 and 4 workers started by their own commands."
    )


def figures(folder: Path) -> Iterator[Figure]:
    inputs = write_samples(folder / "in", SAMPLES)
    yield from _stopped_twice(inputs, folder / "out")
    yield _as_without_a_stop(inputs, folder)
    yield from _on_a_cluster(write_samples(folder / "few", ON_CLUSTER), folder)
    yield _refused(folder)


def _start(*words: object) -> subprocess.Popen[str]:
    command = [*_COMMAND, *map(str, words), *_OPTIONS]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


@dataclass(frozen=True, slots=True)
class _Ended:
    code: int
    fitted: int
    before: int
    failed: int
    errors: list[str]


def _run(*words: object) -> _Ended:
    running = _start(*words)
    out, errors = running.communicate(timeout=_LIMIT_S)
    counts = re.match(r"\d+ samples: (\d+) fitted, (\d+) as before, (\d+) failed", out)
    fitted, before, failed = map(int, counts.groups()) if counts else (0, 0, 0)
    return _Ended(running.returncode, fitted, before, failed, errors.splitlines())


def _done(out: Path) -> dict[str, int]:
    """The samples that are done, and when each was."""
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("*/batch.json")}


def _stop(
    words: tuple[object, ...], out: Path, ending: signal.Signals, after: int
) -> tuple[int, dict[str, int]]:
    """Run until ``after`` samples are done, then end it; the exit code and what was done."""
    running = _start(*words)
    deadline = time.monotonic() + _LIMIT_S
    while (
        len(list(out.glob("*/batch.json"))) < after and running.poll() is None and time.monotonic() < deadline
    ):
        time.sleep(0.05)
    if ending == signal.SIGINT:  # as a terminal sends it: to all of the group
        os.killpg(running.pid, ending)
    else:
        running.send_signal(ending)
    running.communicate(timeout=60)
    return running.returncode, _done(out)


def _stopped_twice(inputs: Path, out: Path) -> Iterator[Figure]:
    words = (inputs, "-o", out)
    first, done_first = _stop(words, out, signal.SIGINT, SAMPLES // 4)
    second, done_second = _stop(words, out, signal.SIGKILL, SAMPLES // 2)
    last = _run(*words)
    done = _done(out)
    twice = sum(done.get(name) != when for part in (done_first, done_second) for name, when in part.items())
    codes = (first, second, last.code) == (130, -signal.SIGKILL, 0)
    once = twice == 0 and last.before == len(done_second) and last.before + last.fitted == SAMPLES
    stops = SAMPLES // 4 <= len(done_first) < len(done_second) < SAMPLES
    yield Figure.judged(
        f"batch of {SAMPLES}, stopped by SIGINT and SIGKILL, resumed: done once",
        f"{len(done)} done, {twice} twice; stopped at {len(done_first)} and {len(done_second)}",
        f"{SAMPLES} done, 0 twice",
        codes and once and stops and len(done) == SAMPLES,
    )
    rows = _rows(out)
    whole = [row["sample"] for row in rows] == [f"s{i:04d}" for i in range(SAMPLES)]
    filled = sum(row["failure"] == "" and row["eta_status"] != "" for row in rows)
    left = len(list(out.rglob(".unfinished*")))
    yield Figure.judged(
        "batch, its table", f"{filled} of {len(rows)} rows filled, {left} unfinished files left", f"{SAMPLES} of {SAMPLES}, 0",
        whole and filled == SAMPLES and left == 0,
    )  # fmt: skip


def _rows(out: Path) -> list[dict[str, str]]:
    with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _as_without_a_stop(inputs: Path, folder: Path) -> Figure:
    """The first samples by themselves, never stopped: the same lines of the table."""
    paths = [inputs / f"s{i:04d}" for i in range(AGAIN)]
    _run(*paths, "-o", folder / "again", "--jobs", 1)
    lines = [
        (folder / name / "summary.csv").read_text().splitlines()[: AGAIN + 1] for name in ("out", "again")
    ]
    same = sum(a == b for a, b in zip(*lines, strict=True)) - 1
    return Figure.judged(
        "batch, rows as of a run that was never stopped",
        f"{same} of {AGAIN}",
        f"{AGAIN} of {AGAIN}",
        same == AGAIN,
    )


def _on_a_cluster(inputs: Path, folder: Path) -> Iterator[Figure]:
    alone = folder / "alone"
    _run(inputs, "-o", alone, "--jobs", 1)
    for workers, killed in WORKERS:
        out = folder / f"cluster-{workers}-{killed}"
        place = folder / f"dask-{workers}-{killed}"
        place.mkdir()
        with cluster(place, workers) as (file, _):
            killer = _Killer(out) if killed else None
            ended = _run(inputs, "-o", out, "--scheduler", file)
            deaths = killer.stop() if killer else 0
        files = [
            p.relative_to(alone) for p in alone.rglob("*") if p.is_file() and p.suffix in (".yaml", ".csv")
        ]
        same = sum((out / f).exists() and (out / f).read_bytes() == (alone / f).read_bytes() for f in files)
        name = f"batch on {workers} Dask worker{'s' * (workers > 1)}{', killed (-9) in turn' if killed else ''}: files as of one process"
        value = f"{same} of {len(files)}" + (f", {deaths} deaths" if killed else "")
        good = ended.code == 0 and same == len(files) > ON_CLUSTER and deaths >= killed
        yield Figure.judged(name, value, "all, byte for byte", good)


class _Killer:
    """Kills a worker under a nanny every three seconds, three times, once results begin to come."""

    def __init__(self, out: Path) -> None:
        self._out, self._deaths = out, 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def stop(self) -> int:
        self._ended.set()
        self._thread.join()
        return self._deaths

    def _work(self) -> None:
        while not self._ended.wait(0.05) and not list(self._out.glob("*/batch.json")):
            pass
        while self._deaths < 3 and not self._ended.is_set():
            workers = [
                pid for nanny in _children(os.getpid(), "dask") for pid in _children(nanny, "spawn_main")
            ]
            if workers:
                os.kill(workers[self._deaths % len(workers)], signal.SIGKILL)
                self._deaths += 1
            self._ended.wait(3.0)


def _children(parent: int, word: str) -> list[int]:
    """Processes that ``parent`` started whose command line has ``word``."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            status = (place / "stat").read_text().rpartition(")")[2].split()
            if int(status[1]) == parent and status[0] != "Z" and word in (place / "cmdline").read_text():
                found.append(int(place.name))
        except OSError:
            continue
    return sorted(found)


def _refused(folder: Path) -> Figure:
    started = time.monotonic()
    ended = _run(folder / "few", "-o", folder / "nowhere", "--scheduler", "tcp://192.0.2.1:8786")
    seconds = time.monotonic() - started
    good = ended.code == 1 and len(ended.errors) == 1 and "tls://" in ended.errors[0] and seconds < 10
    return Figure.judged(
        "plain tcp to another host",
        f"exit {ended.code}, {len(ended.errors)} line",
        "refused: exit 1, 1 line",
        good,
    )
