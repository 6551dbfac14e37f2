"""The chance of a saturated row, compiled."""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import inlined


@inlined
def log_normal_cdf(z: float) -> float:
    """log Phi(z); far out by the first terms of its asymptotic series, to 1e-6 where erfc is near underflow."""
    if z > -30.0:
        return math.log(0.5 * math.erfc(-z / math.sqrt(2.0)))
    return -0.5 * z * z - math.log(-z * math.sqrt(2.0 * math.pi)) + math.log1p(-1.0 / (z * z))
