"""What common mistakes of a photographer cost: the error of eta when nobody allows for them, and when the fit does."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml
from card import Figure, Table

from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.rig import Faults
from reflectance_fit.data_synthetic.spec import CaptureSpec, standard_spec
from reflectance_fit.workflow import fit

SIZE = (400, 300)  # pixels, width and height
CHANNEL = "G"
LARGEST_CLEAN = 0.001
LARGEST_ALLOWED = 0.01
Manifest = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Mistake:
    """``faults`` and ``change`` are what is wrong, ``remedy`` the nuisances of a fit that allows for it."""

    name: str
    faults: Faults
    remedy: dict[str, Any]
    change: Callable[[Manifest], None] = lambda manifest: None


def _no_darks(manifest: Manifest) -> None:
    manifest["frames"] = [frame for frame in manifest["frames"] if frame["role"] != "dark"]


def _ideal_polarizer(manifest: Manifest) -> None:
    manifest["polarizer"] = {"diattenuation": 1.0}


MISTAKES = (
    Mistake("none", Faults(), {}),
    Mistake("all angles of incidence 0.5 deg off", Faults(angle_offset_deg=0.5), {"angle_offset_deg": {}}),
    Mistake("the analyzer's zero 0.5 deg off", Faults(analyzer_offset_deg=0.5), {"analyzer_offset_deg": {}}),
    Mistake(
        "an analyzer of extinction 100:1, taken for ideal",
        Faults(diattenuation=99 / 101),
        {"diattenuation": {"sigma": 0.02}},
        _ideal_polarizer,
    ),
    Mistake("a lamp that is polarized by 2 %", Faults(source_dolp=0.02), {"source_dolp": {}}),
    Mistake("room light or dust, 1 % of the largest signal", Faults(diffuse=0.01), {"diffuse": {}}),
    Mistake("no dark frames", Faults(), {"dark_offset": {}}, _no_darks),
)


def about(*, full: bool) -> str:
    return (
        f"Synthetic plates of N-BK7, standard angles and camera, {SIZE[0]} x {SIZE[1]} pixels, seed 0, channel {CHANNEL}, "
        "model dielectric, Laplace posterior. Without nuisances, and with the one that allows for the mistake."
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    rows = []
    for mistake in MISTAKES:
        error, chi2 = _outcome(mistake, {})
        allowed, allowed_chi2 = _outcome(mistake, mistake.remedy) if mistake.remedy else (error, chi2)
        rows.append((mistake.name, f"{error:+.4f}", f"{chi2:.3g}", f"{allowed:+.4f}", f"{allowed_chi2:.3g}"))
        most = LARGEST_ALLOWED if mistake.remedy else LARGEST_CLEAN
        yield Figure.judged(
            f"error of eta, {mistake.name}, allowed for",
            f"{allowed:+.4f}",
            f"within {most}",
            abs(allowed) <= most,
        )
    heads = ("mistake", "error of eta", "red. chi2", "error, allowed for", "red. chi2, allowed for")
    yield Table("What a mistake costs", heads, tuple(rows))


def _outcome(mistake: Mistake, nuisances: dict[str, Any]) -> tuple[float, float]:
    """The error of eta, and the reduced chi2."""
    spec = replace(standard_spec("N-BK7"), faults=mistake.faults)
    spec = replace(spec, sensor=replace(spec.sensor, width=SIZE[0], height=SIZE[1]))
    with tempfile.TemporaryDirectory() as folder:
        path = write_capture(Path(folder) / "capture", spec)
        manifest = yaml.safe_load(path.read_text(encoding="utf-8"))
        manifest["nuisances"] = nuisances
        manifest["camera"]["channels"] = {CHANNEL: manifest["camera"]["channels"][CHANNEL]}
        mistake.change(manifest)
        path.write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
        report = fit(path, model="dielectric", posterior="laplace").report
    quality = report.fits[0].fit
    median = report.channels[0].eta.median
    return (median or float("nan")) - _true_eta(spec), quality.reduced_chi2 or float("nan")


def _true_eta(spec: CaptureSpec) -> float:
    channel = next(channel for channel in spec.channels if channel.name == CHANNEL)
    return spec.index_of(channel)[0]
