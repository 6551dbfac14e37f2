"""``reflectance-fit schlick``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import is_quiet, output_options


@click.command()
@click.argument("report", required=False, type=click.Path(path_type=Path), metavar="[REPORT.yaml]")
@click.option("--eta", type=float, help="Refractive index relative to the exterior.")
@click.option("--k", type=float, default=0.0, show_default=True, help="Extinction, with --eta.")
@click.option("--material", metavar="NAME", help="A built-in material, seen from air.")
@click.option("--wavelength-nm", type=float, default=550.0, show_default=True, help="With --material.")
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), metavar="DIR", help="Also write a plot and YAML."
)
@output_options
def schlick(
    report: Path | None,
    eta: float | None,
    k: float,
    material: str | None,
    wavelength_nm: float,
    out: Path | None,
) -> None:
    """How wrong Schlick's approximation (and others) is for one material.

    The error is approximation minus exact Fresnel reflectance of unpolarized
    light, over all angles of incidence. Give an index, a material or a report.yaml;
    where its posterior.nc is beside it, errors get their 95 % intervals.

    Example:

    \b
        reflectance-fit schlick --eta 1.5
        reflectance-fit schlick --material gold --wavelength-nm 650 -o schlick-gold
    """
    if sum(given is not None for given in (report, eta, material)) != 1:
        raise click.UsageError("give exactly one of --eta, --material and REPORT.yaml")
    from reflectance_fit.workflow_schlick import schlick_errors

    from .tables import print_approximations

    found = schlick_errors(
        report=report, eta=eta, k=k, material=material, wavelength_nm=wavelength_nm, folder=out
    )
    for channel in found.channels:
        print_approximations(channel.title, channel.errors)
    if found.note and not is_quiet():
        click.echo(found.note)
    if out is not None and not is_quiet():
        click.echo(f"wrote {out}")
