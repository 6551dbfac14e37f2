"""Approximations whose numbers are fitted to one material: Lazanyi's residual, and a table."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics.approximations import Curve, Floats, materials, schlick
from reflectance_fit.physics.domain import checked_cosine
from reflectance_fit.physics.fresnel import r0, reflectances

TABLE_CELLS = 256
TABLE_NODES = np.linspace(0.0, 1.0, TABLE_CELLS + 1)  # square roots of the cosines
_ANGLES_DEG = (np.arange(180) + 0.5) / 2.0
_LOG_EXPONENTS = np.linspace(np.log(0.1), np.log(100.0), 301)


def lazanyi_coefficients(eta: ArrayLike, k: ArrayLike) -> tuple[Floats, Floats]:
    """The a and alpha of `lazanyi`, of the shape of eta and k, which are as for `materials`.

    The paper states neither its weights nor its method.  Here the sum of squares
    over 180 angles, evenly spread over 0 to 90 degrees, is the smallest for alpha in [0.1, 100]:
    a is linear and has a closed form for every alpha; 301 alphas are tried, and a parabola
    through the best and its neighbours gives the alpha between them.
    """
    eta, k = materials(eta, k)
    cosines, basis, squares = _basis()
    residual = schlick(cosines, r0(eta, k)) - reflectances(cosines, eta, k).mean
    # What each alpha takes off the sum of squares, with its best a.
    gain = (residual @ basis.T) ** 2 / squares
    best = np.clip(np.argmax(gain, axis=-1, keepdims=True), 1, _LOG_EXPONENTS.size - 2)
    before, at, after = (np.take_along_axis(gain, best + step, axis=-1) for step in (-1, 0, 1))
    curvature = before - 2.0 * at + after
    # At the end of the range the vertex lies outside; without any residual there is none.
    shift = 0.5 * (before - after) / np.where(curvature < 0.0, curvature, -1.0)
    step = _LOG_EXPONENTS[1] - _LOG_EXPONENTS[0]
    alpha = np.exp(_LOG_EXPONENTS[best] + step * np.clip(shift, -1.0, 1.0))
    shape = cosines * (1.0 - cosines) ** alpha
    a = np.sum(residual * shape, axis=-1, keepdims=True) / np.sum(shape**2, axis=-1, keepdims=True)
    return a.reshape(eta.shape)[()], alpha.reshape(eta.shape)[()]


def lazanyi(eta: ArrayLike, k: ArrayLike) -> Curve:
    """Schlick with the R0 of eta + ik, less a residual a c (1 - c)^alpha.  Arguments as for `materials`.

    Notes
    -----
    Lazanyi & Szirmay-Kalos, Fresnel term approximations for metals, WSCG short papers (2005) 77; a and alpha
    are fitted by `lazanyi_coefficients`.
    """
    eta, k = materials(eta, k)
    normal = r0(eta, k)
    a, alpha = lazanyi_coefficients(eta, k)

    def curve(cos_theta_i: ArrayLike) -> Floats:
        c = checked_cosine(cos_theta_i)
        result: Floats = schlick(c, normal) - a * c * (1.0 - c) ** alpha
        return result

    return curve


def table(eta: ArrayLike, k: ArrayLike) -> Curve:
    """257 exact values, linear in between, at equal steps of sqrt(cos_theta_i).  Arguments as for `materials`.

    In the cosine itself the error is 2 to 100 times as large, because all of a near match and half of a metal's
    dip lie at small cosines.  A kink (the critical angle) is lost in its cell.
    """
    eta, k = materials(eta, k)
    values = reflectances(TABLE_NODES**2, eta, k).mean

    def curve(cos_theta_i: ArrayLike) -> Floats:
        position = np.sqrt(checked_cosine(cos_theta_i))
        return np.apply_along_axis(lambda column: np.interp(position, TABLE_NODES, column), -1, values)

    return curve


@cache
def _basis() -> tuple[Floats, Floats, Floats]:
    """Cosines (N,), c (1 - c)^alpha for every alpha (A, N), and the sums of their squares (A,)."""
    cosines, _ = cos_sin_deg(_ANGLES_DEG)
    basis = cosines * (1.0 - cosines) ** np.exp(_LOG_EXPONENTS)[:, np.newaxis]
    return cosines, basis, np.sum(basis**2, axis=-1)
