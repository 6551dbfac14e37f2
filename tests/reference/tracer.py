"""A slow path tracer, to hold the fast one against: arrays of rays in numpy, float64, one wavelength a path.

Nothing here is shared with the renderer but what a scene is and the physics
of reflection.  Rays follow what surfaces do and add what light they run into;
only lights without extent are sought out.  Transport is by Mueller matrices,
of which unpolarized transport keeps the first element.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tracer_interface import Interface, Sheet, any_axis, through_sheet, turned
from tracer_lobes import Bounce, Optics, connect, scatter
from tracer_shapes import distances, dot, normals, sky_texels, texels, unit

from reflectance_fit.render.scene import (
    AreaLight,
    Conductor,
    Dielectric,
    DirectionalLight,
    ImageEnvironment,
    Lambertian,
    Light,
    Plastic,
    PointLight,
    Polarization,
    Scene,
    Spectrum,
    Surface,
    Texture,
)

Floats = NDArray[np.float64]
# What a spectrum (or a triple a path) is for some paths, as "surface", "light", "index" or what bends rays, "bend".
Look = Callable[[Spectrum | Floats, NDArray[np.intp], str], Floats]


@dataclass(slots=True)
class Rays:
    """Rays under way, the way of light back to the camera, and the axis of its Stokes vectors here; N rays."""

    path: NDArray[np.intp]
    origin: Floats
    direction: Floats
    axis: Floats
    matrix: Floats

    def taken(self, which: NDArray[np.bool_]) -> Rays:
        return Rays(*(getattr(self, name)[which] for name in self.__slots__))

    def __len__(self) -> int:
        return len(self.path)

    def passed(self, near: Floats, matrix: Floats) -> Floats:
        """The way of light, further by a matrix whose light arrives here with axis ``near``."""
        size = self.matrix.shape[1]
        turn = turned(near, self.axis, self.direction)
        return np.asarray(self.matrix @ turn[:, :size, :size] @ matrix[:, :size, :size])


@dataclass(frozen=True, slots=True)
class Tracer:
    """Sums the light of a scene along rays; ``polarized`` carries Stokes vectors."""

    scene: Scene
    look: Look
    rng: np.random.Generator
    polarized: bool = True
    fresnel: str = "exact"

    def radiance(self, origin: Floats, direction: Floats, axis: Floats) -> Floats:
        """What arrives along rays (N, 3), relative to ``axis``, (N, 4 or 1): one random path a ray."""
        size = 4 if self.polarized else 1
        found = np.zeros((len(origin), size))
        way = np.tile(np.eye(size), (len(origin), 1, 1))
        rays = Rays(np.arange(len(origin)), origin.copy(), direction, axis.copy(), way)
        for depth in range(1, self.scene.max_depth + 1):
            t, index = self._advance(rays)
            at = rays.origin + np.where(index < 0, 0.0, t)[:, None] * rays.direction
            for light in self.scene.lights:
                self._met(found, rays, at, index, light)
            if depth == self.scene.max_depth:
                break
            parts = [
                self._scattered(found, rays.taken(index == number), at[index == number], surface)
                for number, surface in enumerate(self.scene.surfaces)
                if np.any(index == number)
            ]
            if not parts:
                break
            rays = Rays(*(np.concatenate([getattr(part, name) for part in parts]) for name in Rays.__slots__))
            rays = rays.taken(rays.matrix[:, 0, 0] != 0.0)
        return found

    def _advance(self, rays: Rays, reach: Floats | float = np.inf) -> tuple[Floats, NDArray[np.intp]]:
        """Distance and number of the next surface or area light (-1: none), past all sheets within ``reach``."""
        shapes = [surface.shape for surface in self.scene.surfaces]
        shapes += [light.shape for light in self.scene.lights if isinstance(light, AreaLight)]
        reach = np.broadcast_to(reach, len(rays)).copy()
        while True:
            every = np.array(
                [distances(s, rays.origin, rays.direction) for s in shapes] or [np.full(len(rays), np.inf)]
            )
            t = every.min(axis=0)
            index = np.where(np.isfinite(t), every.argmin(axis=0), -1)
            passing = False
            for number, surface in enumerate(self.scene.surfaces):
                hit = (index == number) & (t < reach)
                if isinstance(surface.material, Sheet) and hit.any():
                    passing = True
                    near, matrix = through_sheet(surface, rays.direction[hit])
                    rays.matrix[hit] = rays.taken(hit).passed(near, matrix)
                    rays.axis[hit] = near
                    rays.origin[hit] += t[hit, None] * rays.direction[hit]
                    reach[hit] -= t[hit]
            if not passing:
                return t, index

    def _met(self, found: Floats, rays: Rays, at: Floats, index: NDArray[np.intp], light: Light) -> None:
        """Add the light that rays run into."""
        if isinstance(light, PointLight | DirectionalLight):
            return
        hit = index < 0
        if isinstance(light, AreaLight):
            emitters = [x for x in self.scene.lights if isinstance(x, AreaLight)]
            hit = index == len(self.scene.surfaces) + [x is light for x in emitters].index(True)
            hit[hit] = dot(rays.direction[hit], normals(light.shape, at[hit])) < 0.0
        rays = rays.taken(hit)
        if isinstance(light, ImageEnvironment):
            power = light.scale * self.look(sky_texels(light.pixels, rays.direction), rays.path, "light")
        else:
            power = self.look(light.radiance, rays.path, "light")
        self._add(found, rays, power, light.polarization)

    def _add(self, found: Floats, rays: Rays, power: Floats, polarization: Polarization) -> None:
        axis = np.asarray(polarization.axis) - rays.direction * (rays.direction @ polarization.axis)[:, None]
        length = np.linalg.norm(axis, axis=-1, keepdims=True)
        known = length > 1e-9
        axis = np.where(known, axis / np.where(known, length, 1.0), any_axis(rays.direction))
        state = np.where(known, polarization.stokes, [1.0, 0.0, 0.0, 0.0]) * power[:, None]
        way = rays.passed(axis, np.broadcast_to(np.eye(4), (len(rays), 4, 4)))
        found[rays.path] += (way @ state[:, : found.shape[1], None])[..., 0]

    def _scattered(self, found: Floats, rays: Rays, at: Floats, surface: Surface) -> Rays:
        """Rays that go on from a surface; adds what lights without extent send by way of it."""
        n = normals(surface.shape, at)
        behind = dot(rays.direction, n) > 0.0
        n = np.where(behind[:, None], -n, n)
        optics = self._optics(surface, rays.path, at, behind)
        for light in self.scene.lights:
            if isinstance(light, PointLight):
                towards = np.asarray(light.position) - at
                reach = np.linalg.norm(towards, axis=-1)
                power = self.look(light.intensity, rays.path, "light") / reach**2
            elif isinstance(light, DirectionalLight):
                towards, reach = (
                    np.broadcast_to(-np.asarray(light.direction), at.shape),
                    np.full(len(at), np.inf),
                )
                power = self.look(light.irradiance, rays.path, "light")
            else:
                continue
            for joined in connect(optics, rays.direction, n, unit(towards)):
                shadow = _onwards(rays, at, joined)
                t, _ = self._advance(shadow, reach)
                # Sheets on the way have brought the rays nearer.
                left = reach - np.linalg.norm(shadow.origin - at, axis=-1)
                clear = t >= left
                self._add(found, shadow.taken(clear), power[clear], light.polarization)
        return _onwards(rays, at, scatter(optics, rays.direction, n, self.rng))

    def _optics(
        self, surface: Surface, path: NDArray[np.intp], at: Floats, behind: NDArray[np.bool_]
    ) -> Optics:
        """The material as rays meet it that come from its front or from behind."""
        material, black = surface.material, np.zeros(len(path))
        if isinstance(material, Lambertian):
            albedo = material.reflectance
            if isinstance(albedo, Texture):
                albedo = texels(surface.shape, albedo.pixels, at)
            return Optics(material, self.look(albedo, path, "surface"))
        assert isinstance(material, Conductor | Dielectric | Plastic)
        eta, bend = (
            self.look(material.eta, path, what) / self.scene.exterior_ior for what in ("index", "bend")
        )
        if isinstance(material, Conductor):
            k = self.look(material.k, path, "index") / self.scene.exterior_ior
            return Optics(material, black, Interface(eta, k, self.fresnel))
        if isinstance(material, Plastic):
            albedo = self.look(material.reflectance, path, "surface")
            return Optics(material, albedo, Interface(eta, black, self.fresnel))
        eta, bend = np.where(behind, 1.0 / eta, eta), np.where(behind, 1.0 / bend, bend)
        return Optics(material, black, Interface(eta, black, self.fresnel), bend)


def _onwards(rays: Rays, at: Floats, bounce: Bounce) -> Rays:
    way = rays.passed(bounce.near, bounce.matrix)
    return Rays(rays.path, at.copy(), bounce.direction, bounce.far.copy(), way)
