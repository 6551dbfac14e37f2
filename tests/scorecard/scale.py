"""Many samples, every pixel, many machines: nothing lost, nothing done twice, the same bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import scale_batch
import scale_map
from card import Figure


def about(*, full: bool) -> str:
    return f"{scale_batch.about()} {scale_map.about()}"


def figures(*, full: bool) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        yield from scale_map.figures(Path(folder))
    with tempfile.TemporaryDirectory() as folder:
        yield from scale_batch.figures(Path(folder))
