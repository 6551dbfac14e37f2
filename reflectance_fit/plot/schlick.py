"""What a renderer's shortcut would cost on this very material."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics.approximations import conductor_approximation, schlick
from reflectance_fit.physics.fresnel import r0, reflectances
from reflectance_fit.plot import style
from reflectance_fit.plot.text import THETA, subject
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

DRAWS = 300
THETA_DEG = np.linspace(0.0, 90.0, 361)


def draw_schlick(fit: Fit) -> Figure:
    """Exact unpolarized reflectance with its posterior band, the approximations, and their errors."""
    eta, k = fit.optimum.eta / fit.exterior_ior, fit.optimum.k / fit.exterior_ior
    draws = [style.thin(fit.posterior.flat(n), DRAWS)[:, None] / fit.exterior_ior for n in ("eta", "k")]
    cos_theta_i, _ = cos_sin_deg(THETA_DEG)
    low, high = np.percentile(reflectances(cos_theta_i, *draws).mean, (2.5, 97.5), axis=0)
    title = f"{subject(fit)}: unpolarized reflectance, exact and approximate"
    return draw_approximations(title, eta, k, band=(low, high))


@style.styled
def draw_approximations(
    title: str, eta: float, k: float, *, band: tuple[FloatArray, FloatArray] | None = None
) -> Figure:
    """Exact and approximate reflectance of a relative index eta + ik, and the errors below.

    ``band``: lower and upper limit of the exact reflectance over THETA_DEG.
    """
    cos_theta_i, _ = cos_sin_deg(THETA_DEG)
    exact = reflectances(cos_theta_i, eta, k).mean
    approximations = {
        "Schlick": (schlick(cos_theta_i, r0(eta, k)), style.APPROXIMATIONS[0], "-"),
        "conductor approximation": (
            conductor_approximation(cos_theta_i, eta, k).mean,
            style.APPROXIMATIONS[1],
            "--",
        ),
    }

    figure, axes = style.grid(2, panel_height=2.0, right=1.95, gap=(0.2, 0.0), share_x=True)
    style.heading(figure, title)
    above, below = axes[:, 0]
    if band is not None:
        above.fill_between(THETA_DEG, *band, color=style.INK, alpha=0.25, linewidth=0, label="posterior 95 %")
    above.plot(THETA_DEG, exact, color=style.INK, label="exact (Fresnel)")
    below.axhline(0, color=style.INK, linewidth=0.8)
    for name, (values, colour, line) in approximations.items():
        error = values - exact
        worst = int(np.argmax(np.abs(error)))
        above.plot(THETA_DEG, values, color=colour, linestyle=line, label=name)
        below.plot(THETA_DEG, error, color=colour, linestyle=line)
        below.plot(
            THETA_DEG[worst],
            error[worst],
            "o",
            color=colour,
            markeredgecolor="white",
            label=f"{error[worst]:+.2g} at {THETA_DEG[worst]:.3g}°",
        )
    # A metal's reflectance hardly varies: from 0 its curves would be one line.
    lowest = float(np.min(exact if band is None else band[0]))
    floor = lowest - 0.25 * (1 - lowest) if lowest > 0.5 else 0.0
    above.set(ylabel="reflectance (fraction)", ylim=(floor, 1.02))
    below.set(ylabel="approx. − exact (fraction)", xlabel=THETA, xlim=(0, 90), xticks=range(0, 91, 10))
    style.side_legend(above)
    style.side_legend(below, title="largest error", alignment="left", title_fontsize=8.0)
    figure.align_ylabels()
    return figure
