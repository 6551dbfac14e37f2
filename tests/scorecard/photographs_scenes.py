"""The synthetic scenes of the card `photographs`, and what every part does with them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from card import Figure
from decoding_here import decode_here
from numpy.typing import NDArray

from reflectance_fit.capture.ingest import Ingested, ingest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.arrangement import View, views
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.picture import Optics
from reflectance_fit.data_synthetic.spec import CaptureSpec, standard_spec
from reflectance_fit.data_synthetic.target import Board
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference import posterior

FloatArray = NDArray[np.float64]
T = TypeVar("T")

SIZE = (1000, 750)  # pixels, width and height
FOCAL_PX = 2100.0
# Large enough that markers are read at 65 degrees in a picture of this size.
BOARD = Board((7, 5), 16.0, 12.0, "DICT_4X4_50", (44.0, 12.0))
# Sampling for a 95 % interval over many fits, not for one that is published alone.
MIN_ESS, BLOCK, WALKERS = 1000.0, 75, 32


def start() -> None:
    """For each process."""
    posterior.MIN_ESS, posterior.BLOCK, posterior.WALKERS = MIN_ESS, BLOCK, WALKERS
    decode_here()


def board_spec(seed: int, **changes: Any) -> CaptureSpec:
    """A standard capture of a board in a small picture; printed as it says, and the lens known."""
    spec = standard_spec("N-BK7", shape="board", seed=seed)
    sensor = replace(spec.sensor, width=SIZE[0], height=SIZE[1])
    optics = Optics(FOCAL_PX, spec.optics.blur_px)
    known = replace(spec, sensor=sensor, optics=optics, board=BOARD, geometry_views=0)
    return replace(known, **changes)


def ingested(spec: CaptureSpec, *, all_used: bool = True) -> tuple[Ingested, list[View]]:
    """What comes of the photographs, and what they show; an error where ``all_used`` and one is rejected."""
    with tempfile.TemporaryDirectory() as folder:
        found = ingest(read_capture(write_capture(Path(folder) / "capture", spec)))
    if all_used and found.rejected:
        raise ReflectanceFitError("; ".join(f"{file} {reason}" for file, reason in found.rejected.items()))
    return found, list(views(spec))


def in_region(view: View) -> FloatArray:
    """True angle of incidence at each pixel of a board's region, radians, shape (n,)."""
    x0, y0, x1, y1 = view.stated["region"]
    scene: Any = view.scene
    theta, _ = scene.incidence(np.arange(x0, x1), np.arange(y0, y1)[:, None])
    return np.asarray(theta).ravel()


def answers(
    name: str, target: str, jobs: list[Future[T]], judged: Callable[[list[T]], Iterator[Figure]]
) -> Iterator[Figure]:
    """The figures of jobs; where one is refused, that misses the target, and the figure says why."""
    try:
        yield from judged([job.result() for job in jobs])
    except ReflectanceFitError as error:
        yield Figure(name, "refused", target, "short", "; ".join(p.message for p in error.problems)[:300])
