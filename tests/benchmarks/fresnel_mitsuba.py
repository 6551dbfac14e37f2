"""Mitsuba's speed, in a process of its own: some versions of LLVM end it."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from typing import Any

ROUNDS = 11
SECONDS = 60


def measured(kind: str, points: int) -> float | str:
    """Million evaluations a second in Mitsuba's LLVM variant, or why there are none."""
    line = [sys.executable, __file__, kind, str(points)]
    try:
        done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return f"no answer within {SECONDS} s"
    if done.returncode:
        return f"its process ended with {done.returncode}; DRJIT_LIBLLVM_PATH may name an LLVM that Dr.Jit can use"
    return float(done.stdout)


def _speed(kind: str, points: int) -> float:
    import drjit
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(2)
    c = drjit.linspace(mitsuba.Float, 0.0, 1.0, points)
    # Opaque: as an array of one element, not as a constant to be compiled in.
    index: Any = drjit.opaque(mitsuba.Float, 1.5)
    if kind == "conductor":
        index = drjit.llvm.ad.Complex2f(drjit.opaque(mitsuba.Float, 0.2), drjit.opaque(mitsuba.Float, 3.4))
    drjit.eval(c)
    seconds = []
    for _ in range(ROUNDS + 1):
        drjit.sync_thread()
        started = time.perf_counter()
        power = mitsuba.fresnel(c, index)[0] if kind == "dielectric" else mitsuba.fresnel_conductor(c, index)
        drjit.eval(power)
        drjit.sync_thread()
        seconds.append(time.perf_counter() - started)
    return points / statistics.median(seconds[1:]) / 1e6


if __name__ == "__main__":
    print(_speed(sys.argv[1], int(sys.argv[2])))
