"""What a renderer's shortcut would cost on this very material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics.approximation_error import approximation_error
from reflectance_fit.physics.approximation_ladder import LADDER, Approximation
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.plot import style
from reflectance_fit.plot.text import THETA, subject
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]
Draws = tuple[FloatArray, FloatArray]

DRAWS = 300
# Finer towards grazing incidence, where a near match ends.
THETA_DEG = np.concatenate([np.linspace(0.0, 89.75, 360), 90.0 - np.geomspace(0.2, 1e-3, 12), [90.0]])
# Around zero the axis of errors is linear, further out logarithmic: shortcuts differ by powers of ten.
LINEAR_WIDTH = 5e-4
ERROR_TICKS = (-1.0, -0.1, -0.01, -0.001, 0.0, 0.001, 0.01, 0.1, 1.0)
_BAND = (0.025, 0.975)


@dataclass(frozen=True, slots=True)
class _Look:
    label: str
    colour: str
    line: str | tuple[int, tuple[float, ...]] = "-"


# One colour an idea (Okabe and Ito's), and a dash for each of its variants.
_LOOKS = {
    "r0_constant": _Look("R0 constant", style.QUIET, (0, (1, 1))),
    "schlick": _Look("Schlick", "#E69F00"),
    "schlick_real_r0": _Look("Schlick, R0 of η alone", "#E69F00", (0, (4, 1.5))),
    "lazanyi": _Look("Lazanyi", "#D55E00", (0, (5, 1, 1, 1))),
    "f82": _Look("F82 (OpenPBR)", "#0072B2"),
    "lecture_conductor": _Look("large-index form", "#009E73"),
    "gulbrandsen": _Look("Gulbrandsen", "#009E73", (0, (4, 1.5))),
    "table": _Look("table of 257", "#CC79A7"),
}


def draw_schlick(fit: Fit) -> Figure:
    """Exact unpolarized reflectance with its posterior band, the approximations, and their errors."""
    eta, k = fit.optimum.eta / fit.exterior_ior, fit.optimum.k / fit.exterior_ior
    draws = (fit.posterior.flat("eta") / fit.exterior_ior, fit.posterior.flat("k") / fit.exterior_ior)
    title = f"{subject(fit)}: unpolarized reflectance, exact and approximate"
    return draw_approximations(title, eta, k, draws=draws)


@style.styled
def draw_approximations(title: str, eta: float, k: float, *, draws: Draws | None = None) -> Figure:
    """Exact and approximate reflectance of a relative index eta + ik, and the errors below.

    ``draws`` of eta and k (relative, one-dimensional) give 95 % bands.
    """
    cos_theta_i, _ = cos_sin_deg(THETA_DEG)
    exact = reflectances(cos_theta_i, eta, k).mean
    columns = None if draws is None else tuple(style.thin(part, DRAWS)[:, np.newaxis] for part in draws)
    drawn = None if columns is None else reflectances(cos_theta_i, *columns).mean

    figure, axes = style.grid(2, panel_height=2.5, left=0.95, right=2.05, gap=(0.2, 0.0), share_x=True)
    style.heading(figure, title)
    above, below = axes[:, 0]
    if drawn is not None:
        band = np.quantile(drawn, _BAND, axis=0)
        above.fill_between(THETA_DEG, *band, color=style.INK, alpha=0.25, linewidth=0, label="posterior 95 %")
    above.plot(THETA_DEG, exact, color=style.INK, linewidth=2.4, label="exact (Fresnel)")
    below.axhline(0, color=style.INK, linewidth=0.8)
    for rungs, values in _distinct(cos_theta_i, eta, k):
        rung, look = rungs[0], _LOOKS[rungs[0].name]
        worst = approximation_error(eta, k, rung.curve(eta, k))
        names = "\n= ".join(_LOOKS[one.name].label for one in rungs)
        largest = f"{worst.error:+.2g} at {worst.at_deg:.3g}°".replace("-", "−")
        above.plot(THETA_DEG, values, color=look.colour, linestyle=look.line, label=f"{names}\n{largest}")
        below.plot(THETA_DEG, values - exact, color=look.colour, linestyle=look.line)
        below.plot(worst.at_deg, worst.error, "o", color=look.colour, markeredgecolor="white", clip_on=False)
        if columns is not None and drawn is not None:
            band = np.quantile(rung.curve(*columns)(cos_theta_i) - drawn, _BAND, axis=0)
            below.fill_between(THETA_DEG, *band, color=look.colour, alpha=0.3, linewidth=0)
    # A metal's reflectance hardly varies: from 0 its curves would be one line.
    lowest = float(np.min(exact))
    floor = lowest - 0.25 * (1 - lowest) if lowest > 0.5 else 0.0
    above.set(ylabel="reflectance (fraction)", ylim=(floor, 1 + 0.02 * (1 - floor)))
    below.set(
        ylabel="approx. − exact (fraction)\nasinh scale", xlabel=THETA, xlim=(0, 90), xticks=range(0, 91, 10)
    )
    below.set_yscale("asinh", linear_width=LINEAR_WIDTH)
    low, high = below.get_ylim()
    labels = [f"{tick:+g}".replace("-", "−") if tick else "0" for tick in ERROR_TICKS]
    below.set_yticks(ERROR_TICKS, labels, minor=False)
    below.set_yticks([], minor=True)
    below.set_ylim(low, high)
    style.side_legend(above, title="largest error below each name", alignment="left", title_fontsize=8.0)
    figure.align_ylabels()
    return figure


def _distinct(cos_theta_i: FloatArray, eta: float, k: float) -> list[tuple[list[Approximation], FloatArray]]:
    """The approximations and their values; those that are one and the same for this material stand together."""
    found: list[tuple[list[Approximation], FloatArray]] = []
    for rung in LADDER:
        if rung.name not in _LOOKS:
            continue
        values = rung(cos_theta_i, eta, k)
        for rungs, others in found:
            if np.array_equal(values, others):
                rungs.append(rung)
                break
        else:
            found.append(([rung], values))
    return found
