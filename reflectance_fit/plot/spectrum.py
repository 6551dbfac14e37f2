"""Several channels side by side: eta, k and the Brewster angle against wavelength."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from reflectance_fit.plot import style
from reflectance_fit.result import Fit, Interval

_ROWS = (("eta", "η", style.INK), ("k", "k", style.K), ("brewster_deg", "Brewster angle (deg)", style.OTHER))


@style.styled
def draw_spectrum(fits: Sequence[Fit]) -> Figure:
    """Medians with 68 % (thick) and 95 % (thin) intervals; an arrow where only a bound is known."""
    figure, axes = style.grid(len(_ROWS), panel_height=1.6, left=0.85, gap=(0.18, 0.0), share_x=True)
    one_curve = all(fit.shared for fit in fits)
    style.heading(figure, f"{len(fits)} channels" + (" on one dispersion curve" if one_curve else ""))
    for ax, (name, label, colour) in zip(axes[:, 0], _ROWS, strict=True):
        for fit in fits:
            interval = fit.intervals.get(name)
            if interval is not None:
                _draw(ax, fit.wavelength_nm, interval, colour)
        ax.set_ylabel(label)
        ax.margins(x=0.05, y=0.12)
    axes[-1, 0].set_xlabel("wavelength (nm)")
    axes[0, 0].legend(
        [
            Line2D([], [], color=style.INK, marker="o", linewidth=2.4),
            Line2D([], [], color=style.INK, linewidth=0.9),
            Line2D([], [], color=style.INK, marker="v", linestyle="", markerfacecolor="none"),
        ],
        ["median, 68 %", "95 %", "95 % upper limit"],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.03),
        ncols=3,
    )
    return figure


def _draw(ax: Axes, wavelength_nm: float, interval: Interval, colour: str) -> None:
    if interval.status == "upper_limit" and interval.ci95 is not None:
        ax.plot(wavelength_nm, interval.ci95[1], "v", color=colour, markerfacecolor="none")
        ax.vlines(wavelength_nm, interval.ci95[0], interval.ci95[1], color=colour, linewidth=0.9)
        return
    for span, width in ((interval.ci95, 0.9), (interval.ci68, 2.4)):
        if span is not None:
            ax.vlines(wavelength_nm, *span, color=colour, linewidth=width)
    places = interval.modes or (() if interval.median is None else (interval.median,))
    ax.plot([wavelength_nm] * len(places), places, "o", color=colour, markersize=3.5)
