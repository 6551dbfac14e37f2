"""``reflectance-fit map``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import executor_options, output_options


def _ending(ending: str) -> click.Path:
    class Ending(click.Path):
        name = f"*{ending}"

        def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Path:
            path = Path(str(value))
            if path.suffix.lower() != ending:
                self.fail(f"'{value}' does not end in {ending}", param, ctx)
            return path

    return Ending()


@click.command(name="map")
@click.argument("capture", metavar="CAPTURE.yaml", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    type=_ending(".nc"),
    required=True,
    metavar="MAP.nc",
    help="Result; a preview goes beside it.",
)
@click.option("--exr", type=_ending(".exr"), metavar="FILE", help="The same numbers as OpenEXR.")
@click.option(
    "--model",
    type=click.Choice(["auto", "dielectric", "conductor"]),
    default="auto",
    show_default=True,
    help="dielectric: k = 0; auto: what all pixels together need.",
)
@click.option(
    "--tile",
    type=click.IntRange(16, 4096),
    default=512,
    show_default=True,
    help="Side of the squares that are computed at a time; changes memory and time, not numbers.",
)
@executor_options
@output_options
def map(
    capture: Path,
    out: Path,
    exr: Path | None,
    model: str,
    tile: int,
    jobs: int | None,
    scheduler: str | None,
    insecure: bool,
) -> None:
    """Map eta, and k of a metal, of every pixel of the photographs of CAPTURE.yaml.

    MAP.nc (NetCDF4) has eta, sigma, chi2 and a status for each pixel: what is
    known of it, or why it is masked. MAP.png shows them. sigma is that of the
    pixel's noise; errors that all pixels share, as of angles, are what fit tells.

    Example:

    \b
        reflectance-fit map capture.yaml -o map.nc
    """
    from reflectance_fit.scale.executors import executor
    from reflectance_fit.workflow_map import map_to_files

    from .map_table import print_map
    from .progress import progress

    with executor(jobs, scheduler, insecure=insecure) as workers, progress() as report:
        result = map_to_files(capture, out, workers, exr=exr, model=model, tile=tile, progress=report)
    print_map(result)
