"""Materials as the kernels read them: a kind, numbers of curves, and a few parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics import approximations
from reflectance_fit.physics.approximations import F82_COSINE, schlick
from reflectance_fit.physics.fitted_approximations import lazanyi, lazanyi_coefficients
from reflectance_fit.physics.fresnel import r0, reflectances
from reflectance_fit.render import colour
from reflectance_fit.render.kernels import lanes
from reflectance_fit.render.lobes import plastic
from reflectance_fit.render.scene import (
    Conductor,
    Dielectric,
    Lambertian,
    Plastic,
    PolarizerSheet,
    RetarderSheet,
    Spectrum,
    Surface,
    Texture,
    constant,
)
from reflectance_fit.render.settings import Fresnel

Floats = NDArray[np.float64]
Words = NDArray[np.uint32]

# GGX lobes narrower than this are drawn as if they were this wide: their density would leave float32's digits behind.
_SMALLEST_ALPHA = 1e-3

_FORMS: dict[Fresnel, plastic.Form] = {
    "exact": approximations.exact,
    "constant": approximations.constant,
    "schlick": approximations.schlick_exact_r0,
    "schlick_f82": approximations.f82,
    "lazanyi": lazanyi,
    "large_index": approximations.lecture_conductor,
}


@dataclass(slots=True, eq=False)
class Looks:
    """What the materials of one scene share; ``dispersive`` once a dielectric's index differs between channels."""

    curves: colour.Curves
    exterior_ior: float
    fresnel: Fresnel
    dispersive: bool = False
    textures: list[Texture] = field(default_factory=list)

    def index(self, spectrum: Spectrum) -> Floats:
        """Relative to the exterior, shape (C,)."""
        values = colour.index(spectrum, self.curves.mode, self.curves.channels_nm)
        return values / self.exterior_ior


def look(surface: Surface, looks: Looks) -> tuple[Words, Floats]:
    """A surface's kind and curves, and its roughness and four more parameters."""
    material = surface.material
    words, numbers = np.zeros(lanes.SHAPE_IDS, np.uint32), np.zeros(5)
    match material:
        case Lambertian():
            words[lanes.OF_KIND] = lanes.DIFFUSE
            if isinstance(material.reflectance, Texture):
                looks.textures.append(material.reflectance)
                words[lanes.OF_TEXTURE] = len(looks.textures)
                words[lanes.OF_COLOUR] = looks.curves.add(looks.index(constant(1.0)))
            else:
                words[lanes.OF_COLOUR] = looks.curves.reflectance(material.reflectance)
        case Dielectric():
            words[lanes.OF_KIND] = lanes.ROUGH_GLASS if material.roughness > 0 else lanes.GLASS
            eta = looks.index(material.eta)
            looks.dispersive |= bool(np.ptp(eta) > 0)
            _interface(words, looks, eta, np.zeros_like(eta))
            numbers[0] = max(material.roughness, _SMALLEST_ALPHA)
            if np.all(eta == 1.0):
                # No interface at all: facets would pass light straight on.
                words[lanes.OF_KIND] = lanes.GLASS
        case Conductor():
            words[lanes.OF_KIND] = lanes.ROUGH_MIRROR if material.roughness > 0 else lanes.MIRROR
            _interface(words, looks, looks.index(material.eta), looks.index(material.k))
            numbers[0] = max(material.roughness, _SMALLEST_ALPHA)
        case Plastic():
            words[lanes.OF_KIND] = lanes.COAT
            eta = looks.index(material.eta)
            _interface(words, looks, eta, np.zeros_like(eta))
            rho = colour.reflectance(material.reflectance, looks.curves.mode, looks.curves.channels_nm)
            alpha = max(material.roughness, _SMALLEST_ALPHA) if material.roughness > 0 else 0.0
            form = _FORMS[looks.fresnel]
            factor = plastic.base_factor(rho, eta, alpha, form)
            words[lanes.OF_COLOUR] = looks.curves.add(factor)
            through = np.square(eta) * (1.0 - plastic.internal_reflectance(eta, form))
            numbers[:3] = alpha, float(factor.mean()), float(through.mean())
        case PolarizerSheet():
            words[lanes.OF_KIND] = lanes.POLARIZER
            axis = math.radians(material.axis_deg)
            numbers[1:4] = math.cos(axis), math.sin(axis), material.diattenuation
        case RetarderSheet():
            words[lanes.OF_KIND] = lanes.RETARDER
            axis, retardance = math.radians(material.fast_axis_deg), math.radians(material.retardance_deg)
            numbers[1:] = math.cos(axis), math.sin(axis), math.cos(retardance), math.sin(retardance)
    return words, numbers


def _interface(words: Words, looks: Looks, eta: Floats, k: Floats) -> None:
    """Curves of the index, and of the approximate form r0 + b (1 - c)^5 - a c (1 - c)^power that stands for it."""
    words[lanes.OF_ETA], words[lanes.OF_K] = looks.curves.add(eta), looks.curves.add(k)
    if looks.fresnel in ("exact", "large_index"):
        return
    # An approximation is meant for light that comes from the side of the lower index.
    thin = np.where((k == 0.0) & (eta < 1.0), 1.0 / eta, eta)
    normal = r0(thin, k)
    rise, dip, power = 1.0 - normal, np.zeros_like(normal), np.full_like(normal, 6.0)
    if looks.fresnel == "constant":
        rise = np.zeros_like(normal)
    elif looks.fresnel == "schlick_f82":
        plain = schlick(F82_COSINE, normal)
        edge = np.minimum(reflectances(F82_COSINE, thin, k).mean, plain)
        dip = (plain - edge) / (F82_COSINE * (1.0 - F82_COSINE) ** 6)
    elif looks.fresnel == "lazanyi":
        dip, power = (a[:, 0] for a in lazanyi_coefficients(thin[:, None], k[:, None]))
    slots = (lanes.OF_R0, lanes.OF_B, lanes.OF_A, lanes.OF_POWER)
    for slot, row in zip(slots, (normal, rise, dip, power), strict=True):
        words[slot] = looks.curves.add(np.asarray(row, dtype=np.float64))
