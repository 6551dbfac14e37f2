"""A Dask scheduler and workers, started by their own commands, as docs/scaling.md tells users to."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
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
