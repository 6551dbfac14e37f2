"""A capture's photographs to observations: decoded apart, reduced, calibrated, one row a bin."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reflectance_fit.capture.align import align
from reflectance_fit.capture.bins import Bins, Mask, Shift
from reflectance_fit.capture.calibrate import Calibrated, calibrate
from reflectance_fit.capture.cells import box_over
from reflectance_fit.capture.frames import Capture, Exposure, Frame, Sphere, Stated, darks_for, flats_for
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.observe import angle_rows, flat_rows
from reflectance_fit.capture.reduce import Changed, FrameMeans, reduce_file
from reflectance_fit.capture.settings import check_hashes, read_settings
from reflectance_fit.capture.survey import survey, views_of
from reflectance_fit.capture.workers import FrameError, Job, RawWorkers
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import sha256_of
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.nuisances import nuisance_sigmas
from reflectance_fit.views import ViewMaps

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class Ingested:
    """What a fit needs, and what became of every photograph.

    ``samples`` are the sample frames that were used, ``rejected`` maps the
    others' files to the reason, ``unused`` are darks and flats that serve no
    sample frame, ``settings`` every file's exposure and ISO.
    """

    capture: Capture
    measurement: Measurement
    samples: tuple[Calibrated, ...]
    rejected: dict[str, str]
    unused: frozenset[str]
    settings: dict[Path, Exposure]


def ingest(
    capture: Capture, *, progress: Progress | None = None, seen: Callable[[ViewMaps], None] | None = None
) -> Ingested:
    """Decode, reduce and calibrate every frame of ``capture``.

    ``progress`` is called with (what, frames done, frames in all), ``seen``
    with what each view shows.  Raises
    ReflectanceFitError for hashes that do not match, unknown exposures, mixed
    ISO, files that are no raw photographs, and captures of which nothing is
    left.  A file that kills its decoder costs that frame and a warning.
    """
    settings = read_settings(capture)
    jobs = _jobs(capture, settings)
    shifts, lost = _shifts(capture, progress)
    jobs = {path: bins for path, bins in jobs.items() if path not in lost}
    with tempfile.TemporaryDirectory() as folder:
        cells = {path: Path(folder) / f"{number}.npz" for number, path in enumerate(jobs)}
        means, errors, hashes = _decode(capture, jobs, progress, shifts, cells)
        shown = {path: cells[path] for path in means}
        looked = survey(
            capture, settings, shown, [f for f in capture.role("sample") if f.path in means], seen
        )
    if looked.mask:
        means, _, _ = _decode(
            capture, {path: jobs[path] for path in means}, progress, shifts, mask=looked.mask
        )
    errors |= lost
    hashes |= {frame.path: sha256_of(frame.path) for frame in capture.frames if frame.path not in hashes}
    check_hashes(capture, hashes)
    rejected = {frame.file: errors[frame.path] for frame in capture.frames if frame.path in errors}
    rejected |= looked.rejected
    _check_planes(capture, means)
    _check_sizes(capture, settings, means)
    for frame in capture.role("sample"):
        # Among frames that are divided by their flats it would be out of proportion.
        flats = flats_for(frame, capture.frames)
        if flats and not any(flat.path in means for flat in flats):
            rejected.setdefault(frame.file, "has lost all of its flats")
    samples = [
        _calibrated(capture, frame, settings, means)
        for frame in capture.role("sample")
        if frame.file not in rejected
    ]
    if not samples:
        problems = [Problem(str(capture.path), None, f"{file} {reason}") for file, reason in rejected.items()]
        raise ReflectanceFitError(problems)
    observations = (flat_rows if isinstance(capture.geometry, Stated) else angle_rows)(capture, samples)
    stated = capture.nuisances
    notes = [Note("ROWS_IGNORED", f"{file} {reason}") for file, reason in rejected.items()]
    notes += looked.notes
    if any(frame.sha256 is None for frame in capture.frames):
        notes.append(
            Note("NO_HASHES", "a damaged photograph can pass unnoticed; ingest --write-hashes states them")
        )
    measurement = Measurement(
        path=capture.path,
        sample_name=capture.sample_name,
        exterior_ior=capture.exterior_ior,
        observations=observations,
        nuisances=None if stated is None else nuisance_sigmas(stated, capture.document, observations),
        priors=capture.priors,
        warnings=tuple(notes),
        inputs=(*capture.inputs, *((frame.file, hashes[frame.path]) for frame in capture.frames)),
        sample_note=capture.sample_note,
    )
    unused = frozenset(frame.file for frame in capture.frames if frame.path not in jobs)
    return Ingested(capture, measurement, tuple(samples), rejected, unused, settings)


def _jobs(capture: Capture, settings: Mapping[Path, Exposure]) -> dict[Path, tuple[Bins, ...]]:
    """Which bins each file is averaged over: a dark or flat over those of every frame it serves."""
    wanted: dict[Path, dict[Bins, None]] = {}
    for frame in capture.role("sample"):
        flats = flats_for(frame, capture.frames)
        darks = [dark for one in (frame, *flats) for dark in darks_for(one, capture.frames, settings)]
        for file in (frame, *flats, *darks):
            wanted.setdefault(file.path, {})[bins_of(capture, frame)] = None
    return {path: tuple(bins) for path, bins in wanted.items()}


def _shifts(capture: Capture, progress: Progress | None) -> tuple[dict[Path, Shift], dict[Path, str]]:
    """By frame its shift against the first of its view, and why others do not register."""
    if capture.registration == "none":
        return {}, {}
    views = [[frame.path for frame in view] for view in views_of(capture, capture.role("sample"))]
    return align(views, capture.reading, capture.registration, progress)


def _decode(
    capture: Capture,
    jobs: Mapping[Path, tuple[Bins, ...]],
    progress: Progress | None,
    shifts: Mapping[Path, Shift],
    cells: Mapping[Path, Path] | None = None,
    mask: Mask | None = None,
) -> tuple[dict[Path, FrameMeans], dict[Path, str], dict[Path, str]]:
    """Each file's means, why the others have none, and the sha256 of those that a worker read.

    ``cells`` are the files that their pictures over cells are written to.
    """
    means: dict[Path, FrameMeans] = {}
    errors: dict[Path, str] = {}
    hashes: dict[Path, str] = {}
    frames = {frame.path: frame for frame in capture.frames}
    box = box_over(one for bins in jobs.values() for one in bins)

    def work() -> Iterator[Job[FrameMeans | Changed]]:
        for path, bins in jobs.items():
            frame = frames[path]
            picture = (box, cells[path]) if cells else None
            is_flat = frame.role == "flat"
            args = capture.reading, frame.sha256, bins, is_flat, shifts.get(path), mask, picture
            yield path, reduce_file, args

    with RawWorkers() as workers:
        for done, (path, answer) in enumerate(zip(jobs, workers.map(work()), strict=True), 1):
            match answer:
                case FrameError():
                    errors[path] = answer.reason
                case Changed():
                    hashes[path] = answer.sha256
                case _:
                    hashes[path] = answer.sha256
                    means[path] = answer
            if progress:
                progress("reading frames", done, len(jobs))
    return means, errors, hashes


def _calibrated(
    capture: Capture, frame: Frame, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> Calibrated:
    def darks(one: Frame) -> list[FrameMeans]:
        return [means[d.path] for d in darks_for(one, capture.frames, settings) if d.path in means]

    flats = [
        (means[flat.path], settings[flat.path].seconds or 1.0, darks(flat))
        for flat in flats_for(frame, capture.frames)
        if flat.path in means
    ]
    return calibrate(
        capture, frame, settings[frame.path], bins_of(capture, frame), means[frame.path], darks(frame), flats
    )


def _check_planes(capture: Capture, means: Mapping[Path, FrameMeans]) -> None:
    """A colour sensor stated mono, or the other way round, is the manifest's fault: say it once."""
    sensor = capture.reading.sensor
    for frame in capture.frames:
        if frame.path in means:
            planes = list(means[frame.path].planes[0])
            has = sorted({plane.channel for plane in planes})
            found = ("mono" in has, planes[0].axis_deg is not None)
            if found != (sensor in ("mono", "dofp"), sensor in ("dofp", "dofp_bayer")):
                message = f"{frame.file} has the planes {', '.join(has)}, but camera.sensor says {sensor}; correct it"
                raise ReflectanceFitError(Problem(str(capture.path), frame.line, message))


def _check_sizes(
    capture: Capture, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> None:
    """The region or the ball must be in the picture, and darks and flats must show the same pixels."""
    problems = []
    for frame in capture.role("sample"):
        if frame.path not in means:
            continue
        bins = bins_of(capture, frame)
        flats = flats_for(frame, capture.frames)
        others = {d.path: d for one in (frame, *flats) for d in darks_for(one, capture.frames, settings)}
        others |= {flat.path: flat for flat in flats}
        own = [plane.pixels for plane in means[frame.path].over(bins).values()]
        if not sum(int(pixels.sum()) for pixels in own):
            what = "ball" if isinstance(capture.geometry, Sphere) else "region"
            message = f"{frame.file} does not show the {what}: it is outside the picture; correct it"
            problems.append(Problem(str(capture.path), frame.line, message))
        for other in others.values():
            if other.path in means:
                theirs = [plane.pixels for plane in means[other.path].over(bins).values()]
                if not all(map(np.array_equal, own, theirs)):
                    message = (
                        f"{other.file} is not of the size of {frame.file}; use frames of one camera setting"
                    )
                    problems.append(Problem(str(capture.path), other.line, message))
    if problems:
        raise ReflectanceFitError(sorted(set(problems), key=lambda p: p.line or 0))
