"""``reflectance-fit fit``"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from .options import fit_options, out_folder_option, output_options, resumable, seed_option


@click.command()
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path))
@out_folder_option()
@fit_options
@click.option("--resume", is_flag=True, help="Continue a run that was stopped, from what it left in DIR.")
@click.option("--no-timings", is_flag=True, help="Leave wall-clock figures out of report.yaml.")
@seed_option
@output_options
def fit(
    source: Path,
    out: Path,
    model: str,
    posterior: Literal["emcee", "importance", "laplace"] | None,
    resume: bool,
    no_plots: bool,
    no_timings: bool,
    seed: int,
) -> None:
    """Fit INPUT: eta, k and Brewster angle of every channel, with intervals.

    INPUT is a capture.yaml (photographs), a measurement.yaml (tables) or an
    OBS.nc that ingest wrote. Writes report.yaml, posterior.nc and plots/ into
    the folder DIR.

    Example:

    \b
        reflectance-fit fit measurement.yaml -o result
        reflectance-fit fit capture.yaml -o result
        reflectance-fit fit obs.nc -o result --posterior importance
        reflectance-fit fit measurement.yaml -o result --resume
    """
    from reflectance_fit.workflow import fit_to_folder

    from .progress import progress
    from .tables import print_result

    with resumable(out), progress() as report:
        result = fit_to_folder(
            source,
            out,
            model=model,
            posterior=posterior,
            seed=seed,
            plots=not no_plots,
            timings=not no_timings,
            progress=report,
            resume=resume,
        )
    print_result(result.report, out)
