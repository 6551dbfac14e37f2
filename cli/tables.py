"""Results as text on stdout."""

from __future__ import annotations

from pathlib import Path

import click

from reflectance_fit.cli.options import is_quiet
from reflectance_fit.report.schema import Estimate, Report, SchlickError


def print_result(report: Report, folder: Path) -> None:
    """A line a channel with eta, k and Brewster angle, then the warnings and where the files are."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    if is_quiet():
        return
    table = Table(title=Text(report.sample.name), box=None, pad_edge=False, title_justify="left")
    for heading in ("channel", "eta", "k", "Brewster angle (deg)", "model", "reduced chi2"):
        table.add_column(heading)
    for channel in report.channels:
        quality = report.fits[channel.fit]
        reduced = quality.fit.reduced_chi2
        table.add_row(
            Text(channel.channel),
            in_words(channel.eta),
            in_words(channel.k),
            in_words(channel.brewster_deg),
            quality.model.name,
            "-" if reduced is None else f"{reduced:.2f}",
        )
    console = Console(soft_wrap=True)
    console.print(table)
    for warning in report.warnings:
        where = f" ({warning.channel})" if warning.channel else ""
        console.print(Text(f"{warning.code}{where}: {warning.message}"), style="yellow")
    click.echo(f"wrote {folder / 'report.yaml'}")


def in_words(value: Estimate) -> str:
    """``1.4873 +- 0.0074``, ``< 0.11 (95 %)`` or ``not identified``."""
    if value.status == "upper_limit" and value.ci95:
        return f"< {value.ci95[1]:.2g} (95 %)"
    if value.status == "fixed" and value.median is not None:
        return f"{value.median:g} (fixed)"
    if value.median is None or value.sd is None:
        return "not identified"
    return plus_minus(value.median, value.sd) + (" (one of several)" if value.status == "multimodal" else "")


def plus_minus(value: float, sd: float) -> str:
    """Two digits of the sd, and the value to the same place."""
    from math import floor, log10

    digits = 1 - floor(log10(sd)) if sd > 0 else 6
    digits = min(max(digits, 0), 12)
    return f"{value:.{digits}f} +- {sd:.{digits}f}"


def print_approximations(title: str, errors: SchlickError) -> None:
    """Every approximation against exact, one line each."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), box=None, pad_edge=False, title_justify="left")
    table.add_column("approximation")
    for heading in ("max |error|", "at (deg)", "max relative", "RMS", "albedo", "ns a value"):
        table.add_column(heading, justify="right")
    for row in errors.approximations:
        table.add_row(
            row.name,
            f"{row.max_abs_error:.4f}",
            f"{row.at_deg:.1f}",
            f"{100 * row.max_rel_error:.1f} %",
            f"{row.rms_error:.4f}",
            f"{100 * row.albedo_error:+.1f} %",
            "-" if row.ns_per_eval is None else f"{row.ns_per_eval:.1f}",
        )
    Console(soft_wrap=True).print(table)
