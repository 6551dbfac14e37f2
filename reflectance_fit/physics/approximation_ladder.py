"""Every approximation of the unpolarized reflectance by name, from the crudest to exact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from numpy.typing import ArrayLike

from reflectance_fit.physics import approximations as closed
from reflectance_fit.physics import fitted_approximations as fitted
from reflectance_fit.physics.approximations import Curve, Floats


@dataclass(frozen=True, slots=True)
class Approximation:
    """One rung: called with cosines (N,) and an index eta + ik it gives reflectances (N,).

    ``curve`` does the part that a renderer does once for a material; its
    arguments are those of `approximations.materials`.
    """

    name: str
    curve: Callable[[ArrayLike, ArrayLike], Curve]
    source: str
    valid_for: str

    def __call__(self, cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        return self.curve(eta, k)(cos_theta_i)


LADDER = (
    Approximation(
        "r0_constant",
        closed.constant,
        "reflectance at normal incidence, ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2)",
        "metals with R0 near 1, seen from the front",
    ),
    Approximation(
        "schlick",
        closed.schlick_exact_r0,
        "Schlick, Computer Graphics Forum 13 (1994) 233, with the exact R0, k included; also the base form of "
        "Lazanyi & Szirmay-Kalos (2005)",
        "dielectrics with eta from 1.4 to 2.2; worse towards an index match and for metals with large k and R0 < 0.9",
    ),
    Approximation(
        "schlick_real_r0",
        closed.schlick_real_r0,
        "Schlick (1994) with R0 = ((eta - 1) / (eta + 1))^2, as where only eta is asked for",
        "k = 0, where it is schlick; not for metals",
    ),
    Approximation(
        "lazanyi",
        fitted.lazanyi,
        "Lazanyi & Szirmay-Kalos, WSCG short papers (2005) 77; a and alpha by least squares over the angle",
        "metals, with a and alpha stored for each",
    ),
    Approximation(
        "f82",
        closed.f82,
        "Kutz, Hasan & Edmondson (2021) after Hoffman (2019); OpenPBR 1.1; exact at cos_theta_i = 1/7",
        "metals; below 0 near an index match",
    ),
    Approximation(
        "lecture_conductor",
        closed.lecture_conductor,
        "Pharr & Humphreys, Physically Based Rendering, 2nd ed., 8.2.1: sin^2(theta_i) dropped beside eps",
        "metals, |eta + ik| well above 1; not for dielectrics",
    ),
    Approximation(
        "gulbrandsen",
        closed.gulbrandsen,
        "Gulbrandsen, J. Comput. Graph. Tech. 3 (2014) no. 4, 64: reflectivity and edge tint in [0, 1]",
        "metals with |eta + ik| of 1 or more, where it is lecture_conductor",
    ),
    Approximation(
        "table",
        fitted.table,
        f"{fitted.TABLE_CELLS + 1} exact values at equal steps of sqrt(cos_theta_i), linear in between",
        "every material, except for the cell with the critical angle",
    ),
    Approximation(
        "exact", closed.exact, "Fresnel's equations, fresnel.reflectances", "every plane interface"
    ),
)
