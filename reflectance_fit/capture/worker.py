"""The process that decodes: what ``workers`` starts.

Limits on memory and processor time turn runaway files into errors or a dead
process.  They do not contain code that a file manages to run.
"""

from __future__ import annotations

import math
import os
import pickle
import resource
import signal
import sys
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from reflectance_fit.errors import ReflectanceFitError, printable

# Address space, which libraries reserve more of than they use.  The second is a byte of the file: a pixel takes
# one or two of them, and 32 bytes hold LibRaw's image, our copy and a few images of doubles.
_BASE_BYTES = 1_500_000_000
_BYTES_PER_FILE_BYTE = 32
_LARGEST_FILE = 256_000_000


def serve(descriptor: int) -> None:
    """Answer jobs (path, function, args, timeout_s), pickled, until the other side closes.

    The answers are ("value", result), ("error", reason in one line) for what
    is wrong with the file, or ("bug", traceback); the first, None, says that
    the process is up.
    """
    # An interrupt is the parent's to handle; it ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # LibRaw writes to standard error; the errors that matter travel as answers.
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), 2)
    connection = Connection(descriptor)
    connection.send(None)
    while True:
        try:
            job = connection.recv_bytes()
        except EOFError:
            return
        connection.send_bytes(_answer(job))


def _answer(job: bytes) -> bytes:
    try:
        path, function, args, timeout_s = pickle.loads(job)
        return pickle.dumps(("value", _run(path, function, args, timeout_s)))
    except ReflectanceFitError as error:
        return pickle.dumps(("error", printable("; ".join(p.message for p in error.problems))))
    except MemoryError:
        return pickle.dumps(("error", "needs more memory than a picture of this size should"))
    except Exception:  # noqa: BLE001  the parent raises it
        return pickle.dumps(("bug", traceback.format_exc()))


def _run(path: Path, function: Callable[..., Any], args: tuple[Any, ...], timeout_s: float) -> Any:
    size = min(path.stat().st_size, _LARGEST_FILE) if path.is_file() else 0
    # The parent measures the time; this one is for when it is no more.
    used = resource.getrusage(resource.RUSAGE_SELF)
    _limit(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime + timeout_s) + 1)
    if sys.platform == "linux":  # elsewhere the limit is below what a process starts with, or is not heeded
        _limit(resource.RLIMIT_AS, _BASE_BYTES + _BYTES_PER_FILE_BYTE * size)
    return function(path, *args)


def _limit(which: int, soft: int) -> None:
    hard = resource.getrlimit(which)[1]
    resource.setrlimit(which, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))
