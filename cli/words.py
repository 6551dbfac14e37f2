"""Sentences on stdout: about a render, about a batch."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from reflectance_fit.errors import Problem, ReflectanceFitError, printable

from .options import is_quiet

if TYPE_CHECKING:
    from reflectance_fit.workflow_batch import Batch
    from reflectance_fit.workflow_render import Rendered


def print_rendered(rendered: Rendered) -> None:
    """The mode and why, what it cost and how well it is known, and the files."""
    from reflectance_fit.workflow_render import difference_lines

    film = rendered.film
    height, width = film.mean.shape[:2]
    for note in rendered.notes:
        click.echo(f"note: {printable(note)}")
    click.echo(f"mode {film.mode}: {printable(rendered.choice.reason)}")
    rate = width * height * film.samples / rendered.seconds / 1e6
    error = (
        "unknown from one sample"
        if math.isnan(rendered.error)
        else f"{100 * rendered.error:.2g} % of the mean"
    )
    click.echo(
        f"{width} x {height} pixels, {film.samples} samples each, in {rendered.seconds:.1f} s "
        f"({rate:.2g} million samples a second); standard error {error}"
    )
    if rendered.discarded:
        click.echo(
            f"note: {rendered.discarded} samples were not numbers and are left out; please report this scene"
        )
    if rendered.difference is not None:
        for line in difference_lines(rendered.approximation, rendered.difference):
            click.echo(line)
    click.echo(
        f"preview at {rendered.stops:+.1f} stops, {100 * rendered.clipped:.2g} % of pixels brighter than white"
    )
    for file in rendered.files:
        click.echo(f"wrote {file}")


def print_batch(batch: Batch, folder: Path) -> None:
    """How many samples came to what; raises ReflectanceFitError with a line for each that failed."""
    failed = batch.failed
    if not is_quiet():
        before = len(batch.lines) - batch.fitted - len(failed)
        click.echo(
            f"{len(batch.lines)} samples: {batch.fitted} fitted, {before} as before, {len(failed)} failed"
        )
        click.echo(f"wrote {folder / 'summary.csv'}")
        click.echo(f"wrote {folder / 'summary.yaml'}")
    problems = []
    for line in failed:
        # Most reasons begin with the file.
        known = str(line.failure).startswith(line.input)
        problems.append(Problem(None if known else line.input, None, str(line.failure)))
    if problems:
        raise ReflectanceFitError(problems)
