"""Whether the sampler had settled: traces, autocorrelation time, ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from reflectance_fit.plot import style
from reflectance_fit.plot.corner import varied
from reflectance_fit.plot.text import label, subject
from reflectance_fit.result import Chains, Fit, Posterior

TRACE_POINTS = 800
RANK_BARS = 20


@style.styled
def draw_trace(fit: Fit) -> Figure:
    """The mean over walkers of each ensemble against the step, burn-in shaded."""
    posterior, chains = fit.posterior, _chains(fit)
    moving = [i for i in range(len(posterior.names)) if np.ptp(chains.trace[:, :, i]) > 0]
    figure, axes = style.grid(len(moving), panel_height=0.85, left=1.3, top=0.52, gap=(0.16, 0.0))
    style.heading(figure, f"{subject(fit)}: mean over walkers, burn-in shaded")
    length = chains.trace.shape[1]
    steps = style.thin(np.arange(1.0, length + 1), TRACE_POINTS)
    for ax, i in zip(axes[:, 0], moving, strict=True):
        ax.axvspan(0, chains.burn_in, color=style.QUIET, alpha=0.2, linewidth=0)
        for trace, look in zip(chains.trace[:, :, i], _looks(posterior), strict=True):
            ax.plot(steps, style.thin(trace, TRACE_POINTS), linewidth=0.7, **look)
        ax.set_ylabel(label(posterior.names[i]).replace(" (", "\n("))
        ax.set_xlim(0, length)
        ax.yaxis.set_major_locator(MaxNLocator(4))
        ax.grid(visible=False, axis="x")
        ax.xaxis.set_visible(ax is axes[-1, 0])
    axes[-1, 0].set_xlabel("step (iterations)")
    _ensembles_above(axes[0, 0], posterior)
    return figure


@style.styled
def draw_autocorrelation(fit: Fit) -> Figure:
    """The estimate of the autocorrelation time as the chain grew; to be trusted below N / 25."""
    chains = _chains(fit)
    figure, axes = style.grid(panel_height=2.8, width=4.8)
    style.heading(figure, f"{subject(fit)}: autocorrelation time")
    ax = axes[0, 0]
    known = np.isfinite(chains.tau) & (chains.tau > 0)
    n, tau = chains.tau_steps[known], chains.tau[known]
    ax.set(
        xscale="log", yscale="log", xlabel="chain length N (steps)", ylabel="autocorrelation time τ (steps)"
    )
    ends = np.array([n.min(), n.max()]) if len(n) else np.array([50.0, max(100.0, chains.steps)])
    ax.plot(ends, ends / 25, color=style.QUIET, linestyle="--", label="τ = N / 25")
    ax.fill_between(
        ends, ends / 25, 1e-9, color=style.QUIET, alpha=0.12, linewidth=0, label="long enough: N > 25 τ"
    )
    ax.plot(n, tau, "o-", color=style.INK, label="largest over parameters")
    seen = np.concatenate([tau, ends / 25])
    ax.set_ylim(seen.min() / 1.6, seen.max() * 2.5)
    _plain_log(ax.xaxis)
    _plain_log(ax.yaxis)
    ax.legend(loc="upper left", bbox_to_anchor=(0.02, 0.99), frameon=True, framealpha=0.9, edgecolor="none")
    return figure


@style.styled
def draw_rank(fit: Fit) -> Figure:
    """Where each ensemble's draws rank among all: level lines mean that the ensembles agree."""
    posterior = fit.posterior
    names = varied(posterior)
    excess = {name: rank_densities(posterior, name) - 1 for name in names}
    spread = {name: _spread(posterior, name) for name in names}
    reach = max(1.3 * max(spread.values()), 1.1 * max(float(np.max(np.abs(e))) for e in excess.values()))
    figure, axes = style.grid(panel_height=max(1.2, 0.8 * len(names)), left=1.6, top=0.52)
    style.heading(figure, f"{subject(fit)}: ranks of the draws, grey is 95 % of chance")
    ax = axes[0, 0]
    rows = np.arange(len(names))
    for row, name in enumerate(names):
        band = 0.5 * spread[name] / reach
        ax.axhspan(row - band, row + band, color=style.QUIET, alpha=0.2, linewidth=0)
    ax.hlines(rows, 0, 1, color=style.INK, linewidth=0.5)
    ax.hlines(rows[1:] - 0.5, 0, 1, color=style.INK, linewidth=0.7)
    edges = np.linspace(0, 1, RANK_BARS + 1)
    for ensemble, look in enumerate(_looks(posterior)):
        # Downwards, as rows are read; the gap parts a row's line from the next row's.
        lines = [row - 0.5 * excess[name][ensemble] / reach for row, name in enumerate(names)]
        steps = np.concatenate([np.append(line, (line[-1], np.nan)) for line in lines])
        ax.plot(
            np.tile(np.append(edges, np.nan), len(names)),
            steps,
            drawstyle="steps-post",
            linewidth=1.1,
            **look,
        )
    ax.grid(visible=False)
    ax.set(
        xlim=(0, 1),
        ylim=(len(names) - 0.5, -0.5),
        xlabel="rank (fraction)",
        ylabel=f"density − 1\neach row ±{reach:.2g}",
    )
    ax.set_yticks(range(len(names)), [label(name).replace(" (", "\n(") for name in names])
    ax.tick_params(axis="y", length=0)
    _ensembles_above(ax, posterior)
    return figure


def rank_densities(posterior: Posterior, name: str) -> NDArray[np.float64]:
    """Density of the rank (0 to 1) of each ensemble's draws among all, shape (ensemble, bar)."""
    draws = posterior.samples[name]
    # Equal draws are one walker's that stood still: whichever comes first, its ensemble is the same.
    owner = np.repeat(posterior.ensemble, draws.shape[1])[np.argsort(draws, axis=None)]
    bar = np.arange(draws.size) * RANK_BARS // draws.size
    counts = np.bincount(owner * RANK_BARS + bar, minlength=posterior.ensembles * RANK_BARS)
    share = counts.reshape(posterior.ensembles, RANK_BARS)
    density: NDArray[np.float64] = share / share.mean(axis=1, keepdims=True)
    return density


def _spread(posterior: Posterior, name: str) -> float:
    """How far chance takes a bar from 1, in 95 % of cases."""
    # Correlated draws scatter more than independent ones: the effective number counts.
    effective = max(1.0, posterior.ess.get(name, posterior.samples[name].size) / posterior.ensembles)
    return float(1.96 * np.sqrt((RANK_BARS - 1) / effective))


def _looks(posterior: Posterior) -> list[dict[str, Any]]:
    """Colour and name of each ensemble."""
    return [
        {"color": style.ENSEMBLES[e % len(style.ENSEMBLES)], "label": f"ensemble {e + 1}"}
        for e in range(posterior.ensembles)
    ]


def _ensembles_above(ax: Axes, posterior: Posterior) -> None:
    ax.legend(
        handles=[Line2D([], [], linewidth=2.0, **look) for look in _looks(posterior)],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.02),
        ncols=posterior.ensembles,
        columnspacing=1.2,
    )


def _plain_log(axis: Axis) -> None:
    """Numbers as people write them, where powers of ten would need a formula."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / low < 1000 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.12g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _chains(fit: Fit) -> Chains:
    """How emcee ran; ValueError where another method drew."""
    if fit.posterior.chains is None:
        raise ValueError(f"{fit.posterior.method} has no chains to look at")
    return fit.posterior.chains
