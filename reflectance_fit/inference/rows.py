"""Observations packed for the compiled likelihood: codes and radians instead of words and degrees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.observations import Flag, Observations, Quantity, concatenate

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# The kernel's codes.  Powers first, so that `code <= LAST_POWER` asks for a power.
CODES = {quantity: code for code, quantity in enumerate(Quantity)}
REFLECTANCE_S, REFLECTANCE_P = CODES[Quantity.REFLECTANCE_S], CODES[Quantity.REFLECTANCE_P]
REFLECTANCE, SIGNAL, RATIO = CODES[Quantity.REFLECTANCE], CODES[Quantity.SIGNAL], CODES[Quantity.RATIO_PS]
DOLP, PSI, DELTA = CODES[Quantity.DOLP], CODES[Quantity.PSI_DEG], CODES[Quantity.DELTA_DEG]
LAST_POWER = SIGNAL


class Rows(NamedTuple):
    """N rows as the kernel reads them; a tuple, because numba takes those.

    Angles come as cosines and sines, so that the hot loop has none to take:
    ``analyzer`` (N, 2) of twice the angle from s, ``retarder`` (N, 4) of twice
    its axis and of the retardance, NaN where there is none.

    ``gain`` and ``estimated`` are -1 where a row is absolute, or its sigma
    stated; else the index of its gain, or of its estimated sigma.  ``setting``
    numbers the goniometer settings: rows of one setting share one angle error.
    ``largest`` is the largest value among the rows of equal gain (the unit of
    the diffuse part).  ``dispersion`` is 1 / wavelength^2 in um^-2, less its mean
    over the wavelengths: 0 where there is one.  ``censored`` rows are saturated: all
    that is known is that the truth is at least their value.  ``heavy_tailed``:
    noise is Student's t, not normal (``student``).
    """

    code: IntArray
    cos_theta: FloatArray
    sin_theta: FloatArray
    theta_sigma: FloatArray
    cos_spread: FloatArray
    sin_spread: FloatArray
    analyzer: FloatArray
    retarder: FloatArray
    diattenuation: FloatArray
    light: FloatArray
    value: FloatArray
    sigma: FloatArray
    gain: IntArray
    estimated: IntArray
    setting: IntArray
    largest: FloatArray
    dispersion: FloatArray
    censored: NDArray[np.bool_]
    exterior_ior: float
    gains: int
    settings: int
    errors_in_angle: bool
    heavy_tailed: bool


def gain_names(observations: Observations) -> list[str]:
    """The gain groups, in the order of the kernel's gain index."""
    return sorted({str(name) for name in observations.gain_group if name})


def estimated_names(observations: Observations) -> list[str]:
    """The quantities of which no sigma was stated, in the order of the kernel's index."""
    return sorted({str(q) for q in observations.quantity[np.isnan(observations.sigma)]})


def wrapped(rows: Rows, change: FloatArray) -> FloatArray:
    """Differences of the values of N rows, shape (..., N); those of Delta on its circle."""
    return np.where(rows.code == DELTA, (change + 180.0) % 360.0 - 180.0, change)


def _cos_sin(angle_deg: FloatArray) -> FloatArray:
    radians = np.radians(angle_deg)
    return np.stack([np.cos(radians), np.sin(radians)], axis=1)


def fitted(observations: Observations) -> Observations:
    """The rows that say something: those used, then the saturated ones whose gain and sigma the used ones tell."""
    used = observations.used

    def kinds(o: Observations) -> list[tuple[str, str, bool]]:
        return list(
            zip(map(str, o.gain_group), map(str, o.quantity), map(bool, np.isnan(o.sigma)), strict=True)
        )

    known = set(kinds(used))
    bounds = (observations.flag == Flag.SATURATED) & np.array([kind in known for kind in kinds(observations)])
    return concatenate([used, observations.select(bounds)])


def pack(observations: Observations, exterior_ior: float) -> Rows:
    """The kernel's view of ``observations`` (all rows; filter by ``fitted`` before)."""
    o = observations
    gains = {name: i for i, name in enumerate(gain_names(o))}
    estimated = {name: i for i, name in enumerate(estimated_names(o))}
    gain = np.array([gains.get(str(name), -1) for name in o.gain_group], dtype=np.int64)
    code = np.array([CODES[Quantity(str(q))] for q in o.quantity], dtype=np.int64)
    sigma_index = [estimated[str(q)] if np.isnan(s) else -1 for q, s in zip(o.quantity, o.sigma, strict=True)]
    keys = [f"{s}|{t!r}|{e!r}" for s, t, e in zip(o.set, o.theta_deg, o.theta_deg_sigma, strict=True)]
    settings, setting = np.unique(np.array(keys), return_inverse=True)
    power = code <= LAST_POWER
    censored = o.flag == Flag.SATURATED
    largest = np.ones(len(o))
    for g in np.unique(gain[power]):
        members = power & (gain == g)
        largest[members] = np.max(np.abs(o.value[members & ~censored]))
    cos_theta, sin_theta = cos_sin_deg(o.theta_deg)
    wavelengths, which = np.unique(o.wavelength_nm, return_inverse=True)  # a plan's one may be unknown
    inverse_square = (1000.0 / wavelengths) ** 2 if len(wavelengths) > 1 else np.zeros(1)
    # signal_s and signal_p are signals behind an analyzer along s and p.
    analyzer_deg = np.select(
        [code == CODES[Quantity.SIGNAL_S], code == CODES[Quantity.SIGNAL_P]], [0.0, 90.0], o.analyzer_deg
    )
    return Rows(
        code=code,
        cos_theta=cos_theta,
        sin_theta=sin_theta,
        theta_sigma=np.radians(o.theta_deg_sigma),
        cos_spread=np.cos(np.radians(o.theta_deg_spread)),
        sin_spread=np.sin(np.radians(o.theta_deg_spread)),
        analyzer=_cos_sin(2 * analyzer_deg),
        retarder=np.hstack([_cos_sin(2 * o.retarder_deg), _cos_sin(o.retardance_deg)]),
        diattenuation=np.ascontiguousarray(o.diattenuation),
        light=np.ascontiguousarray(o.light),
        value=np.ascontiguousarray(o.value),
        sigma=np.where(np.isnan(o.sigma), 1.0, o.sigma),
        gain=gain,
        estimated=np.array(sigma_index, dtype=np.int64),
        setting=setting.astype(np.int64),
        largest=largest,
        dispersion=(inverse_square - inverse_square.mean())[which],
        censored=censored,
        exterior_ior=exterior_ior,
        gains=len(gains),
        settings=len(settings),
        errors_in_angle=bool(np.any(o.theta_deg_sigma > 0)),
        heavy_tailed=False,
    )
