"""Python processes of our own that answer over a pipe: plain subprocesses.

Not those of multiprocessing, which import the program's main module again.
For POSIX systems.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe

# One thread a worker: more would fight for the cores, and reserve address space that counts against a limit.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"} | {
    "NUMBA_NUM_THREADS": "1"
}


@dataclass(frozen=True, slots=True, eq=False)
class Child:
    """A process and our end of the pipe to it, which it sees closed when this process ends, however it ends."""

    process: subprocess.Popen[bytes]
    connection: Connection

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def end(self) -> None:
        """Kill it, if it is not dead, and close the pipe."""
        self.process.kill()
        self.process.wait()
        self.connection.close()


def is_worker() -> bool:
    """Whether this process has one core, of which other workers have the others."""
    return os.environ.get("NUMBA_NUM_THREADS") == "1"


def start(module: str) -> Child:
    """Start a process with one thread that calls ``serve(descriptor)`` of ``module`` with its end of the pipe."""
    ours, theirs = Pipe()
    # The path of this process: what it is given to call may come from anywhere on it.
    code = f"import sys; sys.path[:] = {sys.path!r}\nfrom {module} import serve; serve({theirs.fileno()})"
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            pass_fds=[theirs.fileno()],
            env=os.environ | ONE_THREAD,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
    return Child(process, ours)


def cause(status: int) -> str:
    """What ended a process, by the return code of Popen."""
    if status == -signal.SIGKILL:
        return "SIGKILL; perhaps the system is out of memory"
    return signal.Signals(-status).name if -status in set(signal.Signals) else f"exit code {status}"
