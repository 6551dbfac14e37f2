"""How soon a posterior is known: our rungs against emcee as one would write it in an afternoon."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from card import Figure
from numpy.typing import NDArray
from posterior_naive import Naive

from reflectance_fit.inference import ladder, models, search
from reflectance_fit.inference.rows import Rows, gain_names, pack
from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior

FloatArray = NDArray[np.float64]

THETA_DEG = np.linspace(15.0, 85.0, 36)
# Chromium-like, at three wavelengths.
INDICES = ((3.2, 4.3), (3.0, 4.2), (2.1, 3.6))
NOISE, OFFSET_SIGMA_DEG = 0.01, 0.5
SEED = 0
ESS = 1000.0
REPEATS = 5  # of what takes milliseconds, in every round
LEAST = {"emcee": 30.0, "importance": 1000.0}
SIGMAS = 4.0  # Monte Carlo standard errors within which means and sds agree


def about(*, full: bool) -> str:
    return (
        f"{len(THETA_DEG)} angles, signals along s and p with {NOISE:.0%} noise and a gain each, {len(INDICES)} channels; "
        f"free: eta, k, an angle offset ({OFFSET_SIGMA_DEG} deg), two gains. Time to an effective sample size (ESS) of "
        f"{ESS:.0f} = time x {ESS:.0f} / ESS, summed over channels, the smallest ESS of eta and k counting; medians of "
        f"{_rounds(full)} rounds in which everyone takes a turn. Naive: emcee's default stretch move, 32 walkers around "
        "the optimum, a likelihood of numpy for one vector at a time, gains sampled. Ours: from packed data; with "
        "search: the optimum included. ESS by arviz-stats for chains, by weights for importance sampling."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    channels = [_channel(number) for number in range(len(INDICES))]
    seconds: dict[str, list[float]] = {name: [] for name in ("naive", "search", *LEAST)}
    worst_mean = worst_sd = 0.0
    for turn in range(_rounds(full) + 1):
        runs = {name: [_run(name, channel, turn, full) for channel in channels] for name in ("naive", *LEAST)}
        found = {name: sum(run.seconds for run in of) for name, of in runs.items()}
        found["search"] = sum(_median_time(channel.search) for channel in channels)
        if not turn:  # the first compiles
            continue
        for name, value in found.items():
            seconds[name].append(value)
        for name in LEAST:
            for ours, theirs in zip(runs[name], runs["naive"], strict=True):
                mean, sd = _disagreement(ours.draws, theirs.draws)
                worst_mean, worst_sd = max(worst_mean, mean), max(worst_sd, sd)
    median = {name: statistics.median(values) for name, values in seconds.items()}
    yield Figure.reported("time to ESS 1000, naive emcee", _ms(median["naive"]))
    yield Figure.reported("search for the optimum, three channels", _ms(median["search"]))
    for name, least in LEAST.items():
        own, both = median[name], median[name] + median["search"]
        yield Figure.reported(
            f"naive over {name} rung, from the optimum", f"{median['naive'] / own:.0f} times ({_ms(own)})"
        )
        ratio = median["naive"] / both
        value = f"{ratio:.0f} times ({_ms(median['naive'])} over {_ms(both)})"
        yield Figure.judged(
            f"naive over {name} rung, with search", value, f"{least:.0f} at least", ratio >= least
        )
    for what, worst in (("means", worst_mean), ("sds", worst_sd)):
        name = f"{what} of eta and k, worst difference from naive, in Monte Carlo standard errors"
        yield Figure.judged(name, f"{worst:.2f}", f"{SIGMAS:.0f} at most", worst <= SIGMAS)


def _rounds(full: bool) -> int:
    return 9 if full else 3


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.3g} ms"


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel's data, packed, and where a search ends."""

    observations: Observations
    rows: Rows
    model: models.Model
    basins: list[search.optimize.Basin]
    best: dict[str, float]
    gains: list[float]

    def search(self) -> object:
        return search.find(self.model, self.rows, gain_names(self.observations))


class Draws(NamedTuple):
    """Draws of eta and k, each of shape (N,), and the effective sizes of their means and sds."""

    values: dict[str, FloatArray]
    ess: dict[str, float]
    ess_sd: dict[str, float]


class Run(NamedTuple):
    seconds: float  # to ESS 1000
    draws: Draws


def _channel(number: int) -> Channel:
    eta, k = INDICES[number]
    generator = np.random.default_rng((SEED, number))
    n = len(THETA_DEG)
    powers = reflectances(np.cos(np.radians(THETA_DEG)), eta, k)
    truth = np.concatenate([0.8 * powers.s, 0.9 * powers.p])
    sigma = NOISE * truth
    quantity = np.repeat([str(Quantity.SIGNAL_S), str(Quantity.SIGNAL_P)], n)
    nan, zero = np.full(2 * n, np.nan), np.zeros(2 * n)
    observations = Observations(
        channel=np.full(2 * n, str(number)),
        wavelength_nm=np.full(2 * n, 550.0),
        set=np.full(2 * n, "0"),
        gain_group=quantity,
        theta_deg=np.tile(THETA_DEG, 2),
        theta_deg_sigma=zero,
        analyzer_deg=nan,
        retarder_deg=nan,
        retardance_deg=nan,
        theta_deg_spread=zero,
        diattenuation=np.ones(2 * n),
        light=np.tile([1.0, 0.0, 0.0, 0.0], (2 * n, 1)),
        quantity=quantity,
        value=truth + sigma * generator.standard_normal(2 * n),
        sigma=sigma,
        pixels=np.ones(2 * n, dtype=np.int64),
        flag=np.full(2 * n, "used"),
    )
    rows = pack(observations, 1.0)
    priors = {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}
    model = models.build("conductor", rows, priors, {"angle_offset_deg": OFFSET_SIGMA_DEG}, [])
    optimum, basins = search.find(model, rows, gain_names(observations))
    gains = [optimum.gains[name] for name in (str(Quantity.SIGNAL_S), str(Quantity.SIGNAL_P))]
    return Channel(observations, rows, model, basins, optimum.parameters, gains)


def _run(name: str, channel: Channel, turn: int, full: bool) -> Run:
    if name == "naive":
        return _naive(channel, turn, full)
    method: ladder.Method = "emcee" if name == "emcee" else "importance"

    def job() -> object:
        return ladder.draw(channel.model, channel.rows, channel.basins, method, (turn,), min_ess=ESS)

    drawn = ladder.draw(channel.model, channel.rows, channel.basins, method, (turn,), min_ess=ESS)
    assert drawn.method == method
    seconds = _median_time(job, 1 if method == "emcee" else REPEATS)
    least = min(drawn.ess["eta"], drawn.ess["k"])
    values = {n: drawn.flat(n) for n in ("eta", "k")}
    return Run(seconds * ESS / least, Draws(values, drawn.ess, drawn.ess))


def _naive(channel: Channel, turn: int, full: bool) -> Run:
    from arviz_stats.base import array_stats

    o, n = channel.observations, len(THETA_DEG)
    problem = Naive(THETA_DEG, o.value[:n], o.value[n:], o.sigma[:n], o.sigma[n:], OFFSET_SIGMA_DEG)
    best = [channel.best["eta"], channel.best["k"], channel.best["angle_offset_deg"], *channel.gains]
    started = time.perf_counter()
    chain = problem.sample(np.array(best), steps=6000 if full else 2500, seed=turn)
    seconds = time.perf_counter() - started
    values, ess, ess_sd = {}, {}, {}
    for j, name in enumerate(("eta", "k")):
        values[name] = chain[..., j].ravel()
        ess[name] = float(array_stats.ess(chain[..., j], chain_axis=1, draw_axis=0))
        ess_sd[name] = float(array_stats.ess(chain[..., j], chain_axis=1, draw_axis=0, method="sd"))
    return Run(seconds * ESS / min(ess.values()), Draws(values, ess, ess_sd))


def _median_time(job: Callable[[], object], repeats: int = REPEATS) -> float:
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        job()
        seconds.append(time.perf_counter() - started)
    return statistics.median(seconds)


def _disagreement(a: Draws, b: Draws) -> tuple[float, float]:
    """The largest difference of a mean and of a log sd, each in its Monte Carlo standard error."""
    means, sds = [], []
    for name in ("eta", "k"):
        sd = b.values[name].std()
        error = math.sqrt(1 / a.ess[name] + 1 / b.ess[name])
        means.append(abs(a.values[name].mean() - b.values[name].mean()) / (sd * error))
        # Of a normal law's log sd: 1 / sqrt(2 N).
        error = math.sqrt(0.5 / a.ess_sd[name] + 0.5 / b.ess_sd[name])
        sds.append(abs(math.log(a.values[name].std() / sd)) / error)
    return max(means), max(sds)
