"""Whether the sampler had settled: traces, autocorrelation time, ranks."""

from __future__ import annotations

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from reflectance_fit.plot import style
from reflectance_fit.plot.corner import varied
from reflectance_fit.plot.text import label, subject
from reflectance_fit.result import Fit

TRACE_POINTS = 2000
RANK_BARS = 20


@style.styled
def draw_trace(fit: Fit) -> Figure:
    """The mean over walkers of each ensemble against the step, burn-in shaded."""
    posterior = fit.posterior
    moving = [i for i in range(len(posterior.names)) if np.ptp(posterior.trace[:, :, i]) > 0]
    figure, axes = style.grid(
        len(moving),
        panel_height=1.35 if len(moving) <= 4 else 1.0,
        left=1.2,
        top=0.52,
        gap=(0.18, 0.0),
        share_x=True,
    )
    style.heading(figure, f"{subject(fit)}: mean over walkers, burn-in shaded")
    steps = style.thin(np.arange(1.0, posterior.trace.shape[1] + 1), TRACE_POINTS)
    for ax, i in zip(axes[:, 0], moving, strict=True):
        ax.axvspan(0, posterior.burn_in, color=style.QUIET, alpha=0.2, linewidth=0)
        for ensemble, trace in enumerate(posterior.trace[:, :, i]):
            colour = style.ENSEMBLES[ensemble % len(style.ENSEMBLES)]
            ax.plot(
                steps,
                style.thin(trace, TRACE_POINTS),
                color=colour,
                linewidth=0.7,
                label=f"ensemble {ensemble + 1}",
                rasterized=len(steps) == TRACE_POINTS,
            )
        ax.set_ylabel(label(posterior.names[i]).replace(" (", "\n("))
        ax.set_xlim(0, posterior.trace.shape[1])
        ax.label_outer()
    figure.align_ylabels()
    axes[-1, 0].set_xlabel("step (iterations)")
    legend = axes[0, 0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=posterior.trace.shape[0], columnspacing=1.2
    )
    for line in legend.get_lines():
        line.set_linewidth(2.0)
    return figure


@style.styled
def draw_autocorrelation(fit: Fit) -> Figure:
    """The estimate of the autocorrelation time as the chain grew; to be trusted below N / 25."""
    posterior = fit.posterior
    figure, axes = style.grid(panel_height=2.8, width=4.8)
    style.heading(figure, f"{subject(fit)}: autocorrelation time")
    ax = axes[0, 0]
    known = np.isfinite(posterior.tau) & (posterior.tau > 0)
    n, tau = posterior.tau_steps[known], posterior.tau[known]
    ax.set(
        xscale="log", yscale="log", xlabel="chain length N (steps)", ylabel="autocorrelation time τ (steps)"
    )
    ends = np.array([n.min(), n.max()]) if len(n) else np.array([50.0, max(100.0, posterior.steps)])
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
    """Where each ensemble's draws rank among all: level bars mean that the ensembles agree."""
    from scipy.stats import rankdata

    posterior = fit.posterior
    names, count = varied(posterior), posterior.ensembles
    figure, axes = style.grid(
        len(names), count, panel_height=1.15, left=0.95, gap=(0.18, 0.12), top=0.65, share_x=True
    )
    style.heading(figure, f"{subject(fit)}: ranks of the draws, grey is 95 % of chance")
    edges = np.linspace(0, 1, RANK_BARS + 1)
    for row, name in zip(axes, names, strict=True):
        ranks = (rankdata(posterior.samples[name]) - 0.5) / posterior.samples[name].size
        ranks = ranks.reshape(posterior.samples[name].shape)
        # Correlated draws scatter more than independent ones: the effective number counts.
        effective = max(1.0, posterior.ess.get(name, ranks.size) / count)
        spread = 1.96 * np.sqrt((RANK_BARS - 1) / effective)
        bars = [np.histogram(ranks[posterior.ensemble == e], edges, density=True)[0] for e in range(count)]
        top = max(1.0 + 1.6 * spread, 1.05 * float(np.max(bars)))
        for ensemble, (ax, heights) in enumerate(zip(row, bars, strict=True)):
            colour = style.ENSEMBLES[ensemble % len(style.ENSEMBLES)]
            ax.stairs(heights, edges, fill=True, color=colour, alpha=0.45, linewidth=0)
            ax.stairs(heights, edges, color=colour, linewidth=1.0)
            ax.axhspan(1 - spread, 1 + spread, color=style.QUIET, alpha=0.25, linewidth=0, zorder=0.5)
            ax.axhline(1, color=style.INK, linewidth=0.7, zorder=3)
            ax.set(xlim=(0, 1), ylim=(0, top), xticks=[0, 0.5, 1], xticklabels=["0", "0.5", "1"])
            ax.grid(visible=False)
            ax.label_outer()
        row[0].set_ylabel(label(name).replace(" (", "\n(") + "\ndensity")
    for ensemble, ax in enumerate(axes[0]):
        ax.set_title(f"ensemble {ensemble + 1}", size=8.5, loc="center")
    for ax in axes[-1]:
        ax.set_xlabel("rank (fraction)")
    figure.align_ylabels()
    return figure


def _plain_log(axis: Axis) -> None:
    """Numbers as people write them, where powers of ten would need a formula."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / low < 1000 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.12g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
