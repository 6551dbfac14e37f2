"""Which model the rows need: is k above 0, which nuisances, which noise.

Candidates are compared by BIC = -2 log L + p log n.  Three kinds of question
have a threshold of their own, so that chance alone is rarely believed:

* k > 0 is one-sided: at the bound its likelihood ratio is 0 in half of all
  cases and chi-squared with one degree of freedom in the other half (Self and
  Liang 1987).  With fewer than 47 rows log n lies below the 2.5 % point, 3.84,
  which is then what the ratio must exceed.
* A nuisance is only added where nothing is stated about nuisances, and where
  the rows reject what is there: p < 0.001, or a BIC lower by 20, or, where
  sigma is estimated and nothing can be rejected, by 10.  Real readings scatter
  by a little more than their sigmas say; that alone is no reason to turn the
  goniometer.  In any case the BIC must fall by 6, and the ratio to the same model without it must exceed what
  chance gives one of all the nuisances on offer in 1 % of cases.  Where the
  best model fits badly, sigmas may be too small as well: ratios are first
  divided by its reduced chi2.
* Heavy-tailed noise has as many parameters as normal noise.  The BIC must fall
  by 10, and what is left must look like a few scattered outliers in rows that
  fit, not like a wrong model (``robust``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from reflectance_fit.inference import robust
from reflectance_fit.inference.candidates import Candidates, Tried
from reflectance_fit.observations import Observations

K_CHANCE = (
    0.025  # of k > 0 where there is none; more than one basin, and normal noise by name only, add to it
)
REJECTED = 0.001  # as for the warning WRONG_MODEL
NUISANCE_CHANCE = 0.01  # of any nuisance where there is none
NUISANCE_MARGIN, UNJUDGED_MARGIN, DECISIVE_MARGIN = 6.0, 10.0, 20.0  # by which the BIC must fall
NOISE_MARGIN = 10.0
WORTH_A_LOOK = 2.5  # sigma; a row within gains less than 1.5 from heavy tails

# The azimuth of a source that is not polarized means nothing, so it comes with its degree only.
_PARTNERS = {"source_azimuth_deg": "source_dolp"}


Fitted = Callable[[str, Iterable[str]], Tried]


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """``tried`` by BIC, lowest first; ``rival`` is the candidate that ``chosen`` had to beat, if any.

    ``refused`` is how many rows heavy tails would set aside, where they fit far better but the rows are not scattered.
    """

    chosen: Tried
    tried: tuple[Tried, ...]
    rival: Tried | None
    reason: str
    refused: int = 0


def choose(
    names: tuple[str, ...],
    candidates: Candidates,
    given: Iterable[str],
    offered: Iterable[str],
    observations: Observations,
) -> Choice:
    """The model of ``names`` that the rows need, with the nuisances ``given`` and what they need of ``offered``.

    ``observations`` are the used rows.
    """
    given, offered = tuple(given), tuple(offered)
    normal = _ladder(names, candidates, candidates, given, offered)
    best = normal.chosen
    if best.rows.errors_in_angle or np.max(np.abs(best.optimum.residuals)) < WORTH_A_LOOK:
        return normal
    # With an estimated sigma the rows have scaled it already.
    stated = not np.any(best.rows.estimated >= 0)
    scaled = robust.bic_of_scaled_sigmas(best.optimum) if stated else math.inf
    to_beat = min(best.optimum.bic, scaled) - NOISE_MARGIN
    with suppress(ValueError):
        first = candidates.heavy_tailed(best.optimum.model, best.nuisances)
        if first.optimum.bic < to_beat:
            heavy = _ladder(names, candidates.heavy_tailed, candidates, given, offered)
            chosen = heavy.chosen.optimum
            lead = best.optimum.bic - chosen.bic
            count = robust.outliers(chosen)
            if chosen.bic > to_beat or not robust.scattered(chosen, observations):
                said = f"noise with {count} outliers is refused, they are not scattered in rows that fit; "
                return replace(normal, tried=candidates.tried, reason=said + normal.reason, refused=count)
            share = f"{count} of {len(chosen.residuals)} rows are outliers"
            said = f"{share}, so noise is Student's t: delta BIC = {lead:.4g}; "
            return replace(heavy, reason=said + heavy.reason, rival=best)
    return normal


def _ladder(
    names: tuple[str, ...],
    fit: Fitted,
    candidates: Candidates,
    given: tuple[str, ...],
    offered: tuple[str, ...],
) -> Choice:
    """``choose`` for one kind of noise."""
    chosen, reason = _simplest(names, fit, given)
    plain, steps = chosen, []
    while step := _one_more(names, fit, chosen, offered):
        chosen, k_reason, why = step
        steps.append(why)
        reason = f"{'; '.join(steps)}; {k_reason}"
    same = [t for t in candidates.tried if t.noise == chosen.noise and t is not chosen]
    rival = plain if steps else next((t for t in same if t.nuisances == chosen.nuisances), None)
    return Choice(chosen, candidates.tried, rival, reason if steps else _doubt(chosen, same) + reason)


def _simplest(names: tuple[str, ...], fit: Fitted, nuisances: Iterable[str]) -> tuple[Tried, str]:
    """Dielectric or conductor, or the only one there is."""
    if len(names) == 1:
        return fit(names[0], nuisances), "the priors leave nothing else"
    dielectric, conductor = (fit(name, nuisances) for name in names)
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

    sigmas = int(np.max(larger.rows.estimated)) + 1
    if not sigmas:
        return float(chi2.isf(chance, 1))
    n = len(larger.optimum.residuals)
    free = n - (larger.parameters - sigmas)
    return n * math.log1p(f.isf(chance, 1, free) / free) if free > 0 else math.inf


def _one_more(
    names: tuple[str, ...], fit: Fitted, chosen: Tried, offered: tuple[str, ...]
) -> tuple[Tried, str, str] | None:
    """The best model with one nuisance more than ``chosen``, where the rows need it, and why."""
    found: list[tuple[Tried, str, tuple[str, ...]]] = []
    margin = _margin(chosen)
    for added in _steps(chosen.nuisances, offered):
        try:
            larger, reason = _simplest(names, fit, (*chosen.nuisances, *added))
        except ValueError:
            continue  # no finite likelihood anywhere: not a candidate
        parent = fit(larger.optimum.model, chosen.nuisances)
        badness = max(larger.optimum.reduced_chi2 or 1.0, 1.0)
        gain = (parent.optimum.objective - larger.optimum.objective) / badness
        lead = (chosen.optimum.objective - larger.optimum.objective) / badness
        cost = (larger.parameters - chosen.parameters) * math.log(len(larger.optimum.residuals))
        chance = NUISANCE_CHANCE / len(offered)
        if lead - cost >= margin and gain >= likely_by_chance(larger, chance):
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


def _margin(chosen: Tried) -> float:
    """By how much a nuisance must lower the BIC of a model that the rows reject, cannot reject, or do not."""
    if np.any(chosen.rows.estimated >= 0):
        return UNJUDGED_MARGIN
    rejected = robust.p_value(chosen.optimum) < REJECTED
    return NUISANCE_MARGIN if rejected else DECISIVE_MARGIN


def _steps(present: tuple[str, ...], offered: tuple[str, ...]) -> list[tuple[str, ...]]:
    """What may be added next: each nuisance that is not there, one that needs a partner with it."""
    missing = [name for name in offered if name not in present]
    return [
        (partner, name) if (partner := _PARTNERS.get(name)) and partner not in present else (name,)
        for name in missing
    ]


def _doubt(chosen: Tried, others: list[Tried]) -> str:
    """What to say first where k > 0 was preferred to a nuisance that explains the rows as well."""
    if chosen.optimum.model != "conductor":
        return ""
    for other in others:
        added = [name for name in other.nuisances if name not in chosen.nuisances]
        lead = other.optimum.bic - chosen.optimum.bic
        if other.optimum.model == "dielectric" and added and lead < NUISANCE_MARGIN:
            return f"k = 0 with {' and '.join(added)} explains the rows about as well (BIC {lead:+.2g}); "
    return ""
