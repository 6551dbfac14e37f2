"""A dielectric coat over a base that scatters alike in all directions and depolarizes.

Light enters with T(l), is scattered, meets the coat from inside (F_in of it
comes back, again and again) and leaves with T(v):
f = T(v) T(l) rho / (1 - rho F_in) / (pi eta^2), where eta^2 spreads what leaves
over the wider cone outside.  T is that of the smooth interface, also below a
rough coat: ``fresnel.dielectric_transmission`` at v_z and l_z, with eta the
coat's index over the exterior's, or 1 less an approximation; F_in is of the same form, or a
white base would gain light.  The reflection off the coat itself is ``ggx``'s or a mirror's.
A rough coat reflects a little more than a smooth one near the normal, so the
whole base is darkened by ``share``, at most some 0.1 %: then a white one gains no light.

Notes
-----
Baek, Jeon, Tong & Kim, Simultaneous Acquisition of Polarimetric SVBRDF and Normals (2018), eqs. 8 to 10, for
the chain of Mueller matrices T_out . depolarizer . T_in; the sum over internal reflections as in Mitsuba 3's
``plastic`` with ``nonlinear``.  Mitsuba 3's ``pplastic`` leaves the sum and eta^2 out: its diffuse_reflectance is
our rho / ((1 - rho F_in) eta^2).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.approximations import Curve, exact
from reflectance_fit.physics.jit import kernel, vectorised
from reflectance_fit.render.lobes import ggx
from reflectance_fit.render.lobes.select import like

Floats = NDArray[np.float64]
# Fresnel's equations or an approximation, as in ``physics.approximations``: from eta >= 1 and k to a curve of cosines.
Form = Callable[[ArrayLike, ArrayLike], Curve]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_COSINES, _CELLS = np.linspace(0.05, 1.0, 20), 48


def internal_reflectance(eta: ArrayLike, form: Form = exact) -> Floats:
    """Share of diffuse light that a coat of relative index eta throws back from inside, F_in; shape of eta.

    1 - F_in = (1 - F_out) / eta^2, because as much goes in as out in equilibrium;
    F_out = 2 integral of F(c) c dc.

    Raises
    ------
    ValueError
        If eta is not positive.

    Examples
    --------
    >>> print(f"{internal_reflectance(1.5):.4f}")
    0.5964
    """
    eta = np.asarray(eta, dtype=np.float64)
    # Below 1 the integrand has the critical angle's kink, so the side without one is integrated.
    outside = np.maximum(eta, 1.0 / eta)
    # c = x^2: near c = 0 reflectances of a near match change within a cosine of sqrt(eta - 1).
    x = 0.5 * (_NODES + 1.0)
    entering = 1.0 - form(outside[..., np.newaxis], 0.0)(x * x)
    through = np.sum(_WEIGHTS * entering * 2.0 * x**3, axis=-1)
    back: Floats = 1.0 - np.where(eta >= 1.0, through / outside**2, through)
    return back[()]


def share(eta: ArrayLike, roughness: float, form: Form = exact) -> Floats:
    """The largest part of a white base's light that a rough coat leaves room for at every v; shape of eta, at most 1."""
    eta = np.asarray(eta, dtype=np.float64)
    if roughness == 0.0:
        return np.ones_like(eta)[()]
    cosines, weights = _facets(roughness, _COSINES)
    # Most curves are constant.
    different, where = np.unique(eta, return_inverse=True)
    least = np.empty(different.size)
    for i, one in enumerate(different):
        reflected = np.mean(_from_either_side(form, one, cosines) * weights, axis=1)
        through = 1.0 - _from_either_side(form, one, _COSINES)
        least[i] = np.min((1.0 - reflected) / np.maximum(through, 1e-18))
    return np.minimum(least, 1.0)[where].reshape(eta.shape)[()]


def _from_either_side(form: Form, eta: float, cosine: Floats) -> Floats:
    """A form's reflectance; of the angle on the side of the lower index, total reflection is what it is."""
    if eta >= 1.0:
        return form(eta, 0.0)(cosine)
    squared = 1.0 - (1.0 - cosine**2) / eta**2
    return np.where(squared > 0.0, form(1.0 / eta, 0.0)(np.sqrt(np.maximum(squared, 0.0))), 1.0)


@kernel
def _facets(alpha: float, view: Floats) -> tuple[Floats, Floats]:
    """Cosines v . h of facets as they are seen from each cosine of v, and the weights of their reflections."""
    cosines = np.empty((view.size, _CELLS**2))
    weights = np.empty_like(cosines)
    for i in range(view.size):
        c = view[i]
        s = math.sqrt(1.0 - c * c)
        for j in range(_CELLS):
            for k in range(_CELLS):
                hx, hy, hz = ggx.sample_visible(alpha, s, 0.0, c, (j + 0.5) / _CELLS, (k + 0.5) / _CELLS)
                _, _, lz, cosine = ggx.mirrored(s, 0.0, c, hx, hy, hz)
                cosines[i, j * _CELLS + k] = min(max(cosine, 0.0), 1.0)
                weights[i, j * _CELLS + k] = ggx.reflection_weight(alpha, c, lz)
    return cosines, weights


def base_factor(reflectance: ArrayLike, eta: ArrayLike, roughness: float = 0.0, form: Form = exact) -> Floats:
    """share rho / ((1 - rho F_in) eta^2): the albedo that the base seems to have behind a coat that only transmits.

    Parameters
    ----------
    reflectance : float, shape S
        Of the bare base, in [0, 1].
    eta : float, broadcastable to S
        Index of the coat over the exterior's.
    roughness : float
        GGX alpha of the coat, 0: smooth.
    form : callable
        What stands for Fresnel's equations at the coat.

    Raises
    ------
    ValueError
        If a reflectance is outside [0, 1] or eta is not positive.

    Examples
    --------
    >>> print(f"{base_factor(0.5, 1.5):.4f}")
    0.3167
    """
    rho = np.asarray(reflectance, dtype=np.float64)
    if not np.all((rho >= 0.0) & (rho <= 1.0)):
        raise ValueError("the reflectance of a plastic's base must be in [0, 1]; is it in percent?")
    kept = 1.0 - rho * internal_reflectance(eta, form)
    result: Floats = share(eta, roughness, form) * rho / (kept * np.square(eta))
    return result[()]


@vectorised
def diffuse_value(transmitted_v: float, transmitted_l: float, lz: float, factor: float) -> float:
    """BRDF times cosine of unpolarized light; factor is ``base_factor``, 0 where l is below the horizon."""
    return transmitted_v * transmitted_l * factor * max(lz, like(0.0, lz)) * like(1.0 / math.pi, lz)


@vectorised
def choose_specular(reflected: float, transmitted: float, factor: float, through: float) -> float:
    """Probability of the coat's own reflection: its share of what comes back from v.

    ``reflected`` is F(v), ``transmitted`` 1 - F(v), ``factor`` the mean of
    ``base_factor`` over the channels, ``through`` the mean transmittance of
    the coat for diffuse light from outside, eta^2 (1 - F_in).
    """
    return reflected / max(reflected + transmitted * factor * through, like(1e-18, reflected))
