"""Decode and reduce photographs in processes of their own: a file that kills its decoder costs that one file.

Each worker has one job at a time, so a death, a hang or an error is known to
be that job's and disturbs no other.  A worker imports the module of the job's
function and what that needs.  For POSIX systems.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, Self, TypeVar

from reflectance_fit import children
from reflectance_fit.errors import ReflectanceFitError

T = TypeVar("T")
Job = tuple[Path, "Callable[Concatenate[Path, ...], T]", tuple[Any, ...]]

# Each may hold a picture and LibRaw's copy of it.
_MOST = 8
_START_S = 60.0  # a machine may be busy; usually it takes a third of a second


@dataclass(frozen=True, slots=True)
class FrameError:
    """Why a frame gave no result, in one line."""

    path: Path
    reason: str


class RawWorkers:
    """Worker processes, started as jobs need them and ended with the ``with`` block.

    Parameters
    ----------
    workers : int, optional
        How many at most; by default one a core, up to 8; one in a process that is itself a worker.
    timeout_s : float
        Wall time for one frame, decoding and reducing, in seconds.
    """

    def __init__(self, workers: int | None = None, *, timeout_s: float = 60.0) -> None:
        self._limit = workers or (1 if children.is_worker() else min(_MOST, os.cpu_count() or 1))
        self._timeout_s = timeout_s
        self._idle: list[_Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._idle:
            self._idle.pop().end()

    def map(self, jobs: Iterable[Job[T]]) -> Iterator[T | FrameError]:
        """Yield ``function(path, *args)`` of every job (path, function, args), in the order of the jobs.

        ``function`` is one at the top of an importable module; it, its
        arguments and its result are pickled.  A file that cannot be decoded,
        a ReflectanceFitError or MemoryError, a dead process and
        a timeout give a FrameError in place of the result.  Jobs are taken
        as workers become free; one ``map`` at a time.

        Raises RuntimeError, with the worker's traceback, for any other
        exception of ``function``, and ReflectanceFitError when no worker starts.
        """
        waiting = enumerate(jobs)
        busy: dict[Connection, _Worker] = {}
        done: dict[int, T | FrameError] = {}
        yielded = 0
        try:
            while True:
                while len(busy) < self._limit and (item := next(waiting, None)) is not None:
                    worker = self._take()
                    busy[worker.connection] = worker
                    worker.give(*item, self._timeout_s)
                while yielded in done:
                    yield done.pop(yielded)
                    yielded += 1
                if not busy:
                    return
                first_deadline = min(worker.deadline for worker in busy.values())
                ready = wait(list(busy), max(0.0, first_deadline - time.monotonic()))
                for connection, worker in list(busy.items()):
                    if answer := worker.answer(ready=connection in ready):
                        done[worker.number] = answer[0]
                        del busy[connection]
                        self._idle.append(worker)
        finally:
            for worker in busy.values():
                worker.end()

    def _take(self) -> _Worker:
        """A living worker without a job."""
        while self._idle:
            worker = self._idle.pop()
            if worker.alive:
                return worker
            worker.end()
        return _Worker()


class _Worker:
    """One process and the job it has."""

    number: int
    deadline: float

    def __init__(self) -> None:
        self._child = children.start("reflectance_fit.capture.worker")
        self.connection = self._child.connection
        self._up = False

    @property
    def alive(self) -> bool:
        return self._child.alive

    def give(self, number: int, job: Job[Any], timeout_s: float) -> None:
        """Hand over a job."""
        self.number = number
        self._path = job[0]
        self._timeout_s = timeout_s
        self.deadline = time.monotonic() + (timeout_s if self._up else _START_S)
        # A process that has died meanwhile shows when its answer is read.
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.connection.send((*job, timeout_s))

    def answer(self, *, ready: bool) -> tuple[Any] | None:
        """The job's result or FrameError once there is one; ``ready``: the process wrote, or closed by dying."""
        if not ready:
            if time.monotonic() < self.deadline:
                return None
            self.end()
            return self._failed(f"took longer than {self._timeout_s:g} s")
        try:
            message = self.connection.recv()
        except (EOFError, ConnectionResetError):
            status = self._child.process.wait()
            self.end()
            return self._failed(f"ended the process that decoded it ({children.cause(status)})")
        if message is None:
            self._up = True
            self.deadline = time.monotonic() + self._timeout_s
            return None
        kind, value = message
        if kind == "bug":
            raise RuntimeError(f"reducing {self._path} failed:\n{value}")
        return (value,) if kind == "value" else self._failed(value)

    def end(self) -> None:
        self._child.end()

    def _failed(self, reason: str) -> tuple[FrameError]:
        if not self._up:
            raise ReflectanceFitError("no process to decode photographs starts; is there memory left?")
        return (FrameError(self._path, reason),)
