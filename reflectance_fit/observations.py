"""The type in the middle: what was measured, one row a value.

Photographs and tables both become ``Observations``; the fit knows nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Quantity(StrEnum):
    """What a value is; its unit is part of its name, powers and ratios have none."""

    REFLECTANCE_S = "reflectance_s"
    REFLECTANCE_P = "reflectance_p"
    REFLECTANCE = "reflectance"  # of unpolarized light
    SIGNAL_S = "signal_s"  # R_s times an unknown gain (analyzer along s)
    SIGNAL_P = "signal_p"  # R_p times an unknown gain (analyzer along p)
    SIGNAL = "signal"  # unknown gain; analyzer at analyzer_deg, none where that is NaN
    RATIO_PS = "ratio_ps"  # R_p / R_s
    DOLP = "dolp"  # (R_s - R_p) / (R_s + R_p)
    PSI_DEG = "psi_deg"
    DELTA_DEG = "delta_deg"

    @property
    def has_gain(self) -> bool:
        return self in (Quantity.SIGNAL_S, Quantity.SIGNAL_P, Quantity.SIGNAL)

    @property
    def is_power(self) -> bool:
        """Whether the value is a power, so that dark and diffuse light add to it."""
        return self.has_gain or self in (
            Quantity.REFLECTANCE_S,
            Quantity.REFLECTANCE_P,
            Quantity.REFLECTANCE,
        )


class Flag(StrEnum):
    """Whether a row is used, else why not."""

    USED = "used"
    SATURATED = "saturated"
    MASKED = "masked"
    UNREGISTERED = "unregistered"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Columns of equal length N; angles in degrees as files have them.

    ``channel`` names the wavelength band ("550 nm", "G").  Rows of equal
    ``set`` and ``theta_deg`` were taken at one setting of the goniometer and
    share its error.  ``theta_deg_spread`` is the standard deviation of the
    angle over the pixels that were averaged, 0 for one angle.  Rows of equal ``gain_group`` share one unknown gain; the
    empty string means absolute.  ``diattenuation`` is that of the analyzer with
    all optics before it, 1 for an ideal one.  ``light`` is the incident Stokes vector,
    shape (N, 4), in the (s, p) frame of docs/conventions.md.  ``sigma`` is
    one standard deviation, NaN where nobody stated it; ``theta_deg_sigma`` is
    0 where the angle is taken as exact.  ``fwhm_nm`` is the width of the row's wavelength band,
    0 for a line; ``signal_per_dn`` what one raw count more would add to the value, NaN where there are no counts.
    """

    channel: NDArray[np.str_]
    wavelength_nm: FloatArray
    set: NDArray[np.str_]
    gain_group: NDArray[np.str_]
    theta_deg: FloatArray
    theta_deg_sigma: FloatArray
    theta_deg_spread: FloatArray
    analyzer_deg: FloatArray
    retarder_deg: FloatArray
    retardance_deg: FloatArray
    diattenuation: FloatArray
    light: FloatArray
    quantity: NDArray[np.str_]
    value: FloatArray
    sigma: FloatArray
    pixels: NDArray[np.int64]
    flag: NDArray[np.str_]
    fwhm_nm: FloatArray = field(default_factory=lambda: np.zeros(()))
    signal_per_dn: FloatArray = field(default_factory=lambda: np.full((), np.nan))

    def __post_init__(self) -> None:
        n = len(self.value)
        for name in ("fwhm_nm", "signal_per_dn"):
            if np.ndim(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.full(n, getattr(self, name)))
        for column in fields(self):
            if len(getattr(self, column.name)) != n:
                raise ValueError(f"column {column.name} has not {n} rows")
        if self.light.shape != (n, 4):
            raise ValueError("light must have shape (N, 4)")

    def __len__(self) -> int:
        return len(self.value)

    def select(self, rows: NDArray[Any]) -> Observations:
        """The rows that a boolean mask or an index array picks."""
        return replace(self, **{c.name: getattr(self, c.name)[rows] for c in fields(self)})

    @property
    def used(self) -> Observations:
        """Only the rows that take part in a fit."""
        return self.select(self.flag == Flag.USED)

    def channels(self) -> Iterator[tuple[str, Observations]]:
        """Each channel's rows, in order of first appearance."""
        _, first = np.unique(self.channel, return_index=True)
        for name in self.channel[np.sort(first)]:
            yield str(name), self.select(self.channel == name)


def concatenate(parts: list[Observations]) -> Observations:
    """All rows of ``parts``, in order."""
    return Observations(
        **{c.name: np.concatenate([getattr(p, c.name) for p in parts]) for c in fields(Observations)}
    )
