"""Which model is chosen, and what the fit says where the data cannot know."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from unittest import mock

import numpy as np
from card import Figure, Table
from inference_captures import (
    DEFAULT_PRIORS,
    EXTERIOR,
    FOUR_ANALYZERS,
    LINEAR_45,
    S_AND_P,
    SEED,
    Design,
    Reading,
    brewster_deg,
    photographed,
    reflected,
)
from scipy.stats import beta

from reflectance_fit.inference import posterior
from reflectance_fit.inference.run import fit_channel
from reflectance_fit.materials import library

WAVELENGTH_NM = 550.0
NOISE = 0.002  # of what a mirror would send back
BLIND_NOISE = 0.01  # of the signal
# Statuses hang on quantiles to a few per cent.  On the thin ridge that a metal's one reflectance leaves, emcee does
# not converge in any time; what it has seen by then must be enough not to claim an answer.
LEAST_ESS, MOST_STEPS = 1000.0, 1000
LEAST_DIELECTRIC, LEAST_METAL, MOST_FALSE = 0.95, 0.99, 0.01
NO_ANSWER = ("not_identified", "multimodal")
GLASSES, METALS = ("N-BK7", "N-SF11", "PMMA"), ("Au", "Al", "Cr")

# Where k of these metals is known to a few per cent, in as many rows as a session of photographs gives.
# Of n rows BIC fits k to a dielectric where chi2_1 > ln n, on one side of 0: 2.9 % of the time at 36 rows, 5.8 % at 12.
GOOD = {
    "s and p": Design(tuple(np.linspace(20.0, 84.0, 18).tolist()), S_AND_P, sigma=NOISE),
    "4 analyzers, lamp at 45 deg": Design(
        tuple(np.linspace(30.0, 84.0, 9).tolist()), FOUR_ANALYZERS, LINEAR_45, sigma=NOISE
    ),
}
ONE_ANGLE = Design((45.0,), (Reading("reflectance"),), gain="")
STEEP = Design((10.0, 20.0, 30.0, 40.0), S_AND_P)
MINIMUM_DEG = (-1.0, -0.5, 0.0, 0.5, 1.0)  # from it

ONE, MINIMUM, METAL_STEEP = "one angle, unpolarized", "p near its minimum only", "metal at 10 to 40 deg"
BLIND = (ONE, MINIMUM, METAL_STEEP)
# The same rows, in which a glass is known: what flags the metals must not flag it.
GLASS_STEEP = "glass at 10 to 40 deg"
DIELECTRIC, METAL = "dielectric", "metal"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a fit that was left to choose says of one capture."""

    material: str
    k_free: bool
    eta: str
    k: str
    method: str

    @property
    def flagged(self) -> bool:
        """An upper limit of k is an answer."""
        return self.eta in NO_ANSWER or self.k in NO_ANSWER


def verdict(kind: str, number: int) -> Verdict:
    """The fit of capture ``number`` of a kind: BLIND, DIELECTRIC, METAL or GLASS_STEEP."""
    glass = kind in (DIELECTRIC, GLASS_STEEP) or (kind == ONE and number % 2 == 0)
    names = GLASSES if glass else METALS
    material = names[number // 2 % len(names)]
    eta, k = (float(x) for x in library.get(material).absolute_index(WAVELENGTH_NM))
    truth = {"eta": eta, "k": 0.0 if glass else k}
    o = photographed(_design(kind, number, truth).rows(), truth, 1.0, np.random.default_rng((SEED, number)))
    with mock.patch.multiple(posterior, MIN_ESS=LEAST_ESS, MAX_STEPS=MOST_STEPS):
        fit = fit_channel(
            "G",
            o,
            exterior_ior=EXTERIOR,
            priors=DEFAULT_PRIORS,
            nuisances={},
            method="importance",
            seed=(SEED, number),
        )
    statuses = (fit.intervals[name].status for name in ("eta", "k"))
    return Verdict(material, "k" in fit.posterior.names, *statuses, fit.posterior.method)


def _design(kind: str, number: int, truth: Mapping[str, float]) -> Design:
    if kind in (DIELECTRIC, METAL):
        return list(GOOD.values())[number % len(GOOD)]
    at = float(brewster_deg(truth["eta"], truth["k"]))
    near = Design(tuple(at + x for x in MINIMUM_DEG), (Reading("signal_p"),))
    design = {ONE: ONE_ANGLE, METAL_STEEP: STEEP, GLASS_STEEP: STEEP, MINIMUM: near}[kind]
    signal = reflected(design.rows(), truth["eta"], truth["k"], {}).mean()
    return replace(design, sigma=BLIND_NOISE * float(signal))


def verdict_figures(found: Mapping[str, Sequence[Verdict]]) -> Iterator[Figure | Table]:
    chosen = found[DIELECTRIC]
    right = sum(not one.k_free for one in chosen)
    yield _share("k = 0 chosen for dielectrics", right, len(chosen), LEAST_DIELECTRIC)
    chosen = found[METAL]
    right = sum(one.k_free for one in chosen)
    yield _share("k fitted for metals whose k is identified", right, len(chosen), LEAST_METAL)
    for kind in BLIND:
        flagged = sum(one.flagged for one in found[kind])
        yield _share(f"flagged: {kind}", flagged, len(found[kind]), 1.0)
    good = [one for kind in (DIELECTRIC, METAL, GLASS_STEEP) for one in found[kind]]
    false, n = sum(one.flagged for one in good), len(good)
    yield Figure.judged(
        "flagged though identifiable",
        f"{false} of {n} (95 % upper bound {_upper(false, n):.2%})",
        f"{MOST_FALSE:.0%} at most",
        false <= MOST_FALSE * n,
    )
    rows = []
    for kind, verdicts in found.items():
        for material in dict.fromkeys(one.material for one in verdicts):
            some = [one for one in verdicts if one.material == material]
            texts = [
                ", ".join(f"{word} {count}" for word, count in _counts([getattr(one, of) for one in some]))
                for of in ("eta", "k", "method")
            ]
            rows.append((kind, material, f"{sum(one.k_free for one in some)} of {len(some)}", *texts))
    yield Table("Verdicts", ("capture", "material", "k fitted", "eta", "k", "posterior"), tuple(rows))


def _share(name: str, right: int, n: int, least: float) -> Figure:
    missed = n - right
    value = f"{right} of {n} (95 % upper bound of what was missed {_upper(missed, n):.1%})"
    return Figure.judged(
        name, value, f"{least:.0%}" if least == 1 else f"{least:.0%} at least", right >= least * n
    )


def _upper(count: int, n: int) -> float:
    """Clopper and Pearson's one-sided limit; 3 / n where nothing was seen."""
    return 1.0 if count == n else float(beta.ppf(0.95, count + 1, n - count))


def _counts(words: Sequence[str]) -> list[tuple[str, int]]:
    return [(word, words.count(word)) for word in sorted(set(words), key=lambda word: -words.count(word))]
