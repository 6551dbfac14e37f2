"""What common mistakes of a photographer cost: the error of eta when nobody allows for them, and when the fit does."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from card import Figure, Table

from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.rig import Faults
from reflectance_fit.data_synthetic.spec import CaptureSpec, standard_spec
from reflectance_fit.data_synthetic.target import Board
from reflectance_fit.workflow import fit

SIZE = (400, 300)  # pixels, width and height
CHANNEL = "G"
TILTS_DEG = (50.0, 62.0)  # of the plates on a board
LARGEST_CLEAN = 0.001
LARGEST_ALLOWED = 0.01
Manifest = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Mistake:
    """``faults`` and ``change`` are what is wrong, ``remedy`` the nuisances of a fit that allows for it.

    ``board``: the plate lies on a board as printed.  ``wedge_deg``: on a wedge
    that tilts it against the board, away from the lamp at every tilt.
    """

    name: str
    faults: Faults
    remedy: dict[str, Any]
    change: Callable[[Path, Manifest], None] = lambda folder, manifest: None
    board: Board | None = None
    wedge_deg: float = 0.0


def _one_clipped(folder: Path, manifest: Manifest) -> None:
    """The first frame exposed eight times as long, with all else as it was."""
    entry = manifest["frames"][0]
    frame = decode(folder / entry["file"])
    black = np.tile(frame.black, (frame.cfa.shape[0] // 2, frame.cfa.shape[1] // 2))
    white = int(frame.white.min())
    seconds = 8 * Fraction(entry["exposure_s"])
    noise = frame.noise_profile or {}
    levels = (int(frame.black[0, 0]), int(frame.black[0, 1]), int(frame.black[1, 0]), int(frame.black[1, 1]))
    metadata = DngMetadata("RGGB", 14, levels, white, seconds, 100, tuple(noise[c] for c in "RGB"))
    dn = np.clip(np.rint(8 * (frame.cfa - black) + black), 0, white).astype(np.uint16)
    write_dng(folder / entry["file"], dn, metadata)
    del entry["sha256"]
    entry["exposure_s"] = str(seconds)


def _no_darks(folder: Path, manifest: Manifest) -> None:
    manifest["frames"] = [frame for frame in manifest["frames"] if frame["role"] != "dark"]


def _ideal_polarizer(folder: Path, manifest: Manifest) -> None:
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
    Mistake("one frame exposed eight times as long", Faults(), {}, _one_clipped),
    Mistake("a board, without any", Faults(), {}, board=Board()),
    Mistake("a board printed at 97 %", Faults(), {}, board=Board(print_scale=(0.97, 0.97))),
    Mistake(
        "a wedge of 0.5 deg under the plate on the board",
        Faults(),
        {"angle_offset_deg": {"sigma": 0.5}},
        board=Board(),
        wedge_deg=0.5,
    ),
)


def about(*, full: bool) -> str:
    return (
        f"Synthetic plates of N-BK7, standard angles and camera, {SIZE[0]} x {SIZE[1]} pixels, seed 0, channel {CHANNEL}, "
        "model dielectric, Laplace posterior; plates on a board at tilts of 50 and 62 deg, the standard camera whole, "
        "the wedge taken off the angles that the board tells. Without nuisances, and with the one that allows for the mistake."
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
    if mistake.board is None:
        spec = standard_spec("N-BK7")
        spec = replace(spec, sensor=replace(spec.sensor, width=SIZE[0], height=SIZE[1]))
    else:
        spec = replace(standard_spec("N-BK7", shape="board"), board=mistake.board, angles_deg=TILTS_DEG)
    spec = replace(spec, faults=mistake.faults)
    with tempfile.TemporaryDirectory() as folder:
        path = write_capture(Path(folder) / "capture", spec)
        manifest = yaml.safe_load(path.read_text(encoding="utf-8"))
        manifest["nuisances"] = nuisances
        manifest["camera"]["channels"] = {CHANNEL: manifest["camera"]["channels"][CHANNEL]}
        mistake.change(path.parent, manifest)
        path.write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
        measurement = ingest(read_capture(path)).measurement
    rows = measurement.observations
    lower = replace(rows, theta_deg=rows.theta_deg - mistake.wedge_deg)
    report = fit(replace(measurement, observations=lower), model="dielectric", posterior="laplace").report
    quality = report.fits[0].fit
    median = report.channels[0].eta.median
    return (median or float("nan")) - _true_eta(spec), quality.reduced_chi2 or float("nan")


def _true_eta(spec: CaptureSpec) -> float:
    channel = next(channel for channel in spec.channels if channel.name == CHANNEL)
    return spec.index_of(channel)[0]
