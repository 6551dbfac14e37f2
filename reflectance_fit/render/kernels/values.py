"""Values of curves for a lane's channel, and a frame around a direction."""

from __future__ import annotations

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    LANES,
    WAVE,
    Has,
    Tables,
)
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32

FIRST_NM, STEP_NM, POINTS = 360.0, 5.0, 95


@stage
def value(has: Has, F: np.ndarray, curves: np.ndarray, curve: int, channel: int, j: int) -> float:
    """A curve at one of a lane's channels."""
    if len(has.spectral) > 0:
        number = F[0]
        x = (F[WAVE + channel * LANES + j] - like(FIRST_NM, number)) * like(1.0 / STEP_NM, number)
        cell = np.int32(min(max(x, like(0.0, number)), like(POINTS - 2.0, number)))
        share = x - like(cell, number)
        at = u32(u32(curve * u32(POINTS)) + u32(cell))
        low, high = curves[at], curves[u32(at + u32(1))]
        return low + share * (high - low)
    return curves[u32(u32(curve * u32(len(has.channels))) + u32(channel))]


@stage
def primaries(
    has: Has, F: np.ndarray, tables: Tables, pixels: np.ndarray, pixel: int, first: int, channel: int, j: int
) -> float:
    """A picture's pixel at one of a lane's channels; spectra are sums of three, whose curves begin at ``counts[first]``."""
    if len(has.spectral) == 0:
        return pixels[u32(u32(pixel * u32(len(has.channels))) + u32(channel))]
    at = u32(pixel * u32(3))
    return (
        pixels[at] * value(has, F, tables.curves, u32(tables.counts[first]), channel, j)
        + pixels[u32(at + u32(1))] * value(has, F, tables.curves, u32(tables.counts[first + 1]), channel, j)
        + pixels[u32(at + u32(2))] * value(has, F, tables.curves, u32(tables.counts[first + 2]), channel, j)
    )


@stage
def frame(x: float, y: float, z: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors at right angles to a unit vector and to one another.

    Notes
    -----
    Duff et al., "Building an Orthonormal Basis, Revisited", J. Comput. Graph. Tech. 6 (2017) no. 1.
    """
    one = like(1.0, x)
    sign = sel(z >= like(0.0, x), one, -one)
    a = -one / (sign + z)
    b = x * y * a
    return one + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y


@stage
def power_heuristic(taken: float, other: float) -> float:
    """Weight of a direction drawn with density ``taken`` that ``other`` might have drawn; 1 where other is 0.

    Notes
    -----
    Veach, Robust Monte Carlo Methods for Light Transport Simulation (1997), eq. 9.13, beta = 2.
    """
    ratio = other / taken
    return like(1.0, taken) / (like(1.0, taken) + ratio * ratio)
