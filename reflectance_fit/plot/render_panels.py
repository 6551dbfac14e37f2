"""Figures of renders: exact beside approximate, polarization in colours, a turning analyzer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import hsv_to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from reflectance_fit.plot import style
from reflectance_fit.plot.render import encoded
from reflectance_fit.plot.text import printable

Floats = NDArray[np.float64]

_WIDTH = 9.6  # inches
_SIDE, _BAR = 0.12, 0.78
_LOWEST, _TALLEST = 0.4, 1.4  # of a panel's height over its width
# Beyond this share of pixels the scale of differences ends: a few bright dots must not hide the rest.
_SCALED = 0.995
_MARK = "#E69F00"


@style.styled
def draw_compare(
    title: str, pictures: Mapping[str, Floats], difference: Floats, lines: Sequence[str], stops: float
) -> Figure:
    """Two pictures at one exposure, their signed difference with its scale, and lines of numbers below.

    ``pictures`` by name, linear, shape (height, width, 1 or 3); ``difference``, shape (height,
    width), in the unit of radiance.
    """
    figure, axes = _panels(title, 3, difference.shape, right=_BAR, bottom=0.12 + 0.17 * len(lines))
    for ax, (name, picture) in zip(axes, pictures.items(), strict=False):
        _show(ax, name, encoded(picture, stops))
    limit = max(float(np.quantile(np.abs(difference), _SCALED)), 1e-12)
    # The names stand in the order of the panels: the second minus the first.
    first, second = pictures
    _show(axes[2], f"{second} − {first}, radiance", difference, cmap="RdBu_r", vmin=-limit, vmax=limit)
    _scale(axes[2], "RdBu_r", -limit, limit)
    _words(figure, lines)
    return figure


@style.styled
def draw_polarization(title: str, degree: Floats, angle_deg: Floats) -> Figure:
    """Degree of linear polarization, and its angle as a hue, the more grey the less polarized.  Shape (height, width)."""
    figure, axes = _panels(title, 2, degree.shape, right=1.25, gap=0.95)
    _show(axes[0], "degree of linear polarization", degree, cmap="viridis", vmin=0.0, vmax=1.0)
    _scale(axes[0], "viridis", 0.0, 1.0)
    _show(axes[1], "angle of linear polarization (deg)", _hues(degree, angle_deg))
    _wheel(axes[1])
    return figure


@style.styled
def draw_analyzers(
    title: str, pictures: Mapping[float, Floats], degree: Floats, of_rows: Floats, stops: float
) -> Figure:
    """One picture for each analyzer angle in degrees, then the degree of polarization of pixels and of rows.

    ``degree`` has shape (height, width), ``of_rows`` (height,).  The row where the latter is largest is marked.
    """
    count = len(pictures) + 2
    columns = 3 if count % 3 == 0 else 4
    figure, axes = _panels(title, columns, degree.shape, right=0.2, bottom=0.35, count=count)
    for ax, (angle, picture) in zip(axes, pictures.items(), strict=False):
        _show(ax, f"analyzer at {angle:g}°", encoded(picture, stops))
        _arrow(ax, angle)
    shown, profile = axes[len(pictures)], axes[len(pictures) + 1]
    _show(shown, "degree of linear polarization", degree, cmap="viridis", vmin=0.0, vmax=1.0)
    row = int(np.argmax(of_rows))
    profile.plot(of_rows, np.arange(len(of_rows)), color=style.INK)
    profile.set(xlim=(0, 1), ylim=(len(of_rows) - 0.5, -0.5), xticks=(0, 0.5, 1))
    profile.set_title(f"that of each row's light: {of_rows[row]:.2f} in row {row}", size=8.5)
    profile.tick_params(left=False, labelleft=False)
    for ax in (shown, profile):
        ax.axhline(row, color=_MARK, linewidth=1.0, linestyle="--")
    for ax in axes[count:]:
        ax.set_visible(False)
    return figure


def _panels(
    title: str,
    columns: int,
    shape: tuple[int, ...],
    *,
    right: float = _SIDE,
    bottom: float = _SIDE,
    gap: float = _SIDE,
    count: int | None = None,
) -> tuple[Figure, list[Axes]]:
    """Axes of the pictures' aspect, in rows of ``columns``."""
    width = (_WIDTH - _SIDE - right - (columns - 1) * gap) / columns
    height = width * float(np.clip(shape[0] / shape[1], _LOWEST, _TALLEST))
    figure, axes = style.grid(
        -(-(count or columns) // columns),
        columns,
        panel_height=height,
        width=_WIDTH,
        left=_SIDE,
        right=right,
        bottom=bottom,
        top=0.55,
        gap=(0.3, gap),
    )
    style.heading(figure, printable(title, 100))
    return figure, list(axes.flat)


def _show(ax: Axes, title: str, values: Floats, **colours: Any) -> None:
    ax.imshow(values, interpolation="nearest" if max(values.shape[:2]) < 300 else "antialiased", **colours)
    ax.set_title(title, size=8.5)
    ax.grid(visible=False)
    ax.set(xticks=(), yticks=())
    ax.spines[["top", "right"]].set_visible(True)


def _scale(ax: Axes, colours: str, low: float, high: float) -> None:
    bar = ax.inset_axes((1.03, 0.0, 0.04, 1.0))
    steps = np.linspace(low, high, 128)[:, None]
    bar.imshow(steps, cmap=colours, extent=(0, 1, low, high), aspect="auto", origin="lower")
    bar.grid(visible=False)
    bar.xaxis.set_visible(False)
    bar.yaxis.tick_right()
    bar.yaxis.set_major_locator(MaxNLocator(5))
    bar.yaxis.set_major_formatter(lambda value, _: f"{value:.3g}".replace("-", "−"))
    bar.tick_params(labelsize=7.5, length=2.5)


def _hues(degree: Floats, angle_deg: Floats) -> Floats:
    """Once around the colours from 0 to 180 degrees; grey where unpolarized."""
    hue = np.mod(angle_deg / 180.0, 1.0)
    return np.asarray(hsv_to_rgb(np.stack([hue, degree, 0.45 + 0.5 * degree], axis=-1)))


def _wheel(ax: Axes) -> None:
    """The legend of `_hues`: each direction in its own colour, fully polarized at the rim."""
    wheel = ax.inset_axes((1.01, 0.0, 0.33, 0.5))
    steps = np.linspace(-1.0, 1.0, 161)
    x, y = np.meshgrid(steps, steps[::-1])
    radius = np.hypot(x, y)
    colours = _hues(np.minimum(radius, 1.0), np.mod(np.degrees(np.arctan2(y, x)), 180.0))
    wheel.imshow(np.dstack([colours, radius <= 1.0]), extent=(-1, 1, -1, 1))
    wheel.set(xlim=(-1.45, 1.45), ylim=(-1.45, 1.45))
    wheel.axis("off")
    for angle in (0, 45, 90, 135):
        towards = np.radians(angle)
        wheel.text(
            1.24 * np.cos(towards), 1.24 * np.sin(towards), f"{angle}", size=7, ha="center", va="center"
        )


def _arrow(ax: Axes, angle_deg: float) -> None:
    """The transmission axis, as a bar in a corner."""
    corner = ax.inset_axes((0.02, 0.02, 0.16, 0.16 * ax.bbox.width / ax.bbox.height))
    towards = np.radians(angle_deg)
    x, y = np.cos(towards), np.sin(towards)
    for colour, width in (("black", 3.2), ("white", 1.4)):
        corner.plot((-x, x), (-y, y), color=colour, linewidth=width, solid_capstyle="round")
    corner.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2), aspect="equal")
    corner.axis("off")


def _words(figure: Figure, lines: Sequence[str]) -> None:
    width, height = figure.get_size_inches()
    for number, line in enumerate(reversed(lines)):
        figure.text(_SIDE / width, (0.06 + 0.17 * number) / height, printable(line, 160), size=8, va="bottom")
