"""A Dask scheduler and workers, started by their own commands, as docs/scaling.md tells users to."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

_DASK = Path(sys.executable).with_name("dask")
_UP_S = 60.0


@contextmanager
def process(
    folder: Path, *words: object, env: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """``dask WORDS`` until the block ends; what it says is kept in ``folder``."""
    with (folder / f"{words[0]}.log").open("ab") as log:
        running = subprocess.Popen(
            [_DASK, *map(str, words)], cwd=folder, env={**os.environ, **(env or {})}, stdout=log, stderr=log
        )
        try:
            yield running
        finally:
            running.terminate()
            try:
                running.wait(10)
            except subprocess.TimeoutExpired:
                running.kill()
                running.wait()


@contextmanager
def cluster(
    folder: Path,
    workers: int,
    *,
    env: Mapping[str, str] | None = None,
    host: str = "tcp://127.0.0.1",
    threads: int = 1,
) -> Iterator[tuple[Path, subprocess.Popen[bytes]]]:
    """The scheduler's file, and its process; the workers have nannies and start anew when they die."""
    file = folder / "scheduler.json"
    with ExitStack() as stack:
        scheduler = stack.enter_context(
            process(
                folder,
                "scheduler",
                "--host",
                host,
                "--port",
                0,
                "--no-dashboard",
                "--scheduler-file",
                file,
                env=env,
            )
        )
        deadline = time.monotonic() + _UP_S
        while not (file.exists() and file.read_text().rstrip().endswith("}")):
            if scheduler.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError((folder / "scheduler.log").read_text())
            time.sleep(0.05)
        for _ in range(workers):
            words = ["worker", "--scheduler-file", file, "--nthreads", threads, "--no-dashboard"]
            stack.enter_context(process(folder, *words, env={"NUMBA_NUM_THREADS": "1", **(env or {})}))
        yield file, scheduler


def certificates(folder: Path, name: str) -> dict[str, str]:
    """An authority of its own and a certificate of it, for scheduler, workers and clients alike: Dask's settings."""
    folder.mkdir()

    def openssl(*words: str) -> None:
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    key = ("-newkey", "rsa:2048", "-nodes")
    openssl("req", "-x509", *key, "-keyout", "ca.key", "-out", "ca.pem", "-days", "2", "-subj", f"/CN={name}")
    openssl("req", *key, "-keyout", "key.pem", "-out", "request.pem", "-subj", "/CN=cluster")
    sign = ("-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "2")
    openssl("x509", "-req", "-in", "request.pem", *sign, "-out", "cert.pem")
    settings = {"DASK_DISTRIBUTED__COMM__TLS__CA_FILE": str(folder / "ca.pem")}
    for role in ("SCHEDULER", "WORKER", "CLIENT"):
        settings[f"DASK_DISTRIBUTED__COMM__TLS__{role}__CERT"] = str(folder / "cert.pem")
        settings[f"DASK_DISTRIBUTED__COMM__TLS__{role}__KEY"] = str(folder / "key.pem")
    return settings


class Killer:
    """Kills a worker under a nanny every few seconds, in turn, once there is a sign that results have ``begun``."""

    def __init__(self, begun: Callable[[], bool], *, times: int = 3, every_s: float = 3.0) -> None:
        self._begun, self._times, self._every_s, self._deaths = begun, times, every_s, 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def stop(self) -> int:
        """End; returns how many were killed."""
        self._ended.set()
        self._thread.join()
        return self._deaths

    def _work(self) -> None:
        while not self._ended.wait(0.05) and not self._begun():
            pass
        while self._deaths < self._times and not self._ended.is_set():
            workers = [
                pid for nanny in _children(os.getpid(), "dask") for pid in _children(nanny, "spawn_main")
            ]
            if workers:
                os.kill(workers[self._deaths % len(workers)], signal.SIGKILL)
                self._deaths += 1
            self._ended.wait(self._every_s)


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
