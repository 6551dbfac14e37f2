"""A dielectric coat over a base that scatters alike in all directions and depolarizes.

Light enters with T(l), is scattered, meets the coat from inside (F_in of it
comes back, again and again) and leaves with T(v):
f = T(v) T(l) rho / (1 - rho F_in) / (pi eta^2), where eta^2 spreads what leaves
over the wider cone outside.  T is that of the smooth interface, also below a
rough coat: ``fresnel.dielectric_transmission`` at v_z and l_z, with eta the
coat's index over the exterior's.  The reflection off the coat itself is ``ggx``'s or a mirror's.
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

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.physics.jit import kernel, vectorised
from reflectance_fit.render.lobes import fresnel, ggx
from reflectance_fit.render.lobes.select import like

Floats = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_COSINES, _CELLS = np.linspace(0.05, 1.0, 20), 48


def internal_reflectance(eta: ArrayLike) -> Floats:
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
    entering = reflectances(x * x, outside[..., np.newaxis]).transmitted
    through = np.sum(_WEIGHTS * entering * 2.0 * x**3, axis=-1)
    back: Floats = 1.0 - np.where(eta >= 1.0, through / outside**2, through)
    return back[()]


def share(eta: ArrayLike, roughness: float) -> Floats:
    """The largest part of a white base's light that a rough coat leaves room for at every v; shape of eta, at most 1."""
    eta = np.asarray(eta, dtype=np.float64)
    if roughness == 0.0:
        return np.ones_like(eta)[()]
    # Most curves are constant.
    different, where = np.unique(eta, return_inverse=True)
    least = [np.min(_room(roughness, one, _COSINES)) for one in different]
    return np.minimum(np.array(least), 1.0)[where].reshape(eta.shape)[()]


@kernel
def _room(alpha: float, eta: float, cosines: Floats) -> Floats:
    """1 - the albedo of the rough coat's reflection, over T of the smooth one."""
    room = np.empty_like(cosines)
    for i in range(cosines.size):
        c = cosines[i]
        s, reflected = math.sqrt(1.0 - c * c), 0.0
        for j in range(_CELLS):
            for k in range(_CELLS):
                hx, hy, hz = ggx.sample_visible(alpha, s, 0.0, c, (j + 0.5) / _CELLS, (k + 0.5) / _CELLS)
                _, _, lz, cosine = ggx.mirrored(s, 0.0, c, hx, hy, hz)
                power_s, power_p, _ = fresnel.dielectric_power(min(cosine, 1.0), eta)
                reflected += 0.5 * (power_s + power_p) * ggx.reflection_weight(alpha, c, lz)
        power_s, power_p, _ = fresnel.dielectric_power(c, eta)
        through = 1.0 - 0.5 * (power_s + power_p)
        room[i] = (1.0 - reflected / _CELLS**2) / max(through, 1e-18)
    return room


def base_factor(reflectance: ArrayLike, eta: ArrayLike, roughness: float = 0.0) -> Floats:
    """share rho / ((1 - rho F_in) eta^2): the albedo that the base seems to have behind a coat that only transmits.

    Parameters
    ----------
    reflectance : float, shape S
        Of the bare base, in [0, 1].
    eta : float, broadcastable to S
        Index of the coat over the exterior's.
    roughness : float
        GGX alpha of the coat, 0: smooth.

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
    result: Floats = share(eta, roughness) * rho / ((1.0 - rho * internal_reflectance(eta)) * np.square(eta))
    return result[()]


@vectorised
def diffuse_value(transmitted_v: float, transmitted_l: float, lz: float, factor: float) -> float:
    """BRDF times cosine of unpolarized light; factor is ``base_factor``, 0 where l is below the horizon."""
    return transmitted_v * transmitted_l * factor * max(lz, like(0.0, lz)) * like(1.0 / math.pi, lz)


@vectorised
def diffuse_rows(r0: float, r1: float, a_v: float, b_v: float, a_l: float, b_l: float) -> tuple[float, float]:
    """Components 0 and 1 of a row times T_out . depolarizer . T_in; the others become 0.

    The row's frame is that of the plane of v and the normal, the result's that
    of l and the normal; a and b from ``fresnel.dielectric_transmission``.  The rest of the value is
    ``diffuse_value`` with both transmittances 1.
    """
    through = r0 * a_v + r1 * b_v
    return through * a_l, through * b_l


@vectorised
def choose_specular(reflected: float, transmitted: float, factor: float, through: float) -> float:
    """Probability of the coat's own reflection: its share of what comes back from v.

    ``reflected`` is F(v), ``transmitted`` 1 - F(v), ``factor`` the mean of
    ``base_factor`` over the channels, ``through`` the mean transmittance of
    the coat for diffuse light from outside, eta^2 (1 - F_in).
    """
    return reflected / max(reflected + transmitted * factor * through, like(1e-18, reflected))
