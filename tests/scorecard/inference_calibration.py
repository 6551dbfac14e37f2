"""Simulation-based calibration: truths from the prior, and where they lie in their posteriors.

Talts et al., arXiv 1804.06788.  Beside eta, k and Brewster's angle the log-likelihood is
ranked, which depends on the data too (Modrak et al., Bayesian Anal. (2023), 10.1214/23-BA1404):
a posterior that is wrong in spread moves all coordinates' share of it the same way.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from card import Figure, Table
from inference_captures import (
    SEED,
    FloatArray,
    brewster_deg,
    photographed,
    searched,
)
from inference_families import FAMILIES, Family
from inference_ranks import BAND, DRAWS, EFFECTS, p_value, power, rank, sidak
from scipy.stats import binom

from reflectance_fit.inference import ladder
from reflectance_fit.inference.forward import predict_vectors
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.rows import Rows
from reflectance_fit.observations import Observations

Method = Literal["importance", "emcee"]

LEVELS = (0.5, 0.8, 0.95)
# 99 draws of so many effective ones repeat each other in 5 % of all ranks at most, by one place.
MIN_ESS = 2000.0
EMCEE_ESS = 1000.0


@dataclass(frozen=True, slots=True)
class Trial:
    """One truth in its posterior: a rank of each quantity, and the intervals by level that have it."""

    ranks: Mapping[str, int]
    covered: Mapping[tuple[str, float], bool]
    method: str
    converged: bool


Capture = Callable[[Observations, Mapping[str, float], float, np.random.Generator], Observations]


def trial(
    family: Family, method: Method, number: int, capture: Capture = photographed, truths: Family | None = None
) -> Trial:
    """Draw a truth (of ``truths``, where it is not the family's own), ``capture`` it, fit it and rank it."""
    generator = np.random.default_rng((SEED, number))
    truth, gain = (truths or family).truth(generator)
    o = capture(family.design.rows(), truth, gain, generator)
    model, rows, _, basins = searched(family.model, o, family.priors, family.nuisances)
    ess = MIN_ESS if method == "importance" else EMCEE_ESS
    posterior = ladder.draw(model, rows, basins, method, (SEED, number), min_ess=ess)
    return judged(
        family, posterior.samples, truth, model, rows, generator, posterior.method, posterior.converged
    )


def judged(
    family: Family,
    samples: Mapping[str, FloatArray],
    truth: Mapping[str, float],
    model: Model,
    rows: Rows,
    generator: np.random.Generator,
    method: str,
    converged: bool,
) -> Trial:
    """``truth`` ranked among ``samples``; the ranks from DRAWS of them, the intervals from all."""
    draws = {name: values.ravel() for name, values in samples.items()}
    draws["brewster_deg"] = brewster_deg(draws["eta"], draws["k"])
    true = {**truth, "brewster_deg": float(brewster_deg(truth["eta"], truth["k"]))}
    some = generator.choice(len(draws["eta"]), DRAWS, replace=False)
    picked = {name: values[some] for name, values in draws.items()}
    x = np.column_stack(
        [
            prior.to_coordinate(np.append(picked[name], truth[name]))
            for name, prior in zip(model.names, model.priors, strict=True)
        ]
    )
    likelihood = log_likelihood(rows, model.full(x))
    picked["log-likelihood"], true["log-likelihood"] = likelihood[:-1], float(likelihood[-1])
    ranks = {name: rank(true[name], picked[name], generator) for name in family.quantities}
    covered = {}
    for name in family.quantities:
        if name == "log-likelihood":
            continue
        for level in LEVELS:
            low, high = np.quantile(draws[name], [0.5 - level / 2, 0.5 + level / 2])
            covered[name, level] = bool(low <= true[name] <= high)
    return Trial(ranks, covered, method, converged)


def log_likelihood(rows: Rows, vectors: FloatArray) -> FloatArray:
    """-chi2 / 2 of full parameter vectors, shape (D,), at their best gain of all rows, angles taken as exact.

    Any function of parameters and data serves a calibration; this one needs the fit's model only.
    """
    background = predict_vectors(rows, vectors, np.zeros(rows.gains))
    at_one = predict_vectors(rows, vectors, np.ones(rows.gains)) - background
    weight, target = rows.sigma**-2, rows.value - background
    gain = (weight * at_one * target).sum(axis=1) / (weight * at_one**2).sum(axis=1)
    return np.asarray(-0.5 * (weight * (target - gain[:, None] * at_one) ** 2).sum(axis=1))


def calibration_figures(
    kind: str, found: Mapping[str, Sequence[Trial]], families: Sequence[Family]
) -> Iterator[Figure | Table]:
    """Ranks, what their bands can see, and coverage, of the same fits."""
    yield from rank_figures(kind, found, families)
    yield from detectable(kind, min(map(len, found.values())), families)
    yield from coverage_figures(kind, found, families)
    converged = sum(one.converged for trials in found.values() for one in trials)
    total = sum(map(len, found.values()))
    yield Figure.judged(
        f"posteriors that converged, {kind}", f"{converged} of {total}", "all", converged == total
    )


def rank_figures(
    kind: str, found: Mapping[str, Sequence[Trial]], families: Sequence[Family]
) -> Iterator[Figure]:
    """A line a family: the quantity that is furthest from uniform, in bands that hold together."""
    level = sidak(sum(len(family.quantities) for family in families))
    for family in families:
        trials = found[family.name]
        p = p_values(family, trials)
        worst = min(p, key=lambda name: p[name])
        others = Counter(one.method for one in trials if one.method != kind)
        handed = "".join(f", {count} by {name}" for name, count in others.items())
        yield Figure.judged(
            f"ranks of {', '.join(family.quantities)}: {family.name}, {kind}",
            f"furthest: {worst}, p = {p[worst]:.2g}, N = {len(trials)}{handed}",
            f"p of each at least {1 - level:.2g}",
            p[worst] >= 1 - level,
        )


def p_values(family: Family, trials: Sequence[Trial]) -> dict[str, float]:
    return {name: p_value(np.array([one.ranks[name] for one in trials])) for name in family.quantities}


def coverage_figures(
    kind: str, found: Mapping[str, Sequence[Trial]], families: Sequence[Family]
) -> Iterator[Figure | Table]:
    """A line a level, over all families and quantities, and a table of each."""
    cells = [
        (family.name, name, level)
        for family in families
        for name in family.quantities
        if name != "log-likelihood"
        for level in LEVELS
    ]
    band = sidak(len(cells))
    hits = {(f, q, level): sum(one.covered[q, level] for one in found[f]) for f, q, level in cells}
    for level in LEVELS:
        outside, worst, extreme = [], "", 0.0
        for f, q, at in cells:
            n = len(found[f])
            low, high = binom.interval(band, n, level)
            if at != level:
                continue
            if not low <= hits[f, q, at] <= high:
                outside.append(f"{q} of {f}")
            z = abs(hits[f, q, at] / n - level) / math.sqrt(level * (1 - level) / n)
            if z >= extreme:
                worst, extreme = f"{q} of {f} {hits[f, q, at] / n:.1%}", z
        n = min(len(found[family.name]) for family in families)
        low, high = (edge / n for edge in binom.interval(band, n, level))
        yield Figure.judged(
            f"{level:.0%} intervals that have the truth, {kind}",
            f"furthest: {worst}, N = {n}" + (f"; outside: {', '.join(outside)}" if outside else ""),
            f"each {low:.1%} to {high:.1%}",
            not outside,
        )
    rows = tuple(
        (f, q, *(f"{hits[f, q, level] / len(found[f]):.1%}" for level in LEVELS))
        for f, q in dict.fromkeys((f, q) for f, q, _ in cells)
    )
    yield Table(
        f"Coverage of central intervals, {kind}", ("family", "quantity", *(f"{x:.0%}" for x in LEVELS)), rows
    )


def detectable(kind: str, n: int, families: Sequence[Family]) -> Iterator[Figure | Table]:
    """What the bands of ``rank_figures`` would catch, by simulation."""
    tests = sum(len(family.quantities) for family in families)
    rows = []
    for count in sorted({n, 1000, 3000}):
        for name, level in ((f"one of {tests}", sidak(tests)), ("alone", BAND)):
            found = power(count, level)
            rows.append((f"{count}", name, *(f"{found[effect.name]:.2f}" for effect in EFFECTS)))
    yield Table(
        f"Probability that a band of ranks catches a wrong posterior, {kind}",
        ("N", "band", *(effect.name for effect in EFFECTS)),
        tuple(rows),
    )
    found = power(n, sidak(tests))
    values = ", ".join(f"{effect.name} {found[effect.name]:.2f}" for effect in EFFECTS)
    yield Figure.reported(f"probability that a band catches a posterior that is, {kind}, N = {n}", values)


def caught(family: Family, trials: Sequence[Trial], families: Sequence[Family] = FAMILIES) -> str:
    """What of these trials is furthest outside of the card's bands; empty where nothing is."""
    level = sidak(sum(len(one.quantities) for one in families))
    p = p_values(family, trials)
    worst = min(p, key=lambda name: p[name])
    return f"ranks of {worst}, p = {p[worst]:.0e}" if p[worst] < 1 - level else ""
