"""Renders for the eye: linear radiance as sRGB pixels, and the one way they become a PNG.

Pictures are scaled and encoded, nothing else: no curve flatters them, so that
two at the same exposure can be compared.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from reflectance_fit.files import write_whole
from reflectance_fit.plot.canvas import png_and_svg
from reflectance_fit.plot.style import styled

Floats = NDArray[np.float64]
Pixels = NDArray[np.uint8]

WHITE_SHARE = 0.98
"""Of the pixels that light reaches, this share is no brighter than white at the automatic exposure."""


def automatic_stops(radiance: Floats) -> float:
    """Exposure in stops (powers of two) that brings the 98th percentile of lit pixels to white.

    Of shape (height, width, 1 or 3), linear; a pixel counts by its largest
    channel.  Down to a tenth of a stop; 0 where there is no light.
    """
    largest = radiance.max(axis=-1)
    lit = largest[largest > 0]
    return math.floor(-10 * math.log2(np.quantile(lit, WHITE_SHARE))) / 10 if lit.size else 0.0


def encoded(radiance: Floats, stops: float) -> Floats:
    """sRGB in [0, 1], shape (height, width, 3), of linear radiance exposed by 2^stops.

    What is brighter than white or, a colour outside sRGB, below 0 is clipped.

    Notes
    -----
    IEC 61966-2-1.
    """
    linear = np.clip(radiance * 2.0**stops, 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.broadcast_to(curve, (*curve.shape[:2], 3))


def clipped_share(radiance: Floats, stops: float) -> float:
    """Share of pixels brighter than white at this exposure."""
    return float(np.mean(radiance.max(axis=-1) * 2.0**stops > 1.0))


def write_preview(path: Path, radiance: Floats, stops: float) -> None:
    """A PNG of the picture as it is, pixel for pixel."""
    pixels = np.rint(255 * encoded(radiance, stops)).astype(np.uint8)
    write_whole(path, lambda unfinished: Image.fromarray(pixels).save(unfinished, "png"))


@styled
def write_figure(path: Path, figure: Figure) -> None:
    """A PNG of a drawn figure."""
    picture = png_and_svg(figure)["png"]
    write_whole(path, lambda unfinished: unfinished.write_bytes(picture))
