"""Which model the rows need: is k above 0, which nuisances, which noise.

Candidates are compared by BIC = -2 log L + p log n.  Three kinds of question
have a threshold of their own, so that chance alone is rarely believed:

* k > 0 is one-sided: at the bound its likelihood ratio is 0 in half of all
  cases and chi-squared with one degree of freedom in the other half (Self and
  Liang 1987).  With few rows log n lies below the 5 % point, 2.71, which is
  then what the ratio must exceed.
* A nuisance is only added where nothing is stated about nuisances.  The BIC
  must fall by 6, and the ratio to the same model without it must exceed what
  chance gives one of all the nuisances on offer in 1 % of cases.  Where the
  best model fits badly, sigmas may be too small as well: ratios are first
  divided by its reduced chi2.
* Heavy-tailed noise has as many parameters as normal noise.  The BIC must fall
  by 10, and what is left must look like a few scattered outliers in rows that
  fit, not like a wrong model.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from reflectance_fit.inference import models, search
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.optimize import Basin
from reflectance_fit.inference.rows import Rows
from reflectance_fit.priors import Prior
from reflectance_fit.result import Optimum

K_CHANCE = 0.05  # of k > 0 where there is none
NUISANCE_CHANCE = 0.01  # of any nuisance where there is none
NUISANCE_MARGIN = 6.0  # by which the BIC must fall

# The azimuth of a source that is not polarized means nothing, so it comes with its degree only.
_PARTNERS = {"source_azimuth_deg": "source_dolp"}


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """A candidate at its optimum; ``nuisances`` and ``rows`` are those it was fitted with."""

    model: Model
    nuisances: tuple[str, ...]
    rows: Rows
    optimum: Optimum
    basins: list[Basin]

    @property
    def parameters(self) -> int:
        return len(self.optimum.parameters) + len(self.optimum.gains)


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """``tried`` by BIC, lowest first; ``rival`` is the candidate that ``chosen`` had to beat, if any."""

    chosen: Tried
    tried: tuple[Tried, ...]
    rival: Tried | None
    reason: str


class Candidates:
    """Fits models on demand, each once; with the nuisances of ``sigmas`` (name -> sigma) that are asked for."""

    def __init__(
        self,
        rows: Rows,
        gains: list[str],
        priors: Mapping[str, Prior],
        sigmas: Mapping[str, float],
        estimated: list[str],
    ) -> None:
        self._rows, self._gains, self._priors = rows, gains, priors
        self._sigmas, self._estimated = sigmas, estimated
        self._tried: dict[tuple[str, frozenset[str]], Tried] = {}

    def __call__(self, name: str, nuisances: Iterable[str]) -> Tried:
        asked = frozenset(nuisances)
        key = (name, asked)
        if key not in self._tried:
            sigmas = {n: s for n, s in self._sigmas.items() if n in asked}
            model = models.build(name, self._rows, self._priors, sigmas, self._estimated)
            optimum, basins = search.find(model, self._rows, self._gains)
            self._tried[key] = Tried(model, tuple(sigmas), self._rows, optimum, basins)
        return self._tried[key]

    @property
    def tried(self) -> tuple[Tried, ...]:
        return tuple(sorted(self._tried.values(), key=lambda t: t.optimum.bic))


def choose(
    names: tuple[str, ...], candidates: Candidates, given: Iterable[str], offered: Iterable[str]
) -> Choice:
    """The model of ``names`` that the rows need, with the nuisances ``given`` and what they need of ``offered``."""
    chosen, reason = _simplest(names, candidates, given)
    plain, steps = chosen, []
    while step := _one_more(names, candidates, chosen, tuple(offered)):
        chosen, k_reason, why = step
        steps.append(why)
        reason = f"{'; '.join(steps)}; {k_reason}"
    if plain is not chosen:
        rival: Tried | None = plain
    else:
        rival = next((t for t in candidates.tried if t is not chosen), None)
        reason = _doubt(chosen, candidates) + reason if offered else reason
    return Choice(chosen, candidates.tried, rival, reason)


def _simplest(names: tuple[str, ...], candidates: Candidates, nuisances: Iterable[str]) -> tuple[Tried, str]:
    """Dielectric or conductor, or the only one there is."""
    if len(names) == 1:
        return candidates(names[0], nuisances), "the priors leave nothing else"
    dielectric, conductor = (candidates(name, nuisances) for name in names)
    gain = dielectric.optimum.objective - conductor.optimum.objective
    difference = conductor.optimum.bic - dielectric.optimum.bic
    if difference < 0 and gain > likely_by_chance(conductor, 2 * K_CHANCE):
        return conductor, f"k > 0 is needed: delta BIC = {-difference:.4g}"
    if difference < 0:
        return (
            dielectric,
            f"k > 0 adds no more than chance does with so few rows: delta BIC = {difference:.4g}",
        )
    return dielectric, f"k adds nothing: delta BIC = {difference:.4g}"


def likely_by_chance(larger: Tried, chance: float) -> float:
    """What a parameter without meaning takes off -2 log L with probability ``chance`` at most.

    With stated sigmas chi-squared; where sigma is estimated, the ratio of
    variances is F-distributed and -2 log L is n times its logarithm.
    """
    from scipy.stats import chi2, f

    if not np.any(larger.rows.estimated >= 0):
        return float(chi2.isf(chance, 1))
    n = len(larger.optimum.residuals)
    free = n - larger.parameters
    return n * math.log1p(f.isf(chance, 1, free) / free) if free > 0 else math.inf


def _one_more(
    names: tuple[str, ...], candidates: Candidates, chosen: Tried, offered: tuple[str, ...]
) -> tuple[Tried, str, str] | None:
    """The best model with one nuisance more than ``chosen``, where the rows need it, and why."""
    found: list[tuple[Tried, str, tuple[str, ...]]] = []
    for added in _steps(chosen.nuisances, offered):
        try:
            larger, reason = _simplest(names, candidates, (*chosen.nuisances, *added))
        except ValueError:
            continue  # no finite likelihood anywhere: not a candidate
        parent = candidates(larger.optimum.model, chosen.nuisances)
        badness = max(larger.optimum.reduced_chi2 or 1.0, 1.0)
        gain = (parent.optimum.objective - larger.optimum.objective) / badness
        lead = (chosen.optimum.objective - larger.optimum.objective) / badness
        cost = (larger.parameters - chosen.parameters) * math.log(len(larger.optimum.residuals))
        chance = NUISANCE_CHANCE / len(offered)
        if lead - cost >= NUISANCE_MARGIN and gain >= likely_by_chance(larger, chance):
            found.append((larger, reason, added))
    if not found:
        return None
    found.sort(key=lambda each: each[0].optimum.bic)
    larger, reason, added = found[0]
    equal = [
        " with ".join(others)
        for other, _, others in found[1:]
        if other.optimum.bic < larger.optimum.bic + NUISANCE_MARGIN and not set(others) & set(added)
    ]
    would = f" ({' or '.join(equal)} would do nearly as well)" if equal else ""
    difference = chosen.optimum.bic - larger.optimum.bic
    verb = "are" if len(added) > 1 else "is"
    return larger, reason, f"{' and '.join(added)} {verb} needed{would}: delta BIC = {difference:.4g}"


def _steps(present: tuple[str, ...], offered: tuple[str, ...]) -> list[tuple[str, ...]]:
    """What may be added next: each nuisance that is not there, one that needs a partner with it."""
    missing = [name for name in offered if name not in present]
    return [
        (partner, name) if (partner := _PARTNERS.get(name)) and partner not in present else (name,)
        for name in missing
    ]


def _doubt(chosen: Tried, candidates: Candidates) -> str:
    """What to say first where k > 0 was preferred to a nuisance that explains the rows as well."""
    if chosen.optimum.model != "conductor":
        return ""
    others = [
        t
        for t in candidates.tried
        if t.optimum.model == "dielectric"
        and t.parameters <= chosen.parameters
        and t.nuisances != chosen.nuisances
        and t.optimum.bic < chosen.optimum.bic + NUISANCE_MARGIN
    ]
    if not others:
        return ""
    best = others[0]
    difference = best.optimum.bic - chosen.optimum.bic
    added = " and ".join(n for n in best.nuisances if n not in chosen.nuisances)
    return f"k = 0 with {added} would explain the rows nearly as well (BIC {difference:+.2g}); "
