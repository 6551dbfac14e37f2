"""What the photographs of one view show: signal, polarization, angles, contradictions, and what is masked."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, PowerNorm
from matplotlib.figure import Figure

from reflectance_fit.plot import panels, style
from reflectance_fit.plot.text import printable
from reflectance_fit.views import FloatArray, ViewMaps

_WIDTH = 9.6  # inches: three pictures side by side
_LEFT, _RIGHT, _GAP, _TOP, _BOTTOM = 0.62, 0.72, 1.05, 0.62, 0.5
_PANEL = (_WIDTH - _LEFT - _RIGHT - 2 * _GAP) / 3
_LOWEST, _TALLEST = 0.2, 1.3  # of a panel's height over its width
_MASKS = ("#E69F00", "#CC79A7", "#D55E00", "#0072B2")
# Below this degree of polarization its azimuth is that of noise.
_NO_AZIMUTH = 0.02
# Length of the mean of directions that all but agree: they spread over ten degrees at most.
_ONE_DIRECTION = 0.98


@style.styled
def draw_view(view: ViewMaps) -> Figure:
    """Six maps over the sample in sensor pixels; masked cells are left out of the colour scales."""
    rows, columns = view.inside.shape
    height = _PANEL * float(np.clip(rows / max(1, columns), _LOWEST, _TALLEST))
    figure, axes = style.grid(
        2,
        3,
        panel_height=height,
        width=_WIDTH,
        left=_LEFT,
        right=_RIGHT,
        bottom=_BOTTOM,
        top=_TOP,
        gap=(0.5, _GAP),
    )
    style.heading(figure, f"{printable(view.name)}, channel {printable(view.channel)}")
    left_out = np.any(list(view.masked.values()), axis=0)
    shown = view.inside & ~left_out
    stokes = view.stokes
    level = np.where(view.inside, stokes.s0, np.nan)
    level = level / np.nanmax(np.where(shown, level, np.nan)) if np.isfinite(level[shown]).any() else level
    _map(axes[0, 0], view, level, "signal of both polarizations (of the largest)", "gray", shown)
    dolp = np.where(view.inside, stokes.dolp, np.nan)
    _map(axes[0, 1], view, dolp, "degree of linear polarization", "viridis", shown)
    _azimuth(axes[0, 2], view, shown)
    _angles(axes[1, 0], view, shown)
    _contradictions(axes[1, 1], view, shown)
    _masks(axes[1, 2], view)
    for ax in axes[:, 0]:
        ax.set_ylabel("row (pixels)")
    for ax in axes[1]:
        ax.set_xlabel("column (pixels)")
    return figure


def _extent(view: ViewMaps) -> tuple[float, float, float, float]:
    rows, columns = view.inside.shape
    left, top = view.left - 0.5, view.top - 0.5
    return left, left + columns * view.pitch, top + rows * view.pitch, top


def _map(
    ax: Axes,
    view: ViewMaps,
    values: FloatArray,
    title: str,
    colours: str,
    shown: Any,
    *,
    limits: tuple[float, float] | None = None,
) -> None:
    """A map and its scale: over ``limits``, or what all but some stray cells span, from 0 where that is near."""
    known = values[shown & np.isfinite(values)]
    low, high = limits or (0.0, 1.0)
    if limits is None and known.size:
        low, high = (float(q) for q in np.percentile(known, (0.2, 99.8)))
        low = 0.0 if 0.0 <= low < 0.5 * high else low
        high = max(high, low + 1e-3)
    # A ball's rim is ten times as bright as its middle.
    norm = PowerNorm(0.5 if low == 0.0 and colours == "gray" else 1.0, low, high)
    ax.imshow(values, cmap=colours, norm=norm, extent=_extent(view), interpolation="nearest")
    panels.frame(ax, title)
    panels.scale(ax, norm, colours)
    if not known.size:
        panels.say(ax, "not determined\nby these views")


def _azimuth(ax: Axes, view: ViewMaps, shown: Any) -> None:
    """All directions around the clock, or, where there is hardly more than one, what it is off by."""
    known = view.inside & (view.stokes.dolp > _NO_AZIMUTH)
    twice = np.exp(2j * np.where(known, view.stokes.aolp, np.nan))
    title, colours, limits = "azimuth of polarization (deg)", "twilight", (0.0, 180.0)
    azimuth = np.degrees(np.where(known, view.stokes.aolp, np.nan))
    if (known & shown).any():
        mean = np.mean(twice[known & shown])
        if abs(mean) > _ONE_DIRECTION:
            middle = mean / abs(mean)
            azimuth = np.degrees(0.5 * np.angle(twice / middle))
            most = max(float(np.percentile(np.abs(azimuth[known & shown]), 99.5)), 1e-3)
            about = np.degrees(0.5 * np.angle(middle)) % 180.0
            title, colours, limits = (
                f"azimuth of polarization (deg from {about:.2f})",
                "RdBu_r",
                (-most, most),
            )
    _map(ax, view, azimuth, title, colours, shown, limits=limits)


def _angles(ax: Axes, view: ViewMaps, shown: Any) -> None:
    title = "angle of incidence (deg)"
    if view.theta.ndim:
        theta = np.degrees(np.where(view.inside, view.theta, np.nan))
        _map(ax, view, theta, title, "cividis", view.inside)
        span = float(np.nanmax(theta) - np.nanmin(theta)) if np.isfinite(theta).any() else 0.0
        if span > 0.1:
            step = next(s for s in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0) if span / s <= 8)
            rows, columns = theta.shape
            x = view.left + view.pitch * (np.arange(columns) + 0.5)
            y = view.top + view.pitch * (np.arange(rows) + 0.5)
            levels = np.arange(np.ceil(np.nanmin(theta) / step), np.nanmax(theta) / step) * step
            ax.contour(x, y, theta, levels=levels, colors="white", linewidths=0.6)
        return
    flat = np.where(shown, 0.5, np.nan)
    ax.imshow(flat, cmap="cividis", vmin=0, vmax=1, extent=_extent(view), interpolation="nearest")
    panels.frame(ax, title)
    panels.say(ax, f"{np.degrees(float(view.theta)):.4g}°\nas stated, everywhere")


def _contradictions(ax: Axes, view: ViewMaps, shown: Any) -> None:
    title = "what the views contradict (% of signal)"
    redundancy = view.stokes.redundancy
    if redundancy is None:
        ax.imshow(np.full(view.inside.shape, np.nan), extent=_extent(view), interpolation="nearest")
        panels.frame(ax, title)
        panels.say(ax, "three views contradict\nnothing; take a fourth")
        return
    percent = np.where(view.inside, 100.0 * redundancy, np.nan)
    known = np.abs(percent[shown & np.isfinite(percent)])
    most = max(float(np.percentile(known, 99.5)) if known.size else 0.0, 1e-3)
    _map(ax, view, percent, title, "RdBu_r", shown, limits=(-most, most))


def _masks(ax: Axes, view: ViewMaps) -> None:
    kind = np.where(view.inside, 1, 0)
    legend: list[tuple[str, str]] = []
    for number, (reason, masked) in enumerate(view.masked.items()):
        kind[masked] = number + 2
        share = 100.0 * masked.sum() / max(1, view.inside.sum())
        if masked.any():
            legend.append((f"{reason} {share:.2g} %", _MASKS[number % len(_MASKS)]))
    colours = [panels.BESIDE, "#BFD9E8", *_MASKS]
    ax.imshow(
        kind,
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(colours) - 0.5,
        extent=_extent(view),
        interpolation="nearest",
    )
    used = 100.0 * (1.0 - np.any(list(view.masked.values()), axis=0).sum() / max(1, view.inside.sum()))
    panels.frame(ax, f"used: {used:.4g} % of the sample")
    if legend:
        panels.legend(ax, legend)
