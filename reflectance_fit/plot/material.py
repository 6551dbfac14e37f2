"""A material's tabulated constants as a picture."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import numpy as np

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.materials.loader import Formula, OpticalConstants, Table
from reflectance_fit.plot.canvas import png_and_svg
from reflectance_fit.plot.style import QUIET, K, S, grid, heading, styled
from reflectance_fit.plot.text import printable

_ENDINGS = (".png", ".svg")
# Tables from X-rays to the far infrared would squeeze the optical range into one stroke.
_OPTICAL_NM = (200.0, 2500.0)


@styled
def plot_optical_constants(constants: OpticalConstants, path: Path) -> None:
    """Draw eta and, where tabulated, k against wavelength, and write ``path`` whole or not at all.

    The curves are those of ``constants.index``, as tabulated, between 200 and
    2500 nm, or all of them where the source lies outside; dots are its rows.

    Raises ReflectanceFitError for a file name that does not end in .png or .svg,
    or a folder that cannot be written to.
    """
    if path.suffix.lower() not in _ENDINGS:
        raise ReflectanceFitError(Problem(str(path), None, "choose a name that ends in .png or .svg"))
    low, high = constants.range_nm
    if low <= _OPTICAL_NM[1] and high >= _OPTICAL_NM[0]:
        low, high = max(low, _OPTICAL_NM[0]), min(high, _OPTICAL_NM[1])

    figure, axes = grid(2 if constants.k else 1, 1, panel_height=2.0, top=0.65, share_x=True)
    heading(figure, printable(constants.name))
    figure.text(
        0.12 / figure.get_figwidth(),
        1 - 0.32 / figure.get_figheight(),
        printable(constants.source, 115),
        va="top",
        size=7.5,
        color=QUIET,
    )
    curves: list[tuple[Table | Formula, str, str]] = [
        (constants.n, f"η, relative to {constants.relative_to}", S)
    ]
    if constants.k:
        curves.append((constants.k, "k", K))
    for ax, (curve, label, colour) in zip(axes[:, 0], curves, strict=True):
        wavelength_nm = np.linspace(low, high, 500)
        if isinstance(curve, Table):
            rows_nm = curve.wavelength_um * 1000
            shown = (rows_nm >= low) & (rows_nm <= high)
            ax.plot(rows_nm[shown], curve.values[shown], ".", color=colour, markersize=3)
            wavelength_nm = np.union1d(wavelength_nm, rows_nm[shown])
        ax.plot(wavelength_nm, curve.at(wavelength_nm / 1000), color=colour, linewidth=1)
        ax.set_ylabel(label)
        ax.margins(x=0.02)
    axes[-1, 0].set_xlabel("wavelength (nm)")

    picture = png_and_svg(figure)[path.suffix[1:].lower()]
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        unfinished.write_bytes(picture)
        os.replace(unfinished, path)
    except OSError as error:
        raise ReflectanceFitError(
            Problem(str(path), None, f"cannot be written: {error.strerror}; choose another place")
        ) from error
    finally:
        with suppress(OSError):
            unfinished.unlink()
