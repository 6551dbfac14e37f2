"""Plastic: a dielectric coat, smooth or rough, over a base that scatters alike in all directions and depolarizes.

The coat's reflection and the base are two lobes, each drawn and weighed by itself: their rows have different frames.
"""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.fresnel_of import glass_blocks, glass_reflectance
from reflectance_fit.render.kernels.lanes import (
    ALONE,
    ALPHA,
    EMIT,
    LANES,
    LIT,
    LX,
    LY,
    LZ,
    M0,
    M1,
    MET,
    MOST,
    OF_COLOUR,
    Q_ALONE,
    Q_DENSITY,
    Q_FACTOR,
    Q_LIGHT,
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
    components,
    row,
    row_count,
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
from reflectance_fit.render.kernels.polarization import sampled_state
from reflectance_fit.render.kernels.queue import CHUNK
from reflectance_fit.render.kernels.random import draw
from reflectance_fit.render.kernels.values import power_heuristic, value
from reflectance_fit.render.lobes import ggx
from reflectance_fit.render.lobes.diffuse import sample_cosine
from reflectance_fit.render.lobes.mueller import across, reflect, turn
from reflectance_fit.render.lobes.plastic import choose_specular
from reflectance_fit.render.lobes.select import like, sel


@vectorised
def _through_base(
    has: Has, F: Floats, tables: Tables, shape: int, c: int, j: int, vz: float, lz: float
) -> tuple[float, float, float, float]:
    """Base factor times the block (a_v, b_v) out of the coat, and (a_l, b_l) into it."""
    one = like(1.0, vz)
    factor = value(has, F, tables.curves, tables.shape_ids[shape + OF_COLOUR], c, j)
    av, bv, _, _ = glass_blocks(has, F, tables, shape, c, j, min(vz, one), True, False)
    al, bl, _, _ = glass_blocks(has, F, tables, shape, c, j, min(max(lz, like(0.0, vz)), one), True, False)
    return factor * av, factor * bv, al, bl


@vectorised
def _light(
    has: Has, F: Floats, I: Words, Q: Floats, tables: Tables,
    here: Side, shape: int, alpha: float, specular: float, j: int,
) -> None:  # fmt: skip
    """What the sampled light gives by the base, and by the coat where that is rough."""
    zero, one = like(0.0, alpha), like(1.0, alpha)
    lx, ly, lz = to_local(here, F[LX + j], F[LY + j], F[LZ + j])
    lit = F[LIT + j]
    seen = F[SEEN + j]
    if len(has.refracting) > 0:
        seen = seen * F[SQUEEZE + j]
    # The coat.
    hx, hy, hz, cosine = ggx.half(here.vx, here.vy, here.vz, lx, ly, lz)
    cosine = min(cosine, one)
    rough = alpha > zero
    wide = max(alpha, like(1e-3, one))
    d = ggx.ndf(wide, hx, hy, hz)
    mis = power_heuristic(lit, specular * ggx.reflection_pdf(wide, here.vz, d))
    weight = ggx.reflection_value(wide, here.vz, lz, d) * seen * sel(lit > zero, mis, one)
    weight = sel(rough, weight, zero)
    wx, wy, wz = to_world(here, hx, hy, hz)
    sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
    for c in range(len(has.channels)):
        ra, rb, rc, rd = glass_blocks(has, F, tables, shape, c, j, cosine, True, True)
        gather_light(has, F, I, Q, tables.lamps, c, j, weight, sx, sy, sz, ra, rb, rc, rd, cos, sin)
    # The base: out of the coat along v, depolarized, into it along l; one block where nothing is polarized.
    around = max(lz, zero) * like(1.0 / math.pi, one)
    mis = power_heuristic(lit, (one - specular) * around)
    weight = around * seen * sel(lit > zero, mis, one)
    sx, sy, sz, cos, sin = plane_of(has, F, j, here.zx, here.zy, here.zz)
    for c in range(len(has.channels)):
        av, bv, al, bl = _through_base(has, F, tables, shape, c, j, here.vz, lz)
        into_base(has, F, I, Q, tables, here, c, j, weight, av, bv, al, bl, cos, sin)


@vectorised
def into_base(
    has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, here: Side,
    c: int, j: int, weight: float, av: float, bv: float, al: float, bl: float, cos: float, sin: float,
) -> None:  # fmt: skip
    """Adds what a lane's rows have of the sampled light by way of the base."""
    zero = like(0.0, av)
    for r in range(row_count(has)):
        k = row(has, c, r, 0) + j
        seen = F[k] * av * al
        if len(has.rows) > 0:
            r1, _ = turn(F[k + LANES], F[k + 2 * LANES], cos, sin)
            through = F[k] * av + r1 * bv
            lx, ly, lz = F[LX + j], F[LY + j], F[LZ + j]
            sx, sy, sz = across(lx, ly, lz, here.zx, here.zy, here.zz, here.xx, here.xy, here.xz)
            seen = sampled_state(
                has, F, I, tables.lamps, j, sx, sy, sz, through * al, through * bl, zero, zero
            )
        k = Q_LIGHT + (c * row_count(has) + r) * LANES + j
        Q[k] = Q[k] + sel(weight > zero, weight * F[EMIT + c * LANES + j] * seen, zero)


@vectorised
def coat(has: Has, F: Floats, I: Words, Q: Floats, tables: Tables, n: int) -> None:
    """One of the two lobes, by what comes back from each."""
    zero, one = like(0.0, F[0]), like(1.0, F[0])
    for block in range(0, n, CHUNK):
        for j in range(block, block + CHUNK):
            here = side(F, j)
            met = I[MET + j] & MOST
            shape, body = met * SHAPE_IDS, met * SHAPE
            alpha = tables.shapes[body + ALPHA]
            rough = alpha > zero
            wide = max(alpha, like(1e-3, one))
            power, _, _ = glass_reflectance(
                has, F, tables, shape, 1 if len(has.channels) == 3 else 0, j, min(here.vz, one), True
            )
            specular = choose_specular(power, one - power, tables.shapes[body + M0], tables.shapes[body + M1])
            no_light(has, Q, j)
            if len(has.lamps) > 0:
                _light(has, F, I, Q, tables, here, shape, alpha, specular, j)
            u, v = draw(has, I, j, 1, one)
            _, choice = draw(has, I, j, 2, one)
            mirror = choice < specular
            hx, hy, hz = ggx.sample_visible(wide, here.vx, here.vy, here.vz, u, v)
            hx, hy, hz = sel(rough, hx, zero), sel(rough, hy, zero), sel(rough, hz, one)
            rx, ry, rz, cosine = ggx.mirrored(here.vx, here.vy, here.vz, hx, hy, hz)
            cosine = min(max(cosine, zero), one)
            bx, by, bz = sample_cosine(u, v)
            lx, ly, lz = sel(mirror, rx, bx), sel(mirror, ry, by), sel(mirror, rz, bz)
            d = ggx.ndf(wide, hx, hy, hz)
            lobe = sel(rough, specular * ggx.reflection_pdf(wide, here.vz, d), zero)
            Q[Q_DENSITY + j] = sel(mirror, lobe, (one - specular) * bz * like(1.0 / math.pi, one))
            Q[QX + j], Q[QY + j], Q[QZ + j] = to_world(here, lx, ly, lz)
            Q[Q_SQUEEZE + j] = F[SQUEEZE + j]
            Q[Q_ALONE + j] = F[ALONE + j]
            weight = sel(
                mirror,
                sel(rough, ggx.reflection_weight(wide, here.vz, rz), one) / max(specular, like(1e-18, one)),
                one / max(one - specular, like(1e-18, one)),
            )
            fx, fy, fz = sel(mirror, hx, zero), sel(mirror, hy, zero), sel(mirror, hz, one)
            wx, wy, wz = to_world(here, fx, fy, fz)
            sx, sy, sz, cos, sin = plane_of(has, F, j, wx, wy, wz)
            if len(has.rows) > 0:
                # Rows of the base refer to the plane of l and the normal.
                ox, oy, oz = to_world(here, -ly, lx, zero)
                length = one / math.sqrt(max(lx * lx + ly * ly, like(1e-18, one)))
                upright = lx * lx + ly * ly < like(1e-12, one)
                ox, oy, oz = (
                    sel(upright, here.xx, ox * length),
                    sel(upright, here.xy, oy * length),
                    sel(upright, here.xz, oz * length),
                )
                Q[QA + j], Q[QB + j], Q[QC + j] = (
                    sel(mirror, sx, ox),
                    sel(mirror, sy, oy),
                    sel(mirror, sz, oz),
                )
            for c in range(len(has.channels)):
                ra, rb, rc, rd = glass_blocks(has, F, tables, shape, c, j, cosine, True, True)
                av, bv, al, bl = _through_base(has, F, tables, shape, c, j, here.vz, bz)
                for r in range(row_count(has)):
                    f = row(has, c, r, 0) + j
                    k = Q_FACTOR + (c * row_count(has) + r) * components(has) * LANES + j
                    if len(has.rows) == 0:
                        Q[k] = F[f] * weight * sel(mirror, ra, av * al)
                    else:
                        r1, r2 = turn(F[f + LANES], F[f + 2 * LANES], cos, sin)
                        m0, m1, m2, m3 = reflect(F[f], r1, r2, F[f + 3 * LANES], ra, rb, rc, rd)
                        through = F[f] * av + r1 * bv
                        Q[k] = weight * sel(mirror, m0, through * al)
                        Q[k + LANES] = weight * sel(mirror, m1, through * bl)
                        Q[k + 2 * LANES] = weight * sel(mirror, m2, zero)
                        Q[k + 3 * LANES] = weight * sel(mirror, m3, zero)
