"""Pictures of the sensor as panels of a figure: axes in pixels, a scale beside them, words over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

BESIDE = "#F2F2F2"
"""Where there is nothing."""


def frame(ax: Axes, title: str) -> None:
    """Title, and axes that count pixels."""
    ax.set_title(title, size=8.5)
    ax.grid(visible=False)
    ax.set_facecolor(BESIDE)
    ax.set_aspect("equal", adjustable="box")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(4, integer=True))
    ax.spines[["top", "right"]].set_visible(True)


def scale(ax: Axes, norm: Normalize, colours: str) -> None:
    """A bar of colours to the right of the axes."""
    bar = ax.inset_axes((1.03, 0.0, 0.04, 1.0))
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    bar.imshow(
        np.linspace(low, high, 128)[:, None],
        cmap=colours,
        norm=norm,
        extent=(0, 1, low, high),
        aspect="auto",
        origin="lower",
        interpolation="nearest",
    )
    bar.grid(visible=False)
    bar.xaxis.set_visible(False)
    bar.yaxis.tick_right()
    bar.yaxis.set_major_locator(MaxNLocator(5))
    bar.tick_params(labelsize=7.5, length=2.5)


def legend(ax: Axes, entries: Sequence[tuple[str, str]]) -> None:
    """What the colours stand for: (words, colour)."""
    handles = [Patch(color=colour, label=label, linewidth=0) for label, colour in entries]
    ax.legend(handles=handles, loc="lower left", frameon=True, framealpha=0.85, edgecolor="none", fontsize=7)


def say(ax: Axes, words: str) -> None:
    """Words in the middle of the axes."""
    box = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 4.0}
    ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center", size=8.5, bbox=box)
