"""The command ``schlick``: how wrong each approximation is for one material."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.material import Material
from reflectance_fit.materials import library
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.report.approximations import schlick_errors as errors_of
from reflectance_fit.report.read import material_of, read_report
from reflectance_fit.report.schema import SchlickError
from reflectance_fit.report.write import approximations_yaml, write_text


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
            errors_of(n, x, timed=True),
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
