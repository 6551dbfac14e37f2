"""A capture's photographs to observations: decoded apart, reduced, calibrated, one row a bin."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from reflectance_fit.capture.bins import Bins, Mask
from reflectance_fit.capture.brackets import brackets, merged
from reflectance_fit.capture.calibrate import Calibrated, calibrate
from reflectance_fit.capture.frames import Ball, Capture, Exposure, Frame, Sphere, darks_for, flats_for
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.hot import find_hot
from reflectance_fit.capture.linearity import complaints, departures
from reflectance_fit.capture.locate import locate
from reflectance_fit.capture.observe import angle_rows, flat_rows
from reflectance_fit.capture.reduce import Changed, FrameMeans, reduce_file
from reflectance_fit.capture.saturation import clipped_alike
from reflectance_fit.capture.settings import check_hashes, read_settings
from reflectance_fit.capture.workers import FrameError, Job, RawWorkers
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import sha256_of
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.nuisances import nuisance_sigmas

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


def ingest(capture: Capture, *, progress: Progress | None = None) -> Ingested:
    """Decode, reduce and calibrate every frame of ``capture``.

    ``progress`` is called with (what, frames done, frames in all).  Raises
    ReflectanceFitError for hashes that do not match, unknown exposures, mixed
    ISO, files that are no raw photographs, and captures of which nothing is
    left.  A file that kills its decoder costs that frame and a warning.
    """
    settings = read_settings(capture)
    capture, rejected = locate(capture, progress)
    jobs = _jobs(capture, settings, rejected)
    means, errors, hashes = _decode(capture, jobs, progress)
    hashes |= {frame.path: sha256_of(frame.path) for frame in capture.frames if frame.path not in hashes}
    check_hashes(capture, hashes)
    rejected |= {frame.file: errors[frame.path] for frame in capture.frames if frame.path in errors}
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
    rows_of = angle_rows if isinstance(capture.geometry, Sphere | Ball) else flat_rows
    observations = rows_of(capture, merged(samples))
    stated = capture.nuisances
    notes = [Note("ROWS_IGNORED", f"{file} {reason}") for file, reason in rejected.items()]
    white = [
        _flat_alone(capture, flat, settings, means) for flat in capture.role("flat") if flat.path in means
    ]
    notes += [Note("NOT_LINEAR", text) for text in _nonlinear([*samples, *white])]
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
    # Frames of role geometry have served when they were not rejected.
    serves = {frame.path for frame in capture.role("geometry")} | set(jobs)
    unused = frozenset(f.file for f in capture.frames if f.path not in serves and f.file not in rejected)
    return Ingested(capture, measurement, tuple(samples), rejected, unused, settings)


def _jobs(
    capture: Capture, settings: Mapping[Path, Exposure], rejected: Container[str]
) -> dict[Path, tuple[Bins, ...]]:
    """Which bins each file is averaged over: a dark or flat over those of every frame it serves."""
    wanted: dict[Path, dict[Bins, None]] = {}
    for frame in capture.role("sample"):
        if frame.file in rejected:
            continue
        flats = flats_for(frame, capture.frames)
        darks = [dark for one in (frame, *flats) for dark in darks_for(one, capture.frames, settings)]
        for file in (frame, *flats, *darks):
            wanted.setdefault(file.path, {})[bins_of(capture, frame)] = None
    return {path: tuple(bins) for path, bins in wanted.items()}


def _decode(
    capture: Capture, jobs: Mapping[Path, tuple[Bins, ...]], progress: Progress | None
) -> tuple[dict[Path, FrameMeans], dict[Path, str], dict[Path, str]]:
    """Each file's means, why the others have none, and the sha256 of those that a worker read."""
    means: dict[Path, FrameMeans] = {}
    hashes: dict[Path, str] = {}
    frames = {frame.path: frame for frame in capture.frames}

    with RawWorkers() as workers:
        darks = [path for path in jobs if frames[path].role == "dark"]
        mask, errors = _hot(capture, darks, workers, progress)
        left = [path for path in jobs if path not in errors]

        def work() -> Iterator[Job[FrameMeans | Changed]]:
            for path in left:
                frame = frames[path]
                args = capture.reading, frame.sha256, jobs[path], frame.role == "flat", None, mask
                yield path, reduce_file, args

        for done, (path, answer) in enumerate(zip(left, workers.map(work()), strict=True), 1):
            match answer:
                case FrameError():
                    errors[path] = answer.reason
                case Changed():
                    hashes[path] = answer.sha256
                case _:
                    hashes[path] = answer.sha256
                    means[path] = answer
            if progress:
                progress("reading frames", done, len(left))
    return clipped_alike(means), errors, hashes


def _hot(
    capture: Capture, darks: Sequence[Path], workers: RawWorkers, progress: Progress | None
) -> tuple[Mask | None, dict[Path, str]]:
    """The pixels that are hot in any of ``darks``, None without darks; and why the others do not tell."""
    mask: Mask | None = None
    errors: dict[Path, str] = {}
    answers = workers.map((path, find_hot, (capture.reading,)) for path in darks)
    for done, (path, answer) in enumerate(zip(darks, answers, strict=True), 1):
        if isinstance(answer, FrameError):
            errors[path] = answer.reason
        elif mask is None:
            mask = answer
        elif mask.shape == answer.shape:  # one of another size is told of when frames and darks are compared
            mask = mask | answer
        if progress:
            progress("looking for hot pixels", done, len(darks))
    return mask, errors


def _calibrated(
    capture: Capture, frame: Frame, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> Calibrated:
    def darks(one: Frame) -> list[FrameMeans]:
        return [means[d.path] for d in darks_for(one, capture.frames, settings) if d.path in means]

    flats = [
        (means[flat.path], float(settings[flat.path].seconds or math.nan), darks(flat))
        for flat in flats_for(frame, capture.frames)
        if flat.path in means
    ]
    return calibrate(
        capture, frame, settings[frame.path], bins_of(capture, frame), means[frame.path], darks(frame), flats
    )


def _flat_alone(
    capture: Capture, flat: Frame, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> Calibrated:
    """A flat's own signal, over the bins of the first frame it serves."""
    darks = [means[d.path] for d in darks_for(flat, capture.frames, settings) if d.path in means]
    own = means[flat.path]
    return calibrate(capture, flat, settings[flat.path], own.bins[0], own, darks, [])


def _nonlinear(frames: Sequence[Calibrated]) -> Iterator[str]:
    """What is to be said of views seen at several exposures."""
    for view in brackets(frames):
        alike = [s for s in view if s.bins == view[0].bins]
        for plane in view[0].signals:
            found = departures([(s.exposure.seconds or Fraction(1), s.signals[plane]) for s in alike])
            files = ", ".join(s.frame.file for s in alike)
            yield from complaints(found, f"{files}, {plane.channel}")


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
            what = "ball" if isinstance(capture.geometry, Sphere | Ball) else "region"
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
