"""Fresnel's equations at one interface, at three rungs of accuracy.

``plain`` is float64 in forms that cancel nowhere but where the data do: a few
ulp, except that the powers lose digits near Brewster's angle, near the
critical angle and at an index near zero.  ``compensated`` computes what
cancels there exactly and keeps all digits but the last four bits, everywhere.
``double_word`` computes in pairs of floats and is right to the last bit or
two; it is the reference of the other two.  The formulas stand in
``differences`` and ``chain``, their compilation in ``rungs``.

Signs of docs/conventions.md: time factor exp(-i omega t), r_p = -r_s at
normal incidence (Verdet).
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics import rungs
from reflectance_fit.physics.domain import (
    checked_angle,
    checked_angle_deg,
    checked_cosine,
    checked_eta_minus_one,
    checked_extinction,
    checked_index,
)
from reflectance_fit.physics.extremes import in_decimals, out_of_range

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Rung = Literal["plain", "compensated", "double_word"]

_NO_SINE = -1.0
_BLOCK = 8192


class Reflectances(NamedTuple):
    """Power over incident power; float64 or float32, shape S.

    ``mean`` and ``transmitted`` hold for unpolarized light.  Transmitted power
    is all that enters: a conductor absorbs it.
    """

    s: Floats
    p: Floats
    mean: Floats
    transmitted_s: Floats
    transmitted_p: Floats
    transmitted: Floats


def amplitudes(
    cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0, *, rung: Rung = "compensated"
) -> tuple[Complexes, Complexes]:
    """Return r_s and r_p, the reflected over the incident field.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, measured from the normal; in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.
    rung : {"plain", "compensated", "double_word"}
        How much arithmetic to spend; the last two give the same here.

    Returns
    -------
    r_s, r_p : complex, shape S
        Equal and opposite at normal incidence, both -1 at grazing incidence,
        zero for eta + ik = 1, where there is no interface.  complex64 where
        every array is float32, else complex128.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, k is negative or
        the rung is unknown.

    Notes
    -----
    Born & Wolf, Principles of Optics, 7th ed., 1.5.2 (21), whose reflected p
    axis is ours; Mitsuba 3 writes eta - ik inside and gives the conjugates.

    Examples
    --------
    >>> r_s, r_p = amplitudes(1.0, 1.5)
    >>> print(f"{r_s.real:.3f} {r_p.real:.3f}")
    -0.200 0.200
    """
    c = checked_cosine(cos_theta_i)
    index, extinction = checked_index(eta, k)
    parts = _evaluate(False, rung, c, _NO_SINE, index, index - 1.0, extinction)
    # Adding 0 turns -0 into 0: the phase of a negative r is +pi.
    r_s, r_p = parts[0] + 1j * (parts[1] + 0.0), parts[2] + 1j * (parts[3] + 0.0)
    kind = np.result_type(_kind(cos_theta_i, eta, k), np.complex64)
    return r_s.astype(kind)[()], r_p.astype(kind)[()]


def reflectances(
    cos_theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0, *, rung: Rung = "compensated"
) -> Reflectances:
    """Return the reflected and the entering power, over the incident power.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, measured from the normal; in [0, 1].
    eta, k : float, broadcastable to S
        Index of the far medium relative to the near one, eta + ik.
    rung : {"plain", "compensated", "double_word"}
        How much arithmetic to spend; see the module.

    Returns
    -------
    Reflectances
        Each within [0, 1], never NaN; R + T = 1 for each polarisation.  Beyond
        the critical angle of a transparent medium R is exactly 1 and T exactly
        0.  No interface (eta + ik = 1) reflects nothing, at grazing incidence
        too.  float32 where every array is float32, else float64.

    Raises
    ------
    ValueError
        If cos_theta_i is outside [0, 1], eta is not positive, k is negative or
        the rung is unknown.

    Examples
    --------
    >>> print(f"{reflectances(1.0, 1.5).mean:.3f}")
    0.040
    """
    c = checked_cosine(cos_theta_i)
    index, extinction = checked_index(eta, k)
    parts = _evaluate(True, rung, c, _NO_SINE, index, index - 1.0, extinction)
    return _reflectances(parts, _kind(cos_theta_i, eta, k))


def reflectances_at_angle(
    theta_i: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0, *, rung: Rung = "compensated"
) -> Reflectances:
    """As ``reflectances`` of an angle of incidence in radians, in [0, pi/2].

    Below 45 degrees sin(theta_i) leads, above it cos(theta_i): neither is
    found from the other where that would lose digits.  What remains is the
    rounding of the leading one, times how the powers depend on it.

    Raises ValueError as ``reflectances``, and outside [0, pi/2].

    Examples
    --------
    >>> print(f"{reflectances_at_angle(0.0, 1.5).mean:.3f}")
    0.040
    """
    theta = checked_angle(theta_i)
    kind = _kind(theta_i, eta, k)
    return _at(np.cos(theta), np.sin(theta), eta, k, rung, kind)


def reflectances_at_deg(
    theta_i_deg: ArrayLike, eta: ArrayLike, k: ArrayLike = 0.0, *, rung: Rung = "compensated"
) -> Reflectances:
    """As ``reflectances_at_angle`` of degrees, in [0, 90]; good near 90 degrees, which radians cannot name exactly.

    Raises ValueError as ``reflectances``, and outside [0, 90].

    Examples
    --------
    >>> print(f"{reflectances_at_deg(90.0, 1.5).mean:.3f}")
    1.000
    """
    c, sine = cos_sin_deg(checked_angle_deg(theta_i_deg))
    kind = _kind(theta_i_deg, eta, k)
    return _at(c, sine, eta, k, rung, kind)


def reflectances_near_match(
    cos_theta_i: ArrayLike, eta_minus_one: ArrayLike, k: ArrayLike = 0.0, *, rung: Rung = "compensated"
) -> Reflectances:
    """As ``reflectances`` of eta = 1 + eta_minus_one without rounding that sum.

    Parameters
    ----------
    cos_theta_i : float, shape S
        Cosine of the angle of incidence, in [0, 1].
    eta_minus_one : float, broadcastable to S
        Distance of the relative index from 1, in [-0.5, 1].
    k : float, broadcastable to S
        Its imaginary part, not negative.
    rung : {"plain", "compensated", "double_word"}
        How much arithmetic to spend; see the module.

    Raises
    ------
    ValueError
        If one is outside its range or the rung is unknown.

    Examples
    --------
    >>> print(f"{reflectances_near_match(1.0, 1e-20).mean:.2e}")
    2.50e-41
    """
    c = checked_cosine(cos_theta_i)
    distance, extinction = checked_eta_minus_one(eta_minus_one), checked_extinction(k)
    parts = _evaluate(True, rung, c, _NO_SINE, 1.0 + distance, distance, extinction)
    return _reflectances(parts, _kind(cos_theta_i, eta_minus_one, k))


def r0(eta: ArrayLike, k: ArrayLike = 0.0) -> Floats:
    """Power reflectance at normal incidence, ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2), shape S.

    Raises ValueError if eta is not positive or k is negative.

    Examples
    --------
    >>> print(f"{r0(1.5):.3f}")
    0.040
    """
    eta, k = checked_index(eta, k)
    result: Floats = ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
    return result[()]


def radiance_transmission_factor(eta: ArrayLike) -> Floats:
    """What turns transmitted power into transmitted radiance: (eta_t / eta_i)^2 = eta^2, shape S.

    Refraction squeezes the solid angle, dOmega_t cos_t eta_t^2 = dOmega_i cos_i
    eta_i^2, so L_t = T eta^2 L_i: transmission is reciprocal in power, not in
    radiance.

    Light entering glass of 1.5 at normal incidence: T = 0.96, and radiance
    grows by 0.96 * 2.25 = 2.16.  Leaving it (eta = 1 / 1.5): T = 0.96 again,
    and radiance shrinks by 0.96 / 2.25 = 0.427.  In and out leave 0.96^2.

    Notes
    -----
    Veach, Robust Monte Carlo Methods for Light Transport (1997), 5.2.
    """
    eta, _ = checked_index(eta)
    result: Floats = eta**2
    return result[()]


def _at(
    c: Floats, sine: Floats, eta: ArrayLike, k: ArrayLike, rung: Rung, kind: np.dtype[Any]
) -> Reflectances:
    """From cosine and sine of one angle: the smaller leads."""
    index, extinction = checked_index(eta, k)
    leading_sine = np.where(sine <= c, sine, _NO_SINE)
    return _reflectances(_evaluate(True, rung, c, leading_sine, index, index - 1.0, extinction), kind)


def _evaluate(powers: bool, rung: Rung, *arguments: Floats | float) -> Floats:
    """Four rows of broadcast shape: a kernel's, decimals' where it has no room, nothing where no interface is."""
    if rung not in get_args(Rung):
        raise ValueError(f"no rung {rung!r}; choose 'plain', 'compensated' or 'double_word'")
    whole = np.broadcast_arrays(*arguments)
    # What broadcasting repeats is spelled out block by block, so that the temporaries stay in cache.
    flat = [argument.reshape(-1) if argument.flags.c_contiguous else argument.flat for argument in whole]
    out = np.empty((4, whole[0].size))
    for start in range(0, whole[0].size, _BLOCK):
        block = slice(start, start + _BLOCK)
        out[:, block] = _evaluate_block(powers, rung, *(np.array(argument[block]) for argument in flat))
    return out.reshape(4, *whole[0].shape)


def _evaluate_block(
    powers: bool, rung: Rung, c: Floats, sine: Floats, eta: Floats, eta_minus_one: Floats, k: Floats
) -> Floats:
    out = rungs.evaluate(powers, rung, c, sine, eta, eta_minus_one, k)
    beyond = np.flatnonzero(out_of_range(c, eta, eta_minus_one, k))
    if beyond.size:
        core = rungs.plain_powers if powers else rungs.plain_amplitudes
        out[:, beyond] = in_decimals(core, *(x[beyond] for x in (c, sine, eta, eta_minus_one, k)))
        nothing = (eta_minus_one == 0.0) & (k == 0.0)
        out[:, nothing] = np.array([[0.0], [0.0], [1.0], [1.0]]) if powers else 0.0
    return out


def _reflectances(parts: Floats, kind: np.dtype[Any]) -> Reflectances:
    s, p, transmitted_s, transmitted_p = parts
    rows = (s, p, 0.5 * (s + p), transmitted_s, transmitted_p, 0.5 * (transmitted_s + transmitted_p))
    return Reflectances(*(row.astype(kind, copy=False)[()] for row in rows))


def _kind(*inputs: ArrayLike) -> np.dtype[Any]:
    """float32 where numpy's promotion says so, Python's numbers being weak; else float64."""
    kinds = (x if isinstance(x, int | float) else np.asarray(x).dtype for x in inputs)
    return np.dtype(np.float32 if np.result_type(*kinds) == np.float32 else np.float64)
