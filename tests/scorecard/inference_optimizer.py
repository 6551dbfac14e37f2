"""The estimator ladder: is the best point found, are walls of NaN seen through, are certified values met."""

from __future__ import annotations

import math
import os
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import inference_nist as nist
import numpy as np
from card import Figure, Table
from inference_reference import MULTISTARTS, lowest
from inference_reference import objective as readable
from inference_scenes import Scene, scene
from numpy.typing import NDArray

from reflectance_fit.inference import optimize, search, starts
from reflectance_fit.inference.gauss_newton import descend_all
from reflectance_fit.inference.problem import objective, objectives, problem_of

Floats = NDArray[np.float64]

FIRST_SEED = 100_000  # starts and steps were developed on the seeds from 0 on
CLOSE = 1e-6  # relative to 1 or the objective, whichever is more
WALLS = 15
DATA = Path(
    os.environ.get("REFLECTANCE_FIT_DATA") or Path(__file__).parents[2] / ".." / "shared" / "data"
).resolve()


def about(*, full: bool) -> str:
    return (
        f"{scenes(full=full)} scenes (seeds {FIRST_SEED} upwards; inference_scenes.py) against the best of {MULTISTARTS} descents "
        "from random points by textbook formulas in numpy, the lowest ends polished by scipy's least squares and its "
        "simplex (inference_reference.py, which uses nothing of the fit's). Found: within 1e-6 of it, "
        f"relative to the objective or 1. NaN walls: {WALLS} half-planes and pockets on each of 4 functions, by every "
        "method; a false success claims convergence and is not the best finite point that it saw, or has a slope."
    )


def figures(found: Sequence[Found], *, full: bool) -> Iterator[Figure | Table]:
    """``found``: `compared` of 0 to `scenes` - 1."""
    yield from _global(found)
    yield from _walls(WALLS * (5 if full else 1))
    yield from _certified()


def scenes(*, full: bool) -> int:
    return 10_000 if full else 500


@dataclass(frozen=True, slots=True)
class Found:
    """Of one scene: whether the search found the best point, claims convergence, and how its starts did."""

    kind: str
    hard: bool
    best: bool
    claimed: bool
    apart: float  # its objective from that of the readable formulas, relative
    closed_form: bool | None  # reaches the best basin; None where there is none


def compared(number: int) -> Found:
    """The search against the reference, in one scene."""
    s = scene(FIRST_SEED + number)
    optimum, basins = search.find(s.model, s.rows, s.gains)
    best = min(optimum.objective, lowest(s, number))
    scale = max(1.0, abs(best))
    return Found(
        s.kind,
        s.hard,
        optimum.objective - best <= CLOSE * scale,
        basins[0].converged,
        abs(optimum.objective - readable(s, basins[0].x)) / scale,
        _closed_form_reaches(s, best),
    )


def _global(found: Sequence[Found]) -> Iterator[Figure | Table]:
    count = len(found)
    share = statistics.fmean(one.best for one in found)
    yield Figure.judged(
        f"best of {MULTISTARTS} multistarts found",
        f"{100 * share:.2f} % of {count}",
        "99.9 % at least",
        share >= 0.999,
    )
    hard = [one.best for one in found if one.hard]
    yield Figure.reported(
        "the same, dielectrics with eta < 1", f"{100 * statistics.fmean(hard):.2f} % of {len(hard)}"
    )
    false = sum(one.claimed and not one.best for one in found)
    yield Figure.reported("converged, but to another basin", f"{false} of {count}")
    apart = max(one.apart for one in found)
    yield Figure.judged(
        "objective against the readable formulas", f"{apart:.1g}", "1e-9 at most", apart <= 1e-9
    )
    closed = [one.closed_form for one in found if one.closed_form is not None]
    yield Figure.reported(
        "a closed form starts in the best basin", f"{sum(closed)} of {len(closed)} with one"
    )
    rows = []
    for kind in sorted({one.kind for one in found}):
        of = [one.best for one in found if one.kind == kind]
        rows.append((kind, str(len(of)), f"{100 * statistics.fmean(of):.2f}"))
    yield Table("Best point found, by kind of table", ("kind", "scenes", "found, %"), tuple(rows))


def scalar(s: Scene) -> Callable[[Floats], float]:
    problem = problem_of(s.model, s.rows)
    whitened, gains = np.empty(len(s.rows.value)), np.empty(s.rows.gains)
    return lambda x: objective(s.rows, problem, x, whitened, gains)


def _closed_form_reaches(s: Scene, best: float) -> bool | None:
    problem = problem_of(s.model, s.rows)
    points = starts.closed_forms(s.model, s.rows)
    if not len(points):
        return None
    chosen = points[np.argsort(objectives(s.rows, problem, points))[:2]]
    values, _, _, _ = descend_all(s.rows, problem, chosen)
    return bool(values.min() - best <= CLOSE * max(1.0, abs(best)))


class _Walled:
    """A function with NaN in half-planes and pockets, and the best finite value that anyone saw."""

    def __init__(self, smooth: Callable[[Floats], float], generator: np.random.Generator, ranges: Floats):
        self.smooth = smooth
        low, high = ranges.T
        size = high - low
        self.low, self.size = low, size
        self.normals = generator.standard_normal((generator.integers(0, 3), 2))
        self.distances = generator.uniform(-0.1, 0.45, len(self.normals))
        self.pockets = generator.random((generator.integers(0, 4), 2))
        self.radii = generator.uniform(0.02, 0.2, len(self.pockets))
        self.best = math.inf

    def __call__(self, x: Floats) -> float:
        unit = (x - self.low) / self.size
        planes = (unit - 0.5) @ self.normals.T > self.distances * np.linalg.norm(self.normals, axis=1)
        pockets = np.linalg.norm(unit - self.pockets, axis=1) < self.radii
        if planes.any() or pockets.any():
            return math.nan
        value = self.smooth(x)
        if math.isfinite(value):
            self.best = min(self.best, value)
        return value


def _functions() -> Iterator[tuple[str, Callable[[Floats], float], Floats]]:
    square = np.array([[-2.0, 2.0], [-1.0, 3.0]])
    yield "bowl", lambda x: float((x[0] - 0.3) ** 2 + 4 * (x[1] - 0.1) ** 2), square
    yield "Rosenbrock", lambda x: float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2), square
    yield (
        "Himmelblau",
        lambda x: float((x[0] ** 2 + x[1] - 11) ** 2 + (x[0] + x[1] ** 2 - 7) ** 2),
        np.array([[-5.0, 5.0], [-5.0, 5.0]]),
    )
    s = next(s for s in map(scene, range(1000)) if s.kind == "absolute" and s.k > 0 and s.noise > 0)
    yield "Fresnel", scalar(s), s.model.ranges


def gradient(f: Callable[[Floats], float], x: Floats, size: Floats) -> Floats:
    """Central differences in units of the range; NaN where a neighbour is."""
    steps = 1e-6 * np.diag(size)
    return np.array([f(x + h) - f(x - h) for h in steps]) / (2e-6)


def _walls(count: int) -> Iterator[Figure | Table]:
    rows, total_false, total = [], 0, 0
    for method in optimize.METHODS:
        claimed = false = stopped = 0
        for i, (_, smooth, ranges) in enumerate(_functions()):
            low, high = ranges.T
            for seed in range(count):
                generator = np.random.default_rng([seed, i, 7])
                walled = _Walled(smooth, generator, ranges)
                start = low + (high - low) * generator.random(2)

                def slope(
                    x: Floats, f: Callable[[Floats], float] = walled, size: Floats = high - low
                ) -> Floats:
                    return gradient(f, x, size) / size

                found = optimize.minimise(walled, start, ranges, 0.1 * (high - low), method, slope)
                claimed += found.converged
                stopped += not math.isfinite(found.objective)
                false += found.converged and not _is_minimum(found, walled, smooth, ranges)
        trials = 4 * count
        rows.append((method, str(trials), str(claimed), str(false), str(stopped)))
        total_false, total = total_false + false, total + trials
    yield Figure.judged(
        "false successes beside walls of NaN", f"{total_false} of {total}", "0", total_false == 0
    )
    yield Table(
        "Walls of NaN, by method",
        ("method", "trials", "claim convergence", "falsely", "saw no finite value"),
        tuple(rows),
    )


def _is_minimum(
    found: optimize.Basin, walled: _Walled, smooth: Callable[[Floats], float], ranges: Floats
) -> bool:
    """The best finite point that was seen, and flat but for bounds: a Newton step would win next to nothing."""
    low, high = ranges.T
    size = high - low
    tolerance = 1e-5 * (1 + abs(found.objective))
    if found.objective > walled.best + 1e-7 * (1 + abs(found.objective)):
        return False
    for j in range(2):
        h = 1e-4 * size * np.eye(2)[j]
        around = [smooth(np.clip(found.x + sign * h, low, high)) for sign in (1, -1)]
        if min(around) < found.objective - tolerance:
            return False
    return True


def _certified() -> Iterator[Figure | Table]:
    folder = DATA / "nist_strd"
    present = sorted(path.stem for path in folder.glob("*.dat"))
    names = ("NIST StRD sets to 6 digits from both starts", "NIST StRD, median digits")
    if not present:
        for name, target in zip(names, ("all", "9 at least"), strict=True):
            yield Figure.not_run(name, target, f"no files in {folder.name} of the third-party data")
        return
    digits = {name: nist.recovered(name, nist.read(folder / f"{name}.dat")) for name in present}
    good = sum(min(both) >= 6 for both in digits.values())
    median = statistics.median(d for both in digits.values() for d in both)
    yield Figure.judged(names[0], f"{good} of {len(present)}", "all", good == len(present))
    yield Figure.judged(names[1], f"{median:.1f}", "9 at least", median >= 9)
    rows = tuple((name, *(f"{d:.1f}" for d in both)) for name, both in digits.items())
    yield Table("NIST StRD, digits of the worst parameter", ("set", "start 1", "start 2"), rows)
