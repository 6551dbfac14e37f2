"""``reflectance-fit demo``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import out_folder_option, output_options, seed_option


@click.command()
@out_folder_option("demo")
@click.option("--material", metavar="NAME", help="Only this material.  [default: N-BK7 and Au]")
@click.option("--no-plots", is_flag=True, help="Write no pictures.")
@seed_option
@output_options
def demo(out: Path, material: str | None, no_plots: bool, seed: int) -> None:
    """The whole job with no camera, and recovered beside true.

    Photographs a glass and a gold mirror that are not there (RAW files of a
    camera with an analyzer), reads the photographs, fits eta, k and the
    Brewster angle, and compares with what went in.

    Example:

    \b
        reflectance-fit demo -o demo --material N-BK7 --no-plots
    """
    from reflectance_fit.demonstration import MATERIALS
    from reflectance_fit.demonstration import demo as run

    from .progress import progress
    from .tables import print_recovered

    names = MATERIALS if material is None else (material,)
    with progress() as report:
        results = list(run(out, names, seed=seed, plots=not no_plots, progress=report))
    print_recovered(results, out)
