"""What is read before the sample: the noise by pairs of frames, the analyzer by a series on a polarized lamp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from reflectance_fit.capture.agreement import check_planes, check_sizes
from reflectance_fit.capture.decoding import Progress, decode, jobs_of
from reflectance_fit.capture.frames import Capture, Exposure
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.noise_frames import compare_files, pairs_of, transfer_of
from reflectance_fit.capture.polarizer_frames import with_polarizer
from reflectance_fit.capture.settings import check_hashes
from reflectance_fit.capture.signals import calibrated
from reflectance_fit.capture.workers import FrameError, RawWorkers


@dataclass(frozen=True, slots=True)
class FirstLooks:
    """What came of the frames that are read first: why some have nothing, those used, and what to tell."""

    errors: dict[Path, str]
    used: set[Path]
    told: list[str]


def first_looks(
    capture: Capture, settings: Mapping[Path, Exposure], progress: Progress | None
) -> tuple[Capture, FirstLooks]:
    """The capture with its noise by pairs of flats and its analyzer by polarizer frames."""
    first = FirstLooks({}, set(), [])
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
        files = jobs_of(capture, settings, lamp)
        means, errors, hashes = decode(capture, files, progress, {})
        check_hashes(capture, hashes)
        check_planes(capture, means)
        check_sizes(capture, settings, means, lamp)
        first.errors.update(errors)
        first.used.update(files)
        series = [
            calibrated(capture, f, settings, means, bins_of(capture, f)) for f in lamp if f.path in means
        ]
        if series:
            capture, told = with_polarizer(capture, series)
            first.told.extend(told)
    return capture, first
