"""What is read before the sample: the noise by pairs of frames, the analyzer by a series on a polarized lamp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from reflectance_fit.capture.agreement import check_planes, check_sizes
from reflectance_fit.capture.bins import Mask
from reflectance_fit.capture.decoding import Progress, decode, jobs_of
from reflectance_fit.capture.frames import Capture, Exposure
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.noise_frames import Compared, Pair, compare_files, pairs_of, transfer_of
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
        compared = _compared(capture, pairs, progress)
        first.used.update(frame.path for pair, _ in compared for frame in pair)
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


def _compared(
    capture: Capture, pairs: Sequence[Pair], progress: Progress | None
) -> list[tuple[Pair, Compared]]:
    """The pairs that could be read; darks first, for their hot pixels are left out of the flats."""
    found: list[tuple[Pair, Compared]] = []
    hot: Mask | None = None
    with RawWorkers() as workers:
        for dark in (True, False):
            mine = [pair for pair in pairs if pair.is_dark is dark]
            jobs = [(p.first.path, compare_files, (p.second.path, capture.reading, dark, hot)) for p in mine]
            before = len(pairs) - len(mine) if not dark else 0
            for done, (pair, answer) in enumerate(zip(mine, workers.map(jobs), strict=True), before + 1):
                if not isinstance(answer, FrameError):
                    found.append((pair, answer))
                    if answer.hot is not None:
                        hot = answer.hot if hot is None else hot | answer.hot
                if progress:
                    progress("comparing pairs", done, len(pairs))
    return found
