"""Photographs decoded in the process that measures: starting workers for each of hundreds of captures would take most of the time."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from reflectance_fit.capture import ingest as _ingest  # noqa: F401  and with it all that reads photographs
from reflectance_fit.capture.workers import FrameError, Job
from reflectance_fit.errors import ReflectanceFitError

T = TypeVar("T")


def decode_here() -> None:
    """From now on in this process; for files of our own, which kill no decoder."""
    for name, module in list(sys.modules.items()):
        if name.startswith("reflectance_fit.capture.") and hasattr(module, "RawWorkers"):
            vars(module)["RawWorkers"] = _Here


class _Here(contextlib.AbstractContextManager["_Here"]):
    """In place of RawWorkers: the same functions of the same files."""

    def __exit__(self, *_: object) -> None:
        pass

    def map(self, jobs: Iterable[Job[T]]) -> Iterator[T | FrameError]:
        for path, function, arguments in jobs:
            try:
                yield function(path, *arguments)
            except ReflectanceFitError as error:
                yield FrameError(path, "; ".join(problem.message for problem in error.problems))
