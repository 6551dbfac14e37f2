"""From photons to intervals: what the synthetic camera writes, and what the fit makes of it."""

from __future__ import annotations

import multiprocessing
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import get_args

import numpy as np
import rawpy
import tifffile
from card import Figure
from decoding_here import decode_here
from numpy.typing import NDArray
from scipy.stats import binom

from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.rig import Setting
from reflectance_fit.data_synthetic.sensor import Pattern
from reflectance_fit.data_synthetic.spec import CaptureSpec, Shape, standard_spec
from reflectance_fit.inference import posterior
from reflectance_fit.inference.run import fit_channel
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.measured import Measurement
from reflectance_fit.observations import Flag
from reflectance_fit.physics.brewster import brewster_angle

FloatArray = NDArray[np.float64]

PROCESSES = 2
FIT_SENSOR, FLAT_SENSOR = (400, 300), (100, 76)  # pixels, width and height
# Sampling for a 95 % interval over many fits, not for one that is published alone.
MIN_ESS, BLOCK, WALKERS = 1000.0, 75, 32
# Repeats of (flat, sphere) captures: with them a variance is known to 2 % or better.
REPEATS = {"flat": 20, "sphere": 30}
SHAPES: tuple[Shape, ...] = ("flat", "sphere")
QUANTITIES = ("eta", "k", "brewster_deg")
CHANNEL = "G"
LEVEL, BAND = 0.95, 0.99
MOST_BIAS = 0.3  # of sigma
MOST_ETA_ERROR = 0.003


@dataclass(frozen=True, slots=True)
class Family:
    """A kind of sample: the built-in material whose light and angles it gets, and how it is fitted."""

    name: str
    material: str
    model: str
    index: tuple[float, float] | None = None

    def spec(self, shape: Shape, seed: int) -> CaptureSpec:
        spec = standard_spec(self.material, shape=shape, seed=seed)
        return replace(_sized(spec, FIT_SENSOR), index=self.index)


FAMILIES = (
    Family("N-BK7", "N-BK7", "dielectric"),
    Family("1.5 + 0.3i", "Au", "conductor", (1.5, 0.3)),
    Family("Au", "Au", "conductor"),
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """One fit: by quantity (error in sigma, whether the 95 % interval has the truth), where identified."""

    converged: bool
    eta_error: float
    found: dict[str, tuple[float, bool]]


def about(*, full: bool) -> str:
    width, height = FIT_SENSOR
    return (
        f"Residuals: {REPEATS['flat']} captures of a flat sample (120 frames, pixels all alike, no flat frame) and "
        f"{REPEATS['sphere']} of a sphere (standard camera), seeds from 0, N-BK7, every row of every channel. "
        f"Fits: {_seeds(full)} captures of each kind, seeds 0 to {_seeds(full) - 1}, {width} x {height} pixels, "
        f"channel {CHANNEL}, model given, effective sample size of at least {MIN_ESS:.0f}. "
        "Photographs are decoded as always but in the process that fits."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    yield from _round_trips()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(PROCESSES, context, _start) as pool:
        yield from _repeats(pool)
        yield from _recovery(pool, _seeds(full))


def _seeds(full: bool) -> int:
    return 600 if full else 60


def _start() -> None:
    posterior.MIN_ESS, posterior.BLOCK, posterior.WALKERS = MIN_ESS, BLOCK, WALKERS
    decode_here()


def _round_trips() -> Iterator[Figure]:
    """Files whose every pixel comes back, by two readers that share no code."""
    exact = {"rawpy": 0, "tifffile": 0}
    patterns, depths = get_args(Pattern), (12, 14, 16)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.dng"
        for pattern in patterns:
            for bits in depths:
                cfa = np.random.default_rng(bits).integers(0, 2**bits, (130, 202), dtype=np.uint16)
                black = (60, 61, 62, 63)
                write_dng(path, cfa, DngMetadata(pattern, bits, black, 2**bits - 1, Fraction(1, 60), 100))
                with rawpy.imread(str(path)) as raw:
                    exact["rawpy"] += np.array_equal(raw.raw_image_visible, cfa)
                exact["tifffile"] += np.array_equal(tifffile.imread(path), cfa)
    files = len(patterns) * len(depths)
    for reader, count in exact.items():
        yield Figure.judged(
            f"DNG files read bit for bit by {reader}", f"{count} of {files}", "all", count == files
        )


def _repeats(pool: ProcessPoolExecutor) -> Iterator[Figure]:
    """(signal - expectation) / sigma over repeats: 1 where sigma is what repeats scatter by."""
    for shape, repeats in REPEATS.items():
        expected = pool.submit(_signals, _repeat_spec(shape, seed=0, noise=False)).result()[0]
        noisy = pool.map(_signals, [_repeat_spec(shape, seed, noise=True) for seed in range(repeats)])
        z = np.concatenate([(value - expected) / sigma for value, sigma in noisy])
        z = z[np.isfinite(z)]
        variance = float(np.mean(z**2))
        error = variance * np.sqrt(2 / len(z))
        yield Figure.judged(
            f"variance of repeated signals over sigma^2, {shape}",
            f"{variance:.3f} +- {error:.3f}, mean {np.mean(z):+.3f}, N = {len(z)}",
            "1 +- 0.05",
            abs(variance - 1) <= 0.05,
        )


def _repeat_spec(shape: str, seed: int, *, noise: bool) -> CaptureSpec:
    """Of a flat sample with fixed patterns left out: all of a row's pixels share them, so they go into its gain."""
    if shape == "flat":
        spec = CaptureSpec(
            "N-BK7",
            angles_deg=tuple(np.linspace(30.0, 68.0, 20).tolist()),
            settings=tuple(Setting(angle) for angle in (0.0, 30.0, 60.0, 90.0, 120.0, 150.0)),
            flats=0,
        )
        spec = _sized(spec, FLAT_SENSOR)
    else:
        spec = _sized(standard_spec("N-BK7", shape="sphere"), FIT_SENSOR)
    if shape == "flat" or not noise:
        spec = replace(spec, sensor=replace(spec.sensor, prnu=0.0, dsnu_dn=0.0))
    if not noise:
        # A dark of equal pixels would be rounded as a whole; without background there is nothing to round.
        spec = replace(spec, sensor=replace(spec.sensor, background_e_per_s=0.0))
    return replace(spec, seed=seed, noise=noise)


def _sized(spec: CaptureSpec, size: tuple[int, int]) -> CaptureSpec:
    return replace(spec, sensor=replace(spec.sensor, width=size[0], height=size[1]))


def _measured(spec: CaptureSpec) -> Measurement:
    with tempfile.TemporaryDirectory() as folder:
        return ingest(read_capture(write_capture(Path(folder) / "capture", spec))).measurement


def _signals(spec: CaptureSpec) -> tuple[FloatArray, FloatArray]:
    """Every row's value and sigma, NaN where it is not used."""
    rows = _measured(spec).observations
    return np.where(rows.flag == Flag.USED, rows.value, np.nan), rows.sigma


def _recovery(pool: ProcessPoolExecutor, seeds: int) -> Iterator[Figure]:
    """Errors and intervals of whole fits, frames to eta, k and Brewster's angle."""
    kinds = [(family, shape) for family in FAMILIES for shape in SHAPES]
    jobs = {kind: [pool.submit(_fit, *kind, seed) for seed in range(seeds)] for kind in kinds}
    converged = 0
    for (family, shape), fits in jobs.items():
        outcomes = [fit.result() for fit in fits]
        converged += sum(outcome.converged for outcome in outcomes)
        yield from _judged(f"{family.name} {shape}", outcomes, fixed_k=family.model == "dielectric")
    total = seeds * len(kinds)
    yield Figure.judged("fits that converged", f"{converged} of {total}", "all", converged == total)


def _fit(family: Family, shape: Shape, seed: int) -> Outcome:
    spec = family.spec(shape, seed)
    measurement = _measured(spec)
    fit = fit_channel(
        CHANNEL,
        dict(measurement.observations.channels())[CHANNEL],
        exterior_ior=measurement.exterior_ior,
        priors=measurement.priors,
        nuisances=measurement.nuisances or {},
        known=measurement.known(CHANNEL),
        model=family.model,
        seed=(seed,),
    )
    (channel,) = [one for one in spec.channels if one.name == CHANNEL]
    eta, k = spec.index_of(channel)
    angle = float(np.degrees(brewster_angle(eta / AIR_INDEX, k / AIR_INDEX)))
    found = {}
    for name, truth in zip(QUANTITIES, (eta, k, angle), strict=True):
        interval = fit.intervals[name]
        if interval.median is not None and interval.sd and interval.ci95 is not None:
            low, high = interval.ci95
            found[name] = (interval.median - truth) / interval.sd, low <= truth <= high
    return Outcome(fit.posterior.converged, float(np.median(fit.posterior.flat("eta"))) - eta, found)


def _judged(kind: str, outcomes: list[Outcome], *, fixed_k: bool) -> Iterator[Figure]:
    by_quantity: dict[str, list[tuple[float, bool]]] = defaultdict(list)
    for outcome in outcomes:
        for name, pair in outcome.found.items():
            by_quantity[name].append(pair)
    for name in QUANTITIES:
        pairs = by_quantity[name]
        coverage, bias = f"{kind}: 95 % intervals of {name} with the truth", f"{kind}: mean error of {name}"
        if not pairs:
            why = "the model fixes k at 0" if fixed_k and name == "k" else "identified in no fit"
            yield Figure.not_run(coverage, f"in the {BAND:.0%} band", why)
            yield Figure.not_run(bias, f"within {MOST_BIAS} sigma", why)
            continue
        n, hits = len(pairs), sum(hit for _, hit in pairs)
        low, high = (int(edge) for edge in binom.interval(BAND, n, LEVEL))
        yield Figure.judged(coverage, f"{hits} of {n}", f"{low} to {high}", low <= hits <= high)
        z = np.array([error for error, _ in pairs])
        yield Figure.judged(
            bias,
            f"{z.mean():+.2f} sigma (scatter {z.std(ddof=1):.2f} sigma, N = {n})",
            f"within {MOST_BIAS} sigma",
            bool(abs(z.mean()) < MOST_BIAS),
        )
    if fixed_k:
        largest = max(abs(outcome.eta_error) for outcome in outcomes)
        yield Figure.judged(
            f"{kind}: largest error of eta",
            f"{largest:.2g} in {len(outcomes)} fits",
            f"{MOST_ETA_ERROR} at most",
            largest <= MOST_ETA_ERROR,
        )
