"""Files that others made: a photograph that must be read right, sensors with polarizers, and what is no photograph."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from card import Figure
from numpy.typing import NDArray

from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.stokes_pixels import fit_stokes, redundancy
from reflectance_fit.capture.workers import FrameError, RawWorkers

VARIABLE = "REFLECTANCE_FIT_DATA"
DATA = Path(os.environ.get(VARIABLE) or Path(__file__).parents[2] / ".." / "shared" / "data").resolve()
CANON = "raw/canon_kissx4_colorchart.dng"
HEADERLESS = "raw/headerless_openisp_1920x1080.RAW"
MOSAIC = "polarization/polanalyser/polarizer_IMX250MZR.png"
# Centres of the chart's neutral patches in the visible area, and their reflectances (MANIFEST.csv of the data).
NEUTRAL_X, NEUTRAL_Y = (704, 811, 922, 1030, 1141, 1255), 926
NEUTRAL = np.array([0.90, 0.591, 0.362, 0.198, 0.090, 0.031])
# Of the four polarizers: their middles in cells, and the angles that a plain reading gives (README.md of the data).
DISCS, DISC_RADIUS = ((189, 543), (500, 550), (777, 549), (1054, 554)), 60
AOLP_DEG = (83.4, 43.7, -4.9, -44.6)
LAYOUTS = (((90.0, 45.0), (135.0, 0.0)), ((90.0, 135.0), (45.0, 0.0)))
IMBALANCE = 0.977


def about(*, full: bool) -> str:
    return "Real files are third-party; discs of the polarizers within 60 cells of their middles, linear in light."


def figures() -> Iterator[Figure]:
    """One figure a file, or why there is none."""
    if not DATA.is_dir():
        yield Figure.not_run("real files", "as published", f"no third-party data; {VARIABLE} names them")
        return
    yield _neutrals()
    yield from _discs()
    yield _sony()
    yield _refused()


def _neutrals() -> Figure:
    frame = read_frame(DATA / CANON, Reading())
    worst = 0.0
    for channel in ("R", "G", "B"):
        level = [
            np.mean([_patch(frame.cfa, x, int(i), int(j)) for i, j in np.argwhere(frame.channels == channel)])
            for x in NEUTRAL_X
        ]
        green = np.array(level) - frame.black[0, 0]
        slope, flare = np.polyfit(NEUTRAL, green, 1)
        worst = max(worst, float(np.abs(green - flare - slope * NEUTRAL).max() / slope))
    return Figure.judged(
        "Canon's neutrals: off a line, of white", f"{worst:.1%}", "2 % at most", worst <= 0.02
    )


def _patch(cfa: NDArray[np.uint16], x: int, row: int, column: int) -> float:
    """Mean of 48 x 48 pixels in one place of the cell."""
    left, top = x - x % 2 - 24, NEUTRAL_Y - 24
    return float(cfa[top + row : top + 48 : 2, left + column : left + 48 : 2].mean())


def _discs() -> Iterator[Figure]:
    for layout, sense in zip(LAYOUTS, (1.0, -1.0), strict=True):
        frame = read_frame(DATA / MOSAIC, Reading("dofp", layout, "linear"))
        y, x = np.indices((frame.cfa.shape[0] // 2, frame.cfa.shape[1] // 2))
        found = []
        for centre_x, centre_y in DISCS:
            inside = np.hypot(x - centre_x, y - centre_y) < DISC_RADIUS
            places = list(np.ndindex(2, 2))
            signal = [float(frame.cfa[i::2, j::2][inside].mean() - frame.black[i, j]) for i, j in places]
            axes = [float(frame.axes_deg[i, j]) for i, j in places]
            found.append(float(np.degrees(fit_stokes(signal, 1.0, np.radians(axes)).aolp)))
        worst = max(abs(a - sense * b) for a, b in zip(found, AOLP_DEG, strict=True))
        yield Figure.judged(
            f"AoLP of polarizers read as {[[int(axis) for axis in row] for row in layout]}",
            f"{', '.join(f'{angle:.1f}' for angle in found)} deg",
            f"{', '.join(f'{sense * angle:.1f}' for angle in AOLP_DEG)} within 0.5",
            worst <= 0.5,
        )


def _sony() -> Figure:
    """Over both scenes; green, the channel in the middle."""
    ratios = []
    for scene in ("scene000", "scene001"):
        paths = [DATA / f"polarization/sony_dolpcc/{scene}_i{angle:03d}.png" for angle in (0, 45, 90, 135)]
        green = np.stack(
            [cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., 1].astype(float) for path in paths]
        )
        mean = green.mean(axis=(1, 2))
        ratios.append(1.0 + float(redundancy(mean, 1.0, np.radians([0, 45, 90, 135])).imbalance))
    return Figure.judged(
        "sony_dolpcc: (I0 + I90) / (I45 + I135)",
        ", ".join(f"{ratio:.4f}" for ratio in ratios),
        f"{IMBALANCE} within 0.002",
        max(abs(ratio - IMBALANCE) for ratio in ratios) <= 0.002,
    )


def _refused() -> Figure:
    """Through the workers, as files of strangers are."""
    paths = [*sorted((DATA / "raw/negative").iterdir()), DATA / HEADERLESS]
    with RawWorkers() as workers:
        found = list(workers.map((path, read_frame, (Reading(),)) for path in paths))
    refused = [one for one in found if isinstance(one, FrameError) and one.reason]
    return Figure.judged(
        "broken files and a headerless dump refused with a reason",
        f"{len(refused)} of {len(paths)}",
        "all",
        len(refused) == len(paths),
    )
