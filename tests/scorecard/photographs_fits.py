"""From photographs of a board to the index of N-BK7: errors, and whether intervals hold the truth."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from card import Figure
from photographs_scenes import BOARD, MIN_ESS, answers, board_spec, ingested
from scipy.stats import binom

from reflectance_fit.data_synthetic.rig import MONO_CHANNELS
from reflectance_fit.data_synthetic.spec import standard_spec
from reflectance_fit.inference.run import fit_channel
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.brewster import brewster_angle

CHANNEL = MONO_CHANNELS[0].name
LEVEL, BAND = 0.95, 0.99
MOST_ERROR = 0.003
_GEOMETRY_VIEWS = 6
QUANTITIES = ("eta", "brewster_deg")


class Outcome(NamedTuple):
    """One fit: error of eta, its error in sigma, by quantity whether the 95 % interval has the truth, frames lost."""

    error: float
    z: float
    hits: tuple[bool, ...]
    rejected: int


def about(*, full: bool) -> str:
    return (
        f"Fits: {_seeds(full)} captures of a board, seeds 0 to {_seeds(full) - 1}, tilts of 30 to 65 deg and four analyzer "
        "angles, prints out of scale by 0.05 % (1 sd) in x and y, an analyzer off by 0.3 deg (1 sd), lens from "
        f"{_GEOMETRY_VIEWS} views of the board; "
        f"a sensor without colour filters at {CHANNEL} nm, model given, effective sample size of at least {MIN_ESS:.0f}."
    )


def _seeds(full: bool) -> int:
    return 200 if full else 60


def figures(pool: ProcessPoolExecutor, *, full: bool) -> Iterator[Figure]:
    """The largest error, and coverage."""
    jobs = [pool.submit(fitted, seed) for seed in range(_seeds(full))]

    def of_fits(found: list[Outcome]) -> Iterator[Figure]:
        errors, z = np.array([one.error for one in found]), np.array([one.z for one in found])
        worst = float(np.abs(errors).max())
        yield Figure.judged(
            "N-BK7 on a board: largest error of eta",
            f"{worst:.2g} (rms {np.sqrt(np.mean(errors**2)):.2g}, N = {len(errors)})",
            f"{MOST_ERROR} at most",
            worst <= MOST_ERROR,
        )
        low, high = (int(edge) for edge in binom.interval(BAND, len(found), LEVEL))
        for i, name in enumerate(QUANTITIES):
            hits = sum(one.hits[i] for one in found)
            yield Figure.judged(
                f"N-BK7 on a board: 95 % intervals of {name} with the truth",
                f"{hits} of {len(found)}",
                f"{low} to {high}",
                low <= hits <= high,
            )
        value = f"{z.mean():+.2f} sigma (scatter {z.std(ddof=1):.2f} sigma)"
        yield Figure.reported("N-BK7 on a board: mean error of eta", value)
        lost = sum(one.rejected for one in found)
        yield Figure.reported("N-BK7 on a board: frames rejected because the board is not found", str(lost))

    yield from answers("N-BK7 on a board", f"{MOST_ERROR} at most, coverage in the band", jobs, of_fits)


def fitted(seed: int) -> Outcome:
    standard = standard_spec("N-BK7", shape="board", seed=seed)
    board = replace(BOARD, print_scale=standard.board.print_scale)
    spec = board_spec(seed, board=board, geometry_views=_GEOMETRY_VIEWS, channels=MONO_CHANNELS)
    spec = replace(spec, sensor=replace(spec.sensor, pattern="MONO"))
    found, _ = ingested(spec, all_used=False)
    measurement = found.measurement
    fit = fit_channel(
        CHANNEL,
        dict(measurement.observations.channels())[CHANNEL],
        exterior_ior=measurement.exterior_ior,
        priors=measurement.priors,
        nuisances=measurement.nuisances or {},
        known=measurement.known(CHANNEL),
        model="dielectric",
        seed=(seed,),
    )
    eta, k = spec.index_of(spec.channel_of(CHANNEL))
    truth = eta, float(np.degrees(brewster_angle(eta / AIR_INDEX, k / AIR_INDEX)))
    hits = []
    for name, true in zip(QUANTITIES, truth, strict=True):
        low, high = fit.intervals[name].ci95 or (np.inf, -np.inf)
        hits.append(bool(low <= true <= high))
    draws = fit.posterior.flat("eta")
    error = float(np.median(draws)) - eta
    return Outcome(error, error / float(np.std(draws)), tuple(hits), len(found.rejected))
