"""The fitted value beside the table that the sample's name points to."""

from __future__ import annotations

import math

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials.library import Entry, get, match
from reflectance_fit.report.schema import Literature
from reflectance_fit.result import Fit, Interval

# Standard deviations; the table's own spread counts as one part of them.
DISAGREES = 3.0
# Below this k no reflection measurement tells a dielectric from an ideal one.
_TRANSPARENT = 1e-3


def compare(sample_name: str, fit: Fit) -> tuple[Literature | None, str | None]:
    """The table's values at the fit's wavelength, and a warning where they disagree.

    (None, None) where no built-in matches the name or it does not cover the
    wavelength.  Both compared relative to vacuum.  The warning weighs the
    difference against the fit's sd and the spread among published tables; the
    report's ``z`` against the fit's sd alone.
    """
    entry = match(sample_name)
    if entry is None:
        return None, None
    constants = get(entry.name)
    try:
        eta, k = constants.absolute_index(fit.wavelength_nm)
    except ReflectanceFitError:  # outside of the table
        return None, None
    table_eta, table_k = float(eta), float(k)
    measured = fit.intervals["eta"]
    z, found_k = _z(measured, table_eta, 0.0), fit.intervals["k"]
    known_k = None if found_k.status == "fixed" or not constants.k_known else _z(found_k, table_k, 0.0)
    literature = Literature(
        nearest=entry.name, eta=table_eta, k=table_k, z=z, z_k=known_k, source=entry.citation
    )
    if entry.kind == "dielectric" and table_k < _TRANSPARENT and fit.intervals["k"].status == "identified":
        return literature, (
            f"k = {fit.intervals['k'].median:.3g} is needed, but {entry.name} is transparent at "
            f"{fit.wavelength_nm:g} nm; suspect stray light, a dark level, or a film"
        )
    if not _disagrees(entry, measured, table_eta):
        # Tables differ in k as they do in eta; relative to the index, for k itself may be tiny.
        z_k = _z(found_k, table_k, entry.spread * math.hypot(table_eta, table_k))
        if entry.kind == "dielectric" or z_k is None or abs(z_k) <= DISAGREES:
            return literature, None
        return literature, (
            f"k = {found_k.median:.4f} +- {found_k.sd:.4f}, but {entry.name} is {table_k:.4f} at "
            f"{fit.wavelength_nm:g} nm ({entry.citation}); suspect a film, or another grade of material"
        )
    return literature, (
        f"eta = {measured.median:.4f} +- {measured.sd:.4f}, but {entry.name} is {table_eta:.4f} at "
        f"{fit.wavelength_nm:g} nm ({abs(z or 0.0):.1f} sd away, {entry.citation}); suspect the angle zero, "
        "another grade of material, or a film"
    )


def _z(measured: Interval, tabulated: float, spread: float) -> float | None:
    if measured.median is None or not measured.sd:
        return None
    return (measured.median - tabulated) / math.hypot(measured.sd, spread)


def _disagrees(entry: Entry, measured: Interval, table_eta: float) -> bool:
    z = _z(measured, table_eta, entry.spread * table_eta)
    return z is not None and abs(z) > DISAGREES
