"""Tasks on the workers of a Dask cluster: the only module that imports Dask."""

from __future__ import annotations

import queue
import time
import warnings
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from itertools import islice
from types import TracebackType
from typing import Any, Self

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.scale.addresses import scheduler_address
from reflectance_fit.scale.executors import Outcome, Task, attempt, reason

LOCAL = "local"
_CONNECT_S = 10.0
_WORKERS_S = 30.0  # without any; a nanny takes a second or two to start one anew
_AHEAD = 2  # tasks in flight for each worker: the next is there when one ends


class Cluster:
    """A scheduler that runs already, or one of ``workers`` workers on this machine for the ``with`` block."""

    def __init__(self, scheduler: str, *, workers: int, insecure: bool) -> None:
        self._address = None if scheduler == LOCAL else scheduler_address(scheduler, insecure=insecure)
        self._count = workers

    def __enter__(self) -> Self:
        try:
            import dask

            # Before distributed is imported: what it has to say comes as errors.
            dask.config.set({"logging": {"distributed": "critical", "distributed.client": "critical"}})
            import distributed
        except ImportError as error:
            raise ReflectanceFitError(
                "Dask is not installed; install it with pip install 'reflectance_fit[cluster]'"
            ) from error
        self._local = None
        if self._address is None:
            self._local = distributed.LocalCluster(
                n_workers=self._count,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address=None,
                # A port for its state is opened in any case: on this machine only, and any that is free.
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                env={"NUMBA_NUM_THREADS": "1"},  # Dask sets those of the linear algebra itself
            )
        self._client = self._connect(distributed.Client, distributed.Security())
        try:
            self._check_workers()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def run(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """As ``Executor.run``.

        When a worker dies Dask charges every task that the worker had, those
        that waited included.  So the tasks that it gives up are run once more
        at the end, one at a time: only what kills its workers then, fails.
        """
        suspects: list[Task] = []
        yield from self._run(tasks, suspects)
        for task in suspects:
            yield from self._run([task], None)

    def _run(self, tasks: Iterable[Task], suspects: list[Task] | None) -> Iterator[Outcome]:
        from distributed import KilledWorker

        waiting = iter(tasks)
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        flying: dict[Any, Task] = {}
        workers, counted = self._count, time.monotonic()
        try:
            while True:
                if time.monotonic() > counted + 1.0:  # workers come and go; asking takes as long as a task
                    workers, counted = max(len(self._client.nthreads()), 1), time.monotonic()
                for task in islice(waiting, max(_AHEAD * workers - len(flying), 0)):
                    # Not pure: a key of its own, so that nothing is taken for known from its arguments.
                    future = self._client.submit(attempt, task.call, task.args, pure=False)
                    flying[future] = task
                    future.add_done_callback(ended.put)
                if not flying:
                    return
                future = self._next(ended)
                task = flying.pop(future)
                if future.status == "finished":
                    yield future.result().outcome(task.key)
                elif future.status == "error":
                    error = future.exception()
                    if not isinstance(error, KilledWorker):
                        yield Outcome(task.key, None, reason(error))
                    elif suspects is not None:
                        suspects.append(task)
                    else:
                        yield Outcome(task.key, None, f"its worker died {error.allowed_failures + 1} times")
                else:
                    raise self._lost()
                future.release()
        finally:
            for future in flying:
                future.release()

    def _next(self, ended: queue.SimpleQueue[Any]) -> Any:
        """The next future that is done; raises where there is nobody left to do one."""
        last_seen = time.monotonic()
        while True:
            try:
                return ended.get(timeout=1.0)
            except queue.Empty:
                if self._client.status != "running":
                    raise self._lost() from None
                if self._client.nthreads():
                    last_seen = time.monotonic()
                elif time.monotonic() - last_seen > _WORKERS_S:
                    raise ReflectanceFitError(
                        f"the cluster has had no worker for {_WORKERS_S:.0f} s; start workers, then the same"
                        " command again continues"
                    ) from None

    def _connect(self, client: Any, security: Any) -> Any:
        where = self._local or self._address
        if str(self._address).startswith("tls://") and not (
            security.tls_ca_file and security.tls_client_cert
        ):
            raise ReflectanceFitError(
                "tls:// needs certificates: set DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ...__CLIENT__CERT and"
                " ...__CLIENT__KEY, or distributed.comm.tls in Dask's configuration"
            )
        try:
            return client(where, timeout=_CONNECT_S, set_as_default=False, direct_to_workers=False)
        except (OSError, ValueError, TypeError, ImportError, RuntimeError) as error:
            first: BaseException = error
            while first.__cause__ is not None:
                first = first.__cause__
            raise ReflectanceFitError(f"no scheduler answers at {self._address}: {reason(first)}") from error

    def _check_workers(self) -> None:
        """There are some, with one thread each and this version of the package."""
        from distributed import TimeoutError

        try:
            self._client.wait_for_workers(1, timeout=_WORKERS_S)
        except TimeoutError:
            raise ReflectanceFitError(
                f"the scheduler has no workers; start some with dask worker {self._address} --nthreads 1"
            ) from None
        threads = self._client.nthreads().values()
        self._count = len(threads)
        if max(threads) > 1:
            raise ReflectanceFitError(
                "tasks share a process only one after the other; start the workers with --nthreads 1"
            )
        here = version("reflectance_fit")
        for worker, there in self._client.run(version, "reflectance_fit", on_error="return").items():
            if there != here:
                found = f"reflectance_fit {there}" if isinstance(there, str) else "no reflectance_fit"
                raise ReflectanceFitError(
                    f"the worker at {worker} has {found}; install the version of this command there, {here}"
                )

    def _lost(self) -> ReflectanceFitError:
        return ReflectanceFitError(
            "the connection to the scheduler is lost; when it is there again, the same command continues"
        )

    def _close(self) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of tasks that are let go
            self._client.close()
            if self._local is not None:
                self._local.close()
