"""The command ``schlick``: how wrong each approximation is for one material."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.material import Material
from reflectance_fit.materials import library
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.report.approximations import Draws
from reflectance_fit.report.approximations import schlick_errors as errors_of
from reflectance_fit.report.netcdf import read_index_draws
from reflectance_fit.report.read import material_of, read_report
from reflectance_fit.report.schema import SchlickError
from reflectance_fit.report.write import approximations_yaml, write_text


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """One channel: a line about its material, the errors, and the posterior's draws where there are any."""

    title: str
    eta: float  # relative, as k and the draws
    k: float
    errors: SchlickError
    draws: Draws | None


@dataclass(frozen=True, slots=True, eq=False)
class Comparisons:
    """Every channel, and what a reader must know about all of them (or nothing)."""

    channels: tuple[Comparison, ...]
    note: str


def schlick_errors(
    *,
    report: Path | None = None,
    eta: float | None = None,
    k: float = 0.0,
    material: str | None = None,
    wavelength_nm: float = 550.0,
    folder: Path | None = None,
) -> Comparisons:
    """Errors of every approximation for each channel of a report, for an index, or for a built-in material.

    ``eta`` and ``k`` are relative to the exterior; a built-in material is seen
    from air.  A report's errors come with their posterior where posterior.nc is beside it.
    With ``folder``, schlick.yaml and a plot a channel are written there.
    """
    if folder is not None:
        check_writable(folder)
    draws: dict[str, Draws] = {}
    note = ""
    if report is not None:
        read = read_report(report)
        subject = material_of(read, report)
        posterior = report.parent / "posterior.nc"
        if posterior.exists():
            draws = read_index_draws(posterior, [channel.channel for channel in read.channels])
        else:
            note = f"no {posterior}: errors without intervals"
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
    results = _compared(subject, draws)
    if folder is not None:
        _write(folder, subject, results)
    return Comparisons(results, note)


def _compared(subject: Material, draws: dict[str, Draws]) -> tuple[Comparison, ...]:
    results = []
    for channel, eta, k in zip(subject.channels, *subject.relative, strict=True):
        relative: Draws | None = None
        if channel in draws:
            of_eta, of_k = draws[channel]
            relative = of_eta / subject.exterior_ior, of_k / subject.exterior_ior
        title = f"{subject.name}, {channel}: eta = {eta:.4f}, k = {k:.4f} (relative)"
        errors = errors_of(float(eta), float(k), timed=True, draws=relative)
        results.append(Comparison(title, float(eta), float(k), errors, relative))
    return tuple(results)


def _write(folder: Path, subject: Material, results: tuple[Comparison, ...]) -> None:
    from reflectance_fit.plot.schlick import draw_approximations
    from reflectance_fit.plot.style import save
    from reflectance_fit.plot.text import slugs

    endings = [""] if len(results) == 1 else [f"-{slug}" for slug in slugs(subject.channels)]

    def fill(stage: Path) -> None:
        for ending, one in zip(endings, results, strict=True):
            figure = draw_approximations(one.title, one.eta, one.k, draws=one.draws)
            save(figure, stage, f"schlick{ending}")
        text = approximations_yaml(subject, [one.errors for one in results])
        write_text(text, stage / "schlick.yaml")

    write_together(folder, fill, last="schlick.yaml")


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
