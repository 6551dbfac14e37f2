"""``materials``: the built-in optical constants and their sources."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import output_options

if TYPE_CHECKING:
    from rich.table import Table

    from reflectance_fit.materials.loader import OpticalConstants

DEFAULT_NM = (450.0, 550.0, 650.0)
PIPE_WIDTH = 120


@click.group()
@output_options
def materials() -> None:
    """Built-in optical constants: what is known, from where, and how well.

    \b
    Example:
        reflectance-fit materials list
    """


@materials.command("list")
@output_options
def list_materials() -> None:
    """List the built-in materials with eta and k near 550 nm.

    \b
    Example:
        reflectance-fit materials list
    """
    from reflectance_fit.materials import library

    table = _table("name", "kind", "range nm", "at nm", "eta", "k", "relative to", "source")
    for name, entry in library.entries().items():
        constants = library.get(name)
        low, high = constants.range_nm
        (wavelength_nm,) = _covered(constants, (550.0,))
        eta, k = constants.index(wavelength_nm)
        table.add_row(
            name,
            entry.kind,
            f"{low:.4g}-{high:.6g}",
            f"{wavelength_nm:g}",
            f"{eta:.4f}",
            f"{k:.3g}" if constants.k_known else "-",
            entry.relative_to,
            entry.citation,
        )
    _print(table)
    click.echo("k is '-' where the source gives none; it is then taken as 0.")


@materials.command()
@click.argument("name", required=False)
@click.option(
    "--file", "file", type=click.Path(path_type=Path), help="A refractiveindex.info YAML file of yours."
)
@click.option(
    "--relative-to",
    type=click.Choice(["air", "vacuum"]),
    default="vacuum",
    show_default=True,
    help="What n in --file is relative to; such files do not say.",
)
@click.option(
    "--wavelength-nm", "-w", type=float, multiple=True, help="May be repeated.  [default: 450, 550, 650]"
)
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), help="Draw eta and k into this .png or .svg."
)
@output_options
def show(
    name: str | None,
    file: Path | None,
    relative_to: str,
    wavelength_nm: tuple[float, ...],
    output: Path | None,
) -> None:
    """Show source, range, eta, k and Brewster angle of NAME, or of a file.

    NAME is a built-in material or one of its aliases, in any case.

    \b
    Example:
        reflectance-fit materials show N-BK7 --wavelength-nm 632.8 -o bk7.png
    """
    from reflectance_fit.materials import library
    from reflectance_fit.materials.loader import load_optical_constants

    if (name is None) == (file is None):
        raise click.UsageError("give a built-in NAME or --file, one of the two")
    entry = None
    if file is not None:
        constants = load_optical_constants(file, relative_to="air" if relative_to == "air" else "vacuum")
    else:
        entry = library.entry(name or "")
        constants = library.get(entry.name)
    # Before anything is printed: a wavelength may be one the source does not cover.
    values = _values(constants, wavelength_nm or _covered(constants, DEFAULT_NM))

    click.echo(f"{constants.name} ({entry.kind})" if entry else constants.name)
    if entry:
        click.echo(f"Spread of eta between published tables: {entry.spread:.1%}")
    if entry and entry.note:
        click.echo(f"Note: {entry.note}")
    low, high = constants.range_nm
    click.echo(f"Range: {low:g} to {high:g} nm")
    click.echo(f"Source: {constants.source or 'not stated'}")
    if constants.comments:
        click.echo(f"Comments: {constants.comments}")
    if not constants.k_known:
        click.echo("k is not in the source and is taken as 0.")
    _print(values)
    click.echo("The Brewster angle is that of the smallest R_p, seen from air.")
    if output is not None:
        from reflectance_fit.plot.material import plot_optical_constants

        plot_optical_constants(constants, output)
        click.echo(f"wrote {output}")


def _values(constants: OpticalConstants, wavelengths_nm: tuple[float, ...]) -> Table:
    import numpy as np

    from reflectance_fit.materials.loader import AIR_INDEX
    from reflectance_fit.physics.brewster import brewster_angle

    tabulated = ("eta (to air)", "k (to air)") if constants.relative_to == "air" else ()
    table = _table("nm", *tabulated, "eta (to vacuum)", "k (to vacuum)", "Brewster deg")
    for wavelength_nm in wavelengths_nm:
        eta, k = constants.absolute_index(wavelength_nm)
        shown = (*constants.index(wavelength_nm), eta, k) if tabulated else (eta, k)
        angle_deg = np.degrees(brewster_angle(eta / AIR_INDEX, k / AIR_INDEX))
        table.add_row(f"{wavelength_nm:g}", *(f"{value:.6g}" for value in shown), f"{angle_deg:.3f}")
    return table


def _covered(constants: OpticalConstants, wavelengths_nm: tuple[float, ...]) -> tuple[float, ...]:
    """Those of the wavelengths that the source covers, or the nearest it does to the middle one."""
    low, high = constants.range_nm
    middle = wavelengths_nm[len(wavelengths_nm) // 2]
    return tuple(w for w in wavelengths_nm if low <= w <= high) or (min(max(middle, low), high),)


def _table(*headings: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in headings:
        table.add_column(heading, no_wrap=heading != "source")
    return table


def _print(table: Table) -> None:
    from rich.console import Console

    # Into a pipe or a file, rich would fold the rows at 80 columns.
    console = Console(width=None if sys.stdout.isatty() else PIPE_WIDTH, highlight=False)
    with console.capture() as capture:
        console.print(table)
    # Not by rich itself, which ends the process with 1 where the reader goes away.
    click.echo(capture.get(), nl=False)
