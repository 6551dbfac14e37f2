"""The renderer's surfaces: reciprocity, samplers, energy and polarization, as figures of the card ``render``."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from card import Figure, Table
from numpy.typing import NDArray
from render_chi2 import ALPHA, examine, integrate, significance
from render_lanes import over_lanes
from render_light_samplers import samplers as light_samplers
from render_matrices import KINDS, least_eigenvalue, random_matrices
from render_samplers import ROUGHNESSES, lobes, towards, view

from reflectance_fit.render.lobes import fresnel, ggx, plastic

Floats = NDArray[np.float64]

SEED = 0
PAIRS = 100_000
SAMPLES = 1_000_000
FURNACE = 200_000
ANGLES = (1.0, 0.8, 0.5, 0.2, 0.05)
ETA = 1.5


def reciprocity() -> Iterator[Figure]:
    """Every reflection lobe with its arguments swapped, and transmission with the squared index ratio between."""
    rng = np.random.default_rng([SEED, 1])
    z = rng.random((2, PAIRS))
    v, l = (towards(one, rng.uniform(-np.pi, np.pi, PAIRS)) for one in z)
    alpha = rng.uniform(0.02, 1.0, PAIRS)
    eta, k = rng.uniform(1.05, 3.0, PAIRS), rng.uniform(0.0, 5.0, PAIRS)
    there = rough_reflection(alpha, v, l, eta, k) / l[2]
    back = rough_reflection(alpha, l, v, eta, k) / v[2]
    yield _worst("reciprocity of the rough conductor", there, back)
    there, back = (rough_reflection(alpha, *pair, eta, 0.0) / pair[1][2] for pair in ((v, l), (l, v)))
    yield _worst("reciprocity of the rough dielectric's reflection", there, back)
    there, back = (base(eta, *pair) / pair[1][2] for pair in ((v, l), (l, v)))
    yield _worst("reciprocity of plastic's base", there, back)
    below = l * np.array([[1.0], [1.0], [-1.0]])
    swapped = v * np.array([[1.0], [1.0], [-1.0]])
    there = rough_transmission(alpha, v, below, eta) / l[2]
    back = rough_transmission(alpha, l, swapped, 1.0 / eta) / v[2]
    # A facet met at grazing incidence is known from v and l to 1e-16 over its cosine only.
    *_, near, far, _ = over_lanes(ggx.refraction_half, *v, *below, eta)
    met = np.minimum(near, far) > 1e-3
    name = "radiance transmission, in over out, against the squared index ratio"
    yield _worst(name, there[met] * eta[met] ** 2, back[met])


def _worst(name: str, there: Floats, back: Floats) -> Figure:
    worst = float(np.max(np.abs(there - back) / np.maximum(back, 1e-300)))
    return Figure.judged(f"{name}, N = {there.size}", f"{worst:.1e}", "1e-12", worst <= 1e-12)


def rough_reflection(
    alpha: Floats | float, v: Floats, l: Floats, eta: Floats | float, k: Floats | float
) -> Floats:
    """BRDF times cosine for unpolarized light."""
    *h, cosine = over_lanes(ggx.half, *v, *l)
    s, p = over_lanes(fresnel.conductor_power, np.minimum(cosine, 1.0), eta, k)
    d = over_lanes(ggx.ndf, alpha, *h)
    return 0.5 * (s + p) * over_lanes(ggx.reflection_value, alpha, v[2], l[2], d)


def rough_transmission(alpha: Floats | float, v: Floats, l: Floats, eta: Floats | float) -> Floats:
    """BTDF times cosine for unpolarized light, radiance from l to v."""
    hx, hy, hz, near, far, length = over_lanes(ggx.refraction_half, *v, *l, eta)
    a, _, _ = over_lanes(fresnel.transmission_between, np.minimum(near, 1.0), far, eta)
    d = over_lanes(ggx.ndf, alpha, hx, hy, hz)
    return a * over_lanes(ggx.transmission_value, alpha, v[2], l[2], near, far, length, d)


def base(eta: Floats, v: Floats, l: Floats) -> Floats:
    """Plastic's base: BRDF times cosine for unpolarized light."""
    t_v, _, _ = over_lanes(fresnel.dielectric_transmission, v[2], eta)
    t_l, _, _ = over_lanes(fresnel.dielectric_transmission, l[2], eta)
    return over_lanes(plastic.diffuse_value, t_v, t_l, l[2], 0.5)


def samplers() -> Iterator[Figure | Table]:
    """Chi-square of every sampler of the renderer, and what its density integrates to."""
    every = [*lobes(), *light_samplers()]
    limit = significance(len(every))
    outcomes = [examine(one, SAMPLES, seed) for seed, one in enumerate(every)]
    least = min(outcomes, key=lambda one: one.p_value)
    failed = sum(not one.p_value >= limit for one in outcomes)
    yield Figure.judged(
        f"chi-square: samplers that fail, of {len(every)}; {SAMPLES:,} samples each, alpha {ALPHA}, Sidak",
        f"{failed}; least p {least.p_value:.1e} ({least.name})",
        f"0, p >= {limit:.1e}",
        failed == 0,
    )
    most = max(outcomes, key=lambda one: one.mass)
    yield Figure.judged(
        "largest integral of a density", f"{most.mass:.6f} ({most.name})", "1 + 1e-4", most.mass <= 1.0 + 1e-4
    )
    rows = ((o.name, f"{o.mass:.6f}", f"{o.p_value:.3f}", str(o.cells)) for o in outcomes)
    yield Table("Samplers", ("sampler", "integral of density", "p", "cells"), tuple(rows))


def weak_furnace() -> Iterator[Figure]:
    """Heitz (2014), eq. 86: D G1 / (4 v_z) over all directions of l, those below the horizon included, is 1."""
    worst = max(abs(_weak(alpha, cosine) - 1.0) for alpha in ROUGHNESSES for cosine in ANGLES)
    yield Figure.judged("weak white furnace, largest deviation from 1", f"{worst:.1e}", "1e-3", worst <= 1e-3)


def _weak(alpha: float, cosine: float) -> float:
    v = view(cosine)
    beside = np.array([-v[1], v[0], 0.0]) / np.hypot(v[0], v[1]) if cosine < 1.0 else np.eye(3)[0]
    frame = np.stack([np.cross(beside, v), beside, v], axis=1)

    def density(z: Floats, phi: Floats) -> Floats:
        # About v as the pole h turns half as far as l, without a place where it jumps but -v.
        h = over_lanes(ggx.half, *v, *(frame @ towards(z, phi)))
        pdf = over_lanes(ggx.reflection_pdf, alpha, v[2], over_lanes(ggx.ndf, alpha, *h[:3]))
        return np.where(h[2] > 0.0, pdf, 0.0)

    edges = np.linspace(-1.0, 1.0, 9), np.linspace(-np.pi, np.pi, 9)
    return float(integrate(density, *edges).sum())


def albedos(
    kind: str, alpha: float, cosine: float, n: int = SAMPLES, seed: int = SEED
) -> tuple[float, float]:
    """Mean and standard error of what comes back of a white furnace: sampled as the renderer samples, in power."""
    rng = np.random.default_rng([SEED, 2, seed])
    v = view(cosine)
    h = over_lanes(ggx.sample_visible, alpha, *v, *rng.random((2, n)))
    mirrored = over_lanes(ggx.mirrored, *v, *h)
    weight = over_lanes(ggx.reflection_weight, alpha, v[2], mirrored[2])
    if kind == "perfect conductor":
        return _mean(weight)
    eta = 1.0 / ETA if kind == "dielectric from inside" else ETA
    s, p, cos_t = over_lanes(fresnel.dielectric_power, np.minimum(mirrored[3], 1.0), eta)
    f = 0.5 * (s + p)
    if kind == "white plastic":
        t, _, _ = over_lanes(fresnel.dielectric_transmission, [cosine], eta)[:, 0]
        through = eta**2 * (1.0 - plastic.internal_reflectance(eta))
        mean, error = _mean(f * weight)
        return mean + float(t * through * plastic.base_factor(1.0, eta, alpha)), error
    behind = over_lanes(ggx.refracted, *v, *h, eta, cos_t)[2]
    passed = over_lanes(ggx.g1, alpha, np.maximum(-behind, 0.0))
    return _mean(f * weight + (1.0 - f) * passed)


def _mean(values: Floats) -> tuple[float, float]:
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(values.size))


def full_furnace() -> Iterator[Figure | Table]:
    """Lossless rough surfaces never give back more than they get; what single scattering loses is tabled."""
    kinds = ("perfect conductor", "dielectric", "dielectric from inside", "white plastic")
    worst, where, rows = -np.inf, "", []
    for kind in kinds:
        for alpha in ROUGHNESSES:
            row = []
            for number, cosine in enumerate(ANGLES):
                mean, error = albedos(kind, alpha, cosine, seed=number)
                excess = (mean - 1.0) / max(error, 1e-9)
                if excess > worst:
                    worst, where = excess, f"{kind}, alpha {alpha}, cosine {cosine}"
                row.append(f"{1.0 - mean:.4f}")
            rows.append((kind, str(alpha), *row))
    yield Figure.judged(
        f"white furnace of rough surfaces, largest excess over 1, {FURNACE:,} samples each",
        f"{worst:.1f} sigma ({where})",
        "4 sigma",
        worst <= 4.0,
    )
    header = ("surface", "alpha", *(f"missing at cosine {c}" for c in ANGLES))
    yield Table("Energy that single scattering loses", header, tuple(rows))


def smooth_furnace() -> Iterator[Figure]:
    """Smooth lossless materials give back everything."""
    c = np.linspace(0.001, 1.0, 1000)
    worst = 0.0
    for eta in (1.05, 1.33, 1.5, 2.4, 1 / 1.5):
        s, p, _ = over_lanes(fresnel.dielectric_power, c, eta)
        a, _, _ = over_lanes(fresnel.dielectric_transmission, c, eta)
        worst = max(worst, float(np.abs(0.5 * (s + p) + a - 1.0).max()))
        through = eta**2 * (1.0 - plastic.internal_reflectance(eta)) * plastic.base_factor(1.0, eta)
        worst = max(worst, float(np.abs(0.5 * (s + p) + a * through - 1.0).max()))
    yield Figure.judged(
        "white furnace of smooth dielectric and plastic, deviation from 1",
        f"{worst:.1e}",
        "1e-3",
        worst <= 1e-3,
    )


def admissibility() -> Iterator[Figure]:
    """Mueller matrices of every lobe in random frames: no eigenvalue of the coherency matrix below 0."""
    for kind in KINDS:
        matrices = random_matrices(kind, 20_000, np.random.default_rng([SEED, 3]))
        least = float(least_eigenvalue(matrices).min())
        yield Figure.judged(
            f"{kind}: least eigenvalue of the coherency matrix over its trace, N = 20,000",
            f"{least:.1e}",
            ">= -1e-12",
            least >= -1e-12,
        )


def figures() -> Iterator[Figure | Table]:
    yield from reciprocity()
    yield from samplers()
    yield from weak_furnace()
    yield from smooth_furnace()
    yield from full_furnace()
    yield from admissibility()
