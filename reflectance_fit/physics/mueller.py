"""Mueller matrices, shape (..., 4, 4), in the frames and signs of `stokes`.

Angles in radians from s towards p, counter-clockwise for the receiver.  Apply
with ``M @ stokes`` or, for stacks, ``(M @ stokes[..., None])[..., 0]``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.stokes import checked_diattenuation

Floats = NDArray[np.float64]


def reflection(r_s: ArrayLike, r_p: ArrayLike) -> Floats:
    """Reflection with complex amplitudes r_s, r_p, from the incident to the reflected ray's (s, p) frame.

    Light polarized at +45 degrees, s = [1, 0, 1, 0], comes off gold at 60
    degrees with S3 > 0: partly right circular.  Off glass it stays linear.

    Notes
    -----
    Mitsuba 3 documentation, "Polarization", section "Fresnel equations", which
    writes eta - ik inside, so its amplitudes are our conjugates.  C = r_s conj(r_p)
    = |r_s r_p| exp(+i Delta) turns E_s conj(E_p) = (S2 + i S3) / 2.
    """
    r_s, r_p = np.asarray(r_s, dtype=np.complex128), np.asarray(r_p, dtype=np.complex128)
    power_s, power_p = np.abs(r_s) ** 2, np.abs(r_p) ** 2
    a, b, c = (power_s + power_p) / 2.0, (power_s - power_p) / 2.0, r_s * np.conj(r_p)
    return _matrix([[a, b, 0, 0], [b, a, 0, 0], [0, 0, c.real, -c.imag], [0, 0, c.imag, c.real]])


def rotator(angle: ArrayLike) -> Floats:
    """The same light seen from a frame turned by angle: S1' = S1 cos 2a + S2 sin 2a.

    Light polarized along s, [1, 1, 0, 0], looks like -45 degrees, [1, 0, -1, 0],
    from a frame turned by +45 degrees.

    Notes
    -----
    Collett, Field Guide to Polarization (2005).
    """
    cos, sin = np.cos(2.0 * np.asarray(angle)), np.sin(2.0 * np.asarray(angle))
    return _matrix([[1, 0, 0, 0], [0, cos, sin, 0], [0, -sin, cos, 0], [0, 0, 0, 1]])


def polarizer(phi: ArrayLike, diattenuation: ArrayLike = 1.0) -> Floats:
    """Linear polarizer with transmission axis phi that passes half of unpolarized light.

    Unpolarized light, [1, 0, 0, 0], leaves a perfect one at phi = 0 as
    [1/2, 1/2, 0, 0]; a second one at 90 degrees then stops it.

    Notes
    -----
    Collett (2005), with the diattenuation
    D = (T_max - T_min) / (T_max + T_min), scaled to T_max + T_min = 1.
    """
    d = checked_diattenuation(diattenuation)
    rest = np.sqrt((1.0 - d) * (1.0 + d))
    along_s = _matrix([[1, d, 0, 0], [d, 1, 0, 0], [0, 0, rest, 0], [0, 0, 0, rest]]) / 2.0
    return _turned(along_s, phi)


def retarder(fast_axis: ArrayLike, retardance: ArrayLike) -> Floats:
    """Linear retarder; retardance in radians, the phase by which the slow axis lags behind the fast one.

    A quarter-wave plate (pi/2) with its fast axis along s turns right circular
    light, [1, 0, 0, 1], into +45 degrees, [1, 0, 1, 0], and +45 degrees into left
    circular light.

    Notes
    -----
    With exp(-i omega t) the slow field gains exp(+i retardance): for slow = p,
    S2 + i S3 = 2 E_s conj(E_p) turns by -retardance.
    """
    cos, sin = np.cos(np.asarray(retardance)), np.sin(np.asarray(retardance))
    along_s = _matrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, cos, sin], [0, 0, -sin, cos]])
    return _turned(along_s, fast_axis)


def _turned(matrix: Floats, angle: ArrayLike) -> Floats:
    """The same component turned by angle: into its frame, through it, and back."""
    angle = np.asarray(angle, dtype=np.float64)
    turned: Floats = rotator(-angle) @ matrix @ rotator(angle)
    return turned


def _matrix(rows: list[list[ArrayLike]]) -> Floats:
    """Stack entries of any broadcastable shape to (..., 4, 4)."""
    matrix = np.zeros((*np.broadcast_shapes(*(np.shape(entry) for row in rows for entry in row)), 4, 4))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrix[..., i, j] = entry
    return matrix
