"""The rough interface: GGX microfacets by Smith, sampled by the normals that are visible; lossless but for single scattering.

Local frame: the normal is +z; v goes to where the path came from, l to where
it goes on, both outward unit vectors, v_z > 0.  eta is the index on l's side of the surface
over that on v's.  Everything leaves out Fresnel's factor, which is that of the half
vector h: ``fresnel`` of v . h, or a Mueller block in the plane of v and h.  So
``weight = value / pdf`` of each lobe is at most 1, in radiance behind an
interface 1 / eta^2.  ``value`` includes the cosine of l.

Notes
-----
Walter, Marschner, Li & Torrance, Microfacet Models for Refraction (2007), eqs. 16, 17, 20, 21, 33 to 41; Heitz,
Understanding the Masking-Shadowing Function (2014), eqs. 72, 99; Dupuy & Benyoub, Sampling Visible GGX
Normals with Spherical Caps (2023).  Reflection has the height-correlated masking and shadowing, transmission the
separable one: behind the surface heights are anticorrelated, and the product is nearer to Smith's.
"""

from __future__ import annotations

import math

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.lobes.select import cos_sin_turn, like, sel


@vectorised
def ndf(alpha: float, hx: float, hy: float, hz: float) -> float:
    """D(h), per solid angle: its integral over h times h_z is 1.  From x and y: 1 - h_z^2 has no digits at small alpha."""
    alpha2 = alpha * alpha
    spread = hx * hx + hy * hy + alpha2 * hz * hz
    return alpha2 / (like(math.pi, alpha) * spread * spread)


@vectorised
def stretched(alpha: float, z: float) -> float:
    """Length of (alpha x, alpha y, z) for a unit vector: z (1 + 2 Lambda) with Smith's Lambda."""
    return math.sqrt(alpha * alpha * (like(1.0, z) - z) * (like(1.0, z) + z) + z * z)


@vectorised
def g1(alpha: float, z: float) -> float:
    """The part of the microfacets facing a direction of cosine z that it sees."""
    return like(2.0, z) * z / (z + stretched(alpha, z))


@vectorised
def sample_visible(
    alpha: float, vx: float, vy: float, vz: float, u1: float, u2: float
) -> tuple[float, float, float]:
    """A normal h that v sees, by its visible area: ``visible_pdf``; u1 and u2 in [0, 1)."""
    one, zero, tiny = like(1.0, vz), like(0.0, vz), like(1e-18, vz)
    sx, sy = alpha * vx, alpha * vy
    flat2 = sx * sx + sy * sy
    scale = one / math.sqrt(max(flat2 + vz * vz, tiny))
    sx, sy, sz = sx * scale, sy * scale, vz * scale
    # A point of the cap z > -sz of the unit sphere: 1 - z and 1 + z each without a difference of near numbers.
    down = u2 * (one + sz)
    hz = (one - u2) * (one + sz)
    up = flat2 * scale * scale / (one + sz) + hz
    cosine, sine = cos_sin_turn(u1)
    radius = math.sqrt(max(down * up, zero))
    hx, hy = alpha * (radius * cosine + sx), alpha * (radius * sine + sy)
    scale = one / math.sqrt(max(hx * hx + hy * hy + hz * hz, tiny * tiny))
    return hx * scale, hy * scale, hz * scale


@vectorised
def visible_pdf(alpha: float, vz: float, cosine: float, d: float) -> float:
    """Density of h per solid angle: G1(v) (v . h) D(h) / v_z, from cosine = v . h and d = ``ndf`` of h."""
    return like(2.0, vz) * max(cosine, like(0.0, vz)) * d / (vz + stretched(alpha, vz))


# ---------------------------------------------------------------- reflection


@vectorised
def half(
    vx: float, vy: float, vz: float, lx: float, ly: float, lz: float
) -> tuple[float, float, float, float]:
    """The unit half vector of a reflection, and its cosine to either."""
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    length2 = max(hx * hx + hy * hy + hz * hz, like(1e-18, vz))
    scale = like(1.0, vz) / math.sqrt(length2)
    # |v + l| = 2 v . h
    return hx * scale, hy * scale, hz * scale, like(0.5, vz) * length2 * scale


@vectorised
def mirrored(
    vx: float, vy: float, vz: float, hx: float, hy: float, hz: float
) -> tuple[float, float, float, float]:
    """The direction l of a reflection at h, and the cosine v . h."""
    cosine = vx * hx + vy * hy + vz * hz
    twice = cosine + cosine
    return twice * hx - vx, twice * hy - vy, twice * hz - vz, cosine


@vectorised
def reflection_pdf(alpha: float, vz: float, d: float) -> float:
    """Density of l per solid angle, above and below the horizon: ``visible_pdf`` / (4 v . h)."""
    return d / (like(2.0, vz) * (vz + stretched(alpha, vz)))


@vectorised
def reflection_value(alpha: float, vz: float, lz: float, d: float) -> float:
    """D G2 / (4 v_z), G2 height-correlated; 0 where l is below the horizon.  BRDF times cosine, but for Fresnel."""
    z, two = max(lz, like(0.0, lz)), like(2.0, lz)
    return d * z / max(two * (vz * stretched(alpha, z) + z * stretched(alpha, vz)), like(1e-18, lz))


@vectorised
def reflection_weight(alpha: float, vz: float, lz: float) -> float:
    """G2 / G1(v) = value / pdf; 0 where l is below the horizon."""
    z, v_length = max(lz, like(0.0, lz)), stretched(alpha, vz)
    return z * (vz + v_length) / max(vz * stretched(alpha, z) + z * v_length, like(1e-18, lz))


# -------------------------------------------------------------- transmission


@vectorised
def refraction_half(
    vx: float, vy: float, vz: float, lx: float, ly: float, lz: float, eta: float
) -> tuple[float, float, float, float, float, float]:
    """The unit normal h, h_z >= 0, at which l refracts into v; v . h, -l . h and |v + eta l|.

    The cosines are 0 where no facet does that.  eta is not 1: there every facet passes
    light straight on, and the interface is packed as no interface.
    """
    zero, one = like(0.0, vz), like(1.0, vz)
    hx, hy, hz = vx + eta * lx, vy + eta * ly, vz + eta * lz
    length = math.sqrt(max(hx * hx + hy * hy + hz * hz, like(1e-18, vz)))
    scale = sel(hz < zero, -one, one) / length
    hx, hy, hz = hx * scale, hy * scale, hz * scale
    near = vx * hx + vy * hy + vz * hz
    far = -(lx * hx + ly * hy + lz * hz)
    meets = (near > zero) & (far > zero) & (lz < zero)
    return hx, hy, hz, sel(meets, near, zero), sel(meets, far, zero), length


@vectorised
def refracted(
    vx: float, vy: float, vz: float, hx: float, hy: float, hz: float, eta: float, cos_t: float
) -> tuple[float, float, float]:
    """The direction l behind a facet h, with the cosine of refraction from ``fresnel.dielectric_power`` of v . h."""
    inverse = like(1.0, vz) / eta
    along = (vx * hx + vy * hy + vz * hz) * inverse - cos_t
    return along * hx - vx * inverse, along * hy - vy * inverse, along * hz - vz * inverse


@vectorised
def transmission_pdf(
    alpha: float, vz: float, near: float, far: float, length: float, eta: float, d: float
) -> float:
    """Density of l per solid angle: ``visible_pdf`` times dh/dl; arguments from ``refraction_half``."""
    jacobian = eta * eta * far / (length * length)
    return visible_pdf(alpha, vz, near, d) * jacobian


@vectorised
def transmission_value(
    alpha: float, vz: float, lz: float, near: float, far: float, length: float, d: float
) -> float:
    """Radiance that leaves along v over what comes from l, per solid angle of l: BTDF times cosine, but for 1 - F.

    What flows the other way, from v to l, is eta^2 (squared) times as large: transmission is reciprocal in power
    over index squared.
    """
    length2, two = length * length, like(2.0, vz)
    return two * near * d / (vz + stretched(alpha, vz)) * g1(alpha, abs(lz)) * far / length2
