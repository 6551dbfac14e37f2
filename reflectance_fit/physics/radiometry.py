"""Lambert's cosine law and what follows from it in one line.

Radiometry here is geometry: any unit of power will do, so long as it is the
same throughout.  With power in watts and lengths in metres, irradiance E and
exitance M are in W/m^2, radiance L in W/(m^2 sr), radiant intensity in W/sr.
Directions point away from the surface, also those light comes from.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def beam_irradiance(normal_irradiance: ArrayLike, cos_theta: ArrayLike) -> Floats:
    """Irradiance of a parallel beam on a tilted surface, E = E_n cos(theta), 0 from behind; shape S.

    Parameters
    ----------
    normal_irradiance : float, shape S
        Power over the beam's own cross-section; not negative.
    cos_theta : float, broadcastable to S
        Cosine of the angle between the surface normal and the direction to the source; in [-1, 1].

    Raises
    ------
    ValueError
        If normal_irradiance is negative or cos_theta outside [-1, 1].

    Notes
    -----
    J. H. Lambert, Photometria (1760).

    Examples
    --------
    >>> print(f"{beam_irradiance(1000.0, np.cos(np.radians(60.0))):.1f}")
    500.0
    """
    cosine = np.asarray(cos_theta, dtype=np.float64)
    if not np.all((cosine >= -1.0) & (cosine <= 1.0)):
        raise ValueError("cos_theta must be a cosine in [-1, 1]; is it an angle?")
    result: Floats = checked_power(normal_irradiance, "normal_irradiance") * np.maximum(cosine, 0.0)
    return result[()]


def point_irradiance(
    radiant_intensity: ArrayLike, source: ArrayLike, position: ArrayLike, normal: ArrayLike
) -> Floats:
    """Irradiance of a point source, E = I cos(theta) / r^2, 0 from behind; shape S.

    Parameters
    ----------
    radiant_intensity : float, broadcastable to S
        Power over solid angle, the same in all directions; not negative.
    source, position : float, shape (..., 3)
        Where the source and the receiver are; S is the common shape without the last axis.
    normal : float, shape (..., 3)
        The receiver's; any length.

    Raises
    ------
    ValueError
        If the source lies on the receiver, or an argument is not finite, negative or of another shape.

    Examples
    --------
    >>> print(f"{point_irradiance(8.0, [0, 0, 2], [0, 0, 0], [0, 0, 1]):.1f}")
    2.0
    """
    towards = checked_point(source, "source") - checked_point(position, "position")
    distance = np.linalg.norm(towards, axis=-1)
    if not np.all(distance > 0.0):
        raise ValueError("the point source lies on the receiver; move one of them")
    cosine = np.sum(checked_direction(normal, "normal") * towards, axis=-1) / distance
    # Divided one after the other, so that the square of a small distance cannot underflow.
    falloff = np.maximum(cosine, 0.0) / distance / distance
    result: Floats = checked_power(radiant_intensity, "radiant_intensity") * falloff
    return result[()]


def lambertian_radiance(albedo: ArrayLike, irradiance: ArrayLike) -> Floats:
    """Radiance of a matte reflector, L = albedo E / pi, the same in all directions; shape S.

    Raises ValueError if albedo is outside [0, 1] or irradiance negative.

    Examples
    --------
    >>> print(f"{lambertian_radiance(0.5, 1000.0):.2f}")
    159.15
    """
    rho = np.asarray(albedo, dtype=np.float64)
    if not np.all((rho >= 0.0) & (rho <= 1.0)):
        raise ValueError("albedo must be reflected over incident power in [0, 1]; is it in percent?")
    return exitance_to_radiance(rho * checked_power(irradiance, "irradiance"))


def radiance_to_exitance(radiance: ArrayLike) -> Floats:
    """Exitance M = pi L of a surface that looks equally bright from everywhere; ValueError if L < 0."""
    result: Floats = np.pi * checked_power(radiance, "radiance")
    return result[()]


def exitance_to_radiance(exitance: ArrayLike) -> Floats:
    """Radiance L = M / pi of a surface that looks equally bright from everywhere; ValueError if M < 0."""
    result: Floats = checked_power(exitance, "exitance") / np.pi
    return result[()]


def checked_power(value: ArrayLike, name: str) -> Floats:
    """A radiometric quantity as float64, or ValueError unless finite and at least 0."""
    power = np.asarray(value, dtype=np.float64)
    if not np.all((power >= 0.0) & (power < np.inf)):
        raise ValueError(f"{name} must be finite and not negative")
    return power


def checked_point(point: ArrayLike, name: str) -> Floats:
    """Coordinates, shape (..., 3), as float64, or ValueError unless finite."""
    coordinates = np.asarray(point, dtype=np.float64)
    if coordinates.shape[-1:] != (3,) or not np.all(np.isfinite(coordinates)):
        raise ValueError(f"{name} must be finite and have x, y and z along its last axis")
    return coordinates


def checked_direction(direction: ArrayLike, name: str) -> Floats:
    """A direction, shape (..., 3), brought to length 1, or ValueError if it has none."""
    vector = checked_point(direction, name)
    largest = np.max(np.abs(vector), axis=-1, keepdims=True)
    if not np.all(largest > 0.0):
        raise ValueError(f"{name} must not be the zero vector: it has no direction")
    # The largest component goes first, so that no square overflows or underflows.
    scaled = vector / largest
    unit: Floats = scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
    return unit
