"""Many samples, every pixel, many machines: nothing lost, nothing done twice, the same bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import scale_batch
from card import Figure

_MAP = (
    ("map: per-pixel results against the single fit of the pixel", "1e-6"),
    ("map: coverage of the 95 % interval", "inside its band"),
    ("map on 1, 2 and 4 Dask workers, 3 tile sizes, against one process", "equal byte for byte"),
    ("map on Dask workers that are killed (-9)", "equal byte for byte"),
    ("map with a tile that kills its worker", "masked, the rest equal"),
)


def about(*, full: bool) -> str:
    return scale_batch.about()


def figures(*, full: bool) -> Iterator[Figure]:
    for name, target in _MAP:
        yield Figure.not_run(name, target, "needs map")
    with tempfile.TemporaryDirectory() as folder:
        yield from scale_batch.figures(Path(folder))
