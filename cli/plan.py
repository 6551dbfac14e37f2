"""``reflectance-fit plan``"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import is_quiet, output_options

if TYPE_CHECKING:
    from reflectance_fit.data_synthetic.spec import NoiseLevel

LEVELS: tuple[NoiseLevel, ...] = ("low", "typical", "high")


def _noise(_ctx: click.Context, _param: click.Parameter, value: str) -> NoiseLevel | float:
    """A camera's word, or a relative standard deviation."""
    for level in LEVELS:
        if value == level:
            return level
    try:
        share = float(value)
    except ValueError:
        share = 0.0
    if not 1e-6 <= share <= 1:
        words = ", ".join(LEVELS)
        raise click.BadParameter(
            f"'{value}' is neither {words} nor a relative noise such as 0.01 (1e-6 to 1)"
        )
    return share


@click.command()
@click.option("--eta", type=float, help="Assumed refractive index, relative to vacuum.")
@click.option("--k", type=float, default=0.0, show_default=True, help="Assumed extinction, with --eta.")
@click.option("--material", metavar="NAME", help="A built-in material; see `materials list`.")
@click.option("--wavelength-nm", type=float, default=550.0, show_default=True, help="Of the light.")
@click.option(
    "--noise",
    callback=_noise,
    metavar="LEVEL|SHARE",
    default="typical",
    show_default=True,
    help="A camera as of `synth` (low, typical, high), or the noise of a signal relative to it, such as 0.01.",
)
@click.option(
    "--frames",
    type=click.IntRange(2, 200),
    default=12,
    show_default=True,
    help="How many photographs of the sample, at most.",
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Also write YAML, a plot and a manifest.",
)
@output_options
def plan(
    eta: float | None,
    k: float,
    material: str | None,
    wavelength_nm: float,
    noise: NoiseLevel | float,
    frames: int,
    out: Path | None,
) -> None:
    """Before photographing: which angles and settings, what to expect, what cannot be known.

    Assumes a material, a flat sample in air and a noise, and compares the usual
    angles with the best, for each piece of equipment. With -o DIR also writes
    DIR/plan.yaml, DIR/plan.png and DIR/capture-template.yaml, a manifest of the
    recommended photographs to fill in.

    Example:

    \b
        reflectance-fit plan --material N-BK7
        reflectance-fit plan --eta 0.96 --k 6.7 --noise 0.01 --frames 6 -o plan-al
    """
    if (eta is None) == (material is None):
        raise click.UsageError("give exactly one of --eta and --material")
    from reflectance_fit.workflow_plan import plan_to_folder

    from .plan_table import print_plan

    found = plan_to_folder(
        out, eta=eta, k=k, material=material, wavelength_nm=wavelength_nm, noise=noise, frames=frames
    )
    if not is_quiet():
        print_plan(found)
        if out is not None:
            click.echo(f"wrote {out}")
