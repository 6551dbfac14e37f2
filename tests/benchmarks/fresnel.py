"""How fast the rungs of Fresnel's reflectance are, in units of what memory allows and of numpy."""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import fresnel_mitsuba
import numba
import numpy as np
from card import Figure
from fresnel_peers import textbook
from numpy.typing import NDArray

from reflectance_fit.physics.bulk import unpolarized
from reflectance_fit.physics.fresnel import reflectances

POINTS, FEW_POINTS = 10_000_000, 1_000_000
THREADS = 2
ETA, ETA_OF_METAL, K_OF_METAL = 1.5, 0.2, 3.4
# OpenMP's threads go on spinning for a while after a loop, on the cores that the next job wants.
_PAUSE_S = 0.03
Job = Callable[[], object]


class Promise(NamedTuple):
    """``name`` over ``unit``, in speed, and the least that was promised."""

    name: str
    unit: str
    least: float
    kind: str


PROMISES = (
    Promise("plain", "memory limit", 0.6, "dielectric"),
    Promise("plain", "numpy complex", 25.0, "dielectric"),
    Promise("compensated", "memory limit", 0.35, "dielectric"),
    Promise("compensated", "memory limit", 0.25, "conductor"),
    Promise("double_word", "plain", 0.25, "dielectric"),
    Promise("double_word", "plain", 0.25, "conductor"),
)
REPORTED = (
    "plain, float32",
    "compensated, float32",
    "plain, 1 thread",
    "compensated, 1 thread",
    "numexpr",
    "all six powers, compensated",
)


def about(*, full: bool) -> str:
    return (
        f"F of {POINTS:,} angles (cosines evenly spread in [0, 1]), float64, {THREADS} threads, eta = {ETA}, or "
        f"{ETA_OF_METAL} + {K_OF_METAL}i for a conductor; medians of {_rounds(full)} rounds in which everyone takes a turn. The "
        "memory limit is a loop that multiplies by a constant, same arrays, same threads. Numbers are ratios of "
        f"speeds within the run; in brackets million evaluations a second. All six powers: {FEW_POINTS:,} angles, one thread. "
        "Mitsuba in a process of its own (float32, LLVM), in the same minute but not in turns."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    numba.set_num_threads(min(THREADS, numba.config.NUMBA_NUM_THREADS))
    speeds = {kind: _speeds(kind, _rounds(full)) for kind in ("dielectric", "conductor")}
    for name, unit, least, kind in PROMISES:
        ours, other = speeds[kind][name], speeds[kind][unit]
        value = f"{ours / other:.2f} ({ours:.0f} over {other:.0f})"
        yield Figure.judged(f"{kind}, {name} over {unit}", value, f"{least} at least", ours / other >= least)
    for kind, found in speeds.items():
        for name in REPORTED:
            unit = "memory limit, float32" if name.endswith("float32") else "memory limit"
            title = f"{kind}, {name} over {unit}"
            if name in found:
                value = f"{found[name] / found[unit]:.3g} ({found[name]:.0f} over {found[unit]:.0f})"
                yield Figure.reported(title, value)
            else:
                yield Figure.not_run(title, "none", "not installed")
        yield _mitsuba(kind, found)


def _rounds(full: bool) -> int:
    return 51 if full else 11


@numba.njit(parallel=True)
def _scale(x: NDArray[Any], factor: Any, out: NDArray[Any]) -> None:
    for i in numba.prange(x.shape[0]):
        out[i] = factor * x[i]


def _speeds(kind: str, rounds: int) -> dict[str, float]:
    """Million evaluations a second by name."""
    jobs = dict(_jobs(kind))
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(rounds + 1):
        for name, (_, job) in jobs.items():
            time.sleep(_PAUSE_S)
            started = time.perf_counter()
            job()
            if turn:  # the first compiles
                seconds[name].append(time.perf_counter() - started)
    return {name: points / statistics.median(seconds[name]) / 1e6 for name, (points, _) in jobs.items()}


def _jobs(kind: str) -> Iterator[tuple[str, tuple[int, Job]]]:
    for dtype in (np.float64, np.float32):
        index = (ETA,) if kind == "dielectric" else (ETA_OF_METAL, K_OF_METAL)
        constants = tuple(dtype(x) for x in index)
        c = np.linspace(0.0, 1.0, POINTS, dtype=dtype)
        out = np.empty_like(c)
        suffix = "" if dtype is np.float64 else ", float32"
        yield "memory limit" + suffix, (POINTS, _limit(c, out))
        for rung in ("plain", "compensated", "double_word"):
            yield rung + suffix, (POINTS, _ours(c, constants, rung, THREADS, out))
            if not suffix:
                yield f"{rung}, 1 thread", (POINTS, _ours(c, constants, rung, 1, out))
        if suffix:
            continue
        eta, k = (*constants, dtype(0.0))[:2]
        yield "numpy complex", (POINTS, lambda c=c, eta=eta, k=k: textbook(c, eta, k))
        few = c[:: POINTS // FEW_POINTS].copy()
        yield (
            "all six powers, compensated",
            (FEW_POINTS, lambda few=few, index=constants: reflectances(few, *index)),
        )
        if importlib.util.find_spec("numexpr"):
            yield "numexpr", (POINTS, _numexpr(kind, c, out))


def _limit(c: NDArray[Any], out: NDArray[Any]) -> Job:
    return lambda: _scale(c, c.dtype.type(0.04), out)


def _ours(c: NDArray[Any], index: tuple[Any, ...], rung: Any, threads: int, out: NDArray[Any]) -> Job:
    return lambda: unpolarized(c, *index, rung=rung, threads=threads, out=out)


def _numexpr(kind: str, c: NDArray[Any], out: NDArray[Any]) -> Job:
    """Each kind's shortest real form, in one expression."""
    import numexpr

    numexpr.set_num_threads(THREADS)
    if kind == "dielectric":
        w = f"sqrt({ETA**2 - 1!r} + c * c)"
        text = f"0.5 * (((c - {w}) / (c + {w}))**2 + (({ETA**2!r} * c - {w}) / ({ETA**2!r} * c + {w}))**2)"
    else:
        difference, product = ETA_OF_METAL**2 - K_OF_METAL**2, 4 * (ETA_OF_METAL * K_OF_METAL) ** 2
        t0 = f"({difference!r} - 1 + c * c)"
        h = f"sqrt({t0}**2 + {product!r})"
        t2, s2 = f"(2 * c * sqrt(0.5 * ({h} + {t0})))", "(1 - c * c)"
        s = f"(({h} + c * c - {t2}) / ({h} + c * c + {t2}))"
        t3, t4 = f"(c * c * {h} + {s2}**2)", f"({t2} * {s2})"
        text = f"0.5 * {s} * (1 + ({t3} - {t4}) / ({t3} + {t4}))"
    return lambda: numexpr.evaluate(text, {"c": c}, out=out)


def _mitsuba(kind: str, found: dict[str, float]) -> Figure:
    name, unit = f"{kind}, Mitsuba over memory limit, float32", found["memory limit, float32"]
    if importlib.util.find_spec("mitsuba") is None:
        return Figure.not_run(name, "none", "not installed")
    speed = fresnel_mitsuba.measured(kind, POINTS)
    if isinstance(speed, str):
        return Figure.not_run(name, "none", speed)
    return Figure.reported(name, f"{speed / unit:.3g} ({speed:.0f} over {unit:.0f})")
