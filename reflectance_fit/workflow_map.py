"""``map``: photographs to eta (and k) of every pixel, tile by tile."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import Cells
from reflectance_fit.capture.ingest import Ingested, ingest
from reflectance_fit.capture.pixel_source import pixel_source
from reflectance_fit.capture.read import read_capture
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable
from reflectance_fit.map_columns import ATTRIBUTES, SCHEMA
from reflectance_fit.map_rows import Together
from reflectance_fit.mapping import MapJob, Tile, Tiles, compute_tile, tiles_of
from reflectance_fit.measured import Note
from reflectance_fit.pixels.status import Status
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior
from reflectance_fit.report.map_file import MapHeader, write_map, write_map_exr
from reflectance_fit.result import Fit
from reflectance_fit.scale.executors import Executor, Task
from reflectance_fit.workflow import fit

Progress = Callable[[str, int, int], None]
Compute = Callable[[MapJob, Tile], None]

TILE = 512
"""Cells on a side of a tile: a worker holds some 20 bytes of each for every frame that it reads."""
_PRIORS = {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}
SAMPLE = 500
"""Of the rows and of the columns, at most: what pictures and medians are made of."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelSummary:
    """One channel of a map.

    ``together`` is what all pixels tell together; ``counts`` are pixels by
    status, ``sample`` is every ``step``-th row and column of the fields.
    """

    channel: str
    wavelength_nm: float
    together: Together
    counts: dict[Status, int]
    sample: dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class MapResult:
    """A finished map: what was seen of each channel, what went wrong, and the files."""

    sample_name: str
    extent: Cells
    step: int
    channels: tuple[ChannelSummary, ...]
    notes: tuple[Note, ...]
    files: tuple[Path, ...]


def map_to_files(
    source: Path,
    out: Path,
    executor: Executor,
    *,
    exr: Path | None = None,
    model: str = "auto",
    tile: int = TILE,
    progress: Progress,
    compute: Compute = compute_tile,
) -> MapResult:
    """Map the photographs of a capture.yaml into ``out`` (NetCDF4), a preview beside it, and ``exr`` if given.

    ``model`` is dielectric, conductor, or auto: what a fit of all pixels
    together chooses, channel by channel.  ``tile`` is the side of a tile in
    cells; the files do not depend on it, nor on the executor.  ``compute``
    is what makes a tile's file.  Frames unpacked and tiles are kept beside
    ``out`` until the map is complete, where every worker must see them.
    """
    for file in (out, exr):
        if file is not None:
            check_writable(file.parent)
    capture = read_capture(source)
    ingested = ingest(capture, progress=progress)
    together, taken = _together(ingested, model)
    with _work_folder(out) as folder:
        pixels = pixel_source(ingested, folder, progress)
        job = MapJob(pixels, together)
        extent = pixels.extent()
        tiles = list(tiles_of(extent, tile, folder))
        lost = _compute(job, tiles, executor, compute, progress)
        notes = [*ingested.measurement.warnings, *taken, *_lost_note(lost, tiles)]
        numbers = Tiles(tiles, frozenset(lost), extent.columns)
        header = _header(ingested, job, extent, notes)
        result = _summary(header, job, extent, numbers, notes, out, exr)
        if exr is not None:
            write_map_exr(exr, header, numbers)
        _write_preview(result, out.with_suffix(".png"))
        write_map(out, header, numbers)
    return result


@contextmanager
def _work_folder(out: Path) -> Iterator[Path]:
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}.unfinished.", dir=out.parent) as folder:
        yield Path(folder).absolute()


def _together(ingested: Ingested, model: str) -> tuple[dict[str, Together], list[Note]]:
    """By channel what all pixels tell together; channels without a frame that counts are left out.

    A fit that cannot tell whether k is 0 keeps it free.  A map that is left to choose takes it as 0 then, and says so:
    pixels could tell nothing else.
    """
    for name, prior in ingested.capture.priors.items():
        if prior.kind == "fixed" and (name, prior.low) != ("k", 0.0):
            message = f"priors fix {name} at {prior.low:g}, which a map does not take; leave it out"
            raise ReflectanceFitError(Problem(str(ingested.capture.path), None, message))
    fits = {one.channel: one for one in fit(ingested.measurement, model=model, posterior="laplace").fits}
    unsure = [one.channel for one in fits.values() if model == "auto" and _could_be_dielectric(one)]
    if unsure:
        transparent = fit(ingested.measurement, model="dielectric", posterior="laplace").fits
        fits |= {one.channel: one for one in transparent if one.channel in unsure}
    notes = [
        Note(
            "K_TAKEN_AS_ZERO",
            f"{channel}: the photographs do not tell k from 0; eta is right if there is none. --model conductor "
            "keeps k free",
        )
        for channel in unsure
    ]
    own = [n for n, prior in ingested.capture.priors.items() if prior.kind != "fixed" and prior != _PRIORS[n]]
    if own:
        message = f"the priors of {' and '.join(own)} count for all pixels together; each by itself has the usual ones"
        notes.append(Note("PRIORS_NOT_USED", message))
    return {channel: Together.of(one) for channel, one in fits.items()}, notes


def _could_be_dielectric(found: Fit) -> bool:
    """Whether k = 0 is as good as the k that was found."""
    best = min(found.candidates, key=lambda candidate: candidate.bic)
    return found.optimum.model == "conductor" and best.name == "dielectric"


def _compute(
    job: MapJob, tiles: list[Tile], executor: Executor, compute: Compute, progress: Progress
) -> dict[Path, str]:
    """The tiles that could not be computed, with the reason; ReflectanceFitError where there is no other."""
    lost: dict[Path, str] = {}
    tasks = (Task(str(tile.path), compute, (job, tile)) for tile in tiles)
    for done, outcome in enumerate(executor.run(tasks), 1):
        if outcome.failure is not None:
            lost[Path(outcome.key)] = outcome.failure
        progress("estimating tiles", done, len(tiles))
    if len(lost) == len(tiles):
        raise ReflectanceFitError(next(iter(lost.values())))
    return lost


def _lost_note(lost: dict[Path, str], tiles: list[Tile]) -> Iterator[Note]:
    if lost:
        reasons = "; ".join(sorted(set(lost.values())))
        yield Note(
            "TILES_LOST", f"{len(lost)} of {len(tiles)} tiles could not be computed and are masked: {reasons}"
        )


def _header(ingested: Ingested, job: MapJob, extent: Cells, notes: list[Note]) -> MapHeader:
    capture = ingested.capture
    middle = (extent.pitch - 1) / 2
    attributes: dict[str, Any] = {
        "Conventions": ATTRIBUTES["Conventions"],
        "schema": SCHEMA,
        "title": f"refractive index of {capture.sample_name}, pixel by pixel",
        "sample": capture.sample_name,
        "exterior_ior": capture.exterior_ior,
        "models": {channel: together.model for channel, together in job.channels.items()},
        "warnings": [note._asdict() for note in notes],
        "inputs": [{"file": file, "sha256": sha256} for file, sha256 in ingested.measurement.inputs],
        "version": version("reflectance_fit"),
    }
    if capture.sample_note is not None:
        attributes["note"] = capture.sample_note
    return MapHeader(
        channels={channel: capture.channels[channel].wavelength_nm for channel in job.channels},
        y=extent.top + middle + extent.pitch * np.arange(extent.rows, dtype=np.float64),
        x=extent.left + middle + extent.pitch * np.arange(extent.columns, dtype=np.float64),
        fits=[
            {"eta": t.eta, "eta_sigma": t.eta_sigma, "k": t.k, "k_sigma": t.k_sigma}
            for t in job.channels.values()
        ],
        fields=job.fields,
        flags={int(status): status.name.lower() for status in Status},
        attributes=attributes,
    )


def _summary(
    header: MapHeader,
    job: MapJob,
    extent: Cells,
    tiles: Tiles,
    notes: list[Note],
    out: Path,
    exr: Path | None,
) -> MapResult:
    """Counts of all pixels, and a sample of them."""
    step = max(1, -(-max(extent.rows, extent.columns) // SAMPLE))
    channels = []
    for index, (channel, wavelength_nm) in enumerate(header.channels.items()):
        counts = np.zeros(256, dtype=np.int64)
        sample: dict[str, list[NDArray[Any]]] = {name: [] for name in job.fields}
        for rows in header.bands():
            every = slice(-rows.start % step, None, step)
            for name in job.fields:
                band = tiles.band(name, index, rows)
                # A copy, as a view would keep the band.
                sample[name].append(band[every, ::step].copy())
                if name == "status":
                    counts += np.bincount(band.ravel(), minlength=256)
        found = {status: int(counts[status]) for status in Status if counts[status]}
        joined = {name: np.concatenate(parts) for name, parts in sample.items()}
        channels.append(ChannelSummary(channel, wavelength_nm, job.channels[channel], found, joined))
    files = (out, out.with_suffix(".png"), *([] if exr is None else [exr]))
    return MapResult(
        job.source.capture.sample_name,
        extent,
        step,
        tuple(channels),
        tuple(notes),
        files,
    )


def _write_preview(result: MapResult, path: Path) -> None:
    from reflectance_fit.plot.map import Shown, draw_map
    from reflectance_fit.plot.render import write_figure

    pitch = result.extent.pitch
    flags = {int(status): status.name.lower() for status in Status}
    pictures = [
        Shown(
            f"{c.channel}, {c.wavelength_nm:g} nm",
            c.sample,
            {flags[status]: count / sum(c.counts.values()) for status, count in c.counts.items()},
            flags,
        )
        for c in result.channels
    ]
    place = (result.extent.left, result.extent.top, pitch * result.step)
    write_figure(path, draw_map(result.sample_name, pictures, place))
