"""Spectra as the transport reads them, and back: one number, three, or a curve.

``scalar`` carries one channel, ``rgb`` and ``polarized`` three; the spectral
modes read curves on ``GRID_NM``, linear in between.  Products of such curves
are integrated exactly here, so that white stays white and an sRGB triple comes
back as itself after its way through a spectrum.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render.scene import Spectrum
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]

GRID_NM: Floats = np.arange(360.0, 831.0, 5.0)
"""Wavelengths of a spectral curve, shape (95,)."""

LUMINANCE: Floats = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear sRGB (IEC 61966-2-1)."""

SPECTRAL: tuple[Mode, ...] = ("spectral", "spectral_polarized")

# Of the wavelengths that are drawn.  More spares deep red its noise, less the primaries theirs.
_UNIFORM_SHARE = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Observer:
    """The CIE 1931 2 degree observer in linear sRGB, and spectra that look as sRGB triples do.

    ``rgb``, shape (3, 95): a spectrum's linear sRGB is the integral over nm of ``rgb``
    times it.  ``white``, shape (95,): D65 of luminance 1.  ``lights``, shape (3, 95):
    the primaries, which add up to ``white``.  ``reflectances``, shape (3, 95), in
    [0, 1]: they add up to 1, and are the primaries under ``white``.
    """

    rgb: Floats
    white: Floats
    lights: Floats
    reflectances: Floats


@functools.cache
def observer() -> Observer:
    """Matching functions, D65 and upsampling basis of colour-science, on the grid.

    Notes
    -----
    Basis: Mallett and Yuksel, "Spectral Primary Decomposition for Rendering with
    sRGB Reflectance", EGSR 2019; held constant outside 380 to 780 nm, as is D65
    above 780 nm.  That, and straight lines between grid points, moves a triple by
    up to 0.003; the basis is mixed with itself so that triples come back exactly.
    A spectrum of 1 at every wavelength has luminance 1, as ``white`` has.
    """
    # Takes 2 s, for it brings its plotting along: only spectral renders wait for it.
    import colour
    from colour.recovery import MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019 as PUBLISHED

    matching = _on_grid(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"])
    white = _on_grid(colour.SDS_ILLUMINANTS["D65"])[0]
    of_one = integral(matching[1])
    white *= of_one / integral(matching[1], white)
    x, y, z = (integral(row, white) / of_one for row in matching)
    primaries = colour.RGB_COLOURSPACES["sRGB"].primaries
    npm = colour.normalised_primary_matrix(primaries, np.array([x, y]) / (x + y + z))
    rgb: Floats = np.asarray(np.linalg.solve(npm, matching / of_one), dtype=np.float64)

    basis = _on_grid(PUBLISHED)
    basis /= basis.sum(axis=0)
    reflected = np.array([[integral(row, column, white) for column in basis] for row in rgb])
    emitted = np.array([[integral(row, column) for column in basis * white] for row in rgb])
    return Observer(
        rgb=rgb,
        white=white,
        lights=np.linalg.solve(emitted.T, basis * white),
        reflectances=np.linalg.solve(reflected.T, basis),
    )


def integral(*curves: Floats) -> float:
    """Of the product of up to four curves on the grid, over nm; exact for straight lines between grid points."""
    # Three points a step integrate the fourth degree, the product of four lines.
    points, weights = np.polynomial.legendre.leggauss(3)
    t = (points + 1) / 2
    product = np.ones((GRID_NM.size - 1, 3))
    for curve in curves:
        product = product * (curve[:-1, None] * (1 - t) + curve[1:, None] * t)
    return float(np.sum(product @ weights) * (GRID_NM[1] - GRID_NM[0]) / 2)


def basis(mode: Mode, *, light: bool = False) -> Floats:
    """What a pixel's linear sRGB triple weighs, shape (3, C): its curve is ``triple @ basis``.

    For textures and pictures of the surroundings (``light``).
    """
    if mode == "scalar":
        return LUMINANCE[:, None].copy()
    if mode not in SPECTRAL:
        return np.eye(3)
    return (observer().lights if light else observer().reflectances).copy()


def reflectance(spectrum: Spectrum, mode: Mode, channels_nm: tuple[float, float, float]) -> Floats:
    """A share of light in [0, 1], shape (C,): C = 1, 3 or 95 by mode.

    A table is read at ``channels_nm``; for the spectral modes it is averaged around
    grid points, so that a narrow peak keeps its area.
    """
    values = _checked(spectrum, "a reflectance")
    if np.any(values > 1):
        raise ValueError(f"a reflectance must be at most 1 (found {values.max():g}); is it a percentage?")
    return _curve(spectrum, mode, channels_nm, light=False)


def emission(spectrum: Spectrum, mode: Mode, channels_nm: tuple[float, float, float]) -> Floats:
    """Radiance, irradiance or power per solid angle, shape (C,).

    One number and sRGB triples are times D65 in the spectral modes: light of one
    number is white in every mode.  A table stands for itself.
    """
    _checked(spectrum, "a light's spectrum")
    return _curve(spectrum, mode, channels_nm, light=True)


def index(spectrum: Spectrum, mode: Mode, channels_nm: tuple[float, float, float]) -> Floats:
    """eta or k, shape (C,).  Three numbers stand at ``channels_nm``; ``scalar`` takes the middle one."""
    values = _checked(spectrum, "an index")
    if values.size == 1:
        return np.full(_size(mode), values[0])
    if spectrum.wavelength_nm is None:
        order = np.argsort(channels_nm)
        known, values = np.asarray(channels_nm)[order], values[order]
    else:
        known = spectrum.wavelength_nm
    return np.interp(_wavelengths(mode, channels_nm), known, values)


class Curves:
    """The spectra of one scene as rows of one array, each known by its number; equal rows are kept once."""

    def __init__(self, mode: Mode, channels_nm: tuple[float, float, float]) -> None:
        self.mode = mode
        self.channels_nm = channels_nm
        self._rows: dict[bytes, tuple[int, Floats]] = {}

    def add(self, row: Floats) -> int:
        return self._rows.setdefault(row.tobytes(), (len(self._rows), row))[0]

    def reflectance(self, spectrum: Spectrum) -> int:
        return self.add(reflectance(spectrum, self.mode, self.channels_nm))

    def emission(self, spectrum: Spectrum) -> int:
        return self.add(emission(spectrum, self.mode, self.channels_nm))

    def index(self, spectrum: Spectrum) -> int:
        return self.add(index(spectrum, self.mode, self.channels_nm))

    def array(self) -> Floats:
        """Shape (n, C)."""
        rows = [row for _, row in self._rows.values()]
        return np.stack(rows) if rows else np.empty((0, _size(self.mode)))


def wavelength_quantiles(cells: int = 256) -> Floats:
    """Wavelengths that cut the density into equal shares: nm, shape (cells + 1,), from 360 to 830.

    For u in [0, 1), j = floor(u cells): the wavelength is that between quantiles j
    and j + 1 by the fraction of u cells, its density exactly 1 / (cells (q[j + 1] - q[j])).
    The density follows the eye's response to a flat spectrum in linear sRGB, over
    a floor.  With four wavelengths u, u + 1/4, u + 1/2, u + 3/4 (modulo 1) white
    light is noisy by 0.13 of its mean; by the density of pbrt-v4 (its section 4.5.4), by 0.35.
    """
    # Fine enough that the steps of the cumulative sum do not show in a cell.
    fine = np.linspace(GRID_NM[0], GRID_NM[-1], 20 * cells + 1)
    rgb = [np.interp(fine, GRID_NM, row) for row in observer().rgb]
    seen = np.linalg.norm(rgb, axis=0)
    density = (1 - _UNIFORM_SHARE) * seen / seen.mean() + _UNIFORM_SHARE
    shares = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.interp(np.arange(cells + 1) / cells, shares / shares[-1], fine)


def _size(mode: Mode) -> int:
    return GRID_NM.size if mode in SPECTRAL else 1 if mode == "scalar" else 3


def _wavelengths(mode: Mode, channels_nm: tuple[float, float, float]) -> Floats:
    if mode in SPECTRAL:
        return GRID_NM
    return np.array(channels_nm[1:2] if mode == "scalar" else channels_nm)


def _curve(spectrum: Spectrum, mode: Mode, channels_nm: tuple[float, float, float], light: bool) -> Floats:
    if spectrum.wavelength_nm is not None:
        if mode in SPECTRAL:
            return _averaged(spectrum.wavelength_nm, spectrum.values)
        return np.interp(_wavelengths(mode, channels_nm), spectrum.wavelength_nm, spectrum.values)
    if spectrum.values.size == 3:
        return spectrum.values @ basis(mode, light=light)
    white = observer().white if light and mode in SPECTRAL else np.ones(_size(mode))
    return spectrum.values * white


def _averaged(known: Floats, values: Floats) -> Floats:
    """The table's mean around each grid point, by weights that fall in straight lines to its neighbours."""
    inside = (known > GRID_NM[0]) & (known < GRID_NM[-1])
    knots = np.union1d(GRID_NM, known[inside])
    # Two points a step integrate the second degree, a line of the table times one of the weights.
    points = np.array([-1.0, 1.0]) / np.sqrt(3)
    at = (knots[:-1, None] + np.diff(knots)[:, None] * (points + 1) / 2).ravel()
    area = np.repeat(np.diff(knots) / 2, 2)
    position = (at - GRID_NM[0]) / (GRID_NM[1] - GRID_NM[0])
    left = position.astype(int)
    share = position - left
    cells = np.concatenate([left, left + 1])
    weights = np.concatenate([area * (1 - share), area * share])
    found = np.tile(np.interp(at, known, values), 2)
    size = GRID_NM.size
    return np.bincount(cells, weights * found, size) / np.bincount(cells, weights, size)


def _on_grid(spectra: Any) -> Floats:
    """Columns of a colour-science table as rows on the grid, held constant beyond its ends."""
    columns = np.asarray(spectra.values, dtype=float).reshape(len(spectra.wavelengths), -1).T
    return np.stack([np.interp(GRID_NM, spectra.wavelengths, column) for column in columns])


def _checked(spectrum: Spectrum, what: str) -> Floats:
    values, known = spectrum.values, spectrum.wavelength_nm
    if known is None:
        if values.shape not in ((1,), (3,)):
            raise ValueError(f"{what} needs one number, three, or wavelengths beside its numbers")
    elif values.ndim != 1 or values.shape != known.shape or not values.size or not np.all(np.diff(known) > 0):
        raise ValueError(f"{what} needs one value for each wavelength, and wavelengths that increase")
    if not np.all((values >= 0) & (values < np.inf)):
        raise ValueError(f"{what} must be finite and at 0 or above")
    return values
