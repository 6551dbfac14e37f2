"""Results as text on stdout."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from reflectance_fit.capture.truth import Truth
from reflectance_fit.errors import printable
from reflectance_fit.report.schema import Estimate, Report, SchlickError

from .options import is_quiet

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from reflectance_fit.capture.ingest import Ingested

LONGEST_TITLE = 120


def print_result(report: Report, folder: Path) -> None:
    """A line a channel with eta, k and Brewster angle, then the warnings and where the files are."""
    from rich.text import Text

    if is_quiet():
        return
    table = table_of(report.sample.name)
    for heading in ("channel", "eta", "k", "Brewster (deg)", "model", "red. chi2"):
        table.add_column(heading, no_wrap=True)
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
    warnings = [
        Text(
            f"{warning.code}{f' ({warning.channel})' if warning.channel else ''}: {printable(warning.message)}",
            style="yellow",
        )
        for warning in report.warnings
    ]
    show(table, *warnings)
    click.echo(f"wrote {folder / 'report.yaml'}")


def print_recovered(results: Sequence[tuple[str, Report, Truth]], folder: Path) -> None:
    """Recovered against true for each material and channel, in units of the recovered sd."""
    if is_quiet():
        return
    table = table_of("recovered against true")
    for heading in ("material", "channel", "quantity", "true", "recovered", "off by"):
        table.add_column(heading, no_wrap=True)
    for material, report, truth in results:
        for channel, true in zip(report.channels, truth.channels, strict=True):
            angle = channel.brewster_deg.kind.replace("_", "-") + " (deg)"
            for name, value, found in (
                ("eta", true.eta, channel.eta),
                ("k", true.k, channel.k),
                (angle, true.brewster_deg, channel.brewster_deg),
            ):
                known = found.median is not None and found.sd
                off = f"{(found.median - value) / found.sd:+.1f} sd" if known else "-"  # type: ignore[operator]
                table.add_row(material, channel.channel, name, f"{value:.5f}", in_words(found), off)
    show(table)
    for material, _, _ in results:
        click.echo(f"wrote {folder / material / 'result'}")


def print_frames(ingested: Ingested, out: Path) -> None:
    """A line a frame: how it was taken, how many pixels count, what they gave, and why if they do not."""
    from rich.text import Text

    if is_quiet():
        return
    capture = ingested.capture
    table = table_of(capture.sample_name)
    headings = ("frame", "role", "theta (deg)", "analyzer (deg)", "exposure (s)", "pixels", "clipped (%)")
    for heading in (*headings, *(f"{name} (DN/s)" for name in capture.channels), "status"):
        table.add_column(heading, no_wrap=True)
    samples = {sample.frame.file: sample for sample in ingested.samples}
    for frame in capture.frames:
        sample = samples.get(frame.file)
        seconds = ingested.settings[frame.path].seconds
        status = "rejected: " + ingested.rejected[frame.file] if frame.file in ingested.rejected else "used"
        if frame.file in ingested.unused:
            status = "unused: serves no frame"
        pixels, clipped, signals = "-", "-", ["-"] * len(capture.channels)
        if sample is not None:
            pixels = str(sum(int(s.pixels.sum()) for s in sample.signals.values()))
            clipped = f"{100 * sample.saturated_share:.1f}"
            means = [[s.mean for _, s in sample.of(name)] for name in capture.channels]
            signals = [f"{sum(m) / len(m):.4g}" if m else "-" for m in means]
            if sample.saturated_share == 1.0:
                status = "saturated"
        table.add_row(
            Text(printable(frame.file)),
            frame.role,
            _number(frame.theta_deg),
            _number(frame.analyzer_deg),
            f"{float(seconds):.4g}" if seconds else "-",
            pixels,
            clipped,
            *signals,
            Text(printable(status)),
        )
    told = [Text(printable(line)) for line in ingested.told]
    notes = [
        Text(f"{note.code}: {printable(note.message)}", style="yellow")
        for note in ingested.measurement.warnings
    ]
    show(table, *told, *notes)
    click.echo(f"wrote {out}: {len(ingested.measurement.observations)} rows")


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:g}"


def table_of(title: str) -> Table:
    """An empty table in the style of all; control characters in ``title`` are made visible."""
    from rich.table import Table
    from rich.text import Text

    title = printable(title)
    if len(title) > LONGEST_TITLE:
        title = title[: LONGEST_TITLE - 1] + "…"
    return Table(title=Text(title), box=None, pad_edge=False, title_justify="left")


def show(*parts: Table | Text) -> None:
    """To standard output; wide where it is no terminal, so that nothing is cut or wrapped."""
    from rich.console import Console

    console = Console(soft_wrap=True)
    if not console.is_terminal:
        console = Console(soft_wrap=True, width=200)
    with console.capture() as capture:
        for part in parts:
            console.print(part)
    # Not by rich itself, which ends the process with 1 where the reader goes away.
    click.echo(capture.get(), nl=False)


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
    """Every approximation against exact, one line each; 99 columns at most, the title aside."""
    if is_quiet():
        return
    table = table_of(title)
    table.add_column("approximation", no_wrap=True)
    spread = errors.max_abs_error_posterior is not None
    headings = (
        "max |error|",
        *(["95 % of it"] if spread else []),
        "at (deg)",
        "max relative",
        "RMS",
        "albedo",
    )
    for heading in (*headings, "ns/value"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in errors.approximations:
        cells = [_error(row.max_abs_error)]
        if spread:
            of_it = row.max_abs_error_posterior
            cells.append("-" if of_it is None else f"{_error(of_it.ci95[0])}..{_error(of_it.ci95[1])}")
        cells += [
            f"{row.at_deg:.1f}",
            _percent(row.max_rel_error, ".1f"),
            _error(row.rms_error),
            _percent(row.albedo_error, "+.1f"),
            "-" if row.ns_per_eval is None else f"{row.ns_per_eval:.1f}",
        ]
        table.add_row(row.name, *cells)
    show(table)


def _error(size: float) -> str:
    """Four places; two digits where those would say nothing."""
    return f"{size:.1e}" if 0 < size < 5e-4 else f"{size:.4f}"


def _percent(share: float | None, form: str) -> str:
    if share is None:
        return "infinite"
    return f"{100 * share:{form}} %" if abs(share) < 1e4 else f"{100 * share:.1e} %"
