"""What a pixel costs: the arrays' own copy, scipy pixel by pixel, and how it grows."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import map_streamed
import numba
import numpy as np
from card import Figure, Table
from numba import prange
from numpy.typing import NDArray

from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.pixels.estimate import PixelResult, estimate
from reflectance_fit.pixels.rows import PixelRows
from reflectance_fit.pixels.status import Status

Floats = NDArray[np.float64]

THREADS = 2
ANALYZERS = np.radians([0.0, 45.0, 90.0, 135.0])
GLASS, GOLD = (1.5, 0.0), (0.42, 2.4)
GLASS_ANGLE, GOLD_ANGLES = (40.0,), (50.0, 70.0)
SNR = 200.0
COPY, CURVE_FIT, LEAST_SQUARES, GROWTH = 0.5, 1e5, 5e3, 0.25
MEGA = 1 << 20
MOST = 64  # megapixels
REPEATS = 7
PEERS = 40  # pixels that scipy fits, one at a time


def about(*, full: bool) -> str:
    return (
        f"Glass (eta 1.5) at {GLASS_ANGLE[0]:.0f} degrees with an angle a pixel, gold (0.42 + 2.4 i) at "
        f"{' and '.join(f'{a:.0f}' for a in GOLD_ANGLES)} degrees, four analyzers each, unpolarized light, one free gain, "
        f"signals at 1/{SNR:.0f} noise, float32 values and variances in memory, {THREADS} threads. The copy reads the same "
        "arrays in and writes the same arrays out, in a loop of the same compiler and threads. scipy: "
        "`curve_fit` (defaults, from 1.4) for eta and gain, `least_squares` (defaults, from 0.5 + 2 i, gain 1) for eta, k and "
        f"gain, textbook Fresnel in numpy, one call a pixel, {PEERS} pixels; wall clock, medians of {REPEATS} runs that take "
        f"turns. Growth: 1 to {MOST} megapixels. {map_streamed.about()}"
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    threads = numba.get_num_threads()
    numba.set_num_threads(min(THREADS, threads))
    try:
        yield from _against_copy()
        yield from _against_scipy()
        yield from _growth()
    finally:
        numba.set_num_threads(threads)
    yield from map_streamed.figures()


def scene(index: tuple[float, float], angles: tuple[float, ...], pixels: int) -> PixelRows:
    """``pixels`` of one material, each with its angles."""
    views, m = len(angles), len(angles) * len(ANALYZERS)
    view, analyzer = np.repeat(np.arange(views), len(ANALYZERS)), np.tile(ANALYZERS, views)
    theta = np.radians(np.array(angles, dtype=np.float32))
    r = reflectances(np.cos(theta.astype(float))[view], *index)
    mean = 1000.0 * (r.s * (1 + np.cos(2 * analyzer)) + r.p * (1 - np.cos(2 * analyzer))) / 4
    sigma = np.float32(mean.max() / SNR)
    generator = np.random.default_rng(1)
    values = np.empty((m, pixels), dtype=np.float32)
    for j in range(m):
        generator.standard_normal(dtype=np.float32, out=values[j])
        values[j] *= sigma
        values[j] += np.float32(mean[j])
    return PixelRows(
        values=values,
        variance=np.full((m, pixels), sigma**2, dtype=np.float32),
        view=view,
        gain=np.zeros(m, dtype=np.int64),
        light=np.tile([1.0, 0.0, 0.0, 0.0], (m, 1)),
        diattenuation=np.ones(m),
        analyzer=analyzer,
        retarder=np.full(m, np.nan),
        retardance=np.full(m, np.nan),
        theta=np.repeat(theta[:, None], pixels, axis=1),
        cos_2s=np.ones((views, 1), dtype=np.float32),
        sin_2s=np.zeros((views, 1), dtype=np.float32),
    )


@numba.njit(parallel=True, error_model="numpy")
def _copy(values, variance, theta, reason, eta, sigma, chi2, dof, status):  # type: ignore[no-untyped-def]
    """The least work that reads what the closed form reads and writes what it writes."""
    m, n = values.shape
    for block in prange((n + 1023) // 1024):
        part = slice(block * 1024, min(block * 1024 + 1024, n))
        eta[part], status[part], dof[part] = theta[part], reason[part], np.uint16(1)
        sigma[part], chi2[part] = values[0, part], variance[0, part]
        to_sigma, to_chi2 = sigma[part], chi2[part]
        for j in range(1, m):
            value, noise = values[j, part], variance[j, part]
            for i in range(len(value)):
                to_sigma[i] += value[i]
                to_chi2[i] += noise[i]


def _first(rows: PixelRows, pixels: int) -> PixelRows:
    """The first pixels of a scene, in memory of their own."""
    parts = {name: getattr(rows, name)[:, :pixels].copy() for name in ("values", "variance", "theta")}
    return replace(rows, **parts)


def copier(rows: PixelRows) -> Callable[[], None]:
    """The copy of a scene's arrays, outputs allocated anew as `estimate` does."""
    n = rows.values.shape[1]

    def run() -> None:
        outputs = np.empty((3, n), dtype=np.float32)
        dof, status = np.empty(n, dtype=np.uint16), np.empty(n, dtype=np.uint8)
        reason = np.zeros(n, dtype=np.uint8)
        _copy(rows.values, rows.variance, rows.theta[0], reason, *outputs, dof, status)

    return run


def seconds(jobs: dict[str, Callable[[], object]], repeats: int = REPEATS) -> dict[str, float]:
    """Median wall time of each job; everyone takes a turn in every round, and the first round compiles."""
    found: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(repeats + 1):
        for name, job in jobs.items():
            started = time.perf_counter()
            job()
            if turn:
                found[name].append(time.perf_counter() - started)
    return {name: statistics.median(each) for name, each in found.items()}


def _against_copy() -> Iterator[Figure]:
    rows = scene(GLASS, GLASS_ANGLE, 4 * MEGA)
    found = seconds({"map": lambda: estimate(rows, "dielectric"), "copy": copier(rows)})
    ratio = found["copy"] / found["map"]
    yield Figure.judged(
        "dielectric map over a copy of its arrays", f"{ratio:.2f}", f"{COPY} at least", ratio >= COPY
    )
    rates = ", ".join(f"{name} {4 * MEGA / 1e6 / t:.0f}" for name, t in found.items())
    yield Figure.reported("megapixels a second", rates)


def _signals(rows: PixelRows, eta: float, k: float, gain: float) -> Floats:
    """Textbook signals of pixel 0's frames."""
    theta = rows.theta[rows.view, 0].astype(float)
    cos, wave = np.cos(theta), np.sqrt(complex(eta, k) ** 2 - np.sin(theta) ** 2)
    r_s = (cos - wave) / (cos + wave)
    epsilon = complex(eta, k) ** 2
    r_p = (epsilon * cos - wave) / (epsilon * cos + wave)
    c = np.cos(2 * rows.analyzer)
    return np.asarray(gain * (abs(r_s) ** 2 * (1 + c) + abs(r_p) ** 2 * (1 - c)) / 4)


def _curve_fit(rows: PixelRows) -> Callable[[], Floats]:
    from scipy.optimize import curve_fit

    sigma = np.sqrt(rows.variance[:, 0].astype(float))
    x = np.arange(len(rows.view), dtype=float)

    def fit(i: int) -> float:
        y = rows.values[:, i].astype(float)
        model = lambda _, eta, gain: _signals(rows, eta, 0.0, gain)
        return float(curve_fit(model, x, y, p0=(1.4, 800.0), sigma=sigma)[0][0])

    return lambda: np.array([fit(i) for i in range(PEERS)])


def _least_squares(rows: PixelRows) -> Callable[[], Floats]:
    from scipy.optimize import least_squares

    sigma = np.sqrt(rows.variance[:, 0].astype(float))

    def fit(i: int) -> Floats:
        y = rows.values[:, i].astype(float)
        found = least_squares(
            lambda p: (y - _signals(rows, p[0], p[1], 1000.0 * p[2])) / sigma, (0.5, 2.0, 1.0)
        )
        return np.asarray(found.x[:2])

    return lambda: np.array([fit(i) for i in range(PEERS)])


def _against_scipy() -> Iterator[Figure]:
    glass, gold = scene(GLASS, GLASS_ANGLE, MEGA), scene(GOLD, GOLD_ANGLES, MEGA // 4)
    theirs = {"eta": _curve_fit(glass), "eta and k": _least_squares(gold)}
    ours: dict[str, Callable[[], PixelResult]] = {
        "eta": lambda: estimate(glass, "dielectric"),
        "eta and k": lambda: estimate(gold, "conductor"),
    }
    found = seconds(
        {f"scipy {n}": job for n, job in theirs.items()} | {f"ours {n}": job for n, job in ours.items()}
    )
    for name, peer, pixels, least in (
        ("eta", "curve_fit", glass.values.shape[1], CURVE_FIT),
        ("eta and k", "least_squares", gold.values.shape[1], LEAST_SQUARES),
    ):
        ratio = (found[f"scipy {name}"] / PEERS) / (found[f"ours {name}"] / pixels)
        yield Figure.judged(
            f"{name} a pixel, times faster than scipy {peer}",
            f"{ratio:,.0f} ({1e3 * found[f'scipy {name}'] / PEERS:.2f} ms against {1e9 * found[f'ours {name}'] / pixels:.1f} ns)",
            f"{least:,.0f} at least",
            ratio >= least,
        )
    mine, their = estimate(gold, "conductor"), theirs["eta and k"]()
    assert mine.k is not None
    apart = np.abs(np.stack([mine.eta, mine.k], axis=1)[:PEERS] - their)
    sigma = np.stack([mine.eta_sigma, mine.k_sigma], axis=1)[:PEERS]
    same = int(np.all(apart < 0.01 * sigma, axis=1).sum())
    yield Figure.reported("pixels of gold where scipy comes to our eta and k", f"{same} of {PEERS}")


def _growth() -> Iterator[Figure | Table]:
    """All sizes in every round, so that what else the machine does falls on all alike."""
    sizes = [1 << e for e in range(int(math.log2(MOST)) + 1)]
    whole = scene(GLASS, GLASS_ANGLE, MOST * MEGA)
    parts = {size: _first(whole, size * MEGA) for size in sizes}
    found = seconds({str(size): partial(estimate, part, "dielectric") for size, part in parts.items()})
    costs = {size: found[str(size)] / (size * MEGA) for size in sizes}
    known = np.mean(estimate(parts[1], "dielectric").status == Status.IDENTIFIED)
    assert known > 0.99, known
    spread = max(costs.values()) / min(costs.values()) - 1
    yield Figure.judged(
        f"cost a pixel from 1 to {sizes[-1]} megapixels, largest over smallest",
        f"+{100 * spread:.0f} %",
        f"+{100 * GROWTH:.0f} % at most",
        spread <= GROWTH,
    )
    yield Table(
        "Dielectric map in memory",
        ("megapixels", "ns a pixel"),
        tuple((str(size), f"{1e9 * cost:.2f}") for size, cost in costs.items()),
    )
