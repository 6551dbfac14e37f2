"""``batch``: many samples, one result folder each, and a table of them all.

A sample is done where its folder's ``batch.json`` names the same version of
the package, the same options and the same bytes of all its files.  It is
written last and removed first, so it never vouches for other results.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from reflectance_fit.files import alone, check_writable, write_together, write_whole
from reflectance_fit.inference.ladder import Method
from reflectance_fit.inputs import sha256_of
from reflectance_fit.report.summary import Line, channel_rows, summary_csv, summary_yaml
from reflectance_fit.report.write import write_text
from reflectance_fit.samples import Sample, find_samples
from reflectance_fit.scale.executors import Task, executor
from reflectance_fit.workflow import FitResult, fit_to_folder

Progress = Callable[[str, int, int], None]

_DONE = "batch.json"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Options:
    """What a sample's results depend on beside its files."""

    model: str = "auto"
    posterior: Method | None = None
    seed: int = 0
    plots: bool = True


@dataclass(frozen=True, slots=True)
class Batch:
    """What a run came to: the table's lines, and how many of the samples it had to fit."""

    lines: tuple[Line, ...]
    fitted: int

    @property
    def failed(self) -> tuple[Line, ...]:
        return tuple(line for line in self.lines if line.failure is not None)


def batch(
    paths: Sequence[Path],
    out: Path,
    options: Options,
    *,
    progress: Progress,
    jobs: int | None = None,
    scheduler: str | None = None,
    insecure: bool = False,
) -> Batch:
    """Fit every sample in ``paths`` that is not done, then write summary.csv and summary.yaml into ``out``.

    A sample that fails has a line with its reason and no report; it is tried
    again by the next run.  A sample that is no longer among ``paths`` is not
    in the table; its folder stays.  Reports hold no wall-clock figures, so the
    same files give the same bytes in whatever order they are done.

    Raises
    ------
    ReflectanceFitError
        Where no sample is found, ``out`` cannot be written or another run
        writes it, or there are no workers.
    """
    samples = find_samples(paths, leave_out=out)
    check_writable(out)
    lines = {}
    fitted = 0
    with alone(out), executor(jobs, scheduler, insecure=insecure) as run:
        # Workers on other machines have another working directory.
        tasks = (
            Task(s.name, fit_sample, (s.source.absolute(), (out / s.name).absolute(), options))
            for s in samples
        )
        by_name = {sample.name: sample for sample in samples}
        progress("samples", 0, len(samples))
        for outcome in run.run(tasks):
            sample = by_name[outcome.key]
            if outcome.value is None:
                (out / sample.name / "report.yaml").unlink(missing_ok=True)  # of other inputs
            else:
                fitted += outcome.value["fitted"]
            lines[sample.name] = _line(sample, outcome.value, outcome.failure)
            progress("samples", len(lines), len(samples))
        table = tuple(lines[sample.name] for sample in samples)

        def fill(stage: Path) -> None:
            write_text(summary_csv(table), stage / "summary.csv")
            write_text(summary_yaml(table), stage / "summary.yaml")

        write_together(out, fill, last="summary.csv")
    return Batch(table, fitted)


def fit_sample(source: Path, folder: Path, options: Options) -> dict[str, Any]:
    """One sample's part of the table, ``fitted`` anew or as it stands in ``folder``; runs in a worker."""
    done = folder / _DONE
    if (before := _still_true(done, source, options)) is not None:
        return before | {"fitted": False}
    done.unlink(missing_ok=True)
    result = fit_to_folder(
        source,
        folder,
        model=options.model,
        posterior=options.posterior,
        seed=options.seed,
        plots=options.plots,
        timings=False,
        progress=lambda _what, _done, _total: None,
        resume=True,
    )
    found = {"name": result.report.sample.name, "channels": channel_rows(result.report)}
    record = _conditions(options) | {"inputs": _inputs(source, result)} | found
    write_whole(done, lambda part: write_text(json.dumps(record, indent=1) + "\n", part))
    return found | {"fitted": True}


def _conditions(options: Options) -> dict[str, Any]:
    return {"version": version("reflectance_fit"), "options": asdict(options)}


def _inputs(source: Path, result: FitResult) -> list[list[str]]:
    """(file, sha256) of all that was read, from the folder of ``source``.  An OBS.nc names what it was made from."""
    if source.suffix == ".nc":
        return [[source.name, sha256_of(source)]]
    return [[given.file, given.sha256] for given in result.report.provenance.inputs]


def _still_true(done: Path, source: Path, options: Options) -> dict[str, Any] | None:
    """What ``done`` says of the sample, where it is of these options and these bytes.

    The manifest is the first of the inputs, so while all have their bytes it
    names no others.
    """
    try:
        record = json.loads(done.read_text(encoding="utf-8"))
        if not (done.parent / "report.yaml").is_file():
            return None
        if {key: record[key] for key in ("version", "options")} != _conditions(options):
            return None
        for file, digest in record["inputs"]:
            if sha256_of(source.parent / file) != digest:
                return None
        return {"name": record["name"], "channels": tuple(record["channels"])}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _line(sample: Sample, value: dict[str, Any] | None, failure: str | None) -> Line:
    shown = str(sample.source)
    if value is not None:
        return Line(sample.name, shown, value["name"], tuple(value["channels"]), None)
    # In the user's words: the worker was given absolute paths.
    absolute = f"{sample.source.absolute().parent}/"
    return Line(
        sample.name, shown, None, (), str(failure).replace(absolute, shown[: -len(sample.source.name)])
    )
