"""Is one index enough for a channel as wide as this?

A camera's channel averages the reflectance over its band, and the index that
fits the average is not the average index, still less the one at the centre.
How far apart they are follows from the dispersion of a like material, fitted
over the rows that were measured.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.examination import Band
from reflectance_fit.inference.forward import ETA, K, predict_vectors
from reflectance_fit.inference.point import at_best, index_names
from reflectance_fit.inference.rows import wrapped
from reflectance_fit.materials.library import Entry, entries, get
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

# Of a normal curve of the stated full width at half maximum.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(21)
_WEIGHTS /= _WEIGHTS.sum()
_FWHM = 2 * math.sqrt(2 * math.log(2))
_ROUNDS = 5  # of Gauss-Newton: the fifth moves Au at 530 nm, 90 nm wide, by less than 1e-6


def band(fit: Fit, named: Entry | None) -> Band | None:
    """The shift from the index at the centre to the one that fits the band, for ``named`` or the nearest built-in.

    None where the channel is a line, no material is known there, or the index is not identified.
    """
    fwhm_nm = float(fit.observations.fwhm_nm.max())
    if fwhm_nm == 0 or fit.intervals["eta"].median is None:
        return None
    entry = named if named is not None and _curve(named, fit.wavelength_nm, fwhm_nm) else None
    entry = entry or _nearest(fit, fwhm_nm)
    curve = None if entry is None else _curve(entry, fit.wavelength_nm, fwhm_nm)
    if entry is None or curve is None:
        return None
    centre, index, weights = curve
    eta, k = effective(fit, centre, index, weights)
    return Band(entry.name, named is entry, fwhm_nm, eta - centre.real, k - centre.imag)


def effective(
    fit: Fit, centre: complex, index: NDArray[np.complex128], weights: FloatArray
) -> tuple[float, float]:
    """eta and k of the one bulk that fits the rows averaged over ``index`` with ``weights``; noise as in ``fit``."""
    names = index_names(fit)
    eta, k = centre.real, centre.imag if "k" in names else 0.0
    for _ in range(_ROUNDS):
        info = at_best(fit, eta=eta, k=k)
        vectors = np.tile(info.vector, (len(index) + 1, 1))
        vectors[1:, ETA], vectors[1:, K] = index.real, index.imag
        values = predict_vectors(info.rows, vectors, info.gains)
        apart = weights @ wrapped(info.rows, values[1:] - values[0])
        step = info.covariance() @ (info.columns.T @ (info.whitening @ apart))
        change = dict(zip(info.names, step, strict=True))
        eta *= math.exp(change.get("eta", 0.0))
        k = max(k + change.get("k", 0.0), 0.0)
    return eta, k if "k" in names else centre.imag


def _curve(
    entry: Entry, wavelength_nm: float, fwhm_nm: float
) -> tuple[complex, NDArray[np.complex128], FloatArray] | None:
    """Index at the centre, over the band, and the band's weights; None where the table has no centre.

    The band ends where the table does.
    """
    constants = get(entry.name)
    wavelengths = np.append(wavelength_nm + fwhm_nm / _FWHM * _NODES, wavelength_nm)
    low, high = constants.range_nm
    inside = (wavelengths >= low) & (wavelengths <= high)
    try:
        eta, k = constants.absolute_index(wavelengths[inside])
    except ReflectanceFitError:  # k is known over less
        return None
    if not inside[-1]:
        return None
    weights = _WEIGHTS[inside[:-1]]
    index = eta + 1j * k
    return complex(index[-1]), index[:-1], weights / weights.sum()


def _nearest(fit: Fit, fwhm_nm: float) -> Entry | None:
    """The built-in material whose index is nearest to the fitted one."""
    best = complex(fit.optimum.eta, fit.optimum.k)
    known = [
        (abs(curve[0] - best), entry)
        for entry in entries().values()
        if (curve := _curve(entry, fit.wavelength_nm, fwhm_nm))
    ]
    return min(known, key=lambda found: found[0])[1] if known else None
