"""The picture to look at first: points, model, posterior band, Brewster angle."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator

from reflectance_fit.observations import Quantity
from reflectance_fit.plot import style
from reflectance_fit.plot.curve import Curve, FloatArray, Model, Predict, turn
from reflectance_fit.plot.series import ABSCISSAS, LEGEND_ENTRIES, Panel, Series, panels
from reflectance_fit.plot.text import subject, with_error
from reflectance_fit.result import Fit


@style.styled
def draw_fit(fit: Fit, predict: Predict) -> Figure:
    """Measured values, the model at the optimum and its 68 and 95 % band, one panel per unit.

    Signals are divided by their fitted gain, so that every setting lies on one
    scale; each draw of the band takes the gain that suits it best.
    """
    shown = panels(fit.observations)
    figure, axes = style.grid(
        len(shown), panel_height=3.0 if len(shown) == 1 else 2.2, right=1.75, top=0.58, gap=(0.42, 0.0)
    )
    left_out = f", {fit.saturated} saturated not shown" if fit.saturated else ""
    style.heading(figure, subject(fit) + left_out)
    model = Model(fit, predict)
    y, sigma = _measured(fit, model)
    for number, (ax, panel) in enumerate(zip(axes[:, 0], shown, strict=True)):
        _limits(ax, fit, panel, y, sigma)
        for series, curve in zip(panel.series, model.curves(panel), strict=True):
            _curve(ax, panel, series, curve)
            _points(ax, fit, panel, series, y, sigma)
        if panel.abscissa == "theta_deg":
            _brewster(ax, fit, named=number == 0)
        if number == len(shown) - 1 or panel.abscissa != shown[number + 1].abscissa:
            ax.set_xlabel(ABSCISSAS[panel.abscissa])
        ax.set_ylabel(panel.ylabel)
        if panel.kind == Quantity.DELTA_DEG and np.ptp(ax.get_ylim()) > 100:
            ax.yaxis.set_major_locator(MultipleLocator(45))
        _legend(ax, fit, panel, explain=number == 0)
    return figure


def _measured(fit: Fit, model: Model) -> tuple[FloatArray, FloatArray]:
    """Every row's value and own standard deviation as drawn: without gain, Delta near the model."""
    rows, predicted = fit.observations, fit.optimum.predicted
    near = predicted + turn(rows.value - predicted)
    value = np.where(rows.quantity == Quantity.DELTA_DEG, near, rows.value)
    estimated = np.array([fit.estimated_sigma.get(str(q), np.nan) for q in rows.quantity])
    sigma = np.where(np.isfinite(rows.sigma), rows.sigma, estimated)
    gain = model.gain(rows)
    return value / gain, sigma / gain


def _limits(ax: Axes, fit: Fit, panel: Panel, y: FloatArray, sigma: FloatArray) -> None:
    """The range of the data, from zero where zero is near: a model that soars to 1 must not flatten them."""
    rows = np.concatenate([s.rows for s in panel.series])
    error = np.nan_to_num(sigma[rows])
    low, high = float(np.min(y[rows] - error)), float(np.max(y[rows] + error))
    margin = 0.08 * (high - low) or 0.05 * abs(high) or 1.0
    if panel.kind == "power" and 0 <= low < 0.35 * high:
        low = 0.0
    ax.set_ylim(low - margin, high + margin)
    x = getattr(fit.observations, panel.abscissa)[rows]
    if panel.abscissa != "theta_deg":
        return
    span = float(np.ptp(x))
    # A scan of a few degrees would be a smear on the whole quadrant.
    wide = span >= 25.0 or span == 0.0
    ax.set_xlim((0.0, 90.0) if wide else (max(0.0, x.min() - 0.6 * span), min(90.0, x.max() + 0.6 * span)))


def _curve(ax: Axes, panel: Panel, series: Series, curve: Curve) -> None:
    best = curve.best.copy()
    if panel.kind == Quantity.DELTA_DEG:
        # A full turn is no jump of the model; the half turn of glass is.
        best[1:][np.abs(np.diff(best)) > 185.0] = np.nan
    low95, low68, high68, high95 = curve.band
    ax.fill_between(curve.x, low95, high95, color=series.colour, alpha=0.18, linewidth=0)
    ax.fill_between(curve.x, low68, high68, color=series.colour, alpha=0.32, linewidth=0)
    ax.plot(curve.x, best, color=series.colour, linewidth=1.0)


def _points(ax: Axes, fit: Fit, panel: Panel, series: Series, y: FloatArray, sigma: FloatArray) -> None:
    rows, mine = fit.observations, series.rows
    x = getattr(rows, panel.abscissa)
    if len(mine) > style.DENSE:
        # A cloud: its own scatter says what error bars would, and the model stays visible over it.
        ax.plot(
            x[mine], y[mine], ".", color=series.colour, alpha=0.25, markersize=2.0, rasterized=True, zorder=1
        )
        return
    has_x_error = panel.abscissa == "theta_deg" and bool(np.any(rows.theta_deg_sigma[mine] > 0))
    ax.errorbar(
        x[mine],
        y[mine],
        yerr=np.nan_to_num(sigma[mine]),
        xerr=rows.theta_deg_sigma[mine] if has_x_error else None,
        fmt=series.marker,
        color=series.colour,
        markeredgecolor="white",
        markeredgewidth=0.4,
        markersize=4.2 if len(mine) <= 60 else 2.5,
        elinewidth=0.8,
        zorder=3,
    )


def _brewster(ax: Axes, fit: Fit, named: bool) -> None:
    angle = fit.intervals.get("brewster_deg")
    if angle is None or angle.median is None:
        return
    left, right = ax.get_xlim()
    if angle.ci95 is not None:
        ax.axvspan(*angle.ci95, color=style.QUIET, alpha=0.35, linewidth=0, zorder=0.5)
    ax.axvline(angle.median, color=style.INK, linewidth=0.8, linestyle=(0, (4, 2)), zorder=0.6)
    ax.set_xlim(left, right)
    if named:
        kind = "Brewster" if fit.optimum.k == 0 else "pseudo-Brewster"
        text = f"{kind} {with_error(angle.median, angle.sd or 0.0)}°"
        text = f"← {text}" if angle.median < left else f"{text} →" if angle.median > right else text
        place = float(np.clip((angle.median - left) / (right - left), 0.0, 1.0))
        ax.text(
            place,
            1.02,
            text,
            transform=ax.transAxes,
            ha="right" if place > 0.8 else "left" if place < 0.2 else "center",
            va="bottom",
            size=8.5,
        )


def _legend(ax: Axes, fit: Fit, panel: Panel, explain: bool) -> None:
    named = list(panel.series)
    if len(named) > LEGEND_ENTRIES:
        named = [named[i] for i in np.linspace(0, len(named) - 1, LEGEND_ENTRIES).astype(int)]
    handles: list[Artist] = [Line2D([], [], color=s.colour, marker=s.marker, linestyle="") for s in named]
    labels = [s.label for s in named]
    if explain:
        handles.append(Line2D([], [], color=style.QUIET, linewidth=1.0))
        labels.append("model at optimum")
        for share, alpha in (("68 %", 0.5), ("95 %", 0.25)):
            handles.append(Patch(color=style.QUIET, alpha=alpha, linewidth=0))
            labels.append(f"posterior {share}")
    if explain or len(named) > 1:
        ax.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.02, 1.0))
