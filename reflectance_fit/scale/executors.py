"""Run many independent tasks, here or elsewhere, and give what each comes to: a value or the reason for none.

A task may run more than once, where its worker dies or the connection breaks:
running it again must do no harm.  Tasks write their files under another name
and then move them, and skip what is done.
"""

from __future__ import annotations

import logging
import os
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, Protocol

from reflectance_fit.errors import ReflectanceFitError, printable

DEATHS = 3  # of the worker that has it, before a task is given up

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Task:
    """``call(*args)``, under a name.

    ``call`` stands at the top of a module that workers can import; it, the
    arguments and the value are pickled.
    """

    key: str
    call: Callable[..., Any]
    args: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the task ``key`` came to: its ``value``, or in one line why there is none."""

    key: str
    value: Any | None
    failure: str | None


class Executor(Protocol):
    """Something that runs tasks."""

    def run(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """Yield every task's outcome as it completes, in any order.

        ``tasks`` is read as workers become free, a few ahead.  No task makes
        this raise; ReflectanceFitError says that there are no workers left.
        """
        ...


@dataclass(frozen=True, slots=True)
class Answer:
    """An outcome on its way: of a failure, ``trace`` has what a developer would ask for."""

    value: Any | None
    failure: str | None
    trace: str = ""

    def outcome(self, key: str) -> Outcome:
        """The outcome of ``key``; the trace goes to the log."""
        if self.trace:
            _log.info("%s failed:\n%s", key, self.trace)
        return Outcome(key, self.value, self.failure)


def attempt(call: Callable[..., Any], args: tuple[Any, ...]) -> Answer:
    """Call it; an exception becomes a failure."""
    try:
        return Answer(call(*args), None)
    except ReflectanceFitError as error:
        return Answer(None, printable("; ".join(str(problem) for problem in error.problems)))
    except Exception as error:  # noqa: BLE001  one task's bug must not end the others
        return Answer(None, reason(error), traceback.format_exc())


def reason(error: BaseException) -> str:
    """Kind and first line of an exception."""
    first = (str(error).strip().splitlines() or [""])[0]
    return printable(f"{type(error).__name__}: {first}" if first else type(error).__name__)


class Serial:
    """One task after the other, in this process: a task that kills it ends the run."""

    def run(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        for task in tasks:
            yield attempt(task.call, task.args).outcome(task.key)


def executor(
    jobs: int | None = None, scheduler: str | None = None, insecure: bool = False
) -> AbstractContextManager[Executor]:
    """What runs tasks until its ``with`` block ends.

    Parameters
    ----------
    jobs : int, optional
        Worker processes on this machine, each with one thread; 1 stands for
        none: the tasks run in this process.  By default one a core.
    scheduler : str, optional
        Of a Dask cluster, its address or the file that it wrote; ``local``
        starts a cluster of ``jobs`` workers on this machine.
    insecure : bool
        Talk to a scheduler on another machine without encryption.

    Raises
    ------
    ReflectanceFitError
        For a scheduler that cannot be reached, or must not be.
    """
    if scheduler is not None:
        from reflectance_fit.scale.cluster import Cluster

        return Cluster(scheduler, workers=jobs or cores(), insecure=insecure)
    if jobs == 1:
        return nullcontext(Serial())
    from reflectance_fit.scale.processes import Processes

    return Processes(jobs or cores())


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
