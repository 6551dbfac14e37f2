"""A surface's Fresnel factor for a lane: power, or the block of its Mueller matrix, exact or by the approximation in use."""

from __future__ import annotations

import numpy as np

from reflectance_fit.physics.jit import stage
from reflectance_fit.render.kernels.lanes import (
    OF_A,
    OF_B,
    OF_ETA,
    OF_K,
    OF_POWER,
    OF_R0,
    Has,
    Tables,
)
from reflectance_fit.render.kernels.values import value
from reflectance_fit.render.lobes.fresnel import (
    approximate,
    conductor_mueller,
    conductor_power,
    dielectric_mueller,
    dielectric_power,
    dielectric_transmission,
    large_index,
)
from reflectance_fit.render.lobes.select import like, sel

u32 = np.uint32


@stage
def index_of(has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, front: bool) -> float:
    """Of the far side over the near one."""
    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], channel, j)
    return sel(front, eta, like(1.0, eta) / eta)


@stage
def approximated(
    has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float
) -> float:
    """r0 + b (1 - c)^5 - a c (1 - c)^power with the surface's coefficients; the power is 6 but for one form."""
    r0 = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_R0))], channel, j)
    b = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_B))], channel, j)
    a = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_A))], channel, j)
    if len(has.approximate) == 1:
        return approximate(c, r0, b, a)
    power = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_POWER))], channel, j)
    zero = like(0.0, c)
    return approximate(c, r0, b, zero) - a * c * max(like(1.0, c) - c, zero) ** power


@stage
def glass_reflectance(
    has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float, front: bool
) -> tuple[float, float, float]:
    """Reflectance, cosine of refraction and relative index at a dielectric, by the Fresnel form in use."""
    one = like(1.0, c)
    relative = index_of(has, F, tables, shape, channel, j, front)
    r_s, r_p, cos_t = dielectric_power(c, relative)
    power = like(0.5, c) * (r_s + r_p)
    if len(has.approximate) > 0:
        # On the side of the lower index; total reflection is what it is.
        thin = sel(relative >= one, c, cos_t)
        if len(has.approximate) != 2:
            form = approximated(has, F, tables, shape, channel, j, thin)
        else:
            form = large_index(thin, sel(relative >= one, relative, one / relative), like(0.0, c))
        power = sel(cos_t > like(0.0, c), form, one)
    return power, cos_t, relative


@stage
def metal_reflectance(
    has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float
) -> float:
    """Reflectance of a metal for unpolarized light, by the Fresnel form in use."""
    if len(has.approximate) == 1 or len(has.approximate) == 3:
        return approximated(has, F, tables, shape, channel, j, c)
    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], channel, j)
    k = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_K))], channel, j)
    if len(has.approximate) == 2:
        return large_index(c, eta, k)
    r_s, r_p = conductor_power(c, eta, k)
    return like(0.5, c) * (r_s + r_p)


@stage
def glass_blocks(
    has: Has,
    F: np.ndarray,
    tables: Tables,
    shape: int,
    channel: int,
    j: int,
    c: float,
    front: bool,
    back: bool,
) -> tuple[float, float, float, float]:
    """Block of reflection where ``back``, else of transmission; without polarization its first number alone."""
    one, zero = like(1.0, c), like(0.0, c)
    if len(has.rows) == 0:
        power, _, _ = glass_reflectance(has, F, tables, shape, channel, j, c, front)
        return sel(back, power, one - power), zero, zero, zero
    index = index_of(has, F, tables, shape, channel, j, front)
    ra, rb, rc, rd = dielectric_mueller(c, index)
    ta, tb, tc = dielectric_transmission(c, index)
    return sel(back, ra, ta), sel(back, rb, tb), sel(back, rc, tc), sel(back, rd, zero)


@stage
def metal_block(
    has: Has, F: np.ndarray, tables: Tables, shape: int, channel: int, j: int, c: float
) -> tuple[float, float, float, float]:
    """Block of reflection; without polarization its first number alone."""
    zero = like(0.0, c)
    if len(has.rows) == 0:
        return metal_reflectance(has, F, tables, shape, channel, j, c), zero, zero, zero
    eta = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_ETA))], channel, j)
    k = value(has, F, tables.curves, tables.shape_ids[u32(shape + u32(OF_K))], channel, j)
    return conductor_mueller(c, eta, k)
