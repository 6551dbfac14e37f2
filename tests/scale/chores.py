"""Tasks for the workers, in a module of their own that they can import."""

import os
import signal
import time
from pathlib import Path

from reflectance_fit.errors import Problem, ReflectanceFitError


def double(x: float) -> float:
    return 2 * x


def wrong(file: str) -> None:
    raise ReflectanceFitError([Problem(file, 3, "no such column"), Problem(None, None, "and \x1b[31mmore")])


def bug() -> None:
    raise KeyError("first\nsecond")


def unpicklable() -> object:
    return lambda: None


def leave() -> None:
    raise SystemExit(7)


def die(signal_number: int = signal.SIGKILL) -> None:
    os.kill(os.getpid(), signal_number)
    time.sleep(60)


def interrupted() -> str:
    os.kill(os.getpid(), signal.SIGINT)
    return "still here"


def die_at_first(marks: Path, name: str, times: int) -> str:
    """Kill the worker ``times`` times, then give ``name``; a file a time counts."""
    count = len(list(marks.glob(f"{name}.*")))
    (marks / f"{name}.{count}").touch()
    if count < times:
        die()
    return name


def sleep(seconds: float, mark: Path | None = None) -> float:
    if mark is not None:
        mark.write_text(str(os.getpid()))
    time.sleep(seconds)
    return seconds


def surroundings() -> dict[str, object]:
    import numba

    from reflectance_fit.capture.workers import RawWorkers

    return {
        "decoders": RawWorkers()._limit,
        "pid": os.getpid(),
        "threads": (os.environ.get("OMP_NUM_THREADS"), numba.get_num_threads()),
    }


def fit_or_die(source: Path, folder: Path, options: object) -> object:
    """As ``fit_sample``, but for s2, amid whose results the worker dies."""
    from reflectance_fit.workflow_batch import Options, fit_sample

    assert isinstance(options, Options)
    if folder.name == "s2":
        (folder.parent / ".unfinished.s2").mkdir(exist_ok=True)
        die()
    return fit_sample(source, folder, options)
