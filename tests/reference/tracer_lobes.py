"""What surfaces do to rays and to Stokes vectors, by the simplest sampling that is right.

Rays run from the camera, light runs against them.  ``d`` arrives at a surface
from the camera's side, ``to`` leaves it: unit vectors, shape (N, 3).  Normals
``n`` are on the camera's side.  Mueller matrices, shape (N, 4, 4), turn light
that comes along -to into light that goes along -d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tracer_interface import Interface, across, any_axis, average_reflectance, depolarizer
from tracer_shapes import dot, unit

from reflectance_fit.render.scene import Conductor, Dielectric, Lambertian, Material, Plastic

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Optics:
    """A material for some paths: ``reflectance`` (N,); ``bend``, the index ratio that refracts, which wavelengths may share."""

    material: Material
    reflectance: Floats
    interface: Interface | None = None
    bend: Floats | None = None

    @property
    def alpha(self) -> float:
        return float(getattr(self.material, "roughness", 0.0))


@dataclass(frozen=True, slots=True)
class Bounce:
    """Where rays go on, and the light that then arrives, from axis ``far`` on the new ray to ``near`` on the old one."""

    direction: Floats
    matrix: Floats
    near: Floats
    far: Floats


def scatter(optics: Optics, d: Floats, n: Floats, rng: np.random.Generator) -> Bounce:
    """One random way on, its matrix over its density."""
    material = optics.material
    if isinstance(material, Lambertian):
        to = cosine_direction(n, rng)
        return Bounce(to, depolarizer(optics.reflectance), any_axis(d), any_axis(to))
    if isinstance(material, Conductor):
        return reflect(optics, d, n, rng)
    return (reflect_plastic if isinstance(material, Plastic) else reflect_or_refract)(optics, d, n, rng)


def connect(optics: Optics, d: Floats, n: Floats, to: Floats) -> list[Bounce]:
    """What a surface sends on of light from a given direction: BRDF times cosine, a summand a lobe."""
    material, found = optics.material, []
    above = np.maximum(dot(to, n), 0.0)[:, None, None]
    if isinstance(material, Lambertian):
        found.append(Bounce(to, above * depolarizer(optics.reflectance / np.pi), any_axis(d), any_axis(to)))
    if isinstance(material, Plastic):
        found.append(Bounce(to, above * base_matrix(optics, d, n, to), across(d, n), across(to, n)))
    if optics.alpha > 0.0:
        found.append(lobe(optics, d, n, to))
        if isinstance(material, Dielectric):
            found.append(lobe_through(optics, d, n, to))
    return found


def reflect(optics: Optics, d: Floats, n: Floats, rng: np.random.Generator) -> Bounce:
    """Off an interface, smooth or GGX; half vectors by the distribution of normals."""
    interface, alpha = optics.interface, optics.alpha
    assert interface is not None
    h = half_vector(alpha, n, rng)
    c = -dot(d, h)
    to = d + 2.0 * c[:, None] * h
    good = (c > 0.0) & (dot(to, n) > 0.0)
    weight = np.where(good, microfacet_weight(alpha, d, to, n, h), 0.0)
    s = across(d, h)
    return Bounce(to, weight[:, None, None] * interface.reflection(np.clip(c, 0.0, 1.0)), s, s)


def reflect_or_refract(optics: Optics, d: Floats, n: Floats, rng: np.random.Generator) -> Bounce:
    """Through or off a transparent interface."""
    interface, bend, alpha = optics.interface, optics.bend, optics.alpha
    assert interface is not None
    assert bend is not None
    h = half_vector(alpha, n, rng)
    c = -dot(d, h)
    cosine = np.clip(c, 0.0, 1.0)
    off, through = interface.reflection(cosine), interface.transmission(cosine)
    squared = 1.0 - (1.0 - cosine**2) / bend**2
    chance = np.where(squared > 0.0, off[:, 0, 0], 1.0)
    reflects = rng.random(len(d)) < chance
    root = np.sqrt(np.maximum(squared, 0.0))
    mirrored = d + 2.0 * c[:, None] * h
    to = np.where(
        reflects[:, None], mirrored, unit(d / bend[:, None] + ((cosine / bend) - root)[:, None] * h)
    )
    side = np.where(reflects, 1.0, -1.0) * dot(to, n)
    weight = np.where((c > 0.0) & (side > 0.0), microfacet_weight(alpha, d, to, n, h), 0.0)
    # Radiance grows by the squared index ratio in the direction of light, from far to near.
    weight = weight / np.where(reflects, chance, (1.0 - chance) * bend**2)
    s = across(d, h)
    return Bounce(to, weight[:, None, None] * np.where(reflects[:, None, None], off, through), s, s)


def reflect_plastic(optics: Optics, d: Floats, n: Floats, rng: np.random.Generator) -> Bounce:
    """Off the coat or off its base, each half of the time."""
    coat = reflect(optics, d, n, rng)
    to = cosine_direction(n, rng)
    base = np.pi * base_matrix(optics, d, n, to)
    first = rng.random(len(d)) < 0.5
    pick = first[:, None]
    return Bounce(
        np.where(pick, coat.direction, to),
        2.0 * np.where(pick[..., None], coat.matrix, base),
        np.where(pick, coat.near, across(d, n)),
        np.where(pick, coat.far, across(to, n)),
    )


def base_matrix(optics: Optics, d: Floats, n: Floats, to: Floats) -> Floats:
    """BRDF of the base below a plastic's coat, between the frames across d and to with the normal.

    Light enters, T(to), is spread evenly and depolarized, comes back from below again and again,
    1 / (1 - rho F), and leaves, T(d), wider by the squared index.
    """
    interface, reflectance = optics.interface, optics.reflectance
    assert interface is not None
    into, out = interface.transmission(np.abs(dot(to, n))), interface.transmission(np.abs(dot(d, n)))
    inside = 1.0 - (1.0 - average_reflectance(interface)) / interface.eta**2
    scale = reflectance / (1.0 - reflectance * inside) / (np.pi * interface.eta**2)
    return np.asarray(scale[:, None, None] * out[:, :, :1] * into[:, :1, :])


def lobe(optics: Optics, d: Floats, n: Floats, to: Floats) -> Bounce:
    """GGX's BRDF times the cosine."""
    assert optics.interface is not None
    h = unit(to - d)
    c, cos_d, cos_to = -dot(d, h), -dot(d, n), dot(to, n)
    shape = (
        distribution(optics.alpha, dot(h, n)) * shadowing(optics.alpha, cos_d, cos_to) / (4.0 * np.abs(cos_d))
    )
    value = np.where(cos_to > 0.0, shape, 0.0)[:, None, None]
    return Bounce(to, value * optics.interface.reflection(np.clip(c, 0.0, 1.0)), across(d, h), across(d, h))


def lobe_through(optics: Optics, d: Floats, n: Floats, to: Floats) -> Bounce:
    """GGX's transmission of radiance times the cosine: Walter et al. (2007), eq. 21, without the squared index ratio."""
    interface, bend, alpha = optics.interface, optics.bend, optics.alpha
    assert interface is not None
    assert bend is not None
    h = unit(d - bend[:, None] * to)
    h = h * np.sign(dot(h, n))[:, None]
    c, beyond = -dot(d, h), dot(to, h)
    weight = (
        distribution(alpha, dot(h, n))
        * shadowing(alpha, -dot(d, n), dot(to, n))
        * np.abs(c * beyond / dot(d, n))
    )
    good = (c > 0.0) & (beyond < 0.0) & (dot(to, n) < 0.0)
    value = np.where(good, weight / (c + bend * beyond) ** 2, 0.0)[:, None, None]
    return Bounce(to, value * interface.transmission(np.clip(c, 0.0, 1.0)), across(d, h), across(d, h))


# ------------------------------------------------------------------------ GGX


def distribution(alpha: float, cosine: Floats) -> Floats:
    return np.asarray(alpha**2 / (np.pi * (1.0 + (alpha**2 - 1.0) * cosine**2) ** 2))


def shadowing(alpha: float, cos_d: Floats, cos_to: Floats) -> Floats:
    """Smith's, of both directions: heights are correlated where both are on one side, else taken to be independent."""

    def lamb(cosine: Floats) -> Floats:
        squared = np.maximum(cosine**2, 1e-30)
        return np.asarray((np.sqrt(1.0 + alpha**2 * (1.0 - squared) / squared) - 1.0) / 2.0)

    one, other = lamb(cos_d), lamb(cos_to)
    return 1.0 / np.where(cos_to > 0.0, 1.0 + one + other, (1.0 + one) * (1.0 + other))


def half_vector(alpha: float, n: Floats, rng: np.random.Generator) -> Floats:
    """By the distribution of normals, D cos."""
    if alpha == 0.0:
        return n
    u = rng.random(len(n))
    return around(n, 1.0 / np.sqrt(1.0 + alpha**2 * u / (1.0 - u)), rng)


def microfacet_weight(alpha: float, d: Floats, to: Floats, n: Floats, h: Floats) -> Floats:
    """What is left of value over density: G |d.h| / (|d.n| h.n), by reflection and by refraction alike."""
    if alpha == 0.0:
        return np.ones(len(d))
    cos_d = np.abs(dot(d, n))
    return shadowing(alpha, cos_d, dot(to, n)) * np.abs(dot(d, h)) / (cos_d * dot(h, n))


def around(n: Floats, cosine: Floats, rng: np.random.Generator) -> Floats:
    """Unit vectors at ``cosine`` from ``n``, anywhere around it."""
    x = any_axis(n)
    phi = 2.0 * np.pi * rng.random(len(n))
    ring = np.cos(phi)[:, None] * x + np.sin(phi)[:, None] * np.cross(n, x)
    return cosine[:, None] * n + np.sqrt(np.maximum(1.0 - cosine**2, 0.0))[:, None] * ring


def cosine_direction(n: Floats, rng: np.random.Generator) -> Floats:
    return around(n, np.sqrt(rng.random(len(n))), rng)
