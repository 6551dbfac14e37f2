"""Fresnel's equations and sheets as Mueller matrices, and the frames that Stokes vectors refer to.

Mueller matrices have shape (N, 4, 4).  Rays run from the camera, light runs
against them: a receiver of the light looks along the ray.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tracer_shapes import axes, dot, unit

from reflectance_fit.physics import approximations, fitted_approximations, mueller
from reflectance_fit.physics.fresnel import amplitudes, reflectances
from reflectance_fit.render.scene import PolarizerSheet, RetarderSheet, Surface

Floats = NDArray[np.float64]
Sheet = PolarizerSheet | RetarderSheet

APPROXIMATIONS = {
    "constant": approximations.constant,
    "schlick": approximations.schlick_exact_r0,
    "schlick_f82": approximations.f82,
    "lazanyi": fitted_approximations.lazanyi,
    "large_index": approximations.lecture_conductor,
}


@dataclass(frozen=True, slots=True)
class Interface:
    """Index of the far over the near medium, eta + ik, shape (N,), and how Fresnel's equations are met.

    Approximations have no s and p: their matrices are right in element [0, 0] alone.
    """

    eta: Floats
    k: Floats
    fresnel: str = "exact"

    def reflection(self, c: Floats) -> Floats:
        if self.fresnel == "exact":
            return mueller.reflection(*amplitudes(c, self.eta, self.k))
        return depolarizer(self._approximate(c))

    def transmission(self, c: Floats) -> Floats:
        """Of power; both amplitudes are positive, so the phase between s and p is zero."""
        if self.fresnel != "exact":
            return depolarizer(1.0 - self._approximate(c))
        power = reflectances(c, self.eta)
        return mueller.reflection(np.sqrt(power.transmitted_s), np.sqrt(power.transmitted_p))

    def _approximate(self, c: Floats) -> Floats:
        """Of the angle on the thin side; forms take one index at a time, and rays meet glass from either side."""
        found = np.empty(np.broadcast_shapes(c.shape, self.eta.shape))
        c, eta, k = (np.broadcast_to(a, found.shape) for a in (c, self.eta, self.k))
        for index in np.unique(np.stack([eta, k], axis=-1), axis=0):
            here = (eta == index[0]) & (k == index[1])
            found[here] = self._of_one_index(c[here], *map(float, index))
        return found

    def _of_one_index(self, c: Floats, eta: float, k: float) -> Floats:
        if eta >= 1.0 or k > 0.0:
            return np.asarray(APPROXIMATIONS[self.fresnel](eta, k)(c))
        squared = 1.0 - (1.0 - c**2) / eta**2
        outside = np.sqrt(np.maximum(squared, 0.0))
        return np.where(squared > 0.0, APPROXIMATIONS[self.fresnel](1.0 / eta, 0.0)(outside), 1.0)


def average_reflectance(interface: Interface) -> Floats:
    """Share of evenly spread light that an interface reflects, shape (N,)."""
    x, w = np.polynomial.legendre.leggauss(64)
    c, weight = (x + 1.0) / 2.0, w / 2.0
    eta, where = np.unique(interface.eta, return_inverse=True)
    values = np.array(
        [
            np.sum(
                2.0
                * c
                * weight
                * Interface(np.full(64, e), np.zeros(64), interface.fresnel).reflection(c)[:, 0, 0]
            )
            for e in eta
        ]
    )
    return np.asarray(values[where])


def through_sheet(surface: Surface, d: Floats) -> tuple[Floats, Floats]:
    """The sheet's axis at right angles to each ray, and the sheet's matrix with that axis first.

    A tilted polarizer stops the field along its other axis as the ray sees it: Korger et al., Opt. Express 21 (2013) 27032.
    """
    sheet, (u, v) = surface.material, axes(surface.shape)
    if isinstance(sheet, PolarizerSheet):
        angle, matrix = sheet.axis_deg, mueller.polarizer(0.0, sheet.diattenuation)
        stopped = np.cos(np.radians(angle)) * v - np.sin(np.radians(angle)) * u
        axis = np.cross(d, unit(stopped - d * (d @ stopped)[:, None]))
    else:
        assert isinstance(sheet, RetarderSheet)
        angle, matrix = sheet.fast_axis_deg, mueller.retarder(0.0, np.radians(sheet.retardance_deg))
        fast = np.cos(np.radians(angle)) * u + np.sin(np.radians(angle)) * v
        axis = unit(fast - d * (d @ fast)[:, None])
    return axis, np.broadcast_to(matrix, (len(d), 4, 4))


def any_axis(d: Floats) -> Floats:
    """Some unit vector at right angles to each direction."""
    other = np.where(np.abs(d[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    return unit(np.cross(d, other))


def across(d: Floats, n: Floats) -> Floats:
    """Unit normal of the plane of incidence; any where there is none."""
    s = np.cross(d, n)
    length = np.linalg.norm(s, axis=-1, keepdims=True)
    return np.where(length > 1e-12, s / np.maximum(length, 1e-12), any_axis(d))


def turned(first: Floats, second: Floats, d: Floats) -> Floats:
    """Matrix that states light of axis ``first`` by axis ``second``; its p axis is (direction of light) x axis."""
    return mueller.rotator(np.arctan2(dot(second, np.cross(-d, first)), dot(second, first)))


def depolarizer(power: Floats) -> Floats:
    matrix = np.zeros((len(power), 4, 4))
    matrix[:, 0, 0] = power
    return matrix
