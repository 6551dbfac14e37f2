"""Every pair of parameters, in the form that emcee's users know."""

from __future__ import annotations

import warnings

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from reflectance_fit.plot import style
from reflectance_fit.plot.text import label, subject, with_error
from reflectance_fit.result import Fit, Posterior

POINTS = 8000
# Outside 95 % the single draws show; inside, the shade must not hide the lines of the medians.
_FILL = [(1.0, 1.0, 1.0, 0.0), "#C8E8DD", "#86CCB4"]


def varied(posterior: Posterior) -> list[str]:
    """The parameters that move; a k held at zero has no picture."""
    return [n for n in posterior.samples if np.ptp(posterior.samples[n]) > 0]


@style.styled
def draw_corner(fit: Fit) -> Figure:
    """Joint and single distributions with medians and 95 % intervals, in report units."""
    with warnings.catch_warnings():
        # corner looks for arviz, whose import may announce news that concern nobody here.
        warnings.simplefilter("ignore")
        from corner import corner

    names = varied(fit.posterior)
    draws = np.stack([fit.posterior.flat(n) for n in names], axis=1)
    size = max(3.4, 1.5 * len(names) + 1.0)
    figure = Figure(figsize=(size, size))
    FigureCanvasAgg(figure)
    corner(
        style.thin(draws, POINTS),
        fig=figure,
        labels=[label(n).replace(" (", "\n(") for n in names],
        color=style.POSTERIOR,
        bins=28,
        smooth=1.2,
        range=[0.998] * len(names),
        levels=(0.68, 0.95),
        plot_density=False,
        # Each panel's points are a picture of their own; with many panels the file would be megabytes.
        plot_datapoints=len(names) <= 4,
        fill_contours=True,
        max_n_ticks=3,
        data_kwargs={"alpha": 0.15, "ms": 1.5},
        contourf_kwargs={"colors": _FILL},
        contour_kwargs={"linewidths": 0.9},
        hist_kwargs={"linewidth": 1.1},
        quiet=True,
    )
    axes = np.array(figure.axes).reshape(len(names), len(names))
    figure.subplots_adjust(left=0.95 / size, bottom=0.9 / size, right=1 - 0.2 / size, top=1 - 0.65 / size)
    for i in range(len(names)):
        low, middle, high = np.percentile(draws[:, i], (2.5, 50, 97.5))
        axes[i, i].axvspan(low, high, color=style.POSTERIOR, alpha=0.12, linewidth=0)
        axes[i, i].axvline(middle, color=style.INK, linewidth=0.9)
        axes[i, i].set_title(with_error(middle, float(draws[:, i].std())), size=8.5, loc="center")
        for j in range(i):
            axes[i, j].axhline(middle, color=style.INK, linewidth=0.6, linestyle=":")
            axes[i, j].axvline(np.median(draws[:, j]), color=style.INK, linewidth=0.6, linestyle=":")
    side = float(axes[0, 0].get_position().height) * size
    for i in range(len(names)):
        axes[-1, i].xaxis.set_label_coords(0.5, -0.52 / side)
        axes[i, 0].yaxis.set_label_coords(-0.52 / side, 0.5)
    for ax in axes[np.tril_indices(len(names))]:
        ax.grid(visible=False)
    style.heading(figure, f"{subject(fit)}: median, 95 % shaded")
    return figure
