"""What the data taught: each parameter before and after."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reflectance_fit.plot import style
from reflectance_fit.plot.corner import varied
from reflectance_fit.plot.text import label, subject
from reflectance_fit.priors import Prior
from reflectance_fit.result import Fit

BARS = 40
MOST_COLUMNS = 3


@style.styled
def draw_prior_posterior(fit: Fit) -> Figure:
    """The prior's density over the posterior's histogram, one panel per parameter.

    Where k = 0 was chosen, k is shown from the conductor's posterior: the
    upper limit of the report comes from there.
    """
    draws = {name: fit.posterior.flat(name) for name in varied(fit.posterior)}
    if fit.k_posterior is not None:
        draws["k"] = fit.k_posterior.flat("k")
    rows = -(-len(draws) // MOST_COLUMNS)
    columns = -(-len(draws) // rows)
    figure, axes = style.grid(
        rows,
        columns,
        panel_height=1.7,
        width=max(4.2, 2.3 * columns),
        left=0.4,
        gap=(0.62, 0.3),
        top=0.62,
    )
    style.heading(figure, f"{subject(fit)}: prior and posterior")
    for ax, (name, values) in zip(axes.flat, draws.items(), strict=False):
        _panel(ax, values, fit.priors.get(name))
        conductor = name == "k" and fit.k_posterior is not None
        ax.set_xlabel(f"{label(name)}, if a conductor" if conductor else label(name))
    for ax in axes.flat[len(draws) :]:
        ax.set_axis_off()
    axes[0, 0].set_ylabel("density")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0.12 / figure.get_figwidth(), 1 - 0.32 / figure.get_figheight()),
        ncols=2,
    )
    return figure


def _panel(ax: Axes, values: NDArray[np.float64], prior: Prior | None) -> None:
    low, high = np.percentile(values, (0.1, 99.9))
    density, edges = np.histogram(values, BARS, range=(low, high), density=True)
    # One outline: forty bars would be forty artists.
    ax.fill_between(
        edges,
        np.append(density, density[-1]),
        step="post",
        color=style.POSTERIOR,
        alpha=0.45,
        linewidth=0,
        label="posterior",
    )
    view = _view(float(low), float(high), prior)
    if prior is not None:
        # Just outside the range the density is zero, and the step there should be seen.
        x = np.linspace(*view, 601)
        ax.plot(x, prior.density(x), color=style.INK, linewidth=1.1, label="prior")
    ax.set_xlim(*view)
    ax.set_ylim(bottom=0)
    ax.set_yticks([])
    ax.set_xticks(style.inner_ticks(*view, most=2))
    ax.grid(visible=False)
    ax.spines["left"].set_visible(False)


def _view(low: float, high: float, prior: Prior | None) -> tuple[float, float]:
    """The posterior with some room, or the prior where it is not much wider."""
    room = 0.35 * (high - low)
    view = low - room, high + room
    if prior is None:
        return view
    if prior.kind == "normal":
        reach = prior.mean - 3 * prior.sigma, prior.mean + 3 * prior.sigma
    else:
        reach = prior.low, prior.high
    reach = max(reach[0], prior.low), min(reach[1], prior.high)
    if reach[1] - reach[0] < 20 * (high - low):
        view = min(view[0], reach[0]), max(view[1], reach[1])
    # A little beyond a wall, to show that it is one.
    edge = 0.03 * (view[1] - view[0])
    return max(view[0], prior.low - edge), min(view[1], prior.high + edge)
