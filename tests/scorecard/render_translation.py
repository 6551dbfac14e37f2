"""Our scenes as Mitsuba 3 takes them.

Surfaces are one-sided there and shown from their fronts: its `twosided` turns Stokes vectors
wrongly.  `pplastic`, which lets light out of its base but once, gets the base that ours comes
to.  Mitsuba separates shadowing from masking where ours correlates their heights; what that
changes is of the order of alpha^4 / 16, so alpha is small here and angles are moderate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.render import colour
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    DirectionalLight,
    Disk,
    Lambertian,
    Light,
    Material,
    Plane,
    Plastic,
    PointLight,
    PolarizerSheet,
    Rectangle,
    RetarderSheet,
    Scene,
    Shape,
    Spectrum,
    Sphere,
)
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]

_FAR = 1e3


def translated(scene: Scene, mode: Mode) -> dict[str, Any]:
    """The scene as `mitsuba.load_dict` takes it; a variant must be set."""
    sheets = sum(isinstance(surface.material, PolarizerSheet | RetarderSheet) for surface in scene.surfaces)
    integrator = {"type": "path", "max_depth": scene.max_depth + sheets}
    if "polarized" in mode:
        integrator = {"type": "stokes", "nested": integrator}
    found: dict[str, Any] = {"type": "scene", "integrator": integrator, "sensor": _camera(scene.camera)}
    for number, surface in enumerate(scene.surfaces):
        bsdf = _material(surface.material, scene, mode)
        found[f"surface_{number}"] = {**_shape(surface.shape, surface.material), "bsdf": bsdf}
    for number, light in enumerate(scene.lights):
        found[f"light_{number}"] = _light(light, scene.camera, mode)
    return found


def _camera(camera: Camera) -> dict[str, Any]:
    from mitsuba import ScalarTransform4f as Transform

    place = Transform().look_at(origin=list(camera.position), target=list(camera.target), up=list(camera.up))
    if camera.projection == "orthographic":
        place = place @ Transform().scale([camera.width / 2.0, camera.width / 2.0, 1.0])
        projection: dict[str, Any] = {"type": "orthographic", "near_clip": 1e-3, "far_clip": 1e4}
    else:
        projection = {
            "type": "perspective",
            "fov": camera.width,
            "fov_axis": "x",
            "near_clip": 1e-3,
            "far_clip": 1e4,
        }
    film = {
        "type": "hdrfilm",
        "width": camera.size_px[0],
        "height": camera.size_px[1],
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }
    return {**projection, "to_world": place, "film": film, "sampler": {"type": "independent"}}


def _shape(shape: Shape, material: Material | None = None) -> dict[str, Any]:
    if isinstance(shape, Sphere):
        return {"type": "sphere", "center": list(shape.center), "radius": shape.radius}
    if isinstance(shape, Rectangle):
        return _placed("rectangle", shape.center, np.asarray(shape.u), np.asarray(shape.v), material)
    normal = np.asarray(shape.normal) / np.linalg.norm(shape.normal)
    if isinstance(shape, Disk):
        return _placed("disk", shape.center, np.asarray(shape.u), np.cross(normal, shape.u), material)
    assert isinstance(shape, Plane)
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u *= _FAR / np.linalg.norm(u)
    return _placed("rectangle", shape.point, u, np.cross(normal, u), material)


def _placed(kind: str, center: Any, u: Floats, v: Floats, material: Material | None) -> dict[str, Any]:
    from mitsuba import ScalarTransform4f as Transform

    # Mitsuba turns a sheet in itself only where light meets it at a right angle, and a disk's u axis is radial.
    turned = getattr(material, "axis_deg", getattr(material, "fast_axis_deg", 0.0))
    if turned or (kind == "disk" and isinstance(material, PolarizerSheet | RetarderSheet)):
        raise ValueError("a sheet is a rectangle with its axis along u here")
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 3] = u, v, center
    matrix[:3, 2] = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return {"type": kind, "to_world": Transform(matrix)}


def _material(material: Material, scene: Scene, mode: Mode) -> dict[str, Any]:
    camera, outside = scene.camera, scene.exterior_ior
    if isinstance(material, Lambertian):
        assert isinstance(material.reflectance, Spectrum)
        reflectance = _curve(colour.reflectance(material.reflectance, mode, camera.channels_nm))
        return {"type": "diffuse", "reflectance": reflectance}
    if isinstance(material, Dielectric):
        return {"type": "dielectric", "int_ior": _one(material.eta), "ext_ior": outside}
    if isinstance(material, Conductor):
        eta, k = (colour.index(x, mode, camera.channels_nm) / outside for x in (material.eta, material.k))
        bsdf = {"type": "conductor", "eta": _curve(eta), "k": _curve(k)}
        if material.roughness:
            bsdf |= {"type": "roughconductor", "distribution": "ggx", "alpha": material.roughness}
        return bsdf
    if isinstance(material, Plastic):
        eta = _one(material.eta) / outside
        c, weight = np.polynomial.legendre.leggauss(64)
        average = float(np.sum(weight * (c + 1.0) / 2.0 * reflectances((c + 1.0) / 2.0, eta).mean))
        rho = colour.reflectance(material.reflectance, mode, camera.channels_nm)
        base = rho / (1.0 - rho * (1.0 - (1.0 - average) / eta**2)) / eta**2
        bsdf = {"type": "pplastic", "int_ior": eta, "ext_ior": 1.0, "diffuse_reflectance": _curve(base)}
        return bsdf | {"distribution": "ggx", "alpha": material.roughness}
    if isinstance(material, PolarizerSheet):
        return {"type": "polarizer"}
    return {"type": "retarder", "delta": material.retardance_deg}


def _light(light: Light, camera: Camera, mode: Mode) -> dict[str, Any]:
    if isinstance(light, AreaLight):
        radiance = _curve(colour.emission(light.radiance, mode, camera.channels_nm), light=True)
        black = {"type": "diffuse", "reflectance": _curve(np.zeros(1))}
        return {**_shape(light.shape), "bsdf": black, "emitter": {"type": "area", "radiance": radiance}}
    if isinstance(light, ConstantEnvironment):
        return {
            "type": "constant",
            "radiance": _curve(colour.emission(light.radiance, mode, camera.channels_nm), light=True),
        }
    if isinstance(light, PointLight):
        intensity = _curve(colour.emission(light.intensity, mode, camera.channels_nm), light=True)
        return {"type": "point", "position": list(light.position), "intensity": intensity}
    assert isinstance(light, DirectionalLight)
    irradiance = _curve(colour.emission(light.irradiance, mode, camera.channels_nm), light=True)
    return {"type": "directional", "direction": list(light.direction), "irradiance": irradiance}


def _curve(values: Floats, light: bool = False) -> dict[str, Any]:
    """One number, three, or one for each wavelength of the grid."""
    if np.all(values == values[0]) and not (light and len(values) > 3):
        return {"type": "uniform", "value": float(values[0])}
    if len(values) == 3:
        return {"type": "rgb", "value": [float(x) for x in values]}
    return {
        "type": "regular",
        "wavelength_min": float(colour.GRID_NM[0]),
        "wavelength_max": float(colour.GRID_NM[-1]),
        "values": ", ".join(repr(float(x)) for x in values),
    }


def _one(spectrum: Spectrum) -> float:
    """Mitsuba's dielectrics have one index."""
    if spectrum.values.size != 1:
        raise ValueError("a dielectric has the same index at every wavelength here")
    return float(spectrum.values[0])
