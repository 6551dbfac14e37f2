"""Functions for the worker processes: they live in a module of their own, which the workers import."""

import os
import signal
import sys
import time
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from reflectance_fit.capture.raw import RawFrame, decode
from reflectance_fit.errors import ReflectanceFitError


def decoded(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function of a path that decodes it first."""

    @wraps(function)
    def run(path: Path, *args: Any) -> Any:
        return function(decode(path), *args)

    return run


@decoded
def total(frame: RawFrame, scale: int = 1) -> int:
    return int(frame.cfa.sum(dtype=np.int64)) * scale


@decoded
def die_of(frame: RawFrame, number: int) -> int:
    os.kill(os.getpid(), number)
    time.sleep(10)
    return 0


@decoded
def leave(frame: RawFrame) -> int:
    os._exit(3)


@decoded
def sleep(frame: RawFrame, seconds: float) -> float:
    time.sleep(seconds)
    return seconds


@decoded
def spin(frame: RawFrame) -> int:
    # Brings the worker's own limit of processor time near.
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + 1, -1))
    while True:
        pass


@decoded
def allocate(frame: RawFrame) -> int:
    return int(np.ones(400_000_000).sum())


@decoded
def refuse(frame: RawFrame) -> int:
    raise ReflectanceFitError("the region\nlies outside")


@decoded
def fail(frame: RawFrame) -> int:
    raise KeyError("a bug")


@decoded
def write_streams(frame: RawFrame) -> int:
    print("to standard output", flush=True)
    print("to standard error", file=sys.stderr)
    os.write(2, b"to descriptor 2\n")
    return 1


@decoded
def surroundings(frame: RawFrame) -> dict[str, Any]:
    import resource

    return {
        "pid": os.getpid(),
        "modules": sorted(sys.modules),
        "core": resource.getrlimit(resource.RLIMIT_CORE),
        "processor_s": resource.getrlimit(resource.RLIMIT_CPU)[0] - time.process_time(),
        "address_space": resource.getrlimit(resource.RLIMIT_AS)[0],
        "interrupt": signal.getsignal(signal.SIGINT) == signal.SIG_IGN,
    }


@decoded
def large(frame: RawFrame) -> np.ndarray:
    return np.arange(5_000_000)
