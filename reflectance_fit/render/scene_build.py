"""Checked keys of a scene file as the dataclasses of scene.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inputs import existing
from reflectance_fit.material import Material as FittedMaterial
from reflectance_fit.render import scene, scene_blocks, scene_lights, scene_materials
from reflectance_fit.render.pictures import read_picture
from reflectance_fit.render.scene_index import index_of
from reflectance_fit.render.scene_shapes import vector
from reflectance_fit.render.scene_spectra import Encoding, Texture, spectrum

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Files:
    """What a scene file may name: files inside its folder.  ``fitted`` reads a report.yaml."""

    manifest: Path
    fitted: Callable[[Path], FittedMaterial]

    def picture(self, name: str, encoding: Encoding | None) -> Floats:
        return read_picture(existing(self.manifest, name), name, encoding)

    def report(self, name: str) -> FittedMaterial:
        existing(self.manifest, name)
        return self.fitted(self.manifest.parent / name)


def material(
    block: scene_materials.Material, files: Files, channels_nm: tuple[float, float, float]
) -> tuple[scene.Material, str | None]:
    """The material, and a word on where its index is a guess."""
    if isinstance(block, scene_materials.Lambertian):
        if isinstance(block.reflectance, Texture):
            return scene.Lambertian(_texture(block.reflectance, files)), None
        return scene.Lambertian(spectrum(block.reflectance)), None
    if isinstance(block, scene_materials.Polarizer):
        return scene.PolarizerSheet(block.axis_deg, block.diattenuation), None
    if isinstance(block, scene_materials.Retarder):
        return scene.RetarderSheet(block.fast_axis_deg, block.retardance_deg), None
    eta, k, note = index_of(block, channels_nm, files.report)
    if isinstance(block, scene_materials.Conductor):
        return scene.Conductor(eta, k, block.roughness), note
    if isinstance(block, scene_materials.Plastic):
        return scene.Plastic(eta, spectrum(block.reflectance), block.roughness), note
    return scene.Dielectric(eta, block.roughness), note


def _texture(block: Texture, files: Files) -> scene.Texture:
    pixels = files.picture(block.texture, block.encoding)
    if pixels.max() > 1:
        raise ReflectanceFitError(
            f"{block.texture}: a reflectance is at most 1 (found {pixels.max():.3g}); scale the picture down"
        )
    return scene.Texture(pixels)


def light(block: scene_lights.Light, files: Files) -> scene.Light:
    state = block.polarization()
    if isinstance(block, scene_lights.PointLight):
        return scene.PointLight(vector(block.position), spectrum(block.intensity), state)
    if isinstance(block, scene_lights.DirectionalLight):
        return scene.DirectionalLight(vector(block.direction), spectrum(block.irradiance), state)
    if not isinstance(block, scene_lights.Environment):
        return scene.AreaLight(block.shape(), spectrum(block.radiance), state)
    if block.radiance is not None:
        return scene.ConstantEnvironment(spectrum(block.radiance), state)
    pixels = files.picture(block.image or "", block.encoding)
    if not pixels.any():
        raise ReflectanceFitError(f"{block.image}: is black all over; a light of 0 everywhere is none")
    return scene.ImageEnvironment(np.broadcast_to(pixels, (*pixels.shape[:2], 3)), block.scale or 1.0, state)


def camera(block: scene_blocks.Camera) -> scene.Camera:
    width, height = block.size_px
    red, green, blue = block.channels_nm
    return scene.Camera(
        position=vector(block.position),
        target=vector(block.target),
        up=vector(block.up),
        size_px=(width, height),
        projection="perspective" if block.width is None else "orthographic",
        width=block.width or block.fov_deg or 40.0,
        analyzer_deg=block.analyzer_deg,
        channels_nm=(red, green, blue),
    )
