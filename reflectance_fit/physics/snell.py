"""Snell's law, real and complex: the wave in the far medium.

Signs of docs/conventions.md: eta + ik with k >= 0, so a wave that decays away
from the interface has a normal component with Im >= 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.domain import checked_angle, checked_cosine, checked_index

Floats = NDArray[np.float64]


def normal_component(cos_i: Floats, sin2_i: Floats, eta: Floats, k: Floats) -> tuple[Floats, Floats, Floats]:
    """Real and imaginary part of w = (eta + ik) cos(theta_t), and |w|^2.  Trusts its inputs.

    w^2 = (eta + ik)^2 - sin^2(theta_i), the root with Re w >= 0 and Im w >= 0:
    the transmitted wave leaves the interface and never grows.
    """
    # The real part of w^2, twice: near the critical angle eta^2 meets sin^2 and 1 - eta^2 meets cos^2.
    # The form with the smaller terms loses less, and keeps both eta -> 0 at normal incidence and
    # eta -> 1 at grazing incidence exact to a few ulp.
    real = np.where(
        sin2_i < 0.5,
        (eta - k) * (eta + k) - sin2_i,
        (eta - 1.0) * (eta + 1.0) + (cos_i - k) * (cos_i + k),
    )
    modulus = np.hypot(real, 2.0 * eta * k)
    larger = np.sqrt((modulus + np.abs(real)) / 2.0)
    # The smaller part from the product u v = eta k, which never cancels.  larger = 0 only where w = 0.
    smaller = eta * k / np.where(larger > 0.0, larger, 1.0)
    return np.where(real >= 0.0, larger, smaller), np.where(real >= 0.0, smaller, larger), modulus


def cos_theta_t(cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0) -> NDArray[np.complex128]:
    """Complex cosine of the angle of refraction.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.

    Returns
    -------
    complex, shape S
        Real for k = 0 below the critical angle, positive imaginary above it
        (an evanescent wave).  (eta + ik) cos_theta_t has Re >= 0, Im >= 0.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive or k is negative.

    Notes
    -----
    Born & Wolf, Principles of Optics, 7th ed., 14.2, with their kappa = k / eta.
    """
    cos_i = checked_cosine(cos_theta_i)
    eta, k = checked_index(eta, k)
    u, v, _ = normal_component(cos_i, (1.0 - cos_i) * (1.0 + cos_i), eta, k)
    result: NDArray[np.complex128] = np.asarray((u + 1j * v) / (eta + 1j * k), dtype=np.complex128)
    return result[()]


def refraction_angle(theta_i: ArrayLike, eta: ArrayLike) -> Floats:
    """Real angle of refraction in radians, sin(theta_i) = eta sin(theta_t).

    Parameters
    ----------
    theta_i : float, shape S
        Angle of incidence in radians, in [0, pi/2].
    eta : float, broadcastable to S
        Relative index of a transparent far medium.

    Raises
    ------
    ValueError
        Outside the domain, and beyond the critical angle, where no real angle
        exists; `cos_theta_t` gives the complex cosine there.

    Examples
    --------
    >>> print(f"{np.degrees(refraction_angle(np.radians(45.0), 1.5)):.4f}")
    28.1255
    """
    theta = checked_angle(theta_i)
    eta, _ = checked_index(eta)
    sine = np.sin(theta) / eta
    if not np.all(sine <= 1.0):
        raise ValueError(
            "theta_i is beyond the critical angle: total internal reflection has no real angle of "
            "refraction; cos_theta_t gives the complex cosine"
        )
    result: Floats = np.arcsin(sine)
    return result[()]
