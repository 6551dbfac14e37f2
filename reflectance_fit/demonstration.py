"""The whole job with no camera: photographs are synthesised, read, fitted and compared with the truth."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from pathlib import Path
from queue import Empty
from typing import Any

from reflectance_fit.capture.truth import Truth, read_truth
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.spec import standard_spec
from reflectance_fit.files import check_writable
from reflectance_fit.report.read import read_report
from reflectance_fit.report.schema import Report

Progress = Callable[[str, int, int], None]

MATERIALS = ("N-BK7", "Au")  # a dielectric and a conductor
_POLL_S = 0.1

_queue: Any = None


def demo(
    folder: Path, materials: Sequence[str], *, seed: int, plots: bool, progress: Progress
) -> Iterator[tuple[str, Report, Truth]]:
    """Photograph, read and fit each material; yields its report beside the truth.

    Writes DIR/MATERIAL/capture/ (frames, capture.yaml, truth.yaml) and
    DIR/MATERIAL/result/.  Materials run in processes of their own, as many as
    there are; ``progress`` is called with (what, done, of how many).
    """
    check_writable(folder)
    for material in materials:
        standard_spec(material, seed=seed)  # an unknown material is told before the others start
    if len(materials) == 1:
        _one(folder, materials[0], seed, plots, progress)
    else:
        _together(folder, materials, seed, plots, progress)
    for material in materials:
        here = folder / material
        yield (
            material,
            read_report(here / "result" / "report.yaml"),
            read_truth(here / "capture" / "truth.yaml"),
        )


def _one(folder: Path, material: str, seed: int, plots: bool, progress: Progress) -> None:
    def told(what: str, done: int, total: int) -> None:
        progress(f"{material}: {what}", done, total)

    # Here and not above: the process that only waits for others need not load the samplers.
    from reflectance_fit.workflow import fit_to_folder

    here = folder / material
    capture = write_capture(here / "capture", standard_spec(material, seed=seed), progress=told)
    fit_to_folder(capture, here / "result", model="auto", seed=seed, plots=plots, timings=True, progress=told)


def _together(folder: Path, materials: Sequence[str], seed: int, plots: bool, progress: Progress) -> None:
    """Every material in a process of its own; what they tell comes back through a queue."""
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    with ProcessPoolExecutor(len(materials), context, _start, (queue,)) as pool:
        jobs = [pool.submit(_job, folder, material, seed, plots) for material in materials]
        try:
            _relay(jobs, queue, progress)
            for job in jobs:
                job.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _relay(jobs: Sequence[Future[None]], queue: Any, progress: Progress) -> None:
    while wait(jobs, timeout=0).not_done:
        try:
            progress(*queue.get(timeout=_POLL_S))
        except Empty:
            continue


def _start(queue: Any) -> None:
    global _queue
    _queue = queue


def _job(folder: Path, material: str, seed: int, plots: bool) -> None:
    _one(folder, material, seed, plots, lambda what, done, total: _queue.put((what, done, total)))
