"""The choice by BIC, held against how well each row is foretold by the others.

A nuisance must pass both: where the rows left out are not foretold better with
it, the model without is taken.  Elsewhere the BIC decides, and where leaving
rows out clearly prefers the rival the report says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from reflectance_fit.inference.candidates import Tried
from reflectance_fit.inference.choice import Choice
from reflectance_fit.inference.leave_one_out import compare, foretell
from reflectance_fit.result import LeaveOneOut

# A rival whose -2 log L is so much higher is out of the question, and no weights reach what it leaves out.
HOPELESS = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """A choice and, where there was a rival, the comparison with it; ``elpd`` of the two by candidate."""

    choice: Choice
    loo: LeaveOneOut | None
    elpd: dict[Tried, float]


def checked(found: Choice, seed: tuple[int, ...]) -> Checked:
    """``found``, or its rival where an added nuisance does not stand the test.  ``seed`` starts the draws."""
    chosen, rival = found.chosen, found.rival
    if rival is None or rival.optimum.objective > chosen.optimum.objective + HOPELESS:
        return Checked(found, None, {})
    told = {t: foretell(t.model, t.rows, t.basins, (*seed, i)) for i, t in enumerate((chosen, rival))}
    elpd = {t: foretold.total for t, foretold in told.items()}
    result = compare(told[chosen], told[rival], rival.described)
    if not math.isfinite(result.pareto_k):
        return Checked(found, None, {})  # weights of which one counts tell nothing
    figures = f"elpd difference {result.elpd_difference:.3g} +- {result.se:.2g}"
    added = [name for name in chosen.nuisances if name not in rival.nuisances]
    if added and chosen.noise == rival.noise and result.elpd_difference < 0 and result.trusted:
        names = " and ".join(added)
        reason = f"{names} would lower the BIC, but rows left out are foretold no better with it ({figures})"
        back = replace(found, chosen=rival, rival=chosen, reason=reason)
        return Checked(back, compare(told[rival], told[chosen], chosen.described), elpd)
    if not result.agrees:
        note = f"rows left out are foretold better by the {rival.described} ({figures}); "
        found = replace(found, reason=note + found.reason)
    return Checked(found, result, elpd)
