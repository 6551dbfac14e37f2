"""Every pair of parameters, in the form that emcee's users know."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from reflectance_fit.plot import style
from reflectance_fit.plot.text import label, subject, with_error
from reflectance_fit.result import Fit, Interval, Posterior

FloatArray = NDArray[np.float64]

BINS = 28
NARROW = 6  # times as many where there are modes, each of which is narrow beside the gap
SMOOTHING = 1.2  # bins
SHOWN = 0.998  # of each parameter's draws
LEVELS = (0.95, 0.68)
# Outside 95 % the single draws show; inside, the shade must not hide the lines of the medians.
_FILL = ("#C8E8DD", "#86CCB4")
# Each dot is an element of the SVG: this many draws are shared out among the panels.
DRAWS = 24000
_LEFT, _BOTTOM, _TOP, _RIGHT, _GAP = 0.95, 0.9, 0.65, 0.15, 0.07  # inches


def varied(posterior: Posterior) -> list[str]:
    """The parameters that move; a k held at zero has no picture."""
    return [n for n in posterior.samples if np.ptp(posterior.samples[n]) > 0]


@style.styled
def draw_corner(fit: Fit) -> Figure:
    """Joint and single distributions with medians and 95 % intervals, in report units.

    Not by the corner package, which takes two to three times as long: it fills the
    half above the diagonal with empty panels and puts ticks on the inner ones.
    """
    names = varied(fit.posterior)
    draws = [fit.posterior.flat(n) for n in names]
    verdicts = [fit.intervals.get(n) for n in names]
    views = [_view(d, v) for d, v in zip(draws, verdicts, strict=True)]
    count = len(names)
    panel = max(2.2, 1.5 * count - 0.15) / count - _GAP
    width, height = (count * panel + (count - 1) * _GAP + ends for ends in (_LEFT + _RIGHT, _BOTTOM + _TOP))
    figure = Figure(figsize=(width, height))
    for i in range(count):
        for j in range(i + 1):
            x, y = _LEFT + j * (panel + _GAP), _BOTTOM + (count - 1 - i) * (panel + _GAP)
            ax = figure.add_axes((x / width, y / height, panel / width, panel / height))
            ax.grid(visible=False)
            style.place_labels(ax, _LEFT)
            ax.xaxis.set_label_coords(0.5, -0.52 / panel)
            if i == j:
                _single(ax, draws[i], views[i], verdicts[i])
            else:
                _pair(ax, draws[j], draws[i], views[j], views[i], most=2 * DRAWS // count**2)
                ax.set_ylim(*views[i])
            ax.set_xlim(*views[j])
            _outer(ax.xaxis, names[j], views[j], shown=i == count - 1)
            _outer(ax.yaxis, names[i], views[i], shown=j == 0 < i)
    style.heading(figure, f"{subject(fit)}: median, 95 % shaded")
    return figure


def _view(draws: FloatArray, verdict: Interval | None) -> tuple[float, float]:
    low, high = np.percentile(draws, (50 - 50 * SHOWN, 50 + 50 * SHOWN))
    # The outermost modes stand at the very ends.
    margin = 0.06 * (high - low) if verdict and verdict.modes else 0.0
    return float(low - margin), float(high + margin)


def _single(ax: Axes, draws: FloatArray, view: tuple[float, float], verdict: Interval | None) -> None:
    """One distribution, with no more said of it than in the report."""
    low, middle, high = np.percentile(draws, (2.5, 50, 97.5))
    modes = verdict.modes if verdict else ()
    status = verdict.status if verdict else "identified"
    if status == "upper_limit" and verdict and verdict.ci95:
        low, high = verdict.ci95
    ax.axvspan(low, high, color=style.POSTERIOR, alpha=0.12, linewidth=0)
    bins = BINS * NARROW if modes else BINS
    ax.stairs(*np.histogram(draws, bins, range=view), color=style.POSTERIOR, linewidth=1.1)
    for place in modes or ((middle,) if status == "identified" else ()):
        ax.axvline(place, color=style.INK, linewidth=0.9)
    ax.set_ylim(bottom=0)
    said = {
        "not_identified": "not identified",
        "upper_limit": f"< {high:.2g} (95 %)",
        "multimodal": " or ".join(f"{mode:.3g}" for mode in modes),
    }
    ax.set_title(said.get(status, with_error(middle, float(draws.std()))), size=8.5, loc="center")


def _pair(
    ax: Axes,
    x: FloatArray,
    y: FloatArray,
    x_view: tuple[float, float],
    y_view: tuple[float, float],
    most: int,
) -> None:
    density, x_edges, y_edges = np.histogram2d(x, y, BINS, range=(x_view, y_view))
    density = gaussian_filter(density, SMOOTHING)
    levels = _levels(density)
    cell = tuple(
        np.clip(((style.thin(v, most) - low) / (high - low) * BINS).astype(int), 0, BINS - 1)
        for v, (low, high) in ((x, x_view), (y, y_view))
    )
    rare = density[cell] < levels[0]
    ax.plot(
        style.thin(x, most)[rare],
        style.thin(y, most)[rare],
        "o",
        color=style.POSTERIOR,
        alpha=0.3,
        markersize=1.5,
        markeredgewidth=0,
        zorder=1,
    )
    # A step down to zero just outside the view closes every contour.
    around = [
        np.pad(e[:-1] + (e[1] - e[0]) / 2, 2, mode="reflect", reflect_type="odd") for e in (x_edges, y_edges)
    ]
    closed = np.pad(np.pad(density, 1, mode="edge"), 1)
    regions = ax.contour(*around, closed.T, levels, colors=style.POSTERIOR, linewidths=0.9, zorder=2)
    regions.set(array=None, facecolor=_FILL[-len(levels) :], edgecolor=style.POSTERIOR)
    ax.axvline(float(np.median(x)), color=style.INK, linewidth=0.6, linestyle=":")
    ax.axhline(float(np.median(y)), color=style.INK, linewidth=0.6, linestyle=":")


def _levels(density: FloatArray) -> FloatArray:
    """The densities above which the shares ``LEVELS`` of all draws lie, ascending."""
    ordered = np.sort(density, axis=None)[::-1]
    shares = np.cumsum(ordered) / ordered.sum()
    return np.unique(ordered[np.searchsorted(shares, LEVELS)])


def _outer(axis: Axis, name: str, view: tuple[float, float], *, shown: bool) -> None:
    """Ticks and a name on the outer panels only."""
    axis.set_visible(shown)
    if shown:
        axis.set_ticks(style.inner_ticks(*view, most=3))
        axis.set_tick_params(labelrotation=45)
        axis.set_label_text(label(name).replace(" (", "\n("))
