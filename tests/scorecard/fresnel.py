"""The digits of Fresnel's powers: the worst errors that a search finds, ours and other people's."""

from __future__ import annotations

import multiprocessing
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from card import Figure, Table
from fresnel_oracle import AMPLITUDES, POWERS, Point
from fresnel_peers import peers_of
from fresnel_regimes import CONDUCTOR, DIELECTRIC, NEAR_MATCH
from fresnel_trial import ENTRIES, FEW, RUNGS, SEED, Found, Trial, run

PROCESSES = 2
KINDS = {"dielectric": DIELECTRIC, "conductor": CONDUCTOR}
FORMATS: tuple[type[np.floating[Any]], ...] = (np.float64, np.float32)
# Worst errors allowed, in ulp; what is not named is reported only.
MOST = {
    (np.float64, "double_word"): 1.5,
    (np.float64, "compensated"): 16.0,
    (np.float32, "compensated"): 32.0,
}
TIMED, ROUNDS = 2000, 5  # points a regime
SYMBOLS = dict(zip((*POWERS, *AMPLITUDES), ("R_s", "R_p", "F", "T_s", "T_p", "T", "r_s", "r_p"), strict=True))
NAMES = {
    "cosine": ("cos_theta_i", "eta"),
    "bulk": ("cos_theta_i", "eta"),
    "angle": ("theta_i", "eta"),
    "degrees": ("theta_i_deg", "eta"),
    "near match": ("cos_theta_i", "eta_minus_one"),
}


def about(*, full: bool) -> str:
    return (
        f"{_evaluations('cosine', full):,} points a regime and format ({_evaluations('angle', full):,} where an angle is "
        f"given, and of bulk: one index, F only), seed {SEED}: 40 % at random, then hill-climbing on the error of every output. Errors are in ulp of the "
        "format at the exact value, below its smallest normal number in units of the subnormal spacing. The exact value is "
        "the naive complex formula in 1400 bits or more, at the floats as given. Errors of amplitudes are moduli, in ulp of "
        "the modulus. A given angle is a float too: its errors are in units of 1 ulp plus what one ulp of the angle, or of what "
        "it lacks to 90 degrees, changes, whichever is less. Peers got the same points, tmm every 10th and pyElli every 50th; "
        "theirs is the worst of R_s, R_p and F where they give them, ours of all six powers. Times are medians on "
        f"{TIMED:,} random points a regime, one thread, six powers (ours), Python's overhead included."
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    trials = _trials()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(PROCESSES, context) as pool:
        found = list(pool.map(run, trials, [_evaluations(trial.entry, full) for trial in trials]))
    by_cosine = [one for one in found if one.trial.entry == "cosine"]
    for dtype in FORMATS:
        for rung in RUNGS:
            for kind in KINDS:
                some = [one for one in by_cosine if (one.trial.kind, one.trial.dtype) == (kind, dtype)]
                yield _worst(
                    f"{kind}, {np.dtype(dtype)}, {rung}", some, rung, POWERS, MOST.get((dtype, rung))
                )
    yield from _outside(found)
    for dtype in FORMATS:
        yield _imbalance(dtype, [one for one in found if one.trial.dtype is dtype])
    for entry in ("angle", "degrees", "near match"):
        for rung in RUNGS:
            some = [one for one in found if one.trial.entry == entry]
            exact = entry == "near match"
            # The cosine of an angle is rounded before the formula: there no rung is better than compensated.
            most = MOST.get((np.float64, rung if exact or rung == "plain" else "compensated"))
            yield _worst(f"{entry} given, {rung}", some, rung, POWERS, most, "ulp" if exact else "units")
    for dtype in FORMATS:
        for rung in RUNGS:
            some = [one for one in found if (one.trial.entry, one.trial.dtype) == ("bulk", dtype)]
            yield _worst(f"bulk, {np.dtype(dtype)}, {rung}", some, rung, FEW, MOST.get((dtype, rung)))
    for rung in RUNGS:
        some = [one for one in by_cosine if one.trial.dtype is np.float64]
        yield _worst(f"amplitudes, {rung}", some, rung, AMPLITUDES, MOST.get((np.float64, rung)))
    yield from _peers_missing()
    for kind in KINDS:
        for dtype in FORMATS:
            yield _table(
                kind, dtype, [o for o in by_cosine if (o.trial.kind, o.trial.dtype) == (kind, dtype)]
            )


def _evaluations(entry: str, full: bool) -> int:
    points = 1_000_000 if full else 10_000
    return points if entry in ("cosine", "near match") else points // 4


def _trials() -> list[Trial]:
    regimes = [regime for family in KINDS.values() for regime in family]
    return [
        *(Trial(one.kind, one.name, "cosine", dtype) for dtype in FORMATS for one in regimes),
        *(Trial(one.kind, one.name, entry) for entry in ("angle", "degrees") for one in regimes),
        *(Trial(one.kind, one.name, "bulk", dtype) for dtype in FORMATS for one in regimes),
        *(Trial(one.kind, one.name, "near match") for one in NEAR_MATCH),
    ]


def _worst(
    name: str,
    found: Sequence[Found],
    rung: str,
    outputs: Iterable[str],
    most: float | None,
    unit: str = "ulp",
) -> Figure:
    worst, output, trial = max(
        ((one.worst[rung, output], output, one.trial) for one in found for output in outputs),
        key=lambda triple: triple[0].error,
    )
    value = f"{_short(worst.error)} {unit} of {SYMBOLS[output]}, {_place(trial, worst.at)}"
    if most is None:
        return Figure.reported(name, value)
    return Figure.judged(name, value, f"{most:g} {unit} at most", worst.error <= most)


def _outside(found: Sequence[Found]) -> Iterator[Figure]:
    for rung in RUNGS:
        bad = [one for one in found if one.outside[rung]]
        count, values = sum(one.outside[rung] for one in bad), sum(one.values for one in found) // len(RUNGS)
        value = f"{count} of {values}"
        if bad:
            value += f", {_place(bad[0].trial, bad[0].outside_at[rung])}"
        yield Figure.judged(f"outputs NaN, negative or above 1, {rung}", value, "0", count == 0)


def _imbalance(dtype: type[np.floating[Any]], found: Sequence[Found]) -> Figure:
    worst = max(found, key=lambda one: one.imbalance.error)
    most = float(np.finfo(dtype).eps)
    value = f"{worst.imbalance.error:.2g}, {_place(worst.trial, worst.imbalance.at)}"
    good = worst.imbalance.error <= most
    return Figure.judged(f"R + T - 1, {np.dtype(dtype)}", value, f"{most:.2g} at most", good)


def _peers_missing() -> Iterator[Figure]:
    peers = {peer.package: peer for kind in KINDS for dtype in FORMATS for peer in peers_of(kind, dtype)}
    for package, peer in peers.items():
        if not peer.installed:
            yield Figure.not_run(f"worst errors of {package}", "none", "not installed")


def _table(kind: str, dtype: type[np.floating[Any]], found: Sequence[Found]) -> Table:
    peers = [peer for peer in peers_of(kind, dtype) if peer.installed]
    regimes = [one.trial.regime for one in found]
    rows = [
        (f"ns an evaluation, {name}", *(f"{ns:.3g}" for ns in _times(kind, dtype, some)))
        for name, some in ((regimes[0], regimes[:1]), ("all regimes", regimes))
    ]
    for one in found:
        ours = [(max(one.worst[rung, power].error for power in POWERS), one.outside[rung]) for rung in RUNGS]
        theirs = [(one.peers[peer.name][0].error, one.peers[peer.name][1]) for peer in peers]
        rows.append((one.trial.regime, *(_cell(*pair) for pair in (*ours, *theirs))))
    title = f"Worst error in ulp by regime, {kind}, {np.dtype(dtype)} (values outside [0, 1] or NaN)"
    return Table(title, ("regime", *RUNGS, *(peer.name for peer in peers)), tuple(rows))


def _times(kind: str, dtype: type[np.floating[Any]], regimes: Sequence[str]) -> list[float]:
    """Nanoseconds an evaluation of every column of a table, in turns on the same points."""
    rng = np.random.default_rng(SEED)
    parts = []
    for name in regimes:
        trial = Trial(kind, name, "cosine", dtype)
        axes = trial.family().axes
        parts.append(trial.inputs(rng.random((axes, TIMED)), np.zeros((0, TIMED), dtype=np.int64)))
    points = [np.concatenate(column) for column in zip(*parts, strict=True)]
    given = points if kind == "conductor" else points[:2]

    def ours(rung: str) -> Callable[[], object]:
        return lambda: ENTRIES["cosine"](*given, rung=rung)

    jobs: list[tuple[int, Callable[[], object]]] = [(len(points[0]), ours(rung)) for rung in RUNGS]
    for peer in peers_of(kind, dtype):
        if peer.installed:
            some = [column[:: peer.every] for column in points]
            jobs.append((len(some[0]), lambda call=peer.call, some=some: call(*some)))
    seconds = []
    with np.errstate(all="ignore"):
        for _ in range(ROUNDS + 1):
            seconds.append([_seconds(job) for _, job in jobs])
    medians = (statistics.median(column) for column in zip(*seconds[1:], strict=True))
    return [1e9 * median / n for median, (n, _) in zip(medians, jobs, strict=True)]


def _seconds(job: Callable[[], object]) -> float:
    started = time.perf_counter()
    job()
    return time.perf_counter() - started


def _place(trial: Trial, at: Point) -> str:
    """Regime and exact inputs, to be copied into a call."""
    names = (*NAMES[trial.entry], "k")
    inputs = ", ".join(f"{name} = {x.hex()}" for name, x in zip(names, at, strict=True) if name != "k" or x)
    return f"{trial.regime} ({inputs})"


def _cell(error: float, outside: int) -> str:
    return _short(error) + (f" ({outside})" if outside else "")


def _short(error: float) -> str:
    return f"{error:.2f}" if error < 100 else f"{error:.1e}"
