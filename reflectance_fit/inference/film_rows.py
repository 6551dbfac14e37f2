"""What rows would read of a substrate under a film, where the fit's own model has one plane interface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import optics_of, reading, turns_of
from reflectance_fit.inference.rows import Rows
from reflectance_fit.physics.film import film_amplitudes
from reflectance_fit.physics.jit import kernel

FloatArray = NDArray[np.float64]


def film_values(
    rows: Rows, vector: FloatArray, film: complex, substrate: complex, thickness: float
) -> FloatArray:
    """Every row's value, shape (N,): gain 1, no background, nuisances as in ``vector``.

    Indices relative to vacuum, ``thickness`` in vacuum wavelengths.  A row
    that averages a range of angles gets the mean of two, as in ``forward``.
    """
    turns = turns_of(vector)
    c = rows.cos_theta * turns[0] - rows.sin_theta * turns[1]
    s = rows.sin_theta * turns[0] + rows.cos_theta * turns[1]
    around = rows.exterior_ior
    values = []
    for side in (1.0, -1.0):
        cosine = np.clip(c * rows.cos_spread - side * s * rows.sin_spread, 0.0, 1.0)
        r = film_amplitudes(cosine, film / around, substrate / around, thickness * around)
        cross = r.s * np.conj(r.p)
        seen = np.column_stack([np.abs(r.s) ** 2, np.abs(r.p) ** 2, cross.real, cross.imag])
        values.append(_readings(rows, seen, vector))
    return np.asarray(0.5 * (values[0] + values[1]))


@kernel
def _readings(rows: Rows, seen: FloatArray, vector: FloatArray) -> FloatArray:
    """Each row's reading of its own reflection (N, 4): R_s, R_p and r_s conj(r_p)."""
    turns = turns_of(vector)
    out = np.empty(len(seen))
    for i in range(len(seen)):
        reflection = seen[i, 0], seen[i, 1], seen[i, 2], seen[i, 3]
        out[i] = reading(rows.code[i], optics_of(rows, i), reflection, turns)
    return out
