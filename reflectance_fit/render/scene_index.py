"""The index of a material in a scene: a built-in one, a fitted one, or numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.material import Material
from reflectance_fit.materials import library
from reflectance_fit.render.colour import GRID_NM
from reflectance_fit.render.scene import Spectrum, constant
from reflectance_fit.render.scene_materials import Conductor, Interface
from reflectance_fit.render.scene_spectra import spectrum

Floats = NDArray[np.float64]

# Nearly all that the eye sees; what is not known beyond is not worth a word.
_SEEN_NM = (400.0, 700.0)
# A wavelength deep, such a material leaves less than a third of the light: it is no window.
_OPAQUE_K = 0.1


def index_of(
    block: Interface, channels_nm: tuple[float, ...], fitted: Callable[[str], Material]
) -> tuple[Spectrum, Spectrum, str | None]:
    """eta and k relative to vacuum, and what a user should know about where they come from.

    ``fitted`` reads a report by the path that the scene states.  Tables are held
    constant beyond their ends.  Raises ReflectanceFitError for unknown names,
    for constants that say nothing about visible light, and for what absorbs
    but is to be looked through.
    """
    note = None
    if block.material is not None:
        eta, k, note = _built_in(block.material, channels_nm)
    elif block.report is not None:
        eta, k = _fitted(fitted(block.report))
    else:
        eta = spectrum(block.eta if block.eta is not None else 1.0)
        k = spectrum(block.k) if isinstance(block, Conductor) and block.k is not None else constant(0.0)
    if not isinstance(block, Conductor) and np.any(_at(k, channels_nm) > _OPAQUE_K):
        found = float(np.max(_at(k, channels_nm)))
        raise ReflectanceFitError(f"absorbs (k = {found:.2g}), so no light passes; use type: conductor")
    return eta, k, note


def _built_in(name: str, channels_nm: tuple[float, ...]) -> tuple[Spectrum, Spectrum, str | None]:
    constants = library.get(name)
    low, high = constants.range_nm
    if low > _SEEN_NM[1] or high < _SEEN_NM[0]:
        raise ReflectanceFitError(
            f"{constants.name} is known from {low:g} to {high:g} nm alone, not where the eye sees; give eta and k"
        )
    wanted = np.union1d(GRID_NM, channels_nm)
    # Its own ends belong to it, where they cut the range.
    known = np.unique(np.clip(wanted, low, high))
    eta, k = constants.absolute_index(known)
    note = None
    if low > _SEEN_NM[0] or high < _SEEN_NM[1]:
        note = f"{constants.name} is known from {low:g} to {high:g} nm; its index is held constant beyond"
    return Spectrum(eta, known), Spectrum(k, known), note


def _fitted(material: Material) -> tuple[Spectrum, Spectrum]:
    known, first = np.unique(material.wavelength_nm, return_index=True)
    return Spectrum(material.eta[first], known), Spectrum(material.k[first], known)


def _at(values: Spectrum, channels_nm: tuple[float, ...]) -> Floats:
    if values.wavelength_nm is None:
        return values.values
    return np.interp(channels_nm, values.wavelength_nm, values.values)
