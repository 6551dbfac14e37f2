"""One typed function per command; the command line only parses and prints."""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from reflectance_fit.capture.manifest import Manifest as CaptureManifest
from reflectance_fit.capture.truth import Truth as TruthFile
from reflectance_fit.data_synthetic.example import Truth, copy_example
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.inference.predict import predictor
from reflectance_fit.inference.run import MODELS, fit_channel
from reflectance_fit.material import Material
from reflectance_fit.materials import library
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.measurement.manifest import Manifest
from reflectance_fit.measured import Measurement
from reflectance_fit.measurement.read import read_measurement
from reflectance_fit.observations import Flag
from reflectance_fit.observations_columns import observations_schema
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.report.approximations import schlick_errors as schlick_errors_of
from reflectance_fit.report.build import build_report
from reflectance_fit.report.netcdf import write_posterior
from reflectance_fit.report.read import material_of, read_report
from reflectance_fit.report.schema import Report, SchlickError
from reflectance_fit.report.write import approximations_yaml, report_yaml, write_text
from reflectance_fit.result import Fit

Progress = Callable[[str, int, int], None]

# The names draw_all gives to pictures: those of an earlier fit must not outlive its report.
_PICTURE = re.compile(
    r"(fit|residuals|corner|trace|autocorrelation|rank|prior_posterior|schlick|spectrum)(-[\w.-]+)?\.(png|svg)"
)

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """A finished fit: the report, and the fits behind it (draws, residuals, candidates)."""

    report: Report
    fits: tuple[Fit, ...]

    def write(
        self, folder: Path | str, *, plots: bool = True, progress: Callable[[str], None] | None = None
    ) -> Path:
        """Write report.yaml, posterior.nc and plots/ into ``folder``; returns the path of report.yaml.

        Until all are complete nothing appears; report.yaml comes last, so
        where it stands the rest does.  An earlier fit's files, plots
        included, are replaced; anything else in the folder stays.
        """
        folder = Path(folder)

        def fill(stage: Path) -> None:
            write_posterior(self.fits, stage / "posterior.nc")
            if plots:
                from reflectance_fit.plot.figures import draw_all

                draw_all(self.fits, stage / "plots", predictor, progress=progress)
            write_text(report_yaml(self.report), stage / "report.yaml")

        earlier = [path for path in (folder / "plots").glob("*") if _PICTURE.fullmatch(path.name)]
        write_together(folder, fill, last="report.yaml", superseded=earlier)
        _log.info("wrote %s", folder / "report.yaml")
        return folder / "report.yaml"


def fit(
    source: Measurement | Path | str,
    *,
    model: str = "auto",
    seed: int = 0,
    timings: bool = True,
    progress: Progress | None = None,
) -> FitResult:
    """Fit a measurement: eta, k and the Brewster angle of every channel, with posteriors.

    Parameters
    ----------
    source : Measurement or path
        A measurement, or the path of a measurement.yaml.
    model : {"auto", "dielectric", "conductor"}
        auto takes whichever has the lower BIC.
    seed : int
        The same inputs and seed give the same result, bit for bit.
    timings : bool
        Without them the report holds no wall-clock figure.
    progress : callable, optional
        Called with (channel, steps done, steps at most) while sampling.

    Raises
    ------
    ReflectanceFitError
        For anything wrong with the input; nothing is written then.
    """
    if model not in ("auto", *MODELS):
        raise ReflectanceFitError(f"unknown model '{model}'; choose auto, {' or '.join(MODELS)}")
    started = time.perf_counter()
    measurement = source if isinstance(source, Measurement) else read_measurement(Path(source))
    read = time.perf_counter()
    _log.info("%s: %d rows", measurement.path, len(measurement.observations))
    fits = []
    for index, (channel, rows) in enumerate(measurement.observations.channels()):
        if not np.any(rows.flag == Flag.USED):
            raise ReflectanceFitError(f"{measurement.path}: no usable row for {channel}; all are saturated")
        fits.append(
            fit_channel(
                channel,
                rows,
                exterior_ior=measurement.exterior_ior,
                priors=measurement.priors,
                nuisances=measurement.nuisances or {},
                model=model,
                seed=(seed, index),
                progress=progress,
            )
        )
        _log_fit(fits[-1])
    seconds = {"read": read - started, "fit": time.perf_counter() - read}
    report = build_report(
        fits,
        sample_name=measurement.sample_name,
        exterior_ior=measurement.exterior_ior,
        notes=measurement.warnings,
        seed=seed,
        inputs=measurement.inputs,
        seconds=seconds if timings else None,
    )
    return FitResult(report, tuple(fits))


def _log_fit(fit: Fit) -> None:
    _log.info(
        "%s: %s (%s), chi2 %.4g for %d degrees of freedom; %d steps, effective sample size %.0f",
        fit.channel,
        fit.optimum.model,
        fit.chosen_because,
        fit.optimum.chi2,
        fit.optimum.dof,
        fit.posterior.steps,
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
    drawing: Callable[[str], None],
) -> FitResult:
    """``fit`` and ``FitResult.write``; an unwritable folder is told before the work, not after."""
    check_writable(folder)
    if plots:
        check_writable(folder / "plots")
    result = fit(source, model=model, seed=seed, timings=timings, progress=progress)
    result.write(folder, plots=plots, progress=drawing)
    return result


def demo(
    folder: Path,
    materials: Sequence[str],
    *,
    seed: int,
    plots: bool,
    progress: Progress,
    drawing: Callable[[str], None],
) -> Iterator[tuple[str, Report, Truth]]:
    """Fit the shipped example of each material; yields its report beside the truth.

    Writes DIR/MATERIAL/measurement/ (the example's files) and DIR/MATERIAL/result/.
    """
    check_writable(folder)
    for material in materials:
        here = folder / material
        truth = copy_example(material, here / "measurement")
        result = fit_to_folder(
            here / "measurement" / "measurement.yaml",
            here / "result",
            model="auto",
            seed=seed,
            plots=plots,
            timings=True,
            progress=progress,
            drawing=drawing,
        )
        yield material, result.report, truth


def json_schema(name: str) -> dict[str, Any]:
    """The JSON Schema of a YAML format, or the columns of OBS.nc; ``name`` is one of cli/schema.py."""
    if name == "observations":
        return observations_schema()
    models: dict[str, type[BaseModel]] = {
        "capture": CaptureManifest,
        "measurement": Manifest,
        "report": Report,
        "truth": TruthFile,
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | models[name].model_json_schema()


def schlick_errors(
    *,
    report: Path | None = None,
    eta: float | None = None,
    k: float = 0.0,
    material: str | None = None,
    wavelength_nm: float = 550.0,
    folder: Path | None = None,
) -> list[tuple[str, SchlickError]]:
    """Errors of every approximation for each channel of a report, for an index, or for a built-in material.

    ``eta`` and ``k`` are relative to the exterior; a built-in material is seen
    from air.  Titles come with the errors.  With ``folder``, schlick.yaml and
    a plot a channel are written there.
    """
    if folder is not None:
        check_writable(folder)
    if report is not None:
        subject = material_of(read_report(report), report)
    elif material is not None:
        subject = _built_in(material, wavelength_nm)
    else:
        if eta is None:
            raise ReflectanceFitError("give an index, a material or a report")
        try:
            checked_index(eta, k)
        except ValueError as error:
            raise ReflectanceFitError(str(error)) from error
        subject = Material(
            "given index", "", ("index",), np.array([math.nan]), np.array([eta]), np.array([k])
        )
    relative_eta, relative_k = subject.relative
    results = [
        (
            f"{subject.name}, {channel}: eta = {n:.4f}, k = {x:.4f} (relative)",
            schlick_errors_of(n, x, timed=True),
        )
        for channel, n, x in zip(
            subject.channels, map(float, relative_eta), map(float, relative_k), strict=True
        )
    ]
    if folder is not None:
        from reflectance_fit.plot.schlick import draw_approximations
        from reflectance_fit.plot.style import save
        from reflectance_fit.plot.text import slugs

        endings = [""] if len(results) == 1 else [f"-{slug}" for slug in slugs(subject.channels)]

        def fill(stage: Path) -> None:
            for ending, (title, _), n, x in zip(endings, results, relative_eta, relative_k, strict=True):
                save(draw_approximations(title, float(n), float(x)), stage, f"schlick{ending}")
            text = approximations_yaml(subject, [errors for _, errors in results])
            write_text(text, stage / "schlick.yaml")

        write_together(folder, fill, last="schlick.yaml")
    return results


def _built_in(name: str, wavelength_nm: float) -> Material:
    constants = library.get(name)
    eta, k = constants.absolute_index(wavelength_nm)
    return Material(
        name=constants.name,
        source=constants.source,
        channels=(f"{wavelength_nm:g} nm",),
        wavelength_nm=np.array([wavelength_nm]),
        eta=np.array([float(eta)]),
        k=np.array([float(k)]),
        exterior_ior=AIR_INDEX,
    )
