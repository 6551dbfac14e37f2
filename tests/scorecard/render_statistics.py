"""Whether pictures have the right mean: over seeds and samples, and beside another renderer's."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from card import Figure, Table
from numpy.typing import NDArray
from render_mitsuba import renders
from scipy import stats
from tracer_kernels import specked
from tracer_scenes import PEERS

from reflectance_fit.render.run import render
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Settings

Floats = NDArray[np.float64]

SEEDS, COUNTS, SLOPE = 64, (16, 64, 256), 0.03
GROUPS, TILE = 16, 4
SIZE = (32, 24)
ALPHA, SIGMAS, PRECISION = 0.01, 3.0, 1e-3
# Of what float32 makes of a pixel without noise.
_ROUNDING = 3e-6


def unbiased(*, full: bool) -> Iterator[Figure]:
    """RMS error against the mean of a long render falls as one over the root of the samples, and means stay."""
    for name in ("glass and metal", "plastic"):
        scene = next(case.scene for case in PEERS if case.name == name)
        errors, means = [], []
        reference = _picture(scene, 262144 if full else 65536, SEEDS)
        for count in COUNTS:
            pictures = np.array([_picture(scene, count, seed) for seed in range(SEEDS)])
            errors.append(np.sqrt(np.mean((pictures - reference) ** 2)))
            means.append(pictures.mean(axis=(1, 2, 3)))
        slope = float(np.polyfit(np.log(COUNTS), np.log(errors), 1)[0])
        title = f"unbiased, {name}: RMS error over samples, {SEEDS} seeds x {len(COUNTS)} counts"
        good = abs(slope + 0.5) <= SLOPE
        yield Figure.judged(title, f"slope {slope:.3f}", f"-0.5 +- {SLOPE}", good)
        p = min(
            float(stats.ttest_ind(means[i], means[j], equal_var=False).pvalue)
            for i, j in ((0, 1), (0, 2), (1, 2))
        )
        title = f"unbiased, {name}: means of different counts, smallest p of 3"
        yield Figure.judged(title, f"{p:.3f}", f"{sidak(3):.4f} at least", p >= sidak(3))


def _picture(scene: Scene, samples: int, seed: int) -> Floats:
    return render(scene, Settings("rgb", samples, seed, sampler="independent")).mean[..., 0]


def agreement(*, full: bool) -> Iterator[Figure | Table]:
    """Ours against Mitsuba's, by Welch's test on tiles (Jung et al., JCGT 9 (2020) no. 2)."""
    found, base = [], 2048 if full else 512
    jobs = [(case.name, case.scene, mode) for case in PEERS for mode in case.modes]
    target = f"{SIGMAS:.0f} sigma of {PRECISION:.1%}"
    for number, (name, scene, mode) in enumerate(jobs):
        scene = replace(scene, camera=replace(scene.camera, size_px=SIZE))
        seeds = range(GROUPS * number, GROUPS * (number + 1))
        samples = base * (8 if name == "point and sun" else 1)  # of which rough metal under a sun is noisy
        theirs = renders(scene, mode, samples, seeds)
        if isinstance(theirs, str):
            yield Figure.not_run("agreement with Mitsuba", target, theirs)
            return
        shared = scene if full else specked(scene)
        ours = np.array([render(shared, Settings(mode, samples, seed)).mean for seed in seeds])
        found.append(compared(ours[..., : theirs.shape[-2], :], theirs))
    n, pull, width = len(jobs), max(abs(f.pull) for f in found), max(f.width for f in found)
    title = f"mean S0 against Mitsuba, N = {n} of {len(PEERS)} scenes"
    good = pull <= SIGMAS and width <= PRECISION
    yield Figure.judged(title, f"{pull:.1f} sigma, {width:.2%} wide at most", target, good)
    every = np.concatenate([f.p_values for f in found])
    even = float(stats.kstest(every, "uniform").pvalue)
    title = f"p-values of Welch's test uniform (Kolmogorov and Smirnov), N = {every.size} tiles"
    yield Figure.judged(title, f"p = {even:.3f}", f"{ALPHA} at least", even >= ALPHA)
    low, bound = min(f.smallest for f in found), sidak(sum(f.tests for f in found))
    title = f"tiles that differ, S0 to S3: smallest p of {sum(f.tests for f in found)}"
    yield Figure.judged(title, f"{low:.1e}", f"{bound:.1e} at least (Sidak)", low >= bound)
    rows = tuple(
        (
            name,
            mode,
            f"{f.pull:+.2f}",
            f"{f.width:.3%}",
            f"{stats.kstest(f.p_values, 'uniform').pvalue:.3f}" if f.p_values.size else "no noise",
            f"{f.smallest:.1e}",
        )
        for (name, _, mode), f in zip(jobs, found, strict=True)
    )
    header = (
        "scene",
        "mode",
        "mean S0, sigma",
        "one sigma",
        "p of uniformity",
        "smallest p of a tile",
    )
    yield Table("Against Mitsuba", header, rows)


def sidak(tests: int) -> float:
    """The level of each of some tests that together are wrong as rarely as ALPHA."""
    return float(-np.expm1(np.log1p(-ALPHA) / tests))


class Comparison(NamedTuple):
    """``pull``: mean S0, ours minus theirs, in sigma of the difference, ``width``, over S0.

    ``p_values``: of S0 of the tiles that are not all but free of noise; ``smallest``: of all ``tests``, tiles times components.
    """

    pull: float
    width: float
    p_values: Floats
    smallest: float
    tests: int


def compared(ours: Floats, theirs: Floats) -> Comparison:
    """Two sets of independent pictures, shape (groups, height, width, C, S)."""
    level = float(theirs[..., 0].mean())
    powers = [x[..., 0].mean(axis=3) for x in (ours, theirs)]
    # Pixels are independent of one another, so that their variances add up to a well known one.
    width = float(np.sqrt(sum(x.var(axis=0, ddof=1).sum() / len(x) for x in powers))) / powers[0][0].size
    tiles = [_tiles(x) for x in (ours, theirs)]
    spread = [x.var(axis=0, ddof=1) / len(x) for x in tiles]
    error = np.sqrt(spread[0] + spread[1])
    t = (tiles[0].mean(axis=0) - tiles[1].mean(axis=0)) / np.hypot(error, _ROUNDING * level)
    with np.errstate(invalid="ignore", divide="ignore"):
        freedom = error**4 / sum(s**2 / (len(x) - 1) for s, x in zip(spread, tiles, strict=True))
    # A tile without noise of either is right or wrong by rounding alone.
    freedom = np.where(np.isfinite(freedom), freedom, 2.0 * (GROUPS - 1))
    p = 2.0 * stats.t.sf(np.abs(t), freedom)
    noisy = error > 30.0 * _ROUNDING * level
    # Channels and Stokes components of one tile come from the same paths: only the first is a fair sample of uniformity.
    first = p[:, 0, 0][noisy[:, 0, 0]]
    return Comparison(
        float(np.subtract(*(x.mean() for x in powers)) / width),
        width / level,
        first,
        float(p.min()),
        p.size,
    )


def _tiles(pictures: Floats) -> Floats:
    groups, height, width, channels, size = pictures.shape
    cut = pictures.reshape(groups, height // TILE, TILE, width // TILE, TILE, channels, size)
    return cut.mean(axis=(2, 4)).reshape(groups, -1, channels, size)
