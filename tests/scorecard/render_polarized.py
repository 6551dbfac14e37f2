"""Whole pictures as Mueller matrices: four states of light by the same paths, and whether any light could do that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from card import Figure
from numpy.typing import NDArray
from render_matrices import least_eigenvalue
from tracer_kernels import specked
from tracer_scenes import CASES

from reflectance_fit.render.run import render
from reflectance_fit.render.scene import ConstantEnvironment, Polarization, Scene, constant
from reflectance_fit.render.settings import Settings

Floats = NDArray[np.float64]

SEED = 3
STATES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NAMES = ("glass and metal", "two mirrors", "strong roughness", "smooth plastic", "shaded by sheets")
# Sums of float64 matrices that are admissible each.
ROUNDING = 1e-12


def figures(*, full: bool) -> Iterator[Figure]:
    worst, most = np.inf, 0.0
    for name in NAMES:
        scene = next(case.scene for case in CASES if case.name == name)
        matrices = _matrices(scene, 256 if full else 64)
        scaled = matrices / np.maximum(matrices[:, :1, :1], 1e-300)
        worst = min(worst, float(least_eigenvalue(scaled).min()))
        random = np.random.default_rng(SEED).normal(size=(64, 3))
        light = np.concatenate(
            [np.ones((64, 1)), random / np.linalg.norm(random, axis=1, keepdims=True)], axis=1
        )
        seen = np.einsum("nij,kj->nki", scaled, light).reshape(-1, 4)
        seen = seen[seen[:, 0] > 1e-6]
        most = max(most, float((np.linalg.norm(seen[:, 1:], axis=1) / seen[:, 0]).max()))
    pixels = CASES[0].scene.camera.size_px[0] * CASES[0].scene.camera.size_px[1] * len(NAMES)
    title = f"Mueller matrices of pixels, least eigenvalue of coherency over M00, N = {pixels} of {len(NAMES)} scenes"
    yield Figure.judged(title, f"{worst:.1e}", f"{-ROUNDING:.0e} at least", worst >= -ROUNDING)
    title = f"degree of polarization that they make of polarized light, N = {64 * pixels}"
    yield Figure.judged(title, f"1 {most - 1.0:+.1e} at most", f"1 + {ROUNDING:.0e}", most <= 1.0 + ROUNDING)


def _matrices(scene: Scene, samples: int) -> Floats:
    """Of each pixel, from the surroundings to the picture, shape (N, 4, 4); the surroundings are all light there is."""
    columns = []
    for state in STATES:
        sky = ConstantEnvironment(constant(1.0), Polarization((1.0, *state), (0.3, 0.2, 1.0)))
        given = replace(scene, lights=(sky,))
        film = render(
            specked(given), Settings("polarized", samples, SEED, sampler="independent", precision="double")
        )
        columns.append(film.mean[:, :, 1, :].reshape(-1, 4))
    first = columns[0]
    return np.stack([first, *(column - first for column in columns[1:])], axis=-1)
