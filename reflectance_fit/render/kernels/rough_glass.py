"""Rough dielectrics: facets that reflect or refract; the rows of both, so that a rough interface polarizes too."""

from __future__ import annotations

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.fresnel_of import glass_blocks, glass_reflectance, index_of
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    ALPHA,
    LIT,
    LX,
    LY,
    LZ,
    MET,
    MOST,
    Q_ALONE,
    Q_DENSITY,
    Q_SQUEEZE,
    QA,
    QB,
    QC,
    QX,
    QY,
    QZ,
    SEEN,
    SHAPE,
    SHAPE_IDS,
    SQUEEZE,
    Floats,
    Has,
    Tables,
    Words,
)
from reflectance_fit.render.kernels.local import (
    Side,
    gather_light,
    no_light,
    plane_of,
    side,
    to_local,
    to_world,
)
from reflectance_fit.render.kernels.queue import CHUNK, weigh
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.kernels.values import power_heuristic
from reflectance_fit.render.lobes import ggx
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def reflected_share(
    has: Has, F: Floats, tables: Tables, shape: int, j: int, c: float, front: bool
) -> tuple[float, float, float, bool]:
    """Probability of reflection, cosine of refraction, relative index, and whether all channels share that."""
    zero, one = like(0.0, c), like(1.0, c)
    count = len(has.channels)
    # The channel that is refracted: the middle one, or the first wavelength.
    power, cos_t, relative = glass_reflectance(has, F, tables, shape, 1 if count == 3 else 0, j, c, front)
    if len(has.dispersive) == 0:
        return power, cos_t, relative, True
    total, same = zero, True
    for k in range(count):
        other, _, index = glass_reflectance(has, F, tables, shape, k, j, c, front)
        total += other
        same = same & (index == relative)
    chance = total / like(count, one)
    if len(has.spectral) > 0:
        chance = sel(F[ALONE + j] > zero, power, chance)
    return sel(cos_t > zero, chance, one), cos_t, relative, same


@vectorised
def apart_share(has: Has, F: Floats, j: int, back: bool, same: bool, one: float) -> float:
    """1 where wavelengths part: they are refracted, differently, and have not parted before."""
    zero = like(0.0, one)
    if len(has.spectral) == 0:
        return zero
    return sel(back | same | (F[ALONE + j] > zero), zero, one)


@vectorised
def channel_share(has: Has, apart: float, k: int) -> float:
    """Where wavelengths part the first goes on for all."""
    zero, one = like(0.0, apart), like(1.0, apart)
    if len(has.spectral) == 0:
        return one
    return sel(apart > zero, like(len(has.channels), one) if k == 0 else zero, one)


@vectorised
def _light(
    has: Has, F: Floats, I: Words, Q: Floats, tables: Tables,
    here: Side, shape: int, alpha: float, j: int,
) -> None:  # fmt: skip
    """What the sampled light gives through the one facet that turns it into the path."""
    zero, one = like(0.0, alpha), like(1.0, alpha)
    relative = index_of(has, F, tables, shape, 1 if len(has.channels) == 3 else 0, j, here.front)
    lx, ly, lz = to_local(here, F[LX + j], F[LY + j], F[LZ + j])
    back = lz > zero
    rx, ry, rz, mirror_cosine = ggx.half(here.vx, here.vy, here.vz, lx, ly, lz)
    tx, ty, tz, near, far, length = ggx.refraction_half(here.vx, here.vy, here.vz, lx, ly, lz, relative)
    hx, hy, hz = sel(back, rx, tx), sel(back, ry, ty), sel(back, rz, tz)
    cosine = min(sel(back, mirror_cosine, near), one)
    d = ggx.ndf(alpha, hx, hy, hz)
    chance, _, _, same = reflected_share(has, F, tables, shape, j, cosine, here.front)
    value = sel(
        back,
        ggx.reflection_value(alpha, here.vz, lz, d),
        ggx.transmission_value(alpha, here.vz, lz, near, far, length, d),
    )
    density = sel(
        back,
        chance * ggx.reflection_pdf(alpha, here.vz, d),
        (one - chance) * ggx.transmission_pdf(alpha, here.vz, near, far, length, relative, d),
    )
    lit = F[LIT + j]
    weight = value * F[SEEN + j] * F[SQUEEZE + j]
    weight = weight * sel(lit > zero, power_heuristic(lit, density), one)
    wx, wy, wz = to_world(here, hx, hy, hz)
    sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
    apart = apart_share(has, F, j, back, same, one)
    for c in range(len(has.channels)):
        ra, rb, rc, rd = glass_blocks(has, F, tables, shape, c, j, cosine, here.front, back)
        gather_light(
            has, F, I, Q, tables.lamps, c, j, weight * channel_share(has, apart, c),
            sx, sy, sz, ra, rb, rc, rd, cos, sin,
        )  # fmt: skip


@vectorised
def rough_glass(has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, n: int) -> None:
    """A visible facet reflects with the channels' mean reflectance, else refracts."""
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    for block in range(0, n, CHUNK):
        for j in range(block, block + CHUNK):
            here = side(F, j)
            met = I[MET + j] & MOST
            shape = met * SHAPE_IDS
            alpha = tables.shapes[met * SHAPE + ALPHA]
            no_light(has, Q, j)
            if len(has.lamps) > 0:
                _light(has, F, I, Q, tables, here, shape, alpha, j)
            u, v = draw(has, I, j, 1, one)
            _, choice = draw(has, I, j, 2, one)
            hx, hy, hz = ggx.sample_visible(alpha, here.vx, here.vy, here.vz, u, v)
            rx, ry, rz, cosine = ggx.mirrored(here.vx, here.vy, here.vz, hx, hy, hz)
            cosine = min(max(cosine, zero), one)
            chance, cos_t, relative, same = reflected_share(has, F, tables, shape, j, cosine, here.front)
            back = choice < chance
            tx, ty, tz = ggx.refracted(here.vx, here.vy, here.vz, hx, hy, hz, relative, cos_t)
            d = ggx.ndf(alpha, hx, hy, hz)
            over2 = one / (relative * relative)
            # The density of a refraction, with the facet known: |v + eta l| = eta cos_t - cos of the facet.
            length = relative * cos_t - cosine
            length = sel(abs(length) > like(1e-9, one), length, like(1e-9, one))
            density = sel(
                back,
                chance * ggx.reflection_pdf(alpha, here.vz, d),
                (one - chance) * ggx.transmission_pdf(alpha, here.vz, cosine, cos_t, length, relative, d),
            )
            # Radiance is squeezed in SQUEEZE, not in the rows.
            weight = sel(
                back,
                ggx.reflection_weight(alpha, here.vz, rz) / chance,
                sel(tz < zero, ggx.g1(alpha, max(-tz, zero)), zero) / (one - chance),
            )
            lx, ly, lz = sel(back, rx, tx), sel(back, ry, ty), sel(back, rz, tz)
            Q[Q_DENSITY + j] = density
            Q[QX + j], Q[QY + j], Q[QZ + j] = to_world(here, lx, ly, lz)
            Q[Q_SQUEEZE + j] = F[SQUEEZE + j] * sel(back, one, over2)
            wx, wy, wz = to_world(here, hx, hy, hz)
            sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
            Q[QA + j], Q[QB + j], Q[QC + j] = sx, sy, sz
            apart = apart_share(has, F, j, back, same, one)
            Q[Q_ALONE + j] = F[ALONE + j] + apart
            for c in range(len(has.channels)):
                ra, rb, rc, rd = glass_blocks(has, F, tables, shape, c, j, cosine, here.front, back)
                share = weight * channel_share(has, apart, c)
                weigh(has, F, Q, c, j, share * ra, share * rb, share * rc, share * rd, cos, sin)
