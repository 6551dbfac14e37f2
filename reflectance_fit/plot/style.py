"""One look for every picture, and the one way a picture reaches the disk.

Figures are built without pyplot, so nothing global is left behind, and saved
without dates or random identifiers, so equal input gives equal bytes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from reflectance_fit.plot.canvas import png_and_svg

# Okabe and Ito's palette, told apart by every kind of colour vision.
S = "#0072B2"
P = "#D55E00"
K = "#CC79A7"
OTHER = "#009E73"
INK = "#222222"
QUIET = "#8C8C8C"
POSTERIOR = OTHER
ENSEMBLES = ("#E69F00", "#56B4E9", "#009E73", "#CC79A7")

WIDTH = 6.8  # inches; a text column of A4
PNG_DPI = 150
# Above this many points an SVG keeps a picture of them instead of the points.
DENSE = 400

# Any: matplotlib 3.11 types the keys one by one, 3.10 does not.
RC: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs everywhere
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.grid": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.borderaxespad": 0.0,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "errorbar.capsize": 0.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.dpi": PNG_DPI,
    "svg.hashsalt": "reflectance_fit",
    "svg.fonttype": "path",
    # Names come from files: "$" is a character here, never the start of a formula.
    "text.parse_math": False,
    "text.usetex": False,
}

_P = ParamSpec("_P")
_R = TypeVar("_R")


def styled(draw: Callable[_P, _R]) -> Callable[_P, _R]:
    """Run a drawing function under this style, whatever the user's matplotlibrc says."""

    @wraps(draw)
    def inside(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(RC)
            return draw(*args, **kwargs)

    return inside


def grid(
    rows: int = 1,
    columns: int = 1,
    *,
    panel_height: float = 2.4,
    width: float = WIDTH,
    left: float = 0.75,
    right: float = 0.2,
    bottom: float = 0.55,
    top: float = 0.42,
    gap: tuple[float, float] = (0.35, 0.25),
    height_ratios: Sequence[float] | None = None,
    width_ratios: Sequence[float] | None = None,
    share_x: bool = False,
) -> tuple[Figure, NDArray[Any]]:
    """A figure and its axes, shape (rows, columns); lengths and gaps (down, across) in inches.

    Margins and the places of labels are stated because measuring the text to find them costs more than
    the drawing; it also keeps the labels of a column in line.
    """
    height = rows * panel_height + (rows - 1) * gap[0] + bottom + top
    panel_width = (width - left - right - (columns - 1) * gap[1]) / columns
    figure = Figure(figsize=(width, height))
    axes: NDArray[Any] = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharex=share_x,
        gridspec_kw={
            "left": left / width,
            "right": 1 - right / width,
            "bottom": bottom / height,
            "top": 1 - top / height,
            "hspace": gap[0] / panel_height,
            "wspace": gap[1] / panel_width,
            "height_ratios": height_ratios,
            "width_ratios": width_ratios,
        },
    )
    for ax in axes.flat:
        place_labels(ax, left if ax in axes[:, 0] else 0.5)
    return figure, axes


def place_labels(ax: Axes, left: float) -> None:
    """Fix where the axis labels stand; ``left``: inches from the axes to what limits them there."""
    box = ax.get_window_extent()
    width, height = box.width / ax.figure.dpi, box.height / ax.figure.dpi
    ax.xaxis.set_label_coords(0.5, -0.27 / height)
    ax.yaxis.set_label_coords((0.1 - left) / width, 0.5)
    ax.yaxis.label.set_verticalalignment("top")


def inner_ticks(low: float, high: float, most: int) -> NDArray[np.float64]:
    """At most ``most`` round numbers, none so near an end that its label would run into the neighbour's."""
    room = 0.12 * (high - low)
    ticks: NDArray[np.float64] = np.asarray(MaxNLocator(4).tick_values(low, high))
    inner = ticks[(ticks > low + room) & (ticks < high - room)]
    return inner[:: max(1, -(-len(inner) // most))]


def heading(figure: Figure, text: str) -> None:
    """The line at the top left of a picture, smaller where it would run out of it."""
    width, height = figure.get_size_inches()
    # A bold letter of this font is 0.7 em wide on average; an em is the size, in 72nds of an inch.
    size = min(9.5, (width - 0.24) * 72 / (0.7 * len(text)))
    figure.text(0.12 / width, 1 - 0.1 / height, text, va="top", size=size, weight="bold")


def side_legend(ax: Axes, **options: Any) -> None:
    """A legend to the right of the axes, where it hides nothing."""
    ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), **options)


@styled
def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write ``name.png`` and ``name.svg``, each whole or not at all; returns their paths."""
    paths = []
    for kind, picture in png_and_svg(figure).items():
        path = folder / f"{name}.{kind}"
        unfinished = folder / f".{name}.{kind}.{os.getpid()}"
        try:
            unfinished.write_bytes(picture)
            os.replace(unfinished, path)
        finally:
            unfinished.unlink(missing_ok=True)
        paths.append(path)
    return paths


def thin(values: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """At most ``most`` entries along the first axis, evenly spread."""
    return values[np.linspace(0, len(values) - 1, most).astype(int)] if len(values) > most else values
