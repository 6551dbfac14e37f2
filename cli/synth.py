"""``reflectance-fit synth``"""

from __future__ import annotations

from pathlib import Path

import click

from .options import degrees, is_quiet, output_options, seed_option


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--material", metavar="NAME", required=True, help="A built-in material; see `materials list`.")
@click.option(
    "--shape",
    type=click.Choice(["flat", "sphere", "board"]),
    default="flat",
    show_default=True,
    help="Of the sample; board: flat, in a printed board that shows its tilt.",
)
@click.option(
    "--angles", callback=degrees, metavar="DEG,...", help="Angles of incidence.  [default: by material]"
)
@click.option(
    "--analyzer",
    callback=degrees,
    metavar="DEG,...",
    help="Transmission axes of the analyzer.  [default: 0,45,90,135]",
)
@click.option(
    "--sensor",
    type=click.Choice(["bayer", "mono", "dofp", "dofp_bayer"]),
    default="bayer",
    show_default=True,
    help="Of the camera; dofp: with polarizers on its pixels.",
)
@click.option(
    "--light",
    type=click.Choice(["unpolarized", "linear45", "circular"]),
    help="Incident light.  [default: by material]",
)
@click.option(
    "--noise",
    type=click.Choice(["none", "low", "typical", "high"]),
    default="typical",
    show_default=True,
    help="How good the camera is.",
)
@click.option(
    "--surroundings",
    type=click.Choice(["even", "room"]),
    default="even",
    show_default=True,
    help="room: a ball lies on a table, a board under a softbox, by the path tracer.",
)
@seed_option
@output_options
def synth(
    folder: Path,
    material: str,
    shape: str,
    angles: tuple[float, ...],
    analyzer: tuple[float, ...],
    sensor: str,
    light: str | None,
    noise: str,
    surroundings: str,
    seed: int,
) -> None:
    """Photograph a material that is not there: RAW frames into DIR, with the truth beside them.

    Writes DIR/raw/*.dng, DIR/capture.yaml (what a photographer would know) and
    DIR/truth.yaml (what went in).

    Example:

    \b
        reflectance-fit synth glass --material N-BK7 --angles 45,60 --analyzer 0,90
    """
    from reflectance_fit.data_synthetic.capture import write_capture
    from reflectance_fit.data_synthetic.rig import LIGHTS
    from reflectance_fit.data_synthetic.spec import standard_spec

    from .progress import progress

    spec = standard_spec(
        material,
        shape=shape,
        angles_deg=angles,
        analyzer_deg=analyzer,
        sensor=sensor,
        light=None if light is None else LIGHTS[light],
        noise=noise,
        surroundings=surroundings,
        seed=seed,
    )
    with progress() as report:
        path = write_capture(folder, spec, progress=report)
    if not is_quiet():
        click.echo(f"wrote {path}")
