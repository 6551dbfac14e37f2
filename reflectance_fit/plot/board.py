"""A board on a sheet of paper, drawn at true scale."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

MM = 1 / 25.4  # inch
_BAR_MM = 100.0
_FONT_PT = 8.0
_LINE_MM = 4.2


def board_pdf(
    ink_mm: NDArray[np.float64],
    size_mm: tuple[float, float],
    sheet_mm: tuple[float, float],
    text: Sequence[str],
) -> bytes:
    """One page of ``sheet_mm`` with the board in its middle, a bar of 100 mm and lines of text below.

    ``ink_mm`` are black rectangles (x, y, width, height), shape (N, 4), y
    down from the top left of a pattern of ``size_mm``.  Equal input gives
    equal bytes.
    """
    width, height = sheet_mm
    below = _LINE_MM * (len(text) + 3)
    left, top = (width - size_mm[0]) / 2, (height - size_mm[1] - below) / 2
    figure = Figure(figsize=(width * MM, height * MM))
    # Millimetres from the top left of the sheet to the figure's own unit; pixels and points cancel out.
    place = Affine2D().scale(1, -1).translate(0, height).scale(MM) + figure.dpi_scale_trans
    # One path: where rectangles of several paths touch, viewers show a seam.
    figure.add_artist(
        PathPatch(
            _outlines(ink_mm + np.array([left, top, 0.0, 0.0])),
            transform=place,
            facecolor="black",
            linewidth=0,
            snap=False,
        )
    )
    y = top + size_mm[1] + 2 * _LINE_MM
    # Letters of DejaVu Sans Mono are 0.602 of the font's size wide.
    longest = max(map(len, text)) * 0.602 * _FONT_PT / 72 / MM
    start = (width - max(longest, _BAR_MM)) / 2
    for x0, y0, x1, y1 in _bar(start, y):
        # Butt: a line's own width must not lengthen it.
        figure.add_artist(
            Line2D([x0, x1], [y0, y1], transform=place, color="black", lw=0.3, solid_capstyle="butt")
        )
    for number, line in enumerate(text):
        below_bar = y + _LINE_MM * (number + 1.2)
        figure.add_artist(
            Text(start, below_bar, line, transform=place, fontsize=_FONT_PT, family="DejaVu Sans Mono")
        )
    page = BytesIO()
    # Type 42 keeps the text selectable, so that it can be copied into a manifest.
    with matplotlib.rc_context({"pdf.fonttype": 42, "path.simplify": False}):
        figure.savefig(page, format="pdf", metadata={"CreationDate": None, "Title": "ChArUco board"})
    return page.getvalue()


def _bar(start: float, y: float) -> list[tuple[float, float, float, float]]:
    """Lines of a bar with a tick every centimetre."""
    steps = np.arange(0.0, _BAR_MM + 1, 10.0)
    ticks = [(start + x, y - (2.0 if x % 50 == 0 else 1.2), start + x, y) for x in steps]
    return [(start, y, start + _BAR_MM, y), *ticks]


def _outlines(rectangles: NDArray[np.float64]) -> Path:
    x, y, w, h = rectangles.T
    corners = np.stack([np.stack([x, y], -1), np.stack([x + w, y], -1), np.stack([x + w, y + h], -1)], 1)
    corners = np.concatenate([corners, np.stack([x, y + h], -1)[:, None], corners[:, :1]], axis=1)
    codes = np.tile([Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY], len(rectangles))
    return Path(corners.reshape(-1, 2), codes)
