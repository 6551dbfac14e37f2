"""Surroundings of radiance 1 all over: what loses nothing cannot be seen in them, and nothing is brighter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from card import Figure, Table
from tracer_kernels import specked

from reflectance_fit.render.run import render
from reflectance_fit.render.scene import (
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    Lambertian,
    Material,
    Plastic,
    Rectangle,
    Scene,
    Sphere,
    Surface,
    constant,
)
from reflectance_fit.render.settings import Mode, Settings

SEED = 0
TARGET = 1e-3
SIGMAS = 4.0
ROUGHNESS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
MODES: tuple[Mode, ...] = ("scalar", "rgb", "spectral", "polarized", "spectral_polarized")
# An index without real part absorbs nothing: |r| = 1.  As close as an index may come.
MIRROR = Conductor(constant(1e-9), constant(3.0))


def figures(*, full: bool) -> Iterator[Figure | Table]:
    smooth: dict[str, Material] = {
        "white diffuse": Lambertian(constant(1.0)),
        "glass": Dielectric(constant(1.5)),
        "metal without absorption": MIRROR,
        "plastic on white": Plastic(constant(1.5), constant(1.0)),
    }
    for name, material in smooth.items():
        # The modes of transport are different code.
        found = {mode: _mean(material, mode, 4096 if full else 1024) for mode in MODES}
        worst = max(found, key=lambda mode: abs(found[mode][0] - 1.0))
        mean, error = found[worst]
        value = f"{mean:.6f} (standard error {error:.0e}), {worst} of {len(MODES)} modes"
        yield Figure.judged(
            f"furnace, {name}, N = {len(MODES)}", value, f"1 +- {TARGET:.0e}", abs(mean - 1.0) <= TARGET
        )
    yield from _rough(full)


def _rough(full: bool) -> Iterator[Figure | Table]:
    rows, worst = [], -np.inf
    for alpha in ROUGHNESS:
        metal = Conductor(MIRROR.eta, MIRROR.k, alpha)
        materials = (metal, Dielectric(constant(1.5), alpha), Plastic(constant(1.5), constant(1.0), alpha))
        found = [_mean(material, "scalar", 16384 if full else 4096) for material in materials]
        worst = max(worst, *((mean - 1.0) / error for mean, error in found))
        rows.append((f"{alpha:g}", *(f"{1.0 - mean:.4f} +- {error:.4f}" for mean, error in found)))
    name = f"furnace, rough metal, glass and plastic, N = {3 * len(ROUGHNESS)}"
    value = f"at most {worst:+.1f} sigma above 1"
    yield Figure.judged(name, value, f"not above 1 within {SIGMAS:.0f} sigma", worst <= SIGMAS)
    header = ("roughness alpha", "metal without absorption", "glass 1.5", "plastic 1.5 on white")
    yield Table(
        "Energy that single scattering off GGX loses, of a sphere in a white furnace", header, tuple(rows)
    )


def _mean(material: Material, mode: Mode, samples: int) -> tuple[float, float]:
    """Of a sphere that fills the picture, seen in part through and off a plate of the same; and its standard error."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), (32, 32), "orthographic", 1.2)
    plate = Rectangle((0.5, 0, 2), (0.3, 0, 0), (0, 0.4, 0))
    surfaces = Surface(Sphere((0, 0, 0), 1.0), material), Surface(plate, material)
    sky = ConstantEnvironment(constant(1.0))
    scene = Scene(
        camera, surfaces if isinstance(material, Lambertian) else surfaces[:1], (sky,), max_depth=64
    )
    film = render(specked(scene), Settings(mode, samples, SEED, precision="double"))
    # Luminance, so that one number stands for coloured noise.
    weights = np.array([0.2126, 0.7152, 0.0722]) if film.mean.shape[2] == 3 else np.ones(1)
    value, error = film.mean[..., 0] @ weights, np.sqrt(film.error[..., 0] ** 2 @ weights**2)
    return float(value.mean()), float(np.sqrt((error**2).sum()) / value.size)
