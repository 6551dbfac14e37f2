"""The cubic behind the principal angles, solved to the last digits where its roots meet.

With z = |eps| / tan^2(theta), q = 4 sin^2(arg(eps) / 2) and eps = (eta + ik)^2,
Delta = 90 degrees reads

    f(z) = z^3 + (S - 2) z^2 + z - |eps| = 0,   S = |eps| + q.

All of its positive roots are in (0, 1]: f(0) < 0, f(1) = q, and f grows beyond
1.  So there is one or, for small S, three.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.exact import square

Floats = NDArray[np.float64]

_NEWTON_STEPS = 12
_SMALL_MODULUS = 0.1


def principal_roots(eta: Floats, k: Floats) -> Floats:
    """The z in (0, 1] of every principal angle, shape (*S, 3): descending, then NaN.  Trusts its inputs.

    Notes
    -----
    rho = (1 - g)/(1 + g) with g^2 = t = x (eps (1 + x) - 1), x = cot^2(theta), is imaginary where
    |t| = 1: u^4 = |eps - u|^2 (1 - u)^2 with u = sin^2(theta).  In z = |eps| (1 - u) / u it is f.
    """
    index = np.hypot(eta, k)
    modulus, q = index**2, 4.0 * (k / index) ** 2
    meeting = modulus + q < 1.0
    # Each branch sees the index where it holds, and a harmless one elsewhere.
    several = _meeting_roots(np.where(meeting, eta, 0.5), np.where(meeting, k, 0.0))
    # For S >= 1, f' >= 2/3: Newton converges from 1 at once.
    single = _newton(np.ones_like(index), np.where(meeting, 1.0, modulus), np.where(meeting, 0.0, q))
    return np.where(meeting[..., np.newaxis], several, _alone(single))


def _alone(root: Floats) -> Floats:
    nothing = np.full_like(root, np.nan)
    return np.stack([root, nothing, nothing], axis=-1)


def _newton(z: Floats, modulus: Floats, q: Floats) -> Floats:
    a = (modulus - 2.0) + q
    for _ in range(_NEWTON_STEPS):
        z = z - (((z + a) * z + 1.0) * z - modulus) / ((3.0 * z + 2.0 * a) * z + 1.0)
    return z


def _meeting_roots(eta: Floats, k: Floats) -> Floats:
    """The roots for S < 1, shape (*S, 3), in closed form.

    In y = 1 - z, y^3 - (1 + S) y^2 + 2 S y - q = 0: its coefficients keep the digits of a tiny index.
    Two roots meet where the discriminant vanishes, and the roots vary with its square root; so the
    discriminant is formed as a pair, and the distance of the roots has all its digits.  27/4 of it is
    p^3 - r^2, which keeps them where all three roots meet (p = r = 0) but not for a tiny index (p = r = 1).
    """
    k2 = square(k)
    modulus = square(eta) + k2
    q = 4.0 * k2 / modulus
    s = modulus + q
    b = 1.0 + s
    # 3y = b + t with t^3 - 3 p t - 2 r = 0.
    p = (s - 4.0) * s + 1.0
    r = (b * b - 9.0 * s) * b + 13.5 * q
    discriminant = 4.0 * (s * s * (b * b - 8.0 * s) + b * (9.0 * s - b * b) * q) - 27.0 * q * q
    spread = np.where(s.high < 0.1, 6.75 * discriminant.high, (p * p * p - r * r).high)
    t = _depressed_roots(p.high, r.high, spread)
    z = ((2.0 - s.high)[..., np.newaxis] - t) / 3.0
    # The smallest root is near |eps| for a small index, where 1 - y keeps no digits.  Newton climbs to it
    # from |eps|: f < 0 there, |eps| is below the root (the product of all is |eps| and none exceeds 1),
    # and up to its first root f is concave.
    small = modulus.high < _SMALL_MODULUS
    limit = np.where(small, modulus.high, 0.0)
    last = np.where(np.isnan(z[..., 1]), 0, 2)[..., np.newaxis] == np.arange(3)
    return np.where(last & small[..., np.newaxis], _newton(limit, limit, q.high)[..., np.newaxis], z)


def _depressed_roots(p: Floats, r: Floats, spread: Floats) -> Floats:
    """Real roots of t^3 - 3 p t - 2 r, ascending, then NaN; shape (*S, 3).  spread is p^3 - r^2.

    Viete's cosines for three real roots and Cardano's cube roots for one.
    """
    root = np.sqrt(np.abs(spread))
    alpha = np.arctan2(root, r) / 3.0
    amplitude = 2.0 * np.sqrt(np.maximum(p, 0.0))
    three = [amplitude * np.cos(alpha + shift) for shift in (2.0 * np.pi / 3.0, -2.0 * np.pi / 3.0, 0.0)]
    cube = np.cbrt(r + np.copysign(root, r))
    one = cube + p / np.where(cube == 0.0, 1.0, cube)
    return np.where((spread >= 0.0)[..., np.newaxis], np.stack(three, axis=-1), _alone(one))
