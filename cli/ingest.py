"""``reflectance-fit ingest``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import output_options


@click.command()
@click.argument("capture", metavar="CAPTURE.yaml", type=click.Path(path_type=Path))
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, metavar="OBS.nc", help="Result.")
@click.option("--write-hashes", is_flag=True, help="Write the sha256 of every frame into CAPTURE.yaml.")
@click.option("--no-pictures", is_flag=True, help="Draw nothing into OBS-pictures/.")
@output_options
def ingest(capture: Path, out: Path, write_hashes: bool, no_pictures: bool) -> None:
    """Read the photographs of CAPTURE.yaml into calibrated observations with sigma.

    Prints what became of every frame. The observations can be fitted later,
    without the photographs. OBS-pictures/ shows what each view saw: signal,
    polarization, angles, contradictions between the views, and what is masked.

    Example:

    \b
        reflectance-fit ingest capture.yaml -o obs.nc
    """
    from reflectance_fit.workflow_ingest import ingest_to_file

    from .progress import progress
    from .tables import print_frames

    with progress() as report:
        ingested = ingest_to_file(
            capture, out, write_hashes=write_hashes, pictures=not no_pictures, progress=report
        )
    print_frames(ingested, out)
