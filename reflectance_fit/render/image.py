"""A film as an OpenEXR file: linear radiance as 32-bit floats, every channel named.

Viewers show R, G and B (or Y, which is gray) by default; layers follow the
usual ``layer.channel``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.files import write_whole
from reflectance_fit.physics.stokes import aolp, dolp
from reflectance_fit.render.colour import LUMINANCE
from reflectance_fit.render.film import Film

Floats = NDArray[np.float64]

# D65 and the primaries of sRGB, as the file states them: red, green, blue, white; x and y of each.
_SRGB = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)


def luminance(pixels: Floats) -> Floats:
    """Of linear sRGB in the last axis, or of the one channel that is there: shape (..., C) to (...)."""
    return np.asarray(pixels[..., 0] if pixels.shape[-1] == 1 else pixels @ LUMINANCE)


def stokes_luminance(film: Film) -> Floats:
    """The Stokes vectors of a polarized film's luminance, shape (height, width, 4)."""
    return luminance(np.moveaxis(film.mean, 2, -1))


def polarization(film: Film) -> tuple[Floats, Floats]:
    """Degree and angle of linear polarization of the luminance, shape (height, width) each.

    The degree is in [0, 1], 0 where there is no light; the angle in [0, 180)
    degrees, counter-clockwise from the picture's horizontal.  Noise of S1 and S2
    never cancels in the degree: it reads too high by about their standard error over S0.
    """
    stokes = stokes_luminance(film)
    lit = stokes[..., 0] > 0
    degree = np.zeros(lit.shape)
    degree[lit] = np.minimum(dolp(stokes[lit]), 1.0)
    return degree, np.degrees(aolp(stokes))


def row_polarization(film: Film) -> Floats:
    """Degree of linear polarization of all light of a row of pixels taken together, shape (height,); 0 of a dark row."""
    rows = stokes_luminance(film).mean(axis=1)
    return np.minimum(np.nan_to_num(np.asarray(dolp(rows))), 1.0)


def channels(film: Film) -> dict[str, Floats]:
    """Every channel of the file by name, shape (height, width).

    ``R``, ``G``, ``B`` (``Y`` where the film is scalar): radiance, S0 where
    polarized.  ``variance.R``: squared standard error of R, and so on.  Polarized
    films also have ``S0.R`` to ``S3.B`` with ``variance.S1.R`` to ``variance.S3.B``,
    and `polarization` as ``DoLP`` and ``AoLP``.
    """
    names = "Y" if film.mean.shape[2] == 1 else "RGB"
    found: dict[str, Floats] = {}
    for c, name in enumerate(names):
        found[name] = film.mean[:, :, c, 0]
        found[f"variance.{name}"] = film.error[:, :, c, 0] ** 2
        for s in range(film.mean.shape[3] if film.mean.shape[3] > 1 else 0):
            found[f"S{s}.{name}"] = film.mean[:, :, c, s]
            if s > 0:
                found[f"variance.S{s}.{name}"] = film.error[:, :, c, s] ** 2
    if film.mean.shape[3] > 1:
        found["DoLP"], found["AoLP"] = polarization(film)
    return found


def write_exr(path: Path, pictures: Mapping[str, Floats], about: Mapping[str, str | int | float]) -> None:
    """Write named channels, shape (height, width) each, whole or not at all; ``about`` becomes attributes."""
    # It takes 0.1 s to load, which --help must not.
    import OpenEXR

    header: dict[str, Any] = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": _SRGB,
        **about,
    }
    single = {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in pictures.items()}
    write_whole(path, lambda unfinished: OpenEXR.File(header, single).write(str(unfinished)))
