"""One thin film between two media: Airy's sum, in the signs of docs/conventions.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_cosine, checked_index

Complexes = NDArray[np.complex128]


class FilmAmplitudes(NamedTuple):
    """Amplitude reflectances r_s and r_p."""

    s: Complexes
    p: Complexes


def film_amplitudes(
    cos_theta_i: ArrayLike, film: complex, substrate: complex, thickness: ArrayLike
) -> FilmAmplitudes:
    """Amplitude reflectances of a film of uniform thickness on a substrate.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    film, substrate : complex
        Indices eta + ik relative to the medium around, eta > 0, k >= 0.
    thickness : float, broadcastable to S
        In units of the wavelength in the medium around, 0 or more.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    r = (r01 + r12 e^(2 i beta)) / (1 + r01 r12 e^(2 i beta)), beta = 2 pi (thickness) q of the film, with
    time factor exp(-i omega t): Azzam & Bashara, Ellipsometry and Polarized Light (1977), 4.3 (their exp(+i omega t)
    conjugates all).  Each interface by admittances q and eps / q, so that r_p is Verdet's.
    """
    c = checked_cosine(cos_theta_i)
    for index in (film, substrate):
        checked_index(index.real, index.imag)
    if not np.all(np.asarray(thickness) >= 0):
        raise ValueError("the thickness of a film must be 0 or more")
    s2 = (1.0 - c) * (1.0 + c)
    outside = c + 0j
    # Principal roots: indices lie in the first quadrant, so Im q >= 0.
    inside, below = (np.sqrt(index**2 - s2 + 0j) for index in (film, substrate))
    phase = np.exp(4j * np.pi * np.asarray(thickness) * inside)
    s = _sum((outside - inside) / (outside + inside), (inside - below) / (inside + below), phase)
    # eps / q of three media; cleared of denominators, because q is 0 outside at grazing incidence.
    a, b = film**2 * outside, substrate**2 * inside
    p = _sum((a - inside) / (a + inside), (b - film**2 * below) / (b + film**2 * below), phase)
    return FilmAmplitudes(s, p)


def _sum(top: Complexes, bottom: Complexes, phase: Complexes) -> Complexes:
    """Airy's geometric series of the reflections at both faces."""
    return np.asarray((top + bottom * phase) / (1.0 + top * bottom * phase))
