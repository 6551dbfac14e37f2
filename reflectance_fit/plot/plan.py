"""What planned photographs can tell: expected standard deviations against angle and against effort."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reflectance_fit.plot import style
from reflectance_fit.plot.text import printable

FloatArray = NDArray[np.float64]

# Colour, line and marker together: each tells the equipment without the others.
_LOOKS = ((style.S, "-", "o"), (style.P, "--", "s"), (style.OTHER, "-.", "D"))


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Expected standard deviations ``eta`` and ``k`` at ``x``, all of shape (N,); NaN where there is none.

    ``mark`` are the x of the chosen design, ``mark_eta`` and ``mark_k`` its values.
    """

    label: str
    x: FloatArray
    eta: FloatArray
    k: FloatArray
    mark: FloatArray
    mark_eta: float
    mark_k: float


@style.styled
def draw_plan(
    title: str, against_angle: Sequence[Curve], against_frames: Sequence[Curve], *, limit: bool
) -> Figure:
    """One row for eta, one for k; left against the angle, right against the number of photographs.

    ``limit``: k is the 95 % upper limit instead of a standard deviation.
    """
    figure, axes = style.grid(2, 2, panel_height=2.1, gap=(0.2, 0.2), bottom=0.95, share_x=False)
    style.heading(figure, printable(title, 100))
    for column, curves in enumerate((against_angle, against_frames)):
        for row, name in enumerate(("eta", "k")):
            for curve, look in zip(curves, _LOOKS, strict=False):
                _draw(axes[row, column], curve, name, look)
    for row, label in enumerate(("σ of η (1)", "95 % limit of k (1)" if limit else "σ of k (1)")):
        left, right = axes[row]
        left.set(ylabel=label, xlim=(18, 82))
        right.tick_params(labelleft=False)
        for ax in (left, right):
            ax.set_yscale("log")
            # The default would write powers of ten as formulas, which are off in this style.
            ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        right.set_xlim(left=0)
        _same_range(left, right)
        if row == 0:
            left.tick_params(labelbottom=False)
            right.tick_params(labelbottom=False)
    axes[1, 0].set_xlabel("middle of angles spread over ±10° (deg)")
    axes[1, 1].set_xlabel("photographs at the best angles (number)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="lower left",
        ncols=len(labels),
        bbox_to_anchor=(0.75 / style.WIDTH, 0.01),
        title="best of its equipment; marked: the chosen angles and what they give",
        alignment="left",
        title_fontsize=8.0,
    )
    figure.align_ylabels()
    return figure


def _draw(ax: Axes, curve: Curve, name: str, look: tuple[str, str, str]) -> None:
    colour, line, marker = look
    values, level = (curve.eta, curve.mark_eta) if name == "eta" else (curve.k, curve.mark_k)
    ax.plot(curve.x, values, color=colour, linestyle=line, label=curve.label)
    if np.isfinite(level):
        marks = np.unique(curve.mark)
        ax.plot(marks, np.full(len(marks), level), color=colour, linestyle=":", linewidth=0.8, marker=marker)


def _same_range(*axes: Axes) -> None:
    low, high = zip(*(ax.get_ylim() for ax in axes), strict=True)
    for ax in axes:
        ax.set_ylim(min(low), max(high))
