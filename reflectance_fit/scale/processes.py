"""Tasks in processes of their own on this machine: a task that kills its worker costs nobody else anything.

A worker has one task at a time, so a death is known to be that task's.
"""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Self

from reflectance_fit import children
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.scale.executors import DEATHS, Answer, Outcome, Task


class Processes:
    """At most ``workers`` processes with one thread each, started as tasks need them, ended with the block."""

    def __init__(self, workers: int) -> None:
        self._limit = workers
        self._idle: list[_Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._idle:
            self._idle.pop().child.end()

    def run(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """As ``Executor.run``: a task is read only when a worker is free for it."""
        waiting = (_Trial(task, pickle.dumps((task.call, task.args))) for task in tasks)
        again: list[_Trial] = []
        busy: dict[Connection, _Worker] = {}
        try:
            while True:
                while len(busy) < self._limit and (trial := again.pop() if again else next(waiting, None)):
                    worker = self._take()
                    busy[worker.child.connection] = worker
                    worker.give(trial)
                if not busy:
                    return
                ready = wait(list(busy))
                for connection, worker in list(busy.items()):
                    if connection not in ready:
                        continue
                    key = worker.trial.task.key
                    try:
                        answer: Answer | None = pickle.loads(connection.recv_bytes())
                    except (EOFError, ConnectionResetError):
                        del busy[connection]
                        if why := worker.died():
                            yield Outcome(key, None, why)
                        else:
                            again.append(worker.trial)
                        continue
                    if answer is None:
                        worker.up = True
                        continue
                    del busy[connection]
                    self._idle.append(worker)
                    yield answer.outcome(key)
        finally:
            for worker in busy.values():
                worker.child.end()

    def _take(self) -> _Worker:
        """A living worker without a task."""
        while self._idle:
            worker = self._idle.pop()
            if worker.child.alive:
                return worker
            worker.child.end()
        return _Worker(children.start("reflectance_fit.scale.worker"))


@dataclass(slots=True, eq=False)
class _Trial:
    """A task, as it is sent, and how many workers it has killed."""

    task: Task
    job: bytes
    deaths: int = 0


class _Worker:
    """One process and the task it has."""

    trial: _Trial

    def __init__(self, child: children.Child) -> None:
        self.child = child
        self.up = False

    def give(self, trial: _Trial) -> None:
        self.trial = trial
        # A process that has died meanwhile shows when its answer is read.
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.child.connection.send_bytes(trial.job)

    def died(self) -> str | None:
        """Count the death; why the task is given up, if it is."""
        why = children.cause(self.child.process.wait())
        self.child.end()
        if not self.up:
            raise ReflectanceFitError(f"no worker process starts ({why}); is there memory left?")
        self.trial.deaths += 1
        return f"its worker died {DEATHS} times ({why})" if self.trial.deaths == DEATHS else None
