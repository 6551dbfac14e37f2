"""One typed function per command; the command line only parses and prints."""

from __future__ import annotations

import itertools
import logging
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from reflectance_fit.capture.frames import Capture
from reflectance_fit.capture.manifest import Manifest as CaptureManifest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.truth import Truth
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.inference import checkpoint
from reflectance_fit.inference.examine import examine
from reflectance_fit.inference.ladder import METHODS, Method
from reflectance_fit.inference.predict import predictor
from reflectance_fit.inference.run import MODELS, fit_channel
from reflectance_fit.inference.shared import share_dispersion
from reflectance_fit.map_columns import map_schema
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.measurement.manifest import Manifest
from reflectance_fit.measurement.read import read_measurement
from reflectance_fit.observations import Flag, Observations
from reflectance_fit.observations_columns import observations_schema
from reflectance_fit.observations_file import read_observations
from reflectance_fit.render.scene_blocks import SceneBlock
from reflectance_fit.report.build import build_report
from reflectance_fit.report.netcdf import write_posterior
from reflectance_fit.report.schema import Report
from reflectance_fit.report.write import report_yaml, write_text
from reflectance_fit.result import Fit
from reflectance_fit.strict_yaml import load

Progress = Callable[[str, int, int], None]

# The names draw_all gives to pictures: those of an earlier fit must not outlive its report.
_PICTURE = re.compile(
    r"(fit|residuals|corner|trace|autocorrelation|rank|prior_posterior|schlick|spectrum)(-[\w.-]+)?\.(png|svg)"
)


# A spectrum of more channels gets the importance rung: emcee would take minutes.
_FEW_CHANNELS = 16

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """A finished fit: the report, and the fits behind it (draws, residuals, candidates)."""

    report: Report
    fits: tuple[Fit, ...]

    def write(self, folder: Path | str, *, plots: bool = True, progress: Progress | None = None) -> Path:
        """Write report.yaml, posterior.nc and plots/ into ``folder``; returns the path of report.yaml.

        Until all are complete nothing appears; report.yaml comes last, so
        where it stands the rest does.  An earlier fit's files, plots
        included, are replaced; anything else in the folder stays.
        """
        folder = Path(folder)

        def fill(stage: Path) -> None:
            write_posterior(self.fits, stage / "posterior.nc")
            if plots:
                from reflectance_fit.plot.figures import draw_all, pictures

                drawn = itertools.count(1)

                def told(_name: str) -> None:
                    if progress:
                        progress("drawing", next(drawn), pictures(self.fits))

                draw_all(self.fits, stage / "plots", predictor, progress=told)
            write_text(report_yaml(self.report), stage / "report.yaml")

        earlier = [path for path in (folder / "plots").glob("*") if _PICTURE.fullmatch(path.name)]
        write_together(folder, fill, last="report.yaml", superseded=earlier)
        _log.info("wrote %s", folder / "report.yaml")
        return folder / "report.yaml"


def fit(
    source: Measurement | Capture | Path | str,
    *,
    model: str = "auto",
    posterior: Method | None = None,
    seed: int = 0,
    timings: bool = True,
    progress: Progress | None = None,
) -> FitResult:
    """Fit a measurement: eta, k and the Brewster angle of every channel, with posteriors.

    Parameters
    ----------
    source : Measurement, Capture or path
        What to fit, or the path of a measurement.yaml, capture.yaml or OBS.nc.
    model : {"auto", "dielectric", "conductor", "fixed_k", "fixed_eta"}
        auto takes dielectric or conductor, whichever the rows need, or what the
        input's priors leave; where the input has no nuisances block it also adds
        the nuisances that the rows need, and it puts dielectric channels on one
        dispersion curve where BIC prefers that.  fixed_k and fixed_eta need the
        value in priors.
    posterior : {"emcee", "importance", "laplace"}, optional
        The rung of the posterior ladder: emcee unless there are more than 16
        channels, then importance sampling.  Where importance sampling finds
        that it fails, emcee is used.
    seed : int
        The same inputs and seed give the same result, bit for bit.
    timings : bool
        Without them the report holds no wall-clock figure.
    progress : callable, optional
        Called with (what, done, of how many) while frames are read and posteriors sampled.

    Raises
    ------
    ReflectanceFitError
        For anything wrong with the input; nothing is written then.
    """
    if model not in ("auto", *MODELS):
        raise ReflectanceFitError(f"unknown model '{model}'; choose auto, {', '.join(MODELS)}")
    if posterior not in (None, *METHODS):
        raise ReflectanceFitError(f"unknown posterior '{posterior}'; choose {', '.join(METHODS)}")
    started = time.perf_counter()
    measurement = source if isinstance(source, Measurement) else _measurement(source, progress)
    ingested = time.perf_counter()
    _log.info("%s: %d rows", measurement.path, len(measurement.observations))
    fits, notes = [], list(measurement.warnings)
    _check_fixed(model, measurement)
    many = len(set(measurement.observations.channel)) > _FEW_CHANNELS
    method = posterior or ("importance" if many else "emcee")
    for index, (channel, rows) in enumerate(measurement.observations.channels()):
        if not np.any(rows.flag == Flag.USED):
            notes.append(
                Note("SATURATED", f"{channel} is left out: all of its {len(rows)} rows are saturated")
            )
            continue
        _check_signals(channel, rows.used, measurement)
        fits.append(
            fit_channel(
                channel,
                rows,
                exterior_ior=measurement.exterior_ior,
                priors=measurement.priors,
                nuisances=measurement.nuisances,
                known=measurement.known(channel),
                model=model,
                method=method,
                seed=(seed, index),
                progress=progress,
            )
        )
        _log_fit(fits[-1])
    if not fits:
        message = "every row is saturated; expose less, or correct the saturation level"
        raise ReflectanceFitError(Problem(str(measurement.path), None, message))
    if model == "auto":
        fits = share_dispersion(
            fits,
            measurement.observations,
            exterior_ior=measurement.exterior_ior,
            priors=measurement.priors,
            method=method,
            seed=(seed, index + 1),
            progress=progress,
        )
    seconds = {"ingest": ingested - started, "fit": time.perf_counter() - ingested}
    report = build_report(
        fits,
        sample_name=measurement.sample_name,
        exterior_ior=measurement.exterior_ior,
        notes=notes,
        seed=seed,
        inputs=measurement.inputs,
        seconds=seconds if timings else None,
        examinations=[examine(one, measurement.sample_name) for one in fits],
        sample_note=measurement.sample_note,
    )
    return FitResult(report, tuple(fits))


def _check_signals(channel: str, used: Observations, measurement: Measurement) -> None:
    """A gain is positive, so some reading of its group must be."""
    dark = [
        group
        for group in np.unique(used.gain_group)
        if group and np.max(used.value[used.gain_group == group]) <= 0
    ]
    if dark:
        message = f"{channel}: no reading of gain group '{dark[0]}' is above 0; is it the right column, or is dark taken off twice?"
        raise ReflectanceFitError(Problem(str(measurement.path), None, message))


def _check_fixed(model: str, measurement: Measurement) -> None:
    """A model that takes eta or k as known needs the value; the others must not have it."""
    for name in ("eta", "k"):
        prior = measurement.priors[name]
        fixed = prior.kind == "fixed" and not (model == "dielectric" and name == "k" and prior.low == 0)
        if model == f"fixed_{name}" and not fixed:
            message = f"--model {model} needs the value, as in priors: {{{name}: {{fixed: 1.5}}}}"
            raise ReflectanceFitError(Problem(str(measurement.path), None, message))
        if fixed and model not in ("auto", f"fixed_{name}"):
            message = (
                f"priors fix {name} at {prior.low:g}, which --model {model} does not take; leave one out"
            )
            raise ReflectanceFitError(Problem(str(measurement.path), None, message))


def _log_fit(fit: Fit) -> None:
    _log.info(
        "%s: %s (%s), chi2 %.4g for %d degrees of freedom; %s, effective sample size %.0f",
        fit.channel,
        fit.optimum.model,
        fit.chosen_because,
        fit.optimum.chi2,
        fit.optimum.dof,
        fit.posterior.method,
        min(fit.posterior.ess.values()),
    )


def fit_to_folder(
    source: Path,
    folder: Path,
    *,
    model: str,
    seed: int,
    plots: bool,
    timings: bool,
    progress: Progress,
    posterior: Method | None = None,
    resume: bool = False,
) -> FitResult:
    """``fit`` and ``FitResult.write``; an unwritable folder is told before the work, not after.

    What emcee has sampled is kept in the folder until all is written; with
    ``resume`` a run that was stopped continues from there.
    """
    check_writable(folder)
    if plots:
        check_writable(folder / "plots")
    with checkpoint.keeping(folder / checkpoint.FOLDER, resume=resume):
        result = fit(source, model=model, posterior=posterior, seed=seed, timings=timings, progress=progress)
        result.write(folder, plots=plots, progress=progress)
    return result


def _measurement(source: Capture | Path | str, progress: Progress | None) -> Measurement:
    """What ``source`` comes to, by what it is: the ending of an OBS.nc, the schema of a manifest."""
    if isinstance(source, Capture):
        return _photographs(source, progress)
    path = Path(source)
    if path.suffix == ".nc":
        return read_observations(path)
    data = load(path).data
    schema = str(data.get("schema", "")) if isinstance(data, dict) else ""
    if schema.startswith("reflectance_fit/capture/"):
        return _photographs(read_capture(path), progress)
    return read_measurement(path)


def _photographs(capture: Capture, progress: Progress | None) -> Measurement:
    """What a capture comes to."""
    from reflectance_fit.capture.ingest import (
        ingest,  # here, for tables need nothing of what reads photographs
    )

    return ingest(capture, progress=progress).measurement


def json_schema(name: str) -> dict[str, Any]:
    """The JSON Schema of a YAML format, or the variables of OBS.nc or MAP.nc; ``name`` is one of cli/schema.py."""
    if name in ("observations", "map"):
        return observations_schema() if name == "observations" else map_schema()
    models: dict[str, type[BaseModel]] = {
        "capture": CaptureManifest,
        "measurement": Manifest,
        "report": Report,
        "scene": SceneBlock,
        "truth": Truth,
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | models[name].model_json_schema()
