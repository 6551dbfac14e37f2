"""The renderer's samplers of directions, as `render_chi2.Sampler`: coordinates are z and the azimuth."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from render_chi2 import Sampler
from render_lanes import over_lanes

from reflectance_fit.render.lobes import diffuse, fresnel, ggx, plastic

Floats = NDArray[np.float64]

UPPER = (0.0, 1.0, -np.pi, np.pi)
LOWER = (-1.0, 0.0, -np.pi, np.pi)
ROUGHNESSES = (0.05, 0.2, 0.6, 1.0)
COSINES = (1.0, 0.7, 0.1)


def towards(z: Floats, phi: Floats) -> Floats:
    """Unit vectors (3, N)."""
    radius = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), z])


def view(cosine: float, phi: float = -2.7) -> Floats:
    """Where lobes come from, so that they go to the middle of the azimuths."""
    return towards(np.asarray(cosine), np.asarray(phi))


def coordinates(x: Floats, y: Floats, z: Floats, valid: NDArray[np.bool_]) -> Floats:
    return np.where(valid[:, None], np.stack([z, np.arctan2(y, x)], axis=1), np.nan)


def visible_normals(alpha: float, cosine: float) -> Sampler:
    v = view(cosine)

    def sample(n: int, rng: np.random.Generator) -> Floats:
        x, y, z = over_lanes(ggx.sample_visible, alpha, *v, *rng.random((2, n)))
        return coordinates(x, y, z, z >= 0)

    def density(z: Floats, phi: Floats) -> Floats:
        h = towards(z, phi)
        return over_lanes(ggx.visible_pdf, alpha, v[2], v @ h, over_lanes(ggx.ndf, alpha, *h))

    return Sampler(f"visible normals, alpha {alpha}, cosine {cosine}", sample, density, UPPER)


def reflection(alpha: float, cosine: float) -> Sampler:
    v = view(cosine)

    def sample(n: int, rng: np.random.Generator) -> Floats:
        h = over_lanes(ggx.sample_visible, alpha, *v, *rng.random((2, n)))
        x, y, z, _ = over_lanes(ggx.mirrored, *v, *h)
        return coordinates(x, y, z, z > 0)

    def density(z: Floats, phi: Floats) -> Floats:
        h = over_lanes(ggx.half, *v, *towards(z, phi))
        return over_lanes(ggx.reflection_pdf, alpha, v[2], over_lanes(ggx.ndf, alpha, *h[:3]))

    return Sampler(f"reflection, alpha {alpha}, cosine {cosine}", sample, density, UPPER)


def _reflectance(cosine: Floats, eta: float) -> tuple[Floats, Floats]:
    s, p, cos_t = over_lanes(fresnel.dielectric_power, cosine, eta)
    return 0.5 * (s + p), cos_t


def transmission(alpha: float, cosine: float, eta: float) -> Sampler:
    """The whole rough dielectric, reflecting with probability F; those that reflect count as elsewhere."""
    v = view(cosine)

    def sample(n: int, rng: np.random.Generator) -> Floats:
        h = over_lanes(ggx.sample_visible, alpha, *v, *rng.random((2, n)))
        f, cos_t = _reflectance(np.minimum(v @ h, 1.0), eta)
        x, y, z = over_lanes(ggx.refracted, *v, *h, eta, cos_t)
        return coordinates(x, y, z, (rng.random(n) >= f) & (z < 0))

    def density(z: Floats, phi: Floats) -> Floats:
        hx, hy, hz, near, far, length = over_lanes(ggx.refraction_half, *v, *towards(z, phi), eta)
        d = over_lanes(ggx.ndf, alpha, hx, hy, hz)
        pdf = over_lanes(ggx.transmission_pdf, alpha, v[2], near, far, length, eta, d)
        return pdf * (1.0 - _reflectance(np.minimum(near, 1.0), eta)[0])

    name = f"rough transmission, alpha {alpha}, cosine {cosine}, eta {eta:.3f}"
    return Sampler(name, sample, density, LOWER)


def cosine_lobe() -> Sampler:
    def sample(n: int, rng: np.random.Generator) -> Floats:
        x, y, z = over_lanes(diffuse.sample_cosine, *rng.random((2, n)))
        return coordinates(x, y, z, z >= 0)

    return Sampler("cosine", sample, lambda z, phi: z / np.pi, UPPER)


def plastic_mixture(alpha: float, cosine: float, reflectance: float) -> Sampler:
    """Coat and base of glossy plastic, chosen by what comes back."""
    eta = 1.5
    f, _ = _reflectance(np.array([cosine]), eta)
    through = eta**2 * (1.0 - plastic.internal_reflectance(eta))
    factor = plastic.base_factor(reflectance, eta, alpha)
    chance = float(over_lanes(plastic.choose_specular, f, 1.0 - f, factor, through)[0])
    coat, base = reflection(alpha, cosine), cosine_lobe()

    def sample(n: int, rng: np.random.Generator) -> Floats:
        return np.where(rng.random((n, 1)) < chance, coat.sample(n, rng), base.sample(n, rng))

    def density(z: Floats, phi: Floats) -> Floats:
        return chance * coat.density(z, phi) + (1.0 - chance) * base.density(z, phi)

    return Sampler(f"plastic, alpha {alpha}, cosine {cosine}, base {reflectance}", sample, density, UPPER)


def lobes() -> Iterator[Sampler]:
    """Every sampler of a surface."""
    yield cosine_lobe()
    kinds: tuple[Callable[[float, float], Sampler], ...] = (visible_normals, reflection)
    for kind in kinds:
        for alpha in ROUGHNESSES:
            for cosine in COSINES:
                yield kind(alpha, cosine)
    for eta in (1.5, 1 / 1.5):
        for alpha in ROUGHNESSES:
            for cosine in COSINES:
                yield transmission(alpha, cosine, eta)
    for alpha in ROUGHNESSES:
        for cosine in COSINES:
            yield plastic_mixture(alpha, cosine, 0.5)
