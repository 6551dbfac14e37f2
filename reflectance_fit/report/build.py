"""From fits to a Report: every number of report.yaml, and the warnings."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.examination import Examination, Health, Sensitivity
from reflectance_fit.measured import Note
from reflectance_fit.report import literature, schema
from reflectance_fit.report.approximations import schlick_errors
from reflectance_fit.report.numbers import short
from reflectance_fit.report.warnings import of_the_sample, warnings_of
from reflectance_fit.result import Fit, Interval, Shared

FloatArray = NDArray[np.float64]

PACKAGES = ("numpy", "scipy", "numba", "nlopt", "emcee", "arviz-stats")


def build_report(
    fits: Sequence[Fit],
    *,
    sample_name: str,
    exterior_ior: float,
    notes: Sequence[Note],
    seed: int,
    inputs: Sequence[tuple[str, str]],
    seconds: Mapping[str, float] | None,
    examinations: Sequence[Examination] = (),
    sample_note: str | None = None,
) -> schema.Report:
    """The report of all ``fits``, with an examination of each or of none.

    ``notes`` are what the reader had to tell, ``inputs`` pairs
    of file and sha256.  ``seconds`` are times a stage; with None nothing in
    the report depends on the clock, so equal runs give equal bytes.
    """
    channels = []
    warnings = [
        schema.Warning(code=note.code, channel=None, message=note.message)  # type: ignore[arg-type]
        for note in notes
    ]
    looked_at = examinations or [Examination()] * len(fits)
    found = [warnings_of(fit, seen) for fit, seen in zip(fits, looked_at, strict=True)]
    rejected = [any(note.code == "WRONG_MODEL" for note in of_fit) for of_fit in found]
    coincidence = of_the_sample(rejected)
    for index, (fit, seen) in enumerate(zip(fits, looked_at, strict=True)):
        table, disagreement = literature.compare(sample_name, fit)
        # Channels that share one fit are all channels there are.
        place = 0 if fit.shared else index
        channels.append(_channel(fit, place, table, seen, timed=seconds is not None))
        warnings += [
            schema.Warning(code=note.code, channel=fit.channel, message=note.message)  # type: ignore[arg-type]
            for note in [
                *found[index],
                *([coincidence] if coincidence and not rejected[index] else []),
                *([Note("LITERATURE_DISAGREES", disagreement)] if disagreement else []),
            ]
        ]
    return schema.Report(
        sample=schema.Sample(name=sample_name, note=sample_note),
        exterior_ior=exterior_ior,
        fits=[_fit(fit) for fit in (fits[:1] if fits[0].shared else fits)],
        channels=channels,
        priors=_priors(fits),
        effort=schema.Effort(
            fresnel="plain",
            model=", ".join(dict.fromkeys(fit.optimum.model for fit in fits)),
            posterior=", ".join(dict.fromkeys(fit.posterior.method for fit in fits)),
            seconds={name: short(value, 3) for name, value in seconds.items()} if seconds else None,
        ),
        warnings=warnings,
        provenance=schema.Provenance(
            version=importlib.metadata.version("reflectance_fit"),
            seed=seed,
            inputs=[schema.Input(file=file, sha256=sha256) for file, sha256 in inputs],
            packages={"python": platform.python_version()}
            | {name: importlib.metadata.version(name) for name in PACKAGES},
        ),
    )


def _priors(fits: Sequence[Fit]) -> dict[str, Any]:
    """Every prior once; where channels differ (ranges that follow the data), once a channel."""
    common: dict[str, Any] = {}
    for name in dict.fromkeys(name for fit in fits for name in fit.priors):
        stated = {fit.channel: fit.priors[name].as_yaml() for fit in fits if name in fit.priors}
        same = len({str(prior) for prior in stated.values()}) == 1
        common |= (
            {name: next(iter(stated.values()))} if same else {f"{name} ({c})": p for c, p in stated.items()}
        )
    return common


def _channel(
    fit: Fit, index: int, table: schema.Literature | None, seen: Examination, *, timed: bool
) -> schema.Channel:
    intervals = fit.intervals
    eta, k = intervals["eta"], intervals["k"]
    errors = None
    if eta.median is not None:
        relative = (eta.median / fit.exterior_ior, (k.median or 0.0) / fit.exterior_ior)
        draws = tuple(fit.posterior.flat(name) / fit.exterior_ior for name in ("eta", "k"))
        errors = schlick_errors(*relative, timed=timed, draws=(draws[0], draws[1]))
    kind: Literal["brewster", "pseudo_brewster"] = (
        "brewster" if fit.optimum.model == "dielectric" else "pseudo_brewster"
    )
    if table is not None:
        table = table.model_copy(
            update={
                name: None if (v := getattr(table, name)) is None else short(v)
                for name in ("eta", "k", "z", "z_k")
            }
        )
    return schema.Channel(
        channel=fit.channel,
        fit=index,
        wavelength_nm=fit.wavelength_nm,
        eta=schema.Estimate(**_estimate(eta)),
        k=schema.Estimate(**_estimate(k)),
        brewster_deg=schema.BrewsterEstimate(kind=kind, **_estimate(intervals["brewster_deg"])),
        second_brewster_deg=_optional(intervals.get("second_brewster_deg")),
        principal_angle_deg=_optional(intervals.get("principal_angle_deg")),
        r0=schema.Estimate(**_estimate(intervals["r0"])),
        schlick=errors,
        literature=table,
        sensitivity=[schema.Sensitivity(**_shortened(one)) for one in seen.sensitivity],
        health=[schema.Health(**_shortened(one)) for one in seen.health],
    )


def _shortened(found: Sensitivity | Health) -> dict[str, Any]:
    """Four digits: these are estimates of first order, or standard deviations."""
    return {name: short(v, 4) if isinstance(v, float) else v for name, v in asdict(found).items()}


def _fit(fit: Fit) -> schema.FitReport:
    optimum, posterior, chains = fit.optimum, fit.posterior, fit.posterior.chains
    sampled = [name for name in posterior.names if name not in ("eta", "k") and not name.startswith("sigma[")]
    reduced = optimum.reduced_chi2
    return schema.FitReport(
        channels=list(fit.shared.channels) if fit.shared else [fit.channel],
        model=schema.ModelChoice(
            name=optimum.model,
            noise=fit.noise,
            chosen_because=fit.chosen_because,
            loo=_loo(fit),
            candidates=[
                schema.Candidate(
                    name=c.name,
                    nuisances=list(c.nuisances),
                    noise=c.noise,
                    parameters=c.parameters,
                    chi2=short(c.chi2),
                    dof=c.dof,
                    bic=short(c.bic),
                    elpd_loo=None if c.elpd_loo is None else short(c.elpd_loo),
                )
                for c in fit.candidates
            ],
            dispersion=_dispersion(fit.shared) if fit.shared else None,
        ),
        fit=schema.FitQuality(
            optimizer=optimum.optimizer,
            chi2=short(optimum.chi2),
            dof=optimum.dof,
            reduced_chi2=None if reduced is None else short(reduced),
            p_value=None if (p := fit.p_value) is None else short(p, 3),
            nuisances={name: _nuisance(posterior.samples[name]) for name in sampled},
            gains={
                name: short(value)
                for name, value in (fit.shared.gains if fit.shared else optimum.gains).items()
            },
            estimated_sigma={name: short(value) for name, value in fit.estimated_sigma.items()},
            nan_evaluations=optimum.nan_count,
        ),
        posterior=schema.PosteriorQuality(
            method=posterior.method,
            ensembles=posterior.ensembles,
            draws=posterior.log_density.size,
            steps=chains.steps if chains else None,
            burn_in=chains.burn_in if chains else None,
            ess_min=short(min(posterior.ess.values()), 4),
            rhat_nested_max=short(max(chains.rhat_nested.values()), 6) if chains else None,
            acceptance=short(chains.acceptance, 3) if chains else None,
            autocorrelation_steps=short(float(chains.tau[-1]), 3) if chains else None,
            pareto_k=None if posterior.pareto_k is None else short(posterior.pareto_k, 3),
        ),
    )


def _nuisance(draws: FloatArray) -> schema.Nuisance:
    return schema.Nuisance(median=short(float(np.median(draws))), sd=short(float(draws.std())))


def _dispersion(shared: Shared) -> schema.Dispersion:
    return schema.Dispersion(cauchy_a=_nuisance(shared.cauchy_a), cauchy_b_um2=_nuisance(shared.cauchy_b_um2))


def _loo(fit: Fit) -> schema.LeaveOneOut | None:
    if fit.loo is None:
        return None
    loo = fit.loo
    return schema.LeaveOneOut(
        rival=loo.rival,
        elpd_difference=short(loo.elpd_difference, 4),
        se=short(loo.se, 3),
        pareto_k=short(loo.pareto_k, 3),
        agrees=loo.agrees,
    )


def _estimate(value: Interval) -> dict[str, Any]:
    def pair(interval: tuple[float, float] | None) -> list[float] | None:
        return None if interval is None else [short(x) for x in interval]

    return {
        "median": None if value.median is None else short(value.median),
        "sd": None if value.sd is None else short(value.sd),
        "ci68": pair(value.ci68),
        "ci95": pair(value.ci95),
        "status": value.status,
        "modes": [short(m) for m in value.modes] if value.modes else None,
    }


def _optional(value: Interval | None) -> schema.Estimate | None:
    return None if value is None else schema.Estimate(**_estimate(value))
