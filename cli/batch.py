"""``reflectance-fit batch``"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from .options import executor_options, fit_options, out_folder_option, output_options, seed_option


@click.command()
@click.argument("paths", metavar="PATH...", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_folder_option()
@fit_options
@seed_option
@executor_options
@output_options
def batch(
    paths: tuple[Path, ...],
    out: Path,
    model: str,
    posterior: Literal["emcee", "importance", "laplace"] | None,
    no_plots: bool,
    seed: int,
    jobs: int | None,
    scheduler: str | None,
    insecure: bool,
) -> None:
    """Fit many samples: one folder each in DIR, and a table of all.

    PATH is a folder to search for capture.yaml, measurement.yaml and names
    that end so (run7.measurement.yaml), or one such file, or an OBS.nc. A
    second run does only what is missing or changed, so a run that was stopped
    is continued by the same command. Samples that fail are in the table with
    the reason, and make the exit code 1.

    Example:

    \b
        reflectance-fit batch samples -o results
        reflectance-fit batch samples/a samples/b/measurement.yaml -o results --posterior laplace --jobs 2
    """
    from reflectance_fit.workflow_batch import Options, batch

    from .progress import progress
    from .words import print_batch

    with progress() as report:
        done = batch(
            paths,
            out,
            Options(model, posterior, seed, plots=not no_plots),
            progress=report,
            jobs=jobs,
            scheduler=scheduler,
            insecure=insecure,
        )
    print_batch(done, out)
