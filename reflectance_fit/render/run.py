"""Rendering: tiles on all cores, groups of samples that tell the error, and when to stop."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render.develop import develop, standard_error
from reflectance_fit.render.film import Film
from reflectance_fit.render.kernels import lanes
from reflectance_fit.render.kernels.path import summed, trace
from reflectance_fit.render.pack import Packed, pack
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Settings

Floats = NDArray[np.float64]

# Sides of a tile, in pixels; the larger, the fewer paths a pixel has.
_TILE, _LARGEST_TILE = 16, 64
# Paths in one call of the kernel: many times the lanes, so that few idle at its end, and what a call costs is little.
_PATHS = 65536
# Tiles that a picture has at least, where that is possible: several for each thread.
_TILES = 64
# Groups at least, each with its own scrambling; their spread is the error.
_GROUPS = 16
# With a target of error: samples in a group at most, so that it is looked at early.
_SAMPLES_TO_TARGET = 8


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a render is: paths a pixel, done and at most; seconds; standard error over the mean, once known."""

    samples: float
    total: int
    seconds: float
    error: float | None


class _Job(NamedTuple):
    left: int
    top: int
    width: int
    height: int
    first: int
    groups: int


def render(
    scene: Scene,
    settings: Settings,
    progress: Callable[[Progress], None] | None = None,
    threads: int | None = None,
) -> Film:
    """Trace the scene's picture.

    Parameters
    ----------
    scene : Scene
    settings : Settings
        ``samples`` that 16 divides, 16 times a power of two best, serve the Sobol sequence.
    progress : callable, optional
        Called from this thread after every tile.
    threads : int, optional
        All cores by default; the picture does not depend on it.

    Returns
    -------
    Film
        Its error is the spread of the means of 16 groups of samples or more (as many as there are samples, below
        16); NaN with a single sample.  A sample that is not a number is left out and counted in ``discarded``.

    Raises
    ------
    ValueError
        If the scene has no light, or an approximate Fresnel form meets a polarized mode.

    Notes
    -----
    Each picture is the same whatever the number of threads: samples are drawn by their number, and tiles are added
    up in one order.
    """
    packed = pack(scene, settings)
    size = _group_size(settings)
    most = settings.samples // size
    width, height = scene.camera.size_px
    rows = max(len(packed.has.rows), 1)
    entries = (3 if packed.has.spectral else len(packed.has.channels)) * rows
    total = np.zeros((height, width, entries))
    squares = np.zeros_like(total)
    discarded, done, started = 0, 0, time.perf_counter()
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        while done < most:
            groups = min(_GROUPS, most - done) if settings.error is not None else most
            jobs = list(_jobs(width, height, done, groups, size))
            found = [pool.submit(_trace, packed, scene, settings, job, size, entries) for job in jobs]
            error = _share(total, squares, done, rows)
            try:
                pixels = 0
                for job, future in zip(jobs, found, strict=True):
                    sums, lost = future.result()
                    discarded += lost
                    lines = slice(job.top, job.top + job.height)
                    columns = slice(job.left, job.left + job.width)
                    total[lines, columns] += sums[0]
                    squares[lines, columns] += sums[1]
                    pixels += job.width * job.height * job.groups
                    if progress is not None:
                        samples = (done + pixels / (width * height)) * size
                        progress(Progress(samples, most * size, time.perf_counter() - started, error))
            except BaseException:
                _cancel(found)
                raise
            done += groups
            reached = _share(total, squares, done, rows)
            if settings.error is not None and reached is not None and reached <= settings.error:
                break
    return develop(scene, settings, packed, total, squares, done, size, discarded)


def _trace(
    packed: Packed, scene: Scene, settings: Settings, job: _Job, size: int, entries: int
) -> tuple[Floats, int]:
    """Sums over groups of their means and of these squared, shape (2, height, width, entries); how many were discarded."""
    has, tables = packed.has, packed.tables
    shape = (job.height, job.width, entries)
    work = _workspace(job.groups * math.prod(shape), lanes.floats(has), tables.shapes.dtype)
    discarded = trace(
        has, tables, work.floats, work.words, work.beside, work.words_beside, work.queue, work.film,
        job.left, job.top, job.width, job.height, job.first, job.groups, size,
        scene.camera.size_px[0], settings.seed, scene.max_depth, *packed.parts,
    )  # fmt: skip
    return summed(work.film, job.groups, math.prod(shape), 1.0 / size).reshape(2, *shape), discarded


class _Workspace(NamedTuple):
    film: Floats
    floats: NDArray[Any]
    words: lanes.Words
    beside: NDArray[Any]
    words_beside: lanes.Words
    queue: NDArray[Any]


_OF_THREAD = threading.local()


def _workspace(film: int, floats: int, dtype: np.dtype[Any]) -> _Workspace:
    """Arrays of this thread, as long as it needs them; the film is dark.  New memory for each tile would cost a tenth."""
    work: _Workspace | None = getattr(_OF_THREAD, "work", None)
    if work is None or work.film.size < film or work.floats.size != floats or work.floats.dtype != dtype:
        work = _Workspace(
            np.zeros(film),
            np.zeros(floats, dtype),
            lanes.integers(),
            np.zeros(floats, dtype),
            lanes.integers(),
            np.zeros(lanes.QUEUE, dtype),
        )
        _OF_THREAD.work = work
    return work


def _group_size(settings: Settings) -> int:
    """The largest divisor of the number of samples that leaves enough groups."""
    most = max(settings.samples // _GROUPS, 1)
    if settings.error is not None:
        most = min(most, _SAMPLES_TO_TARGET)
    return next(size for size in range(most, 0, -1) if settings.samples % size == 0)


def _tile(width: int, height: int, samples: int) -> int:
    """Side of a tile; by the picture alone, so that nothing depends on the machine."""
    side = _TILE
    while side < _LARGEST_TILE and side**2 * samples < _PATHS and width * height > _TILES * (2 * side) ** 2:
        side *= 2
    return side


def _jobs(width: int, height: int, first: int, groups: int, size: int) -> Iterator[_Job]:
    tile = _tile(width, height, groups * size)
    together = max(_PATHS // (min(tile, width) * min(tile, height) * size), 1)
    for group in range(first, first + groups, together):
        for top in range(0, height, tile):
            for left in range(0, width, tile):
                wide, high = min(tile, width - left), min(tile, height - top)
                yield _Job(left, top, wide, high, group, min(together, first + groups - group))


def _share(total: Floats, squares: Floats, groups: int, rows: int) -> float | None:
    """Standard error over mean, RMS over pixels and channels of S0; None before two groups are done."""
    error, mean = standard_error(total, squares, groups)[..., ::rows], float(np.mean(total[..., ::rows]))
    return float(np.sqrt(np.mean(error**2))) * groups / mean if groups > 1 and mean > 0.0 else None


def _cancel(found: list[Future[tuple[Floats, int]]]) -> None:
    for future in found:
        future.cancel()
