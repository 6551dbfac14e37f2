"""A capture's photographs to observations: decoded apart, reduced, calibrated, one row a bin."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from reflectance_fit.capture.align import align
from reflectance_fit.capture.balance import check_balance, check_cells
from reflectance_fit.capture.bins import Bins, Mask, Shift
from reflectance_fit.capture.brackets import merged
from reflectance_fit.capture.calibrate import Calibrated, calibrate, pixel_noise
from reflectance_fit.capture.frames import Ball, Capture, Exposure, Frame, Sphere, darks_for, flats_for
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.hot import find_hot
from reflectance_fit.capture.linearity import nonlinear
from reflectance_fit.capture.locate import locate
from reflectance_fit.capture.noise_frames import compare_files, pairs_of, transfer_of
from reflectance_fit.capture.observe import angle_rows, flat_rows
from reflectance_fit.capture.polarizer_frames import with_polarizer
from reflectance_fit.capture.reduce import Changed, FrameMeans, reduce_file
from reflectance_fit.capture.reference import check_references, references_for, relative_to
from reflectance_fit.capture.saturation import clipped_alike
from reflectance_fit.capture.settings import check_hashes, read_settings
from reflectance_fit.capture.survey import survey, views_of
from reflectance_fit.capture.thumbnails import box_over
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
    sample frame, ``settings`` every file's exposure and ISO, ``told`` what the
    calibration frames say, a line each.
    """

    capture: Capture
    measurement: Measurement
    samples: tuple[Calibrated, ...]
    rejected: dict[str, str]
    unused: frozenset[str]
    settings: dict[Path, Exposure]
    told: tuple[str, ...]


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
    check_references(capture)
    capture, rejected = locate(capture, progress)
    capture, first = _first_looks(capture, settings, progress)
    located = [frame for frame in capture.role("sample") if frame.file not in rejected]
    shifts, lost = _shifts(capture, located, progress)
    jobs = _jobs(capture, settings, [frame for frame in located if frame.path not in lost])
    with tempfile.TemporaryDirectory() as folder:
        cells = {path: Path(folder) / f"{number}.npz" for number, path in enumerate(jobs)}
        means, errors, hashes = _decode(capture, jobs, progress, shifts, cells)
        there = [frame for frame in located if frame.path in means]
        looked = survey(capture, settings, {path: cells[path] for path in means}, there, seen)
    if looked.mask:
        again = {path: jobs[path] for path in means}
        means, _, _ = _decode(capture, again, progress, shifts, masked=looked.mask)
    errors = first.errors | lost | errors
    hashes |= {frame.path: sha256_of(frame.path) for frame in capture.frames if frame.path not in hashes}
    check_hashes(capture, hashes)
    rejected |= {frame.file: errors[frame.path] for frame in capture.frames if frame.path in errors}
    rejected |= looked.rejected
    _check_planes(capture, means)
    _check_sizes(capture, settings, means, capture.role("sample"))
    unused_bits = _unused_bits(capture, means)
    for frame in capture.role("sample"):
        # Among frames that are divided by their flats it would be out of proportion.
        flats = flats_for(frame, capture.frames)
        if flats and not any(flat.path in means for flat in flats):
            rejected.setdefault(frame.file, "has lost all of its flats")
        references = references_for(frame, capture.frames)
        if references and not any(r.path in means for r in references):
            rejected.setdefault(frame.file, "has lost its reference")
    samples = [
        _compared(capture, frame, settings, means)
        for frame in capture.role("sample")
        if frame.file not in rejected
    ]
    if not samples:
        problems = [Problem(str(capture.path), None, f"{file} {reason}") for file, reason in rejected.items()]
        raise ReflectanceFitError(problems)
    rows_of = angle_rows if isinstance(capture.geometry, Sphere | Ball) else flat_rows
    views = merged(samples)
    observations = rows_of(capture, views)
    stated = capture.nuisances
    notes = [Note("ROWS_IGNORED", f"{file} {reason}") for file, reason in rejected.items()]
    notes += looked.notes
    white = [
        _flat_alone(capture, flat, settings, means) for flat in capture.role("flat") if flat.path in means
    ]
    notes += [Note("NOT_LINEAR", text) for text in nonlinear([*samples, *white])]
    notes += check_balance(capture, views)
    notes += check_cells(capture, means)
    if not all(
        _knows_noise(capture, means[s.frame.path], plane.channel) for s in samples for plane in s.signals
    ):
        message = "sigma is from how neighbouring pixels of the flats differ, their own differences included"
        if capture.role("flat"):
            notes.append(Note("SIGMA_ESTIMATED", f"{message}; take the flats and a dark in pairs"))
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
    used = set(jobs) | first.used | {frame.path for frame in capture.role("geometry")}
    unused = frozenset(f.file for f in capture.frames if f.path not in used and f.file not in rejected)
    told = (*first.told, *unused_bits)
    return Ingested(capture, measurement, tuple(samples), rejected, unused, settings, told)


@dataclass(frozen=True, slots=True)
class _FirstLooks:
    """What came of the frames that are read first: why some have nothing, those used, and what to tell."""

    errors: dict[Path, str]
    used: set[Path]
    told: list[str]


def _first_looks(
    capture: Capture, settings: Mapping[Path, Exposure], progress: Progress | None
) -> tuple[Capture, _FirstLooks]:
    """The capture with its noise by pairs of flats and its analyzer by polarizer frames."""
    first = _FirstLooks({}, set(), [])
    if pairs := pairs_of(capture, settings):
        jobs = [(p.first.path, compare_files, (p.second.path, capture.reading, p.is_dark)) for p in pairs]
        compared = []
        with RawWorkers() as workers:
            for done, (pair, answer) in enumerate(zip(pairs, workers.map(jobs), strict=True), 1):
                if not isinstance(answer, FrameError):
                    compared.append((pair, answer))
                    first.used.update((pair.first.path, pair.second.path))
                if progress:
                    progress("comparing pairs", done, len(pairs))
        capture = replace(capture, transfer=transfer_of(capture, compared))
        first.told.extend(f"{channel}: {noise}" for channel, noise in capture.transfer.items())
    if lamp := capture.role("polarizer"):
        files = _jobs(capture, settings, lamp)
        means, errors, hashes = _decode(capture, files, progress, {})
        check_hashes(capture, hashes)
        _check_planes(capture, means)
        _check_sizes(capture, settings, means, lamp)
        first.errors.update(errors)
        first.used.update(files)
        series = [
            _calibrated(capture, f, settings, means, bins_of(capture, f)) for f in lamp if f.path in means
        ]
        if series:
            capture, told = with_polarizer(capture, series)
            first.told.extend(told)
    return capture, first


def _served_by(capture: Capture, frame: Frame, settings: Mapping[Path, Exposure]) -> Iterator[Frame]:
    """The frame with all that are reduced over its bins: references, flats, and the darks of each."""
    for one in (frame, *references_for(frame, capture.frames)):
        for shown in (one, *flats_for(one, capture.frames)):
            yield shown
            yield from darks_for(shown, capture.frames, settings)


def _jobs(
    capture: Capture, settings: Mapping[Path, Exposure], frames: Iterable[Frame]
) -> dict[Path, tuple[Bins, ...]]:
    """Which bins each file is averaged over: a dark or flat over those of every frame it serves."""
    wanted: dict[Path, dict[Bins, None]] = {}
    for frame in frames:
        for file in _served_by(capture, frame, settings):
            wanted.setdefault(file.path, {})[bins_of(capture, frame)] = None
    return {path: tuple(bins) for path, bins in wanted.items()}


def _shifts(
    capture: Capture, frames: Sequence[Frame], progress: Progress | None
) -> tuple[dict[Path, Shift], dict[Path, str]]:
    """By frame its shift against the first of its view, and why others do not register."""
    if capture.registration == "none":
        return {}, {}
    views = views_of(capture, frames)
    samples = {view[0].path: bins_of(capture, view[0]).box() for view in views if view[0].region}
    files = [[frame.path for frame in view] for view in views]
    return align(files, capture.reading, capture.registration, samples, progress)


def _decode(
    capture: Capture,
    jobs: Mapping[Path, tuple[Bins, ...]],
    progress: Progress | None,
    shifts: Mapping[Path, Shift],
    cells: Mapping[Path, Path] | None = None,
    masked: Mask | None = None,
) -> tuple[dict[Path, FrameMeans], dict[Path, str], dict[Path, str]]:
    """Each file's means, why the others have none, and the sha256 of those that a worker read.

    ``cells`` are the files that their pictures over cells are written to,
    ``masked`` are pixels left out beside the hot ones.
    """
    if not jobs:
        return {}, {}, {}
    box = box_over(one for bins in jobs.values() for one in bins)
    means: dict[Path, FrameMeans] = {}
    hashes: dict[Path, str] = {}
    frames = {frame.path: frame for frame in capture.frames}

    with RawWorkers() as workers:
        darks = [path for path in jobs if frames[path].role == "dark"]
        mask, errors = _hot(capture, darks, workers, progress)
        if masked is not None:
            mask = masked if mask is None or mask.shape != masked.shape else mask | masked
        left = [path for path in jobs if path not in errors]

        def work() -> Iterator[Job[FrameMeans | Changed]]:
            for path in left:
                frame = frames[path]
                noise = pixel_noise(capture, frame) if frame.role == "sample" else None
                is_flat, picture = frame.role == "flat", (box, cells[path]) if cells else None
                view = is_flat, shifts.get(path), mask
                args = capture.reading, frame.sha256, jobs[path], *view, noise, picture
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


def _compared(
    capture: Capture, frame: Frame, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> Calibrated:
    """A sample frame's signals, over those of its references where there are any."""
    bins = bins_of(capture, frame)
    sample = _calibrated(capture, frame, settings, means, bins)
    references = [
        _calibrated(capture, reference, settings, means, bins)
        for reference in references_for(frame, capture.frames)
        if reference.path in means
    ]
    return relative_to(capture, sample, references) if references else sample


def _calibrated(
    capture: Capture,
    frame: Frame,
    settings: Mapping[Path, Exposure],
    means: Mapping[Path, FrameMeans],
    bins: Bins,
) -> Calibrated:
    def darks(one: Frame) -> list[FrameMeans]:
        return [means[d.path] for d in darks_for(one, capture.frames, settings) if d.path in means]

    flats = [
        (means[flat.path], float(settings[flat.path].seconds or math.nan), darks(flat))
        for flat in flats_for(frame, capture.frames)
        if flat.path in means
    ]
    return calibrate(capture, frame, settings[frame.path], bins, means[frame.path], darks(frame), flats)


def _knows_noise(capture: Capture, means: FrameMeans, channel: str) -> bool:
    told = set(means.noise or ()) | set(capture.transfer)
    return capture.noise is not None or channel in told or "mono" in told


def _unused_bits(capture: Capture, means: Mapping[Path, FrameMeans]) -> list[str]:
    """What to tell of counts that were left-justified; the frames must all be alike."""
    found = {frame.path: means[frame.path].unused_bits for frame in capture.frames if frame.path in means}
    most = max(found.values(), default=0)
    for frame in capture.frames:
        if found.get(frame.path, most) != most:
            message = f"{frame.file} leaves {found[frame.path]} low bits empty and others {most}; use one pixel format"
            raise ReflectanceFitError(Problem(str(capture.path), frame.line, message))
    return [f"counts are multiples of {2**most}, and were divided by that"] if most else []


def _flat_alone(
    capture: Capture, flat: Frame, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> Calibrated:
    """A flat's own signal, over the bins of the first frame it serves."""
    darks = [means[d.path] for d in darks_for(flat, capture.frames, settings) if d.path in means]
    own = means[flat.path]
    return calibrate(capture, flat, settings[flat.path], own.bins[0], own, darks, [])


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
    capture: Capture,
    settings: Mapping[Path, Exposure],
    means: Mapping[Path, FrameMeans],
    frames: Iterable[Frame],
) -> None:
    """The region or the ball must be in the picture, and darks and flats must show the same pixels."""
    problems = []
    for frame in frames:
        if frame.path not in means:
            continue
        bins = bins_of(capture, frame)
        others = {one.path: one for one in _served_by(capture, frame, settings) if one is not frame}
        own = [plane.pixels for plane in means[frame.path].over(bins).values()]
        if not sum(int(pixels.sum()) for pixels in own):
            what = "ball" if isinstance(capture.geometry, Sphere | Ball) else "region"
            message = f"{frame.file} does not show the {what}: it is outside the picture; correct it"
            problems.append(Problem(str(capture.path), frame.line, message))
        for other in others.values():
            if other.path in means and means[other.path].shape != means[frame.path].shape:
                message = f"{other.file} is not of the size of {frame.file}; use frames of one camera setting"
                problems.append(Problem(str(capture.path), other.line, message))
    if problems:
        raise ReflectanceFitError(sorted(set(problems), key=lambda p: p.line or 0))
