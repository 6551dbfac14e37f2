"""Registers the frames of each view: every frame's shift against the first of its view."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from reflectance_fit.capture.bins import Box, Shift
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.register import LEAST_CORRELATION, Match, Motion, View, match, view_of
from reflectance_fit.capture.workers import FrameError, RawWorkers

Progress = Callable[[str, int, int], None]


def align(
    views: Sequence[Sequence[Path]],
    reading: Reading,
    motion: Motion,
    samples: Mapping[Path, Box],
    progress: Progress | None = None,
) -> tuple[dict[Path, Shift], dict[Path, str]]:
    """Shifts of the frames that were found, and why the others are of no use.

    ``views`` are files by view, ``samples`` the rows and columns of the sample
    in the first of each, where that is less than all.

    What the first frames show waits on the disk, so memory does not grow with
    the number of views; a frame is compared in the process that decodes it.
    """
    shifts: dict[Path, Shift] = {}
    errors: dict[Path, str] = {}
    total = sum(map(len, views))
    with tempfile.TemporaryDirectory() as folder, RawWorkers() as workers:
        firsts = {view[0]: Path(folder) / f"{i}.npy" for i, view in enumerate(views)}

        def told() -> None:
            if progress:
                progress("registering frames", len(shifts) + len(errors), total)

        shown = workers.map((path, write_view, (reading, kept)) for path, kept in firsts.items())
        pitch: dict[Path, int] = {}
        for path, answer in zip(firsts, shown, strict=True):
            if isinstance(answer, FrameError):
                errors[path] = answer.reason
            else:
                pitch[path], shifts[path] = answer, Shift()
            told()
        others = [(path, view[0]) for view in views for path in view[1:]]
        for path, first in others:
            if first in errors:
                errors[path] = f"cannot be registered, because {first.name} {errors[first]}"
                told()
        left = [(path, first) for path, first in others if first not in errors]
        jobs = (
            (path, find, (reading, firsts[first], pitch[first], motion, samples.get(first)))
            for path, first in left
        )
        for (path, first), found in zip(left, workers.map(jobs), strict=True):
            if isinstance(found, FrameError):
                errors[path] = found.reason
            elif found.found:
                shifts[path] = found.shift
            else:
                errors[path] = (
                    f"does not register with {first.name}: correlation {found.correlation:.2f}, "
                    f"and {LEAST_CORRELATION:g} is the least"
                )
            told()
    return shifts, errors


def write_view(path: Path, reading: Reading, kept: Path) -> int:
    """Write what a frame shows to ``kept``; returns its pitch.  Runs in a worker."""
    view = view_of(read_frame(path, reading))
    np.save(kept, view.picture)
    return view.pitch


def find(path: Path, reading: Reading, kept: Path, pitch: int, motion: Motion, sample: Box | None) -> Match:
    """Where a frame shows what that of ``kept`` shows; not found if they differ in size.  Runs in a worker."""
    view, first = view_of(read_frame(path, reading)), View(np.load(kept), pitch)
    if first.picture.shape != view.picture.shape:
        return Match(Shift(), 0.0)
    return match(first, view, motion, sample)
