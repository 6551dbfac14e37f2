"""How much of colour a scene needs, as far as that is known without a trial.

White light times one linear sRGB triple is that triple, in RGB and in spectra
alike.  Spectra differ where colours multiply, where a table has more to it than
three wavelengths show, and where an index bends wavelengths apart.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.render.colour import emission, index, integral, observer, reflectance
from reflectance_fit.render.polarization_need import named, sees_itself
from reflectance_fit.render.scene import (
    Conductor,
    Dielectric,
    DirectionalLight,
    ImageEnvironment,
    Lambertian,
    Light,
    Plastic,
    PointLight,
    Scene,
    Spectrum,
    Surface,
    Texture,
)
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

# Refraction differs by this times the tangent of the angle, in radians: at 1e-4 less than a tenth of a pixel.
_DISPERSION = 1e-4
# A colour read at three wavelengths may be off by this share of its largest channel.
_TABLE = 2e-3
_VISIBLE_NM = (400.0, 700.0)


def is_gray(scene: Scene) -> bool:
    """Whether nothing in the scene depends on wavelength."""
    return not _coloured_lights(scene) and not _coloured_surfaces(scene)


def shows(scene: Scene) -> str | None:
    """Why spectra differ from RGB whatever the geometry, as a clause; None where that is not certain."""
    if scene.max_depth >= 2:
        for surface in scene.surfaces:
            if isinstance(surface.material, Dielectric):
                spread = _spread(surface.material.eta, scene.camera.channels_nm)
                if spread > _DISPERSION:
                    return f"the index of {named(surface)} varies by {spread:.2g} over the visible"
    for name, off in _table_errors(scene):
        if off > _TABLE:
            return f"three wavelengths miss the colour of {name} by {100 * off:.2g} %"
    return None


def may_show(scene: Scene) -> str | None:
    """Where one path can meet two colours, as a clause; None where that is impossible, and RGB is exact."""
    lights, surfaces = _coloured_lights(scene), _coloured_surfaces(scene)
    if scene.max_depth < 2 or not surfaces:
        return None
    if lights:
        return f"coloured light meets the colour of {named(surfaces[0])}"
    once = scene.max_depth == 2 or (len(scene.surfaces) == 1 and not sees_itself(surfaces[0], scene))
    if once and all(isinstance(s.material, Lambertian) for s in surfaces):
        return None
    return f"light can meet the colour of {named(surfaces[0])} more than once"


def _coloured_lights(scene: Scene) -> list[Light]:
    """Tables among them even where they are constant: light of equal energy is not white."""
    found = []
    for light in scene.lights:
        spectrum = _emitted(light)
        table = isinstance(spectrum, Spectrum) and spectrum.wavelength_nm is not None
        if table or not _is_flat(spectrum):
            found.append(light)
    return found


def _coloured_surfaces(scene: Scene) -> list[Surface]:
    return [s for s in scene.surfaces if not all(map(_is_flat, _colours(s)))]


def _is_flat(colour: Spectrum | Floats) -> bool:
    """Whether all wavelengths, or all channels of every pixel, are alike to a millionth."""
    values = colour.values if isinstance(colour, Spectrum) else np.moveaxis(colour, -1, 0)
    return bool(np.all(np.abs(values - values[0]) <= 1e-6 * np.abs(values).max(initial=0.0)))


def _emitted(light: Light) -> Spectrum | Floats:
    if isinstance(light, ImageEnvironment):
        return light.pixels
    if isinstance(light, PointLight):
        return light.intensity
    return light.irradiance if isinstance(light, DirectionalLight) else light.radiance


def _colours(surface: Surface) -> tuple[Spectrum | Floats, ...]:
    """Everything about a surface that may depend on wavelength."""
    material = surface.material
    match material:
        case Lambertian():
            paint = material.reflectance
            return (paint.pixels if isinstance(paint, Texture) else paint,)
        case Dielectric():
            return (material.eta,)
        case Conductor():
            return material.eta, material.k
        case Plastic():
            return material.eta, material.reflectance
        case _:
            return ()


def _spread(eta: Spectrum, channels_nm: Triple) -> float:
    """Largest minus smallest index over the visible."""
    known = np.asarray(channels_nm) if eta.wavelength_nm is None else eta.wavelength_nm
    if eta.values.size == 1:
        return 0.0
    order = np.argsort(known)
    within = np.linspace(*_VISIBLE_NM, 61)
    return float(np.ptp(np.interp(within, known[order], eta.values[order])))


def _table_errors(scene: Scene) -> Iterator[tuple[str, float]]:
    """For all that is not made of sRGB triples: its colour by three wavelengths against that by its spectrum."""
    nm = scene.camera.channels_nm
    for light in scene.lights:
        spectrum = _emitted(light)
        if isinstance(spectrum, Spectrum) and spectrum.wavelength_nm is not None:
            yield "a light", _off(emission(spectrum, "rgb", nm), emission(spectrum, "spectral", nm))
    if scene.max_depth < 2:
        return
    for surface in _coloured_surfaces(scene):
        pair = [_reflected(surface, mode, scene) for mode in ("rgb", "spectral")]
        if pair[0] is not None and pair[1] is not None:
            yield named(surface), _off(pair[0], pair[1] * observer().white)


def _reflected(surface: Surface, mode: Mode, scene: Scene) -> Floats | None:
    """Share of light at right angles that comes back, shape (C,); None where sRGB triples say it."""
    material, nm = surface.material, scene.camera.channels_nm
    if isinstance(material, Lambertian):
        paint = material.reflectance
        table = isinstance(paint, Spectrum) and paint.wavelength_nm is not None
        return reflectance(paint, mode, nm) if isinstance(paint, Spectrum) and table else None
    if not isinstance(material, Conductor | Plastic):
        return None
    eta = index(material.eta, mode, nm) / scene.exterior_ior
    k = index(material.k, mode, nm) / scene.exterior_ior if isinstance(material, Conductor) else 0.0
    mirrored = reflectances(1.0, eta, k).mean
    if isinstance(material, Plastic):
        mirrored = mirrored + (1.0 - mirrored) * reflectance(material.reflectance, mode, nm)
    return np.asarray(mirrored)


def _off(three: Floats, curve: Floats) -> float:
    """Largest difference of linear sRGB values from those of a curve, as a share of the largest."""
    seen = np.array([integral(row, curve) for row in observer().rgb])
    return float(np.max(np.abs(three - seen)) / np.max(np.abs(seen)))
