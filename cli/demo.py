"""``reflectance-fit demo``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import out_folder_option, output_options, seed_option


@click.command()
@out_folder_option("demo")
@click.option("--material", metavar="NAME", help="Only this example: N-BK7 or Au.")
@click.option("--no-plots", is_flag=True, help="Write no pictures.")
@seed_option
@output_options
def demo(out: Path, material: str | None, no_plots: bool, seed: int) -> None:
    """Fit the shipped examples and print recovered against true.

    A glass seen through a polarizer on a goniometer, and a gold mirror on an
    ellipsometer; both synthetic, so the truth is known.

    Example:

    \b
        reflectance-fit demo -o demo --material N-BK7 --no-plots
    """
    from reflectance_fit.data_synthetic.example import example_names
    from reflectance_fit.workflow import demo as run

    from .progress import progress
    from .tables import print_recovered

    names = example_names() if material is None else (material,)
    with progress() as reporter:
        results = list(
            run(
                out,
                names,
                seed=seed,
                plots=not no_plots,
                progress=reporter.sampling,
                drawing=reporter.drawing,
            )
        )
    print_recovered(results, out)
