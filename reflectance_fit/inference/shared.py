"""One dielectric over several channels: eta = a + b / wavelength^2 (Cauchy), one zero error for all of them.

Tried once each channel has its own fit, and kept where BIC prefers it.  What
belongs to the goniometer is shared; nuisances of a channel's own (dark offset,
diffuse light, the analyzer's imperfection) keep the channels apart.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference import ladder, models, posterior, search
from reflectance_fit.inference.derived import derived_draws
from reflectance_fit.inference.forward import SLOPE
from reflectance_fit.inference.identify import interval
from reflectance_fit.inference.rows import fitted, gain_names, pack
from reflectance_fit.materials import library
from reflectance_fit.observations import Observations
from reflectance_fit.priors import Prior
from reflectance_fit.result import Candidate, Fit, Interval, Optimum, Posterior, Shared

FloatArray = NDArray[np.float64]

B = "cauchy_b_um2"
# Flat; rutile, among the most dispersive of transparent materials, has 0.09.
B_PRIOR = Prior("uniform", -0.2, 0.2)
_GEOMETRY = {"angle_offset_deg", "analyzer_offset_deg"}
_LEAST_CHANNELS = 3  # two etas are as many parameters as a and b
# Of a channel's own sd of eta.  Sharing shrinks that to a half or less, so the curve's own error stays
# below a third of the sd that is reported.
_DEPARTURE = 0.15
_SEPARATOR = "\x1f"

_log = logging.getLogger(__name__)


def share_dispersion(
    fits: Sequence[Fit],
    observations: Observations,
    *,
    exterior_ior: float,
    priors: Mapping[str, Prior],
    method: ladder.Method,
    seed: tuple[int, ...],
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Fit]:
    """``fits`` as they are, or with their channels on one curve where that is the simpler account.

    ``observations`` are the rows of all channels, saturated ones included.
    The channels must all be dielectrics whose sigmas are stated and whose eta
    is identified.  ``priors`` holds that of eta, for the middle of the curve.
    """
    if not _may_share(fits):
        return list(fits)
    names = [fit.channel for fit in fits]
    o = observations.select(np.isin(observations.channel, names))
    groups = [f"{c}{_SEPARATOR}{g}" if g else "" for c, g in zip(o.channel, o.gain_group, strict=True)]
    chosen = fitted(replace(o, gain_group=np.array(groups)))
    rows, gains = pack(chosen, exterior_ior), gain_names(chosen)
    fitted_ones = {n for fit in fits for n in fit.optimum.parameters if n in _GEOMETRY}
    sigmas = {n: max(fit.priors[n].sigma for fit in fits if n in fit.priors) for n in sorted(fitted_ones)}
    eta = models.build("dielectric", rows, priors, sigmas, [])
    model = replace(
        eta, names=(*eta.names, B), priors=(*eta.priors, B_PRIOR), places=np.append(eta.places, SLOPE)
    )
    optimum, basins = search.find(model, rows, gains)
    parameters = sum(len(fit.optimum.parameters) + len(fit.optimum.gains) for fit in fits)
    apart = sum(fit.optimum.objective for fit in fits) + parameters * math.log(len(optimum.predicted))
    difference = apart - optimum.bic
    departure = _departure(np.array([fit.wavelength_nm for fit in fits]), optimum.parameters[B])
    sd = min(fit.intervals["eta"].sd or 0.0 for fit in fits)
    _log.info(
        "one Cauchy curve for %s: delta BIC %.4g; such curves miss by %.2g, the smallest sd of eta is %.2g",
        ", ".join(names),
        difference,
        departure,
        sd,
    )
    if difference <= 0 or departure > _DEPARTURE * sd:
        return list(fits)
    samples = ladder.draw(
        model,
        rows,
        basins,
        method,
        seed,
        min_ess=posterior.MIN_ESS,
        progress=(lambda done, most: progress("sampling all channels", done, most)) if progress else None,
    )
    candidates = (
        Candidate("dielectric_cauchy", *_counts(optimum), optimum.bic, nuisances=tuple(sigmas)),
        Candidate(
            "dielectric_by_channel",
            parameters,
            sum(fit.optimum.chi2 for fit in fits),
            sum(fit.optimum.dof for fit in fits),
            apart,
            nuisances=tuple(sigmas),
        ),
    )
    because = f"k adds nothing; one Cauchy curve for {', '.join(names)}: delta BIC = {difference:.4g}"
    centre = float(np.mean((1000.0 / np.unique(chosen.wavelength_nm)) ** 2))
    shared = Shared(
        channels=tuple(names),
        gains={name.replace(_SEPARATOR, " "): value for name, value in optimum.gains.items()},
        cauchy_a=samples.samples["eta"] - samples.samples[B] * centre,
        cauchy_b_um2=samples.samples[B],
    )
    return [
        replace(
            _of_channel(fit, chosen.used.channel == fit.channel, optimum, samples, centre),
            candidates=candidates,
            chosen_because=because,
            shared=shared,
            loo=None,
            priors={**fit.priors, B: B_PRIOR},
        )
        for fit in fits
    ]


def _may_share(fits: Sequence[Fit]) -> bool:
    def simple(fit: Fit) -> bool:
        free = set(fit.optimum.parameters) - {"eta"}
        identified = fit.intervals["eta"].status == "identified"
        plain = fit.optimum.model == "dielectric" and fit.noise == "normal"
        return plain and identified and free <= _GEOMETRY

    return len({fit.wavelength_nm for fit in fits}) >= _LEAST_CHANNELS and all(map(simple, fits))


def _departure(wavelengths_nm: FloatArray, b_um2: float) -> float:
    """How far Cauchy's curve misses real materials at these wavelengths, those of like dispersion at most.

    The largest miss of the least-squares line in 1 / wavelength^2 among the
    built-in dielectrics whose b is at most 1.5 times ``b_um2``.
    """
    inverse_square = (1000.0 / wavelengths_nm) ** 2
    worst = 0.0
    for name, entry in library.entries().items():
        if entry.kind != "dielectric":
            continue
        try:
            eta = library.get(name).eta(wavelengths_nm)
        except ReflectanceFitError:  # a table that does not reach all wavelengths
            continue
        line = np.polynomial.Polynomial.fit(inverse_square, eta, 1)
        if line.convert().coef[1] <= 1.5 * abs(b_um2):
            worst = max(worst, float(np.max(np.abs(line(inverse_square) - eta))))
    return worst


def _counts(optimum: Optimum) -> tuple[int, float, int]:
    return len(optimum.parameters) + len(optimum.gains), optimum.chi2, optimum.dof


def _of_channel(
    fit: Fit, mine: NDArray[np.bool_], optimum: Optimum, samples: Posterior, centre: float
) -> Fit:
    """What the shared fit says of one channel; ``mine`` are its rows among those used."""
    place = (1000.0 / fit.wavelength_nm) ** 2 - centre
    eta = samples.samples["eta"] + samples.samples[B] * place
    best = optimum.eta + optimum.parameters[B] * place
    names = tuple(name for name in samples.names if name != B)
    own = {**{n: samples.samples[n] for n in samples.samples if n != B}, "eta": eta}
    chains = samples.chains
    if chains is not None:
        columns = dict(zip(samples.names, np.moveaxis(chains.trace, -1, 0), strict=True))
        columns["eta"] = columns["eta"] + columns[B] * place
        chains = replace(chains, trace=np.stack([columns[n] for n in names], axis=-1))
    drawn = replace(samples, names=names, samples=own, chains=chains)
    derived = derived_draws(eta, own["k"], fit.exterior_ior)
    angle, share = Prior("uniform", 0.0, 90.0), Prior("uniform", 0.0, 1.0)
    intervals: dict[str, Interval] = {
        **fit.intervals,
        "eta": interval(eta, fit.priors["eta"]),
        **{name: interval(d, share if name == "r0" else angle) for name, d in derived.items()},
    }
    gains = {
        name.partition(_SEPARATOR)[2]: value
        for name, value in optimum.gains.items()
        if name.partition(_SEPARATOR)[0] == fit.channel
    }
    others = {n: v for n, v in optimum.parameters.items() if n not in ("eta", B)}
    point = replace(
        optimum,
        parameters={"eta": best, **others},
        eta=best,
        gains=gains,
        predicted=optimum.predicted[mine],
        sigma=optimum.sigma[mine],
        residuals=optimum.residuals[mine],
    )
    return replace(fit, optimum=point, posterior=drawn, derived=derived, intervals=intervals)
