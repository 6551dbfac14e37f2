"""BRDFs of the textbook, to try checks on: matte, two by Phong, one by Blinn.

A BRDF is any function ``brdf(incoming, outgoing)`` of unit vectors, float of
shape (..., 3) that broadcast, in the local frame (z is the normal, z >= 0 for
both, both point away from the surface), that returns float of shape (...) in
1/sr: reflected radiance over the irradiance that causes it.

A mirror has no such function: all its light leaves in one direction, so its
BRDF is Dirac's delta.  `reflection.mirror_radiance` treats it by Fresnel.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Brdf = Callable[[Floats, Floats], Floats]


def lambertian(albedo: float) -> Brdf:
    """albedo / pi, the same in all directions; albedo in [0, 1]."""
    value = _checked_albedo(albedo) / np.pi

    def brdf(incoming: Floats, outgoing: Floats) -> Floats:
        return np.full(np.broadcast_shapes(incoming.shape, outgoing.shape)[:-1], value)

    return brdf


def phong(albedo: float, exponent: float) -> Brdf:
    """Phong's lighting rule read as a BRDF, albedo cos^n(alpha) (n + 2) / (2 pi) / cos(theta_i).

    alpha is the angle between outgoing and the mirror direction.  The rule has no cosine of
    incidence, so the BRDF has its inverse: it is **not reciprocal**, and its albedo
    grows without bound towards grazing incidence, so it does **not conserve energy**.

    Notes
    -----
    B. T. Phong, Commun. ACM 18 (1975) 311; criticised by R. R. Lewis, Making Shaders More
    Physically Plausible (1993).
    """
    modified = modified_phong(albedo, exponent)

    def brdf(incoming: Floats, outgoing: Floats) -> Floats:
        return modified(incoming, outgoing) / incoming[..., 2]

    return brdf


def modified_phong(albedo: float, exponent: float) -> Brdf:
    """albedo (n + 2) / (2 pi) cos^n(alpha), alpha the angle from outgoing to the mirror direction.

    Reciprocal; reflects the fraction ``albedo`` at normal incidence and less elsewhere.  0 beyond 90 degrees.

    Notes
    -----
    E. P. Lafortune and Y. D. Willems, Using the Modified Phong Reflectance Model (1994).
    """
    scale = _checked_albedo(albedo) * (_checked_exponent(exponent) + 2.0) / (2.0 * np.pi)

    def brdf(incoming: Floats, outgoing: Floats) -> Floats:
        # |outgoing - mirror|^2 / 2 is 1 - cos(alpha) without cancellation, which a sharp lobe needs.
        gap = np.sum((outgoing - mirrored(incoming)) ** 2, axis=-1) / 2.0
        return _power(scale, exponent, gap)

    return brdf


def blinn_phong(albedo: float, exponent: float) -> Brdf:
    """albedo (n + 2)(n + 4) / (8 pi (2^(-n/2) + n)) cos^n(theta_h), theta_h that of the half-vector.

    Reciprocal; reflects the fraction ``albedo`` at normal incidence and less elsewhere.

    Notes
    -----
    J. F. Blinn, SIGGRAPH (1977); the factor: F. Giesen, Phong Normalization Factor Derivations (2009).
    """
    n = _checked_exponent(exponent)
    scale = _checked_albedo(albedo) * (n + 2.0) * (n + 4.0) / (8.0 * np.pi * (2.0 ** (-n / 2.0) + n))

    def brdf(incoming: Floats, outgoing: Floats) -> Floats:
        half = incoming + outgoing
        # Both grazing and opposite: the half-vector is then anything, also the normal.
        length = np.maximum(np.linalg.norm(half, axis=-1), np.finfo(np.float64).tiny)
        sideways2 = np.sum((half[..., :2] / length[..., None]) ** 2, axis=-1)
        cosine = half[..., 2] / length
        return _power(scale, exponent, sideways2 / (1.0 + cosine))

    return brdf


def mirrored(direction: Floats) -> Floats:
    """The mirror direction: x and y change sign; both point away from the surface."""
    return np.asarray(direction * np.array([-1.0, -1.0, 1.0]))


def _power(scale: float, exponent: float, gap: Floats) -> Floats:
    """scale cos^exponent for gap = 1 - cos, 0 for a negative cosine."""
    below = gap >= 1.0
    power = np.exp(exponent * np.log1p(-np.where(below, 0.0, gap)))
    return np.where(below, 0.0, scale * power)


def _checked_albedo(albedo: float) -> float:
    if not 0.0 <= albedo <= 1.0:
        raise ValueError("albedo must be reflected over incident power in [0, 1]; is it in percent?")
    return albedo


def _checked_exponent(exponent: float) -> float:
    if not 0.0 <= exponent < np.inf:
        raise ValueError("the exponent of a lobe must be finite and not negative")
    return exponent
