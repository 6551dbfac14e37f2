"""What the model leaves over, in standard deviations."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from reflectance_fit.plot import style
from reflectance_fit.plot.series import ABSCISSAS, LEGEND_ENTRIES, Panel, Series, panels
from reflectance_fit.plot.text import subject
from reflectance_fit.result import Fit

LEGEND_LETTERS = 86  # that fit into a line above the panel, an entry's sign and gaps being 7


@style.styled
def draw_residuals(fit: Fit) -> Figure:
    """Standardised residuals, and their histogram beside the unit normal.

    Drawn against what was scanned: the angle of incidence, or the analyzer's.
    """
    shown = panels(fit.observations)
    lines = max(-(-len(_named(panel)) // _columns(panel)) for panel in shown)
    above = 0.34 + 0.17 * lines
    figure, axes = style.grid(
        len(shown),
        2,
        panel_height=2.6 if len(shown) == 1 else 1.9,
        top=above,
        gap=(above, 0.12),
        width_ratios=(4, 1),
    )
    style.heading(figure, f"{subject(fit)}: {_goodness(fit)}")
    residuals = fit.optimum.residuals
    reach = max(3.4, 1.15 * float(np.max(np.abs(residuals))))
    z = np.linspace(-reach, reach, 201)
    normal = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
    for number, panel in enumerate(shown):
        ax, side = axes[number]
        for level, alpha in ((2, 0.10), (1, 0.16)):
            ax.axhspan(-level, level, color=style.QUIET, alpha=alpha, linewidth=0)
        ax.axhline(0, color=style.INK, linewidth=0.7)
        x = getattr(fit.observations, panel.abscissa)
        for series in panel.series:
            mine = series.rows
            dense = len(mine) > style.DENSE
            ax.plot(
                x[mine],
                residuals[mine],
                series.marker,
                color=series.colour,
                markeredgecolor="white",
                markeredgewidth=0.0 if dense else 0.4,
                markersize=1.5 if dense else 4.5,
                label=series.label,
                rasterized=dense,
            )
        everything = np.concatenate([s.rows for s in panel.series])
        # Square-root rule: enough bars to see a tail, few enough to hold some points each.
        bins = np.linspace(-reach, reach, 2 * int(np.clip(np.sqrt(len(everything)), 3, 20)) + 1)
        density, _ = np.histogram(residuals[everything], bins, density=True)
        side.fill_betweenx(
            bins, np.append(density, density[-1]), step="post", color=style.QUIET, alpha=0.6, linewidth=0
        )
        side.plot(normal, z, color=style.INK, linewidth=1.0, label="unit normal")
        for one in (ax, side):
            one.set_ylim(-reach, reach)
            one.yaxis.set_major_locator(MaxNLocator(7, integer=True))
        side.xaxis.set_visible(False)
        side.yaxis.set_visible(False)
        side.grid(visible=False)
        if panel.abscissa == "theta_deg":
            ax.set_xlim(0, 90)
        ax.set_ylabel(f"{panel.ylabel.split(' (')[0]}\nresidual (σ)" if len(shown) > 1 else "residual (σ)")
        if number == len(shown) - 1 or panel.abscissa != shown[number + 1].abscissa:
            ax.set_xlabel(ABSCISSAS[panel.abscissa])
        if named := _named(panel):
            ax.legend(
                loc="lower right",
                bbox_to_anchor=(1.0, 1.01),
                ncols=min(len(named), _columns(panel)),
                columnspacing=1.2,
            )
    axes[0, 1].set_title("unit normal", size=8.5, color=style.INK, loc="center")
    return figure


def _named(panel: Panel) -> tuple[Series, ...]:
    """The series that a legend can tell apart."""
    return panel.series if 1 < len(panel.series) <= LEGEND_ENTRIES else ()


def _columns(panel: Panel) -> int:
    return max(1, LEGEND_LETTERS // (7 + max(len(series.label) for series in panel.series)))


def _goodness(fit: Fit) -> str:
    best = fit.optimum
    if best.reduced_chi2 is None:
        return f"χ² = {best.chi2:.3g}, no degrees of freedom"
    # Of a curve that channels share there is one chi2, and here are the rows of one channel.
    of = f" of all {len(fit.shared.channels)} channels" if fit.shared else ""
    p = "σ estimated" if fit.p_value is None else f"p = {fit.p_value:.2g}"
    return f"χ²/dof{of} = {best.reduced_chi2:.2f} ({best.chi2:.1f} / {best.dof}), {p}"
