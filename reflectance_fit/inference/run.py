"""One channel from observations to a finished Fit: optimum, model choice, posterior, verdicts."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import ladder, models, posterior, search
from reflectance_fit.inference.candidates import Candidates, Tried
from reflectance_fit.inference.choice import Choice, choose
from reflectance_fit.inference.cross_check import Checked, checked
from reflectance_fit.inference.derived import derived_draws
from reflectance_fit.inference.fisher import information, one_equation
from reflectance_fit.inference.identify import UNINFORMED_SHARE, interval
from reflectance_fit.inference.rows import estimated_names, fitted, gain_names, pack
from reflectance_fit.nuisances import offered as nuisance_defaults
from reflectance_fit.observations import Flag, Observations
from reflectance_fit.priors import NUISANCES, Prior
from reflectance_fit.result import Candidate, Fit, Interval, Posterior

FloatArray = NDArray[np.float64]

MODELS = tuple(models.FREE)
Progress = Callable[[str, int, int], None]

_ASSUME = "where k = 0 may be taken for granted, --model dielectric gives eta"
# k = 0 is a finding where eta is known without it: the ends of its 95 % interval, k free, by no more than this factor
# apart.  A glass in a handful of readings near normal incidence has 1.2, a metal that passes for a dielectric over 3.
_KNOWN_WITHIN = 1.5

_log = logging.getLogger(__name__)


def fit_channel(
    channel: str,
    observations: Observations,
    *,
    exterior_ior: float,
    priors: Mapping[str, Prior],
    nuisances: Mapping[str, float] | None,
    known: Mapping[str, float] = MappingProxyType({}),
    model: str = "auto",
    method: ladder.Method = "emcee",
    seed: tuple[int, ...] = (0,),
    progress: Progress | None = None,
) -> Fit:
    """Fit the used rows of one channel.

    ``nuisances`` maps names to the sigma of their priors; None leaves them to
    auto, which adds what the rows need.  ``known`` maps those that were measured
    to their sigma: they are part of every model, and auto may widen them to the
    usual sigma.  ``model`` is one of MODELS, or auto:
    of what the priors of eta and k leave, the one that ``choice`` finds;
    ``method`` is the rung of the posterior ladder.
    ``progress`` is called with (what, steps done, steps at most).
    """
    saturated = int(np.sum(observations.flag == Flag.SATURATED))
    rows = pack(fitted(observations), exterior_ior)
    observations = observations.used
    estimated, gains = estimated_names(observations), gain_names(observations)
    offered = nuisance_defaults(observations) if nuisances is None and model == "auto" else {}
    offered = {name: sigma for name, sigma in offered.items() if sigma > known.get(name, 0.0)}
    sigmas = {**(nuisances or {}), **offered}
    tried = Candidates(rows, gains, priors, sigmas, estimated, known)
    names = models.candidates(priors)
    if model == "auto":
        found = checked(choose(names, tried, nuisances or (), offered, observations), (*seed, 2))
    else:
        found = Checked(Choice(only := tried(model, nuisances or ()), (only,), None, "asked for"), None, {})
    loo = found.loo
    if loo and not loo.agrees:
        _log.warning("%s: %s", channel, found.choice.reason)

    def draw(each: Tried, method: ladder.Method, stream: int, min_ess: float) -> Posterior:
        report = (lambda done, most: progress(f"sampling {channel}", done, most)) if progress else None
        return ladder.draw(
            each.model, each.rows, each.basins, method, (*seed, stream), min_ess=min_ess, progress=report
        )

    chosen, reason, k_samples = found.choice.chosen, found.choice.reason, None
    ridge = unbounded = False
    if model == "conductor" or (model == "auto" and "conductor" in names):
        both = tried.beside(chosen, "conductor")
        ridge = _one_equation(observations, both, exterior_ior, priors)
        if ridge:
            chosen, reason = (
                both,
                f"one equation for two unknowns; {_ASSUME if chosen is not both else reason}",
            )
        elif chosen is not both:
            # k = 0 was chosen because k adds nothing; how large it may be is the conductor's to say.  One quantile
            # is all that is wanted, which importance sampling gives in a tenth of emcee's time, or says that it cannot.
            k_samples = draw(both, "importance", 1, posterior.LIMIT_ESS)
            if unbounded := _unbounded(k_samples, priors):
                chosen, reason, k_samples = both, f"k is neither needed nor bounded; {_ASSUME}", None
    if chosen.noise == "normal":
        optimum, basins = search.confirmed(chosen.model, chosen.rows, gains, chosen.optimum, chosen.basins)
        chosen = replace(chosen, optimum=optimum, basins=basins)
    samples = draw(chosen, method, 0, posterior.MIN_ESS)
    derived = derived_draws(samples.samples["eta"], samples.samples["k"], exterior_ior)
    return Fit(
        channel=channel,
        wavelength_nm=float(observations.wavelength_nm[0]),
        exterior_ior=exterior_ior,
        observations=observations,
        optimum=chosen.optimum,
        candidates=tuple(
            Candidate(
                t.optimum.model,
                t.parameters,
                t.optimum.chi2,
                t.optimum.dof,
                t.optimum.bic,
                t.nuisances,
                t.noise,
                found.elpd.get(t),
            )
            for t in found.choice.tried
        ),
        chosen_because=reason,
        posterior=samples,
        k_posterior=k_samples,
        intervals=_intervals(
            chosen.model, samples, k_samples, priors, derived, ridge=ridge, unbounded=unbounded
        ),
        derived=derived,
        estimated_sigma={q: chosen.optimum.parameters[f"sigma[{q}]"] for q in estimated},
        priors={**priors, **dict(zip(chosen.model.names, chosen.model.priors, strict=True))},
        saturated=saturated,
        refused_outliers=found.choice.refused,
        noise=chosen.noise,
        loo=loo,
    )


def _one_equation(
    observations: Observations, both: Tried, exterior_ior: float, priors: Mapping[str, Prior]
) -> bool:
    """Whether the rows see eta and k through one number only, at the conductor's best point."""
    best = both.optimum
    info = information(
        replace(observations, sigma=best.sigma),
        best.eta,
        best.k,
        exterior_ior=exterior_ior,
        priors={name: priors[name] for name in ("eta", "k")},
        nuisances={},
        at={name: value for name, value in best.parameters.items() if name in NUISANCES},
        gains=best.gains,
    )
    return one_equation(info)


def _unbounded(conductor: Posterior, priors: Mapping[str, Prior]) -> bool:
    """Whether k, left free, may be anything, or moves eta: then k = 0 is an assumption, not a finding."""
    limit = float(np.quantile(conductor.samples["k"], 0.95))
    eta = interval(conductor.samples["eta"], priors["eta"])
    return limit > UNINFORMED_SHARE * priors["k"].high or _depends_on_k(eta)


def _depends_on_k(eta: Interval) -> bool:
    """Whether eta is not known while k is free; of several modes each may be."""
    if eta.ci95 is None or eta.modes:
        return False
    low, high = eta.ci95
    return high > _KNOWN_WITHIN * low


def _intervals(
    model: models.Model,
    samples: Posterior,
    k_samples: Posterior | None,
    priors: Mapping[str, Prior],
    derived: dict[str, FloatArray],
    *,
    ridge: bool,
    unbounded: bool,
) -> dict[str, Interval]:
    """``ridge``: one number is all that is known of eta and k, and the ends of their curve are the priors'.

    ``unbounded``: k is free only because k = 0 would have been an assumption; the rows do not ask for it.
    """
    known = {
        n: Interval(float(p.low), None, None, None, "fixed") for n, p in priors.items() if p.kind == "fixed"
    }
    eta = known.get("eta") or interval(samples.samples["eta"], priors["eta"])
    if "k" in model.names:
        k = interval(samples.samples["k"], priors["k"], bounded=True)
    elif k_samples is not None:
        # The dielectric was chosen, so a bound is all there is to say, however k's draws lie.
        limit = float(np.quantile(k_samples.samples["k"], 0.95))
        k = Interval(None, None, None, (0.0, limit), "upper_limit")
    elif model.name == "fixed_k":
        k = known["k"]
    else:
        k = Interval(0.0, None, None, None, "fixed")
    if ridge:
        eta, k = _unknown(eta), _unknown(interval(samples.samples["k"]))
    elif unbounded:
        eta = _unknown(eta) if _depends_on_k(eta) else eta
        k = _unknown(k) if k.status == "identified" else k
    angle, share = Prior("uniform", 0.0, 90.0), Prior("uniform", 0.0, 1.0)
    others = {name: interval(d, share if name == "r0" else angle) for name, d in derived.items()}
    return {"eta": eta, "k": k, **others}


def _unknown(found: Interval) -> Interval:
    return replace(found, median=None, sd=None, ci68=None, status="not_identified", modes=())
