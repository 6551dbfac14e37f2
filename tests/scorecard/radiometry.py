"""Radiometry by forms that share no formula, each pair at its worst over random configurations."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from card import Figure
from numpy.typing import NDArray

from reflectance_fit.physics.area_form import irradiance_by_area
from reflectance_fit.physics.area_lights import DiskLight, Light, RectangleLight, SphereLight
from reflectance_fit.physics.brdf import blinn_phong, lambertian, modified_phong, phong
from reflectance_fit.physics.brdf_checks import check_energy, check_reciprocity
from reflectance_fit.physics.cones import cone_projected_solid_angle, ring_projected_solid_angle
from reflectance_fit.physics.direction_form import irradiance_by_direction
from reflectance_fit.physics.fresnel import radiance_transmission_factor, reflectances
from reflectance_fit.physics.hemisphere import direction, hemispherical_irradiance, lobe_irradiance
from reflectance_fit.physics.light_irradiance import irradiance, solid_angle
from reflectance_fit.physics.reflection import directional_albedo

Floats = NDArray[np.float64]

TARGET = 1e-10
SEED = 0
UP = np.array([0.0, 0.0, 1.0])
KINDS = ("rectangle", "disk", "sphere")


def about(*, full: bool) -> str:
    return (
        f"Seed {SEED}, {_scenes(full)} receivers a light and pair of forms, all that see the light; the "
        "horizon cuts a third to two thirds of the lights. Sizes 0.1 to 3, distances up to 8. "
        "Relative differences, worst of all. "
        "Closed: contour sums and elementary formulas. Area: integral over the light. Spherical: integral "
        "over theta and phi about the receiver's normal."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    yield from _lights(_scenes(full))
    yield from _limits(_scenes(full))
    yield from _hemisphere()
    yield from _brdfs(full)


def _scenes(full: bool) -> int:
    return 2000 if full else 60


def _worst(name: str, pairs: list[tuple[float, float]]) -> Figure:
    worst = max(abs(a - b) / abs(b) for a, b in pairs)
    return Figure.judged(f"{name}, N = {len(pairs)}", f"{worst:.1e}", f"{TARGET:.0e}", worst <= TARGET)


def _light(kind: str, rng: np.random.Generator) -> Light:
    x, y, z = _frame(rng)
    center, (a, b) = rng.normal(size=3), rng.uniform(0.2, 3.0, 2)
    if kind == "rectangle":
        return RectangleLight(center, a * x, b * y)
    return DiskLight(center, z, a) if kind == "disk" else SphereLight(center, a / 2.0)


def _frame(rng: np.random.Generator) -> Floats:
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.asarray(axes * np.sign(np.linalg.det(axes)))


def _seen(kind: str, n: int) -> list[tuple[Light, Floats, Floats]]:
    rng = np.random.default_rng([SEED, KINDS.index(kind)])
    found: list[tuple[Light, Floats, Floats]] = []
    while len(found) < n:
        light, position, normal = _light(kind, rng), 2.0 * rng.normal(size=3), rng.normal(size=3)
        if isinstance(light, SphereLight) and np.linalg.norm(position - light.center) <= 1.001 * light.radius:
            continue
        if irradiance(light, position, normal) > 0.0:
            found.append((light, position, normal))
    return found


def _lights(n: int) -> Iterator[Figure]:
    for kind in KINDS:
        scenes = _seen(kind, n)
        closed = [float(irradiance(*scene)) for scene in scenes]
        area = [irradiance_by_area(*scene) for scene in scenes]
        spherical = [irradiance_by_direction(*scene) for scene in scenes]
        areas, sphericals = [a.value for a in area], [s.value for s in spherical]
        yield _worst(f"{kind}: area against closed form", list(zip(areas, closed, strict=True)))
        yield _worst(f"{kind}: spherical against closed form", list(zip(sphericals, closed, strict=True)))
        yield _worst(f"{kind}: area against spherical form", list(zip(areas, sphericals, strict=True)))
        done = sum(found.converged for found in (*area, *spherical))
        yield Figure.judged(f"{kind}: quadratures that converged", f"{done} of {2 * n}", "all", done == 2 * n)


def _limits(n: int) -> Iterator[Figure]:
    rng = np.random.default_rng([SEED, 9])
    far, angles, halves, limb = [], [], [], []
    for _ in range(n):
        u, v, w = _frame(rng)
        a, b = rng.uniform(0.1, 1.0, 2)
        distance = 10.0 ** rng.uniform(6.0, 9.0)
        light = RectangleLight(-a / 2 * u - b / 2 * v, a * u, b * v)
        to = direction(rng.uniform(0.0, 1.4), rng.uniform(0.0, 2.0 * np.pi)) @ np.stack([u, v, w])
        projected = a * b * float(to @ w) / distance**2
        far.append((float(irradiance(light, distance * to, -to)), projected))
        angles.append((float(solid_angle(light, distance * to)), projected))
        disk = DiskLight(np.zeros(3), w, a)
        far.append((float(irradiance(disk, distance * to, -to)), np.pi * a / b * projected))
        angles.append((float(solid_angle(disk, distance * to)), np.pi * a / b * projected))
    for light, position, normal in _seen("rectangle", n):
        assert isinstance(light, RectangleLight)
        cut, u = rng.uniform(0.1, 0.9), np.asarray(light.edge_u)
        parts = (
            RectangleLight(light.corner, cut * u, light.edge_v),
            RectangleLight(light.corner + cut * u, (1.0 - cut) * u, light.edge_v),
        )
        whole = float(irradiance(light, position, normal))
        halves.append((sum(float(irradiance(part, position, normal)) for part in parts), whole))
    for light, position, normal in _seen("sphere", n):
        assert isinstance(light, SphereLight)
        towards = np.asarray(light.center) - position
        sine2 = light.radius**2 / float(towards @ towards)
        disk = DiskLight(light.center - sine2 * towards, -towards, light.radius * np.sqrt(1.0 - sine2))
        limb.append((float(irradiance(disk, position, normal)), float(irradiance(light, position, normal))))
    yield _worst("far rectangles and disks, 1e6 to 1e9 off: closed form against inverse square", far)
    yield _worst("far rectangles and disks, 1e6 to 1e9 off: solid angle against inverse square", angles)
    yield _worst("rectangle against its two parts", halves)
    yield _worst("sphere against the disk of its limb, closed forms", limb)


def _hemisphere() -> Iterator[Figure]:
    def lobe(n: float) -> Callable[[Floats, Floats], Floats]:
        return lambda theta, phi: np.cos(theta) ** n

    exponents = (0.0, 1.0, 2.5, 10.0, 100.0, 1000.0)
    pairs = [(hemispherical_irradiance(lobe(n)).value, float(lobe_irradiance(n))) for n in exponents]
    yield _worst("cosine lobes, exponents 0 to 1000: spherical against closed form", pairs)
    edges = np.linspace(0.0, np.pi / 2.0, 91)
    rings = float(np.sum(ring_projected_solid_angle(edges[:-1], edges[1:])))
    yield _worst(
        "90 rings against the whole hemisphere", [(rings, float(cone_projected_solid_angle(np.pi / 2, 0.0)))]
    )
    pairs = []
    for eta in (1.1, 1.33, 1.5, 2.4):
        cosine = np.linspace(0.01, 1.0, 25)
        entering = reflectances(cosine, eta)
        up = entering.mean + entering.transmitted * radiance_transmission_factor(1.0 / eta) * eta**2
        pairs += [(float(value), 1.0) for value in up]
    yield _worst("white furnace of a window, radiance scaled by the squared index", pairs)


def _brdfs(full: bool) -> Iterator[Figure]:
    beams = 5 if full else 1
    good = {
        "Lambertian": lambertian(1.0),
        "modified Phong, exponent 20": modified_phong(1.0, 20.0),
        "Blinn-Phong, exponent 50": blinn_phong(1.0, 50.0),
    }
    normal = [(directional_albedo(brdf, UP).value, 1.0) for brdf in good.values()]
    yield _worst("directional albedo at normal incidence against its closed form", normal)
    for name, brdf in good.items():
        reciprocity, energy = check_reciprocity(brdf), check_energy(brdf, beams)
        violation = reciprocity.violation
        yield Figure.judged(
            f"{name}: reciprocity, 2^13 pairs", f"{violation:.1e}", "1e-12", violation <= 1e-12
        )
        yield Figure.judged(
            f"{name}: largest albedo, {2**beams + 5} directions",
            f"{energy.albedo:.10f}",
            "1 at most",
            energy.conserves,
        )
    bad, energy = check_reciprocity(phong(0.5, 20.0)), check_energy(phong(0.5, 20.0), beams)
    caught = not bad.reciprocal and not energy.conserves
    found = f"violation {bad.violation:.2f}, albedo {energy.albedo:.1f}"
    yield Figure.judged("Phong's rule, which is no BRDF, is caught by both checks", found, "caught", caught)
