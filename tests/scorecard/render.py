"""The renderer: energy, light, bias, polarization, choice of mode, and another renderer's pictures."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from card import Figure, Table

sys.path.append(str(Path(__file__).parents[1] / "reference"))

import render_bad
import render_furnace
import render_irradiance
import render_lobes
import render_modes
import render_polarized
import render_statistics

Part = Callable[[], Iterator[Figure | Table]]
PROCESSES = 2
_LONGEST = ("modes", "Mitsuba")  # begun first


def about(*, full: bool) -> str:
    return (
        "Seeds fixed by figure. Surfaces: random pairs and samples, as their names say. Furnaces: a ball that fills the "
        f"picture, {'4096' if full else '1024'} paths a pixel (rough: 4 times), 32 x 32, float64. Irradiance: "
        f"{40 if full else 8} random lights a kind, some cut by the horizon, paths until the standard error is small. Bias: independent "
        f"sampling, {render_statistics.SEEDS} seeds. Mitsuba 3: {render_statistics.GROUPS} seeds on each side, "
        f"{2048 if full else 512} paths a pixel, {render_statistics.SIZE[0]} x {render_statistics.SIZE[1]}, tiles of "
        f"{render_statistics.TILE} x {render_statistics.TILE}; level {render_statistics.ALPHA}, over many tests by Sidak. Modes: each scene also "
        "in the fullest mode, differences beyond noise. Scenes share compiled kernels by specks of what they lack, far behind the camera."
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    """Two parts at a time: most of what a part takes is compiling, which is one thread's work."""
    parts: dict[str, Part] = {
        "surfaces": render_lobes.figures,
        "furnaces": partial(render_furnace.figures, full=full),
        "irradiance": partial(render_irradiance.figures, full=full),
        "bias": partial(render_statistics.unbiased, full=full),
        "polarization": partial(render_polarized.figures, full=full),
        "Mitsuba": partial(render_statistics.agreement, full=full),
        "modes": partial(render_modes.figures, full=full),
        "bad scenes": render_bad.figures,
    }
    with ProcessPoolExecutor(PROCESSES, multiprocessing.get_context("spawn")) as pool:
        jobs = {
            name: pool.submit(_told, parts[name]) for name in sorted(parts, key=_LONGEST.__contains__)[::-1]
        }
        for name in parts:
            yield from jobs[name].result()


def _told(part: Part) -> list[Figure | Table]:
    return list(part())
