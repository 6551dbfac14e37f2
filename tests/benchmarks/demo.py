"""How long the demonstration takes, on a new installation and later."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from card import Figure

MOST_COLD_S, MOST_WARM_S = 60.0, 20.0


def about(*, full: bool) -> str:
    return (
        "Wall time of `reflectance-fit demo`, pictures included, seed 0; cold with an empty kernel cache, "
        f"warm the median of {_runs(full)} runs after it."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        cold = _demo(Path(folder), "cold")
        yield Figure.judged(
            "demo, cold kernel cache", f"{cold:.1f} s", f"{MOST_COLD_S:.0f} s at most", cold <= MOST_COLD_S
        )
        times = [_demo(Path(folder), f"warm-{run}") for run in range(_runs(full))]
    warm = statistics.median(times)
    value = f"{warm:.1f} s ({min(times):.1f} to {max(times):.1f})"
    yield Figure.judged("demo, warm", value, f"{MOST_WARM_S:.0f} s at most", warm <= MOST_WARM_S)


def _runs(full: bool) -> int:
    return 9 if full else 3


def _demo(folder: Path, name: str) -> float:
    """Wall seconds of a run into ``folder``/``name`` with ``folder``/cache as everyone's cache."""
    code = "from reflectance_fit.cli.main import cli; cli()"
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", code, "demo", "-o", str(folder / name)],
        env=os.environ | {"XDG_CACHE_HOME": str(folder / "cache")},
        capture_output=True,
        check=True,
    )
    return time.perf_counter() - started
