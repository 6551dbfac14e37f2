"""What many samples cost: beside the fits themselves, with more workers, and for tasks that do nothing."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

from card import Figure
from scale_cluster import cluster
from scale_samples import write_samples

from reflectance_fit.scale.executors import Executor, Task, cores, executor
from reflectance_fit.scale.processes import Processes
from reflectance_fit.workflow import FitResult, fit_to_folder
from reflectance_fit.workflow_batch import Options, batch, fit_sample

OPTIONS = Options(posterior="laplace", plots=False)
EMPTY = 500
WARM = 8  # samples, so that every worker has had some
MOST_OVERHEAD = 0.05


def about(*, full: bool) -> str:
    return (
        f"{_count(full)} synthetic samples of 40 rows, seed 0, posterior laplace, no pictures; kernels compiled before,"
        f" workers started before the clock; medians of {_runs(full)} runs. Tasks that do nothing: {EMPTY}."
        " The Dask scheduler and workers are started by their own commands."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    count, runs = _count(full), _runs(full)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        inputs = write_samples(folder / "in", count)
        with Processes(1) as run:
            _samples(run, inputs, folder / "compiled", WARM)
        rounds = [_batch(inputs, folder / f"b{i}") for i in range(runs)]
        fits = statistics.median(fitting for _, fitting in rounds) / count
        outside = statistics.median(whole - fitting for whole, fitting in rounds) / count
        yield Figure.reported("fit, a sample", f"{1e3 * fits:.0f} ms")
        yield Figure.judged(
            "batch in one process, a sample: beside the fit",
            f"{1e3 * outside:.1f} ms, {100 * outside / fits:.1f} %",
            f"{100 * MOST_OVERHEAD:.0f} % at most",
            outside <= MOST_OVERHEAD * fits,
        )
        again = statistics.median(_batch(inputs, folder / "b0")[0] for _ in range(runs)) / count
        yield Figure.reported("batch, a sample that is done already", f"{1e3 * again:.2f} ms")
        with Processes(1) as one, Processes(2) as two:
            yield from _one_and_two("our processes", one, two, inputs, folder, runs)
        (folder / "dask1").mkdir()
        (folder / "dask2").mkdir()
        with (
            cluster(folder / "dask1", 1) as (file1, _),
            cluster(folder / "dask2", 2) as (file2, _),
            executor(scheduler=str(file1)) as one,
            executor(scheduler=str(file2)) as two,
        ):
            yield from _one_and_two("Dask's workers", one, two, inputs, folder, runs)


def _one_and_two(
    kind: str, one: Executor, two: Executor, inputs: Path, folder: Path, runs: int
) -> Iterator[Figure]:
    """One worker beside two, in turn, so that other load falls on both alike; and tasks that do nothing."""
    for run in (one, two):
        _samples(run, inputs, Path(tempfile.mkdtemp(dir=folder)), WARM)
    rounds = [
        [_samples(run, inputs, Path(tempfile.mkdtemp(dir=folder))) for run in (one, two)] for _ in range(runs)
    ]
    count = len(list(inputs.iterdir()))
    single, double = (1e3 * statistics.median(times) / count for times in zip(*rounds, strict=True))
    faster = statistics.median(a / b for a, b in rounds)
    empty = [1e3 * statistics.median(_empty(run) for _ in range(runs)) / EMPTY for run in (one, two)]
    yield Figure.reported(f"batch on 1 of {kind}, a sample", f"{single:.0f} ms")
    yield Figure.reported(f"batch on 2 of {kind}, a sample", f"{double:.0f} ms, {faster:.2f} times as fast")
    yield Figure.reported(
        f"{kind}, a task that does nothing", f"{empty[0]:.2f} ms with 1, {empty[1]:.2f} ms with 2"
    )


def _batch(inputs: Path, out: Path) -> tuple[float, float]:
    """Seconds of a batch in this process, and those of them that are ``fit``'s own."""
    fitting = 0.0

    def timed(*arguments: Any, **options: Any) -> FitResult:
        nonlocal fitting
        started = time.perf_counter()
        result = fit_to_folder(*arguments, **options)
        fitting += time.perf_counter() - started
        return result

    started = time.perf_counter()
    with patch("reflectance_fit.workflow_batch.fit_to_folder", timed):
        batch([inputs], out, OPTIONS, progress=_silent, jobs=1)
    return time.perf_counter() - started, fitting


def _samples(run: Executor, inputs: Path, out: Path, count: int | None = None) -> float:
    """Seconds of the first ``count`` samples, or all, as ``batch`` would run them."""
    places = sorted(inputs.iterdir())[:count]
    started = time.perf_counter()
    tasks = (Task(p.name, fit_sample, (p / "measurement.yaml", out / p.name, OPTIONS)) for p in places)
    failed = [outcome.failure for outcome in run.run(tasks) if outcome.failure]
    if failed:
        raise RuntimeError(failed[0])
    return time.perf_counter() - started


def _empty(run: Executor) -> float:
    started = time.perf_counter()
    for _ in run.run(Task(f"{i}", cores, ()) for i in range(EMPTY)):
        pass
    return time.perf_counter() - started


def _silent(_what: str, _done: int, _total: int) -> None:
    pass


def _count(full: bool) -> int:
    return 200 if full else 40


def _runs(full: bool) -> int:
    return 7 if full else 3
