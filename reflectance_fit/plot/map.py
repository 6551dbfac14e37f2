"""A map as pictures with scales: eta, k, their sigma, and what is known of each pixel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from reflectance_fit.plot import panels, style
from reflectance_fit.plot.text import printable

_PANEL_WIDTH, _GAP, _LEFT, _RIGHT = 2.5, 1.15, 0.72, 1.75  # inches
_LOWEST, _TALLEST = 0.2, 1.3  # of a panel's height over its width
# By status: what is known of eta, then what is not, then why there is nothing.
_COLOURS = {
    "identified": "#BFD9E8",
    "upper_limit": "#0072B2",
    "ambiguous": "#E69F00",
    "near_brewster": "#009E73",
    "not_identified": "#CC79A7",
    "not_converged": "#D55E00",
    "outside": panels.BESIDE,
    "masked": "#999999",
    "saturated": "#F0E442",
    "too_few": "#666666",
    "no_light": "#333333",
    "tile_lost": "#000000",
}


class Shown(NamedTuple):
    """One channel: its name, fields of shape (h, w), the share of pixels by name of status, code to name."""

    name: str
    fields: Mapping[str, NDArray[Any]]
    shares: Mapping[str, float]
    flags: Mapping[int, str]


@style.styled
def draw_map(sample: str, channels: Sequence[Shown], place: tuple[float, float, float]) -> Figure:
    """A row of panels a channel; ``place`` is the left and top of the first pixel and how far pixels are apart."""
    has_k = any("k" in shown.fields for shown in channels)
    columns = 5 if has_k else 3
    height, width = channels[0].fields["eta"].shape
    figure, axes = style.grid(
        len(channels),
        columns,
        panel_height=_PANEL_WIDTH * float(np.clip(height / width, _LOWEST, _TALLEST)),
        width=_LEFT + _RIGHT + columns * _PANEL_WIDTH + (columns - 1) * _GAP,
        left=_LEFT,
        right=_RIGHT,
        bottom=0.5,
        top=0.62,
        gap=(0.5, _GAP),
    )
    style.heading(figure, f"{printable(sample)}: refractive index, pixel by pixel")
    left, top, pitch = place
    extent = (left - 0.5, left - 0.5 + width * pitch, top - 0.5 + height * pitch, top - 0.5)
    for line, shown in zip(axes, channels, strict=True):
        for ax, field in zip(line, ("eta", "eta_sigma", *(("k", "k_sigma") if has_k else ())), strict=False):
            _numbers(ax, shown, field, extent)
        _status(line[-1], shown, extent)
        line[0].set_ylabel("row (pixels)")
    for ax in axes[-1]:
        ax.set_xlabel("column (pixels)")
    return figure


def _numbers(ax: Axes, shown: Shown, field: str, extent: tuple[float, float, float, float]) -> None:
    """The better half of the pixels sets the scale of eta and k: the worse would stretch it to their noise."""
    values = shown.fields[field]
    known = np.isfinite(values)
    norm = Normalize(0.0, 1.0)
    if known.any():
        of_sigma = field.endswith("sigma")
        sigma = values if of_sigma else shown.fields[f"{field}_sigma"]
        counted = known if of_sigma else known & (sigma <= np.nanmedian(sigma))
        ends = (0.5, 90.0) if of_sigma else (0.5, 99.5)
        low, high = (float(q) for q in np.percentile(values[counted], ends))
        norm = Normalize(low, max(high, low + 1e-6 + 1e-4 * abs(low)))
    colours = "viridis" if field in ("eta", "k") else "magma"
    ax.imshow(values, cmap=colours, norm=norm, extent=extent, interpolation="nearest")
    symbol = {"eta_sigma": "sigma of eta", "k_sigma": "sigma of k"}.get(field, field)
    panels.frame(ax, f"{printable(shown.name)}: {symbol}" if field == "eta" else symbol)
    panels.scale(ax, norm, colours)
    if not known.any():
        panels.say(ax, "known of no pixel" if field.startswith("eta") else "taken as 0")


def _status(ax: Axes, shown: Shown, extent: tuple[float, float, float, float]) -> None:
    names = list(_COLOURS)
    number = np.zeros(256, dtype=np.uint8)
    for code, name in shown.flags.items():
        number[code] = names.index(name)
    ax.imshow(
        number[shown.fields["status"]],
        cmap=ListedColormap(list(_COLOURS.values())),
        vmin=-0.5,
        vmax=len(names) - 0.5,
        extent=extent,
        interpolation="nearest",
    )
    panels.frame(ax, "status")
    ranked = sorted(shown.shares, key=lambda name: -shown.shares[name])
    handles = [
        Patch(
            facecolor=_COLOURS[name],
            edgecolor="#999999",
            linewidth=0.4,
            label=f"{name.replace('_', ' ')} {100 * shown.shares[name]:.3g} %",
        )
        for name in ranked[:7]
    ]
    style.side_legend(ax, handles=handles, fontsize=7)
