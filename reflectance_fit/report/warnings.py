"""What a reader of a fit must know about it, each with a code of the contract."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from reflectance_fit.examination import Examination
from reflectance_fit.measured import Note
from reflectance_fit.result import Fit

_WRONG_MODEL_P = 0.001
_BEYOND_DEG = 5.0  # of extrapolation before ANGLE_RANGE is said
# Standard deviations: one in 16,000 of sound checks.
_UNHEALTHY = 4.0
_DARK_SD = 4.0
_LEAST_CHANNELS = 3
_WIDE = 0.002  # of the index: less is no matter of the band for anyone who names a colour channel
_FILM_NAMES = {1.46: "an oxide", 1.77: "alumina", 1.33: "water"}


def warnings_of(fit: Fit, seen: Examination) -> list[Note]:
    """All warnings of one fit, those about the sample's name aside (``literature``)."""
    return [*_of_the_rows(fit), *_of_the_posterior(fit), *_of_the_examination(fit, seen)]


def of_the_sample(rejected: Sequence[bool]) -> Note | None:
    """What a channel that fits must hear where most others are ``rejected``; None where they are not.

    A film's reflectance swings with the wavelength and passes, here and there,
    through that of one interface.
    """
    count = sum(rejected)
    if len(rejected) < _LEAST_CHANNELS or 2 * count < len(rejected):
        return None
    return Note(
        "WRONG_MODEL",
        f"one interface fits here, but not at {count} of the sample's {len(rejected)} wavelengths: it is one "
        "sample, so the index is a coincidence of this wavelength. A film?",
    )


def _of_the_rows(fit: Fit) -> Iterator[Note]:
    p = fit.p_value
    if p is not None and p < _WRONG_MODEL_P:
        yield Note(
            "WRONG_MODEL",
            f"no model fits: reduced chi2 {fit.optimum.reduced_chi2:.3g} (p = {p:.1g}); intervals are "
            "not to be trusted. A film, a wrong angle zero, or sigmas stated too small?",
        )
    if fit.saturated:
        yield Note("SATURATED", f"{fit.saturated} saturated rows count as lower bounds only")
    if fit.estimated_sigma:
        text = ", ".join(f"{name} {value:.3g}" for name, value in fit.estimated_sigma.items())
        yield Note("SIGMA_ESTIMATED", f"no sigma was stated; estimated from the residuals: {text}")


def _of_the_posterior(fit: Fit) -> Iterator[Note]:
    if not fit.posterior.converged and fit.posterior.chains:
        worst = max(fit.posterior.chains.rhat_nested.values())
        yield Note(
            "NOT_CONVERGED",
            f"after {fit.posterior.chains.steps} steps nested R-hat is {worst:.3f} and the effective sample "
            f"size {min(fit.posterior.ess.values()):.0f}; intervals are rough",
        )
    angle = fit.intervals["brewster_deg"].median
    low, high = fit.observations.theta_deg.min(), fit.observations.theta_deg.max()
    if angle is not None and not low - _BEYOND_DEG <= angle <= high + _BEYOND_DEG:
        yield Note(
            "ANGLE_RANGE",
            f"the Brewster angle {angle:.1f} deg lies outside of the angles measured, "
            f"{low:g} to {high:g} deg: it follows from the model alone",
        )
    if "dark_offset" in fit.posterior.samples:
        draws = fit.posterior.flat("dark_offset")
        dark, sd = float(draws.mean()), float(draws.std())
        if abs(dark) > _DARK_SD * sd:
            largest = float(abs(fit.observations.value).max())
            yield Note(
                "DARK_OFFSET",
                f"the dark level is off by {dark:.3g} +- {sd:.2g} ({100 * dark / largest:.2g} % of the largest "
                "signal); subtract a dark reading taken at the same gain",
            )


def _of_the_examination(fit: Fit, seen: Examination) -> Iterator[Note]:
    if seen.missing_runs is not None and seen.missing_runs > _UNHEALTHY:
        yield Note(
            "WRONG_MODEL",
            f"residuals do not scatter: neighbours are on the same side ({seen.missing_runs:.0f} sd too few changes "
            "of sign), so their estimated sigma is none and intervals are not to be trusted. A wrong angle zero, "
            "drop-outs, a drifting lamp?",
        )
    elif fit.refused_outliers and fit.estimated_sigma:
        yield Note(
            "WRONG_MODEL",
            f"{fit.refused_outliers} rows stand out, and not here and there: neighbours do together, so the residuals tell "
            "no sigma and intervals are not to be trusted. A wrong angle zero, drop-outs, a drifting lamp?",
        )
    for check in seen.health:
        if abs(check.z) > _UNHEALTHY:
            yield Note(
                "WRONG_MODEL",
                f"at {check.theta_deg:g} deg R_p must be R_s^2 whatever the material, and is {abs(check.z):.1f} "
                f"sd {'above' if check.z > 0 else 'below'} it: the calibration or stray light is at fault, not the "
                "sample",
            )
    if seen.film is not None:
        film = seen.film
        yield Note(
            "FILM_SUSPECTED",
            f"{film.thickness_nm:.1f} nm of {_FILM_NAMES[film.eta]} (n = {film.eta:g}) on tabulated {film.substrate} "
            f"would look the same (chi2 {film.chi2:.3g} against {film.bulk_chi2:.3g} for a free eta and k); "
            "eta and k are then not the material's own",
        )
    elif seen.drift is not None:
        drift = seen.drift
        yield Note(
            "FILM_SUSPECTED",
            f"the index drifts with the angle (eta {drift.eta:+.2g}, k {drift.k:+.2g} from the smallest to the largest, "
            f"p = {drift.p_value:.1g}), as pseudo-constants of a film do and no wrong angle zero explains",
        )
    if seen.band is not None:
        yield from _of_the_band(fit, seen)


def _of_the_band(fit: Fit, seen: Examination) -> Iterator[Note]:
    band = seen.band
    if band is None:
        return
    shifts = {"eta": band.eta, "k": band.k}
    least = _WIDE * math.hypot(fit.optimum.eta, fit.optimum.k)
    wide = [
        f"{name} {shifts[name]:+.2g} (sd {interval.sd:.2g})"
        for name in shifts
        if (interval := fit.intervals[name]).sd and abs(shifts[name]) > max(interval.sd, least)
    ]
    if wide:
        how = "" if band.named else ", the nearest built-in material,"
        yield Note(
            "WIDE_BAND",
            f"over {band.fwhm_nm:g} nm {band.material}{how} would be fitted {' and '.join(wide)} away from its "
            f"index at {fit.wavelength_nm:g} nm; the result is an effective index of the channel",
        )
