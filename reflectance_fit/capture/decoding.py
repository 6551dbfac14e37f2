"""Which files are read over which bins, and the reading: each file decoded and reduced by a worker, once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from reflectance_fit.capture.bins import Bins, Mask, Shift
from reflectance_fit.capture.calibrate import pixel_noise
from reflectance_fit.capture.frames import Capture, Exposure, Frame, darks_for, flats_for
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.hot import find_hot
from reflectance_fit.capture.reduce import Changed, FrameMeans, reduce_file
from reflectance_fit.capture.reference import references_for
from reflectance_fit.capture.saturation import clipped_alike
from reflectance_fit.capture.survey import views_of
from reflectance_fit.capture.thumbnails import box_over
from reflectance_fit.capture.workers import FrameError, Job, RawWorkers

Progress = Callable[[str, int, int], None]


def served_by(capture: Capture, frame: Frame, settings: Mapping[Path, Exposure]) -> Iterator[Frame]:
    """The frame with all that are reduced over its bins: references, flats, and the darks of each."""
    for one in (frame, *references_for(frame, capture.frames)):
        for shown in (one, *flats_for(one, capture.frames)):
            yield shown
            yield from darks_for(shown, capture.frames, settings)


def jobs_of(
    capture: Capture, settings: Mapping[Path, Exposure], frames: Iterable[Frame]
) -> dict[Path, tuple[Bins, ...]]:
    """Which bins each file is averaged over: a dark or flat over those of every frame it serves."""
    wanted: dict[Path, dict[Bins, None]] = {}
    for frame in frames:
        for file in served_by(capture, frame, settings):
            wanted.setdefault(file.path, {})[bins_of(capture, frame)] = None
    return {path: tuple(bins) for path, bins in wanted.items()}


def shifts_of(
    capture: Capture, frames: Sequence[Frame], progress: Progress | None
) -> tuple[dict[Path, Shift], dict[Path, str]]:
    """By frame its shift against the first of its view, and why others do not register."""
    if capture.registration == "none":
        return {}, {}
    from reflectance_fit.capture.align import (
        align,  # here, for its Fourier transforms and OpenCV take a second
    )

    views = views_of(capture, frames)
    samples = {view[0].path: bins_of(capture, view[0]).box() for view in views if view[0].region}
    files = [[frame.path for frame in view] for view in views]
    return align(files, capture.reading, capture.registration, samples, progress)


def decode(
    capture: Capture,
    jobs: Mapping[Path, tuple[Bins, ...]],
    progress: Progress | None,
    shifts: Mapping[Path, Shift],
    cells: Mapping[Path, Path] | None = None,
    masked: Mask | None = None,
) -> tuple[dict[Path, FrameMeans], dict[Path, str], dict[Path, str]]:
    """Each file's means, why the others have none, and the sha256 of those that a worker read.

    ``cells`` are the files that their pictures over cells are written to,
    ``masked`` are pixels left out beside the hot ones, which are the sensor's:
    these are the scene's, and a frame that is shifted shows them elsewhere.
    """
    if not jobs:
        return {}, {}, {}
    box = box_over(one for bins in jobs.values() for one in bins)
    means: dict[Path, FrameMeans] = {}
    hashes: dict[Path, str] = {}
    frames = {frame.path: frame for frame in capture.frames}

    with RawWorkers() as workers:
        darks = [path for path in jobs if frames[path].role == "dark"]
        hot, errors = _hot(capture, darks, workers, progress)
        left = [path for path in jobs if path not in errors]

        def work() -> Iterator[Job[FrameMeans | Changed]]:
            for path in left:
                frame = frames[path]
                noise = pixel_noise(capture, frame) if frame.role == "sample" else None
                is_flat, picture = frame.role == "flat", (box, cells[path]) if cells else None
                shift = shifts.get(path)
                there = masked if masked is None or shift is None else masked.moved(shift)
                view = is_flat, shift, _both(hot, there)
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


def _both(hot: Mask | None, masked: Mask | None) -> Mask | None:
    """What either leaves out; darks of another size are told of when frames and darks are compared."""
    if hot is None or masked is None:
        return hot or masked
    return hot | masked if hot.shape == masked.shape else masked


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
