"""A map in a few lines on stdout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
import numpy as np

from reflectance_fit.errors import printable

from .options import is_quiet
from .tables import show, table_of

if TYPE_CHECKING:
    from reflectance_fit.workflow_map import ChannelSummary, MapResult


def print_map(result: MapResult) -> None:
    """A line a channel, why pixels are without a number, the warnings, and where the files are."""
    from rich.text import Text

    if is_quiet():
        return
    table = table_of(result.sample_name)
    for heading in (
        "channel",
        "model",
        "pixels",
        "eta",
        "over pixels",
        "pixel sigma",
        "k",
        "chi2/dof",
        "all together",
    ):
        table.add_column(heading, no_wrap=True)
    for channel in result.channels:
        table.add_row(*map(Text, _cells(channel)))
    warnings = [Text(f"{note.code}: {printable(note.message)}", style="yellow") for note in result.notes]
    show(table, *warnings)
    for channel in result.channels:
        click.echo(f"{printable(channel.channel)}: {_verdicts(channel)}")
    if result.step > 1:
        click.echo(f"eta, k and sigma are medians over one of {result.step} x {result.step} pixels")
    for file in result.files:
        click.echo(f"wrote {file}")


def _cells(channel: ChannelSummary) -> list[str]:
    total = sum(channel.counts.values())
    known = sum(count for status, count in channel.counts.items() if status.estimated)
    fields = channel.sample
    eta = fields["eta"][np.isfinite(fields["eta"])]
    low, middle, high = np.percentile(eta, (16, 50, 84)) if eta.size else (np.nan,) * 3
    dof = np.where(np.isfinite(fields["eta"]), fields["dof"].astype(float), 0.0)
    together = channel.together
    return [
        channel.channel,
        together.model,
        f"{known} of {total}",
        f"{middle:.4f}",
        f"{low:.4f} to {high:.4f}",
        f"{_median(fields['eta_sigma']):.2g}",
        f"{_median(fields['k']):.4f}" if "k" in fields and together.model == "conductor" else "0",
        f"{fields['chi2'][dof > 0].sum() / dof.sum():.2f}" if dof.any() else "-",
        f"{together.eta:.4f} +- {together.eta_sigma:.2g}",
    ]


def _median(values: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def _verdicts(channel: ChannelSummary) -> str:
    total = sum(channel.counts.values())
    return ", ".join(
        f"{status.name.lower().replace('_', ' ')} {100 * count / total:.3g} %"
        for status, count in sorted(channel.counts.items(), key=lambda item: -item[1])
    )
