"""A finished fit looked at again: the budget of what was not fitted, and the tests that it cannot do itself."""

from __future__ import annotations

from reflectance_fit.examination import Examination
from reflectance_fit.inference.band import band
from reflectance_fit.inference.film import drift, film
from reflectance_fit.inference.health import healths
from reflectance_fit.inference.scatter import too_few_runs
from reflectance_fit.inference.sensitivity import sensitivities
from reflectance_fit.materials.library import match
from reflectance_fit.result import Fit


def examine(fit: Fit, sample_name: str) -> Examination:
    """All checks of one fit; ``sample_name`` may name a built-in material."""
    entry = match(sample_name)
    return Examination(
        # Slopes at a point say nothing of a posterior that has none.
        sensitivity=sensitivities(fit) if fit.intervals["eta"].status in ("identified", "fixed") else (),
        health=healths(fit),
        film=film(fit, entry),
        drift=drift(fit),
        band=band(fit, entry),
        missing_runs=too_few_runs(fit),
    )
