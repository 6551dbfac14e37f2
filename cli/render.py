"""``reflectance-fit render``"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from .options import degrees, is_quiet, output_options, seed_option

MODES = ["auto", "scalar", "rgb", "spectral", "polarized", "spectral_polarized"]
RUNGS = ["exact", "constant", "schlick", "schlick_f82", "lazanyi", "large_index"]


def _size(_ctx: click.Context, _param: click.Parameter, value: str | None) -> tuple[int, int] | None:
    if value is None:
        return None
    width, _, height = value.partition("x")
    if not (width.isdecimal() and height.isdecimal() and 0 < int(width) <= 8192 >= int(height) > 0):
        raise click.BadParameter(f"'{value}' is not a size such as 640x480, at most 8192x8192")
    return int(width), int(height)


def _finite(_ctx: click.Context, _param: click.Parameter, value: float | None) -> float | None:
    if value is not None and not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a number to work with")
    return value


def _image(_ctx: click.Context, _param: click.Parameter, value: Path) -> Path:
    if value.suffix.lower() != ".exr":
        raise click.BadParameter(f"'{value}' does not end in .exr; the PNG preview is written beside it")
    return value


@click.command()
@click.argument("scene", metavar="SCENE.yaml", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    callback=_image,
    metavar="IMAGE.exr",
    help="The picture; previews go beside it.",
)
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default="auto",
    show_default=True,
    help="What is carried along a path; auto looks at the scene and says why.",
)
@click.option(
    "--spp",
    type=click.IntRange(1, 2**24),
    help="Samples a pixel; with --error at most.  [default: 64; 65536 with --error]",
)
@click.option(
    "--error",
    type=click.FloatRange(0, min_open=True),
    callback=_finite,
    metavar="X",
    help="Stop at this standard error, a share of the picture's mean, RMS over pixels.",
)
@click.option(
    "--fresnel",
    type=click.Choice(RUNGS),
    default="exact",
    show_default=True,
    help="Reflectance of interfaces.",
)
@click.option(
    "--compare",
    is_flag=True,
    help="Also by the approximation of --fresnel (else schlick), and the difference.",
)
@click.option(
    "--analyzer",
    callback=degrees,
    metavar="DEG,...",
    help="Also a sheet of pictures behind an analyzer at these angles.",
)
@click.option("--size", callback=_size, metavar="WxH", help="Pixels, instead of the scene's.")
@click.option(
    "--exposure",
    type=click.FloatRange(-100, 100),
    callback=_finite,
    metavar="STOPS",
    help="Of the previews: times 2^STOPS.  [default: automatic]",
)
@click.option(
    "--sampler",
    type=click.Choice(["sobol", "independent"]),
    default="sobol",
    show_default=True,
    help="Random numbers: evenly spread, or independent.",
)
@click.option(
    "--precision",
    type=click.Choice(["single", "double"]),
    default="single",
    show_default=True,
    help="Of the arithmetic.",
)
@seed_option
@output_options
def render(
    scene: Path, out: Path, analyzer: tuple[float, ...], compare: bool, mode: Any, fresnel: Any, **given: Any
) -> None:
    """Render SCENE.yaml into IMAGE.exr, with a PNG preview beside it.

    The mode says what light is: one number, RGB, spectra, Stokes vectors of RGB,
    or Stokes spectra. Left to auto, the cheapest is taken that gives the same
    picture to 1 %. The first scene of a kind takes a while longer: its code is compiled once.

    Example:

    \b
        reflectance-fit render scene.yaml -o picture.exr --spp 16
    """
    if compare and mode in ("polarized", "spectral_polarized"):
        raise click.UsageError("--compare has no polarized mode: approximations of Fresnel have no s and p")
    from reflectance_fit.workflow_render import Wish, render_to_file

    from .progress import progress
    from .words import print_rendered

    wish = Wish(
        mode=mode,
        samples=given["spp"],
        error=given["error"],
        fresnel=fresnel,
        compare=compare,
        sampler=given["sampler"],
        precision=given["precision"],
        seed=given["seed"],
        size_px=given["size"],
        analyzers_deg=analyzer,
        stops=given["exposure"],
    )
    with progress() as report:
        rendered = render_to_file(scene, out, wish, progress=report)
    if not is_quiet():
        print_rendered(rendered)
