"""``reflectance-fit board``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import is_quiet, output_options


def _squares(_ctx: click.Context, _param: click.Parameter, value: str) -> tuple[int, int]:
    """Squares across and down."""
    across, _, down = value.lower().partition("x")
    if not (across.isdecimal() and down.isdecimal() and min(int(across), int(down)) >= 3):
        raise click.BadParameter(f"'{value}' is not squares across and down, each at least 3, such as 11x8")
    return int(across), int(down)


@click.command()
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE.pdf",
    required=True,
    help="The page to print.",
)
@click.option(
    "--paper", type=click.Choice(["a4", "letter"]), default="a4", show_default=True, help="Of the printer."
)
@click.option(
    "--squares", callback=_squares, metavar="NxM", default="11x8", show_default=True, help="Across and down."
)
@click.option(
    "--square-mm",
    type=click.FloatRange(0, min_open=True),
    default=10.0,
    show_default=True,
    help="Side of a square; a marker has three quarters of it.",
)
@click.option(
    "--dictionary", metavar="NAME", default="DICT_5X5_100", show_default=True, help="OpenCV's markers."
)
@output_options
def board(out: Path, paper: str, squares: tuple[int, int], square_mm: float, dictionary: str) -> None:
    """A board to print, from which photographs get their angles.

    Writes a page at true scale, with a bar to check the printer by, and prints
    the lines for capture.yaml.

    Example:

    \b
        reflectance-fit board -o board.pdf
    """
    from reflectance_fit.capture.board import Board
    from reflectance_fit.workflow_board import board_to_file

    text = board_to_file(Board(squares, square_mm, 0.75 * square_mm, dictionary), paper, out)
    click.echo(text)
    if not is_quiet():
        click.echo(f"wrote {out}", err=True)
