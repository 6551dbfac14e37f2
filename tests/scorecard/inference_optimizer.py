"""The estimator ladder: is the best point found, are walls of NaN seen through, are certified values met."""

from __future__ import annotations

import math
import os
import statistics
from collections.abc import Callable, Iterator
from pathlib import Path

import inference_nist as nist
import numpy as np
from card import Figure, Table
from inference_scenes import Scene, scene
from numpy.typing import NDArray

from reflectance_fit.inference import optimize, search, starts
from reflectance_fit.inference.gauss_newton import descend_all
from reflectance_fit.inference.problem import objective, objectives, problem_of

Floats = NDArray[np.float64]

MULTISTARTS = 200
CLOSE = 1e-6  # relative to 1 or the objective, whichever is more
WALLS = 15
DATA = Path(
    os.environ.get("REFLECTANCE_FIT_DATA") or Path(__file__).parents[2] / ".." / "shared" / "data"
).resolve()


def about(*, full: bool) -> str:
    return (
        f"{_scenes(full)} scenes (seeds 0 upwards; inference_scenes.py) against the best of {MULTISTARTS} Gauss-Newton "
        "descents from random points, the best of which nlopt's BOBYQA polishes once more. Found: within 1e-6 of it, "
        f"relative to the objective or 1. NaN walls: {WALLS} half-planes and pockets on each of 4 functions, by every "
        "method; a false success claims convergence and is not the best finite point that it saw, or has a slope."
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    yield from _global(_scenes(full))
    yield from _walls(WALLS * (5 if full else 1))
    yield from _certified()


def _scenes(full: bool) -> int:
    return 10_000 if full else 500


def _global(count: int) -> Iterator[Figure | Table]:
    found: list[tuple[Scene, bool, bool]] = []
    closed = {"offered": 0, "in the best basin": 0}
    for seed in range(count):
        s = scene(seed)
        optimum, basins = search.find(s.model, s.rows, s.gains)
        best = min(optimum.objective, reference(s, seed))
        found.append((s, optimum.objective - best <= CLOSE * max(1.0, abs(best)), basins[0].converged))
        if _closed_form_reaches(s, best):
            closed["in the best basin"] += 1
        closed["offered"] += len(starts.closed_forms(s.model, s.rows)) > 0
    share = statistics.fmean(ok for _, ok, _ in found)
    yield Figure.judged(
        f"best of {MULTISTARTS} multistarts found",
        f"{100 * share:.2f} % of {count}",
        "99.9 % at least",
        share >= 0.999,
    )
    hard = [ok for s, ok, _ in found if s.hard]
    yield Figure.reported(
        "the same, dielectrics with eta < 1", f"{100 * statistics.fmean(hard):.2f} % of {len(hard)}"
    )
    false = sum(claimed and not ok for _, ok, claimed in found)
    yield Figure.reported("converged, but to another basin", f"{false} of {count}")
    yield Figure.reported(
        "a closed form starts in the best basin",
        f"{closed['in the best basin']} of {closed['offered']} with one",
    )
    kinds = sorted({s.kind for s, _, _ in found})
    rows = []
    for kind in kinds:
        of = [ok for s, ok, _ in found if s.kind == kind]
        rows.append((kind, str(len(of)), f"{100 * statistics.fmean(of):.2f}"))
    yield Table("Best point found, by kind of table", ("kind", "scenes", "found, %"), tuple(rows))


def reference(s: Scene, seed: int) -> float:
    """The lowest objective from many random points, polished by nlopt."""
    generator = np.random.default_rng([seed, 6])
    problem = problem_of(s.model, s.rows)
    share = generator.random((MULTISTARTS, len(s.model.names)))
    share[:, s.model.names.index("k")] **= 2
    points = problem.low + (problem.high - problem.low) * share
    values, _, _, _ = descend_all(s.rows, problem, points)
    best = int(np.argmin(values))
    polished = optimize.minimise(
        scalar(s), points[best], s.model.ranges, 1e-3 * (problem.high - problem.low), "local"
    )
    return min(float(values[best]), polished.objective)


def scalar(s: Scene) -> Callable[[Floats], float]:
    problem = problem_of(s.model, s.rows)
    whitened, gains = np.empty(len(s.rows.value)), np.empty(s.rows.gains)
    return lambda x: objective(s.rows, problem, x, whitened, gains)


def _closed_form_reaches(s: Scene, best: float) -> bool:
    problem = problem_of(s.model, s.rows)
    points = starts.closed_forms(s.model, s.rows)
    if not len(points):
        return False
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
