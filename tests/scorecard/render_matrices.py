"""Mueller matrices of the renderer's lobes, put together from its rows as a path does it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from render_lanes import over_lanes

from reflectance_fit.render.lobes import fresnel, ggx, mueller

Floats = NDArray[np.float64]

KINDS = (
    "rough conductor",
    "rough dielectric, reflection",
    "rough dielectric, transmission",
    "plastic's base",
)
PAULI = np.array([np.eye(2), [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, 1j], [-1j, 0]]])


def unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=0)


def perpendicular(rng: np.random.Generator, z: Floats) -> Floats:
    return unit(np.cross(z, rng.normal(size=z.shape), axis=0))


def matrix(
    kind: str, v: Floats, h: Floats, l: Floats, axis: Floats, eta: Floats, k: Floats
) -> tuple[Floats, Floats]:
    """Mueller matrices (N, 4, 4) without the unpolarized factor, and the axis (3, N) of the light that comes.

    ``axis`` (3, N) is that of the light that leaves along v.  Each of the four
    rows of the identity goes through as a path's row would.
    """
    n = v.shape[1]
    rows = np.empty((n, 4, 4))
    normal = np.tile([[0.0], [0.0], [1.0]], n) if kind == "plastic's base" else h
    cosine = np.clip(np.sum(v * normal, axis=0), 0.0, 1.0)
    if kind == "rough conductor":
        block = over_lanes(fresnel.conductor_mueller, cosine, eta, k)
    elif kind == "rough dielectric, reflection":
        block = over_lanes(fresnel.dielectric_mueller, cosine, eta)
    else:
        a, b, c = over_lanes(fresnel.dielectric_transmission, cosine, eta)
        block = np.stack([a, b, c, np.zeros(n)])
    for i, row in enumerate(np.eye(4)):
        s = over_lanes(mueller.across, *v, *normal, *axis)
        r1, r2 = over_lanes(mueller.turn, row[1], row[2], *over_lanes(mueller.double_angle, *axis, *s, *v))
        if kind == "plastic's base":
            a_l, b_l, _ = over_lanes(fresnel.dielectric_transmission, l[2], eta)
            through = row[0] * block[0] + r1 * block[1]
            rows[:, i] = np.stack([through * a_l, through * b_l, np.zeros(n), np.zeros(n)], axis=1)
            s = over_lanes(mueller.across, *l, *normal, *s)
        else:
            rows[:, i] = over_lanes(mueller.reflect, row[0], r1, r2, row[3], *block).T
    return rows, np.array(s)


def random_matrices(kind: str, n: int, rng: np.random.Generator) -> Floats:
    """Of random roughness, indices, directions and frames; those that meet a facet only."""
    v = unit(np.abs(rng.normal(size=(3, n))))
    alpha, eta, k = rng.uniform(0.02, 1.0, n), np.exp(rng.uniform(-1.0, 1.0, n)), rng.uniform(0.0, 5.0, n)
    h = over_lanes(ggx.sample_visible, alpha, *v, *rng.random((2, n)))
    l = unit(np.abs(rng.normal(size=(3, n))))
    rows, _ = matrix(kind, v, h, l, perpendicular(rng, v), eta, k)
    return rows


def least_eigenvalue(matrices: Floats) -> Floats:
    """Of the coherency matrix, over its trace: not below 0 where no light in makes impossible light out (Cloude 1986)."""
    coherency = np.einsum("nij,iab,jcd->nacbd", matrices, PAULI, PAULI.conj()).reshape(-1, 4, 4) / 4.0
    trace = np.maximum(np.trace(coherency, axis1=1, axis2=2).real, 1e-300)
    return np.asarray(np.linalg.eigvalsh(coherency)[:, 0] / trace)
