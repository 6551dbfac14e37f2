"""How long the best point takes, against what one would write with scipy or lmfit; and nlopt's rungs alone."""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from card import Figure, Table
from fresnel_peers import textbook
from inference_scenes import PRIORS, Scene, build, scene
from numpy.typing import NDArray

from reflectance_fit.inference import models, optimize, search
from reflectance_fit.inference.normal_equations import normal_equations
from reflectance_fit.inference.problem import objective, problem_of

Floats = NDArray[np.float64]

MATERIALS = {
    "glass": (1.5, 0.0),
    "absorbing plastic": (1.55, 0.3),
    "gold": (0.42, 2.4),
    "chromium": (3.1, 3.3),
}
ANGLES = 10
SAME = 1e-6
REPEATS = 20  # of what takes milliseconds: one is too short for the clock of the CPU's time
DE_TIMES, LMFIT_TIMES = 100.0, 5.0
# Where a table holds the start that lmfit is given, as a user without a search would choose it.
START = (1.4, 1.0)


class Peer(NamedTuple):
    """Seconds of each round by contender, and the objectives that each reached."""

    seconds: dict[str, list[float]]
    reached: dict[str, float]


def about(*, full: bool) -> str:
    return (
        f"Tables of {ANGLES} angles x (signal_s, signal_p), 1 % noise, eta and k free in [0.05, 10] and [0, 20], one gain "
        f"for each of s and p: {', '.join(MATERIALS)}. scipy's differential_evolution minimises chi2 with the gains "
        "eliminated in closed form (numpy, defaults, polish included); lmfit's default leastsq fits eta, k and both gains "
        f"from one start, eta {START[0]} and k {START[1]}. Ours starts from the packed rows: model, grid, closed forms, "
        f"descents, description. CPU time (one thread each); medians of {_rounds(full)} rounds in which everyone takes a turn, "
        f"ours and lmfit's {REPEATS} times over."
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    found = {name: _race(*index, rounds=_rounds(full)) for name, index in MATERIALS.items()}
    yield from _against("scipy differential_evolution", found, DE_TIMES)
    yield from _against("lmfit", found, LMFIT_TIMES)
    ours = [1e3 * statistics.median(peer.seconds["ours"]) for peer in found.values()]
    yield Figure.reported(
        "ours, ms", ", ".join(f"{name} {ms:.2f}" for name, ms in zip(found, ours, strict=True))
    )
    yield _with_nuisances(_rounds(full))
    yield _rungs(400 if full else 60)


def _rounds(full: bool) -> int:
    return 51 if full else 7


def _against(peer: str, found: dict[str, Peer], least: float) -> Iterator[Figure]:
    name = f"times faster than {peer}"
    if not all(peer in race.seconds for race in found.values()):
        yield Figure.not_run(name, f"{least:.0f} at least", "not installed")
        return
    ratios, same = {}, []
    for material, race in found.items():
        ratios[material] = statistics.median(race.seconds[peer]) / statistics.median(race.seconds["ours"])
        theirs, our = race.reached[peer], race.reached["ours"]
        if abs(theirs - our) <= SAME * max(1.0, our):
            same.append(material)
    worst = min(ratios.values())
    value = f"{worst:.0f} ({', '.join(f'{m} {r:.0f}' for m, r in ratios.items())})"
    yield Figure.judged(name + ", the worst material", value, f"{least:.0f} at least", worst >= least)
    lower = [m for m, race in found.items() if race.reached["ours"] > race.reached[peer] + SAME]
    yield Figure.judged(
        f"objective no higher than {peer}'s",
        f"{len(found) - len(lower)} of {len(found)}, equal to 1e-6 in {len(same)}",
        "all",
        not lower,
    )


def _table(eta: float, k: float) -> Scene:
    generator = np.random.default_rng(1)
    return build(eta, k, "signals", np.linspace(20.0, 80.0, ANGLES), 0.01, generator)


def _race(eta: float, k: float, rounds: int) -> Peer:
    s = _table(eta, k)

    def ours() -> float:
        model = models.build("conductor", s.rows, PRIORS, {}, [])
        return search.find(model, s.rows, s.gains)[0].objective

    jobs: dict[str, Callable[[], float]] = {
        "ours": ours,
        "scipy differential_evolution": _differential_evolution(s),
    }
    if importlib.util.find_spec("lmfit"):
        jobs["lmfit"] = _lmfit(s)
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    reached = {}
    for turn in range(rounds + 1):
        for name, job in jobs.items():
            repeats = 1 if name.startswith("scipy") else REPEATS
            started = time.thread_time()
            for _ in range(repeats):
                reached[name] = job()
            if turn:  # the first compiles
                seconds[name].append((time.thread_time() - started) / repeats)
    return Peer(seconds, reached)


def _columns(s: Scene) -> tuple[Floats, list[tuple[Floats, float]]]:
    """Cosines, and the values and sigma of s and of p."""
    half = len(s.rows.value) // 2
    parts = [(s.rows.value[i], float(s.rows.sigma[i][0])) for i in (slice(half), slice(half, None))]
    return s.rows.cos_theta[:half], parts


def _powers(cos: Floats, eta: float, k: float) -> tuple[Floats, Floats]:
    found = textbook(cos, np.float64(eta), np.float64(k))
    return found["s"], found["p"]


def _differential_evolution(s: Scene) -> Callable[[], float]:
    from scipy.optimize import differential_evolution

    cos, parts = _columns(s)

    def chi2(x: Floats) -> float:
        total = 0.0
        for power, (value, sigma) in zip(_powers(cos, x[0], x[1]), parts, strict=True):
            gain = power @ value / (power @ power)
            total += np.sum(((value - gain * power) / sigma) ** 2)
        return float(total)

    bounds = [(PRIORS["eta"].low, PRIORS["eta"].high), (PRIORS["k"].low, PRIORS["k"].high)]
    return lambda: float(differential_evolution(chi2, bounds, rng=0).fun)


def _lmfit(s: Scene) -> Callable[[], float]:
    import lmfit

    cos, parts = _columns(s)

    def residuals(p: lmfit.Parameters) -> Floats:
        powers = _powers(cos, p["eta"].value, p["k"].value)
        gains = p["gain_s"].value, p["gain_p"].value
        return np.concatenate(
            [
                (value - gain * power) / sigma
                for power, gain, (value, sigma) in zip(powers, gains, parts, strict=True)
            ]
        )

    def job() -> float:
        p = lmfit.Parameters()
        p.add("eta", START[0], min=PRIORS["eta"].low, max=PRIORS["eta"].high)
        p.add("k", START[1], min=PRIORS["k"].low, max=PRIORS["k"].high)
        powers = _powers(cos, *START)
        for name, power, (value, _) in zip(("gain_s", "gain_p"), powers, parts, strict=True):
            p.add(name, float(power @ value / (power @ power)))
        return float(lmfit.minimize(residuals, p).chisqr)

    return job


def _with_nuisances(rounds: int) -> Figure:
    generator = np.random.default_rng(2)
    nuisances = {"angle_offset_deg": 0.5, "dark_offset": 0.9, "diffuse": 0.01}
    s = build(1.5, 0.0, "signals", np.linspace(15.0, 85.0, 36), 0.01, generator, **nuisances)
    seconds = []
    for _ in range(rounds + 1):
        started = time.thread_time()
        for _ in range(REPEATS):
            search.find(s.model, s.rows, s.gains)
        seconds.append((time.thread_time() - started) / REPEATS)
    return Figure.reported(
        "ours, ms, 72 rows with angle offset, dark offset and diffuse light",
        f"{1e3 * statistics.median(seconds[1:]):.2f}",
    )


def _rungs(count: int) -> Table:
    """Each rung alone on random scenes, from a random start where it needs one."""
    jobs = ("search", *optimize.METHODS)
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    evaluations: dict[str, list[int]] = {name: [] for name in jobs}
    reached: dict[str, list[float]] = {name: [] for name in jobs}
    hard = []
    for seed in range(20_000, 20_000 + count):
        s = scene(seed)
        hard.append(s.hard)
        problem = problem_of(s.model, s.rows)
        size = problem.high - problem.low
        whitened, gains = np.empty(len(s.rows.value)), np.empty(s.rows.gains)

        def value(x: Floats, s: Scene = s, problem=problem, whitened=whitened, gains=gains) -> float:
            return objective(s.rows, problem, x, whitened, gains)

        def slope(x: Floats, s: Scene = s, problem=problem, whitened=whitened, gains=gains) -> Floats:
            half, curvature = np.empty(len(x)), np.empty((len(x), len(x)))
            objective(s.rows, problem, x, whitened, gains)
            normal_equations(s.rows, problem, x, False, whitened, gains, half, curvature)
            return 2 * half

        start = problem.low + size * np.random.default_rng([seed, 8]).random(len(size))
        for name in jobs:
            started = time.thread_time()
            if name == "search":
                found = search.find(s.model, s.rows, s.gains)[1][0]
            else:
                found = optimize.minimise(value, start, s.model.ranges, 0.1 * size, name, slope)
            seconds[name].append(time.thread_time() - started)
            evaluations[name].append(found.evaluations)
            reached[name].append(found.objective)
    best = [min(row) for row in zip(*reached.values(), strict=True)]
    rows = []
    for name in jobs:
        good = [r <= b + SAME * max(1.0, abs(b)) for r, b in zip(reached[name], best, strict=True)]
        of_hard = [ok for ok, is_hard in zip(good, hard, strict=True) if is_hard]
        rows.append(
            (
                name,
                f"{100 * statistics.fmean(good):.1f}",
                f"{100 * statistics.fmean(of_hard):.1f}" if of_hard else "-",
                f"{1e3 * statistics.median(seconds[name]):.2f}",
                str(int(statistics.median(evaluations[name]))) if name != "search" else "-",
            )
        )
    title = f"Rungs alone: {count} random scenes, success within 1e-6 of the best of all rungs"
    header = ("rung", "success, %", f"eta < 1 dielectrics ({sum(hard)}), %", "median ms", "evaluations")
    return Table(title, header, tuple(rows))
