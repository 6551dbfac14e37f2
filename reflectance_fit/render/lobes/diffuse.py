"""Directions by the cosine, about the normal +z."""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.lobes.select import cos_sin_turn, like


@vectorised
def sample_cosine(u1: float, u2: float) -> tuple[float, float, float]:
    """A direction of the hemisphere with density z / pi per solid angle; u1 and u2 in [0, 1)."""
    cosine, sine = cos_sin_turn(u1)
    radius = math.sqrt(u2)
    return radius * cosine, radius * sine, math.sqrt(like(1.0, u2) - u2)
