"""The reference tracer's pictures: a camera's rays, channels or wavelengths, means and standard errors."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from tracer import Look, Tracer
from tracer_shapes import unit

from reflectance_fit.physics import mueller
from reflectance_fit.render import colour
from reflectance_fit.render.film import Film
from reflectance_fit.render.scene import Camera, Scene, Spectrum
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]

_RAYS = 200_000


def picture(scene: Scene, mode: Mode, samples: int, seed: int = 0, fresnel: str = "exact") -> Film:
    """A Film of independent paths, ``samples`` a pixel and channel; the scene as `render` takes it."""
    rng = np.random.default_rng(seed)
    width, height = scene.camera.size_px
    polarized = mode in ("polarized", "spectral_polarized")
    channels, size = (1 if mode == "scalar" else 3), (4 if polarized else 1)
    sums, squares = np.zeros((2, height * width, channels, size))
    pixels = np.arange(height * width)
    done = 0
    while done < samples:
        batch = min(max(1, _RAYS // len(pixels)), samples - done)
        origin, direction, axis = camera_rays(scene.camera, np.tile(pixels, batch), rng)
        for look, weights in _looks(scene, mode, len(origin), rng):
            tracer = Tracer(scene, look, rng, polarized, fresnel)
            stokes = tracer.radiance(origin, direction, axis)
            if scene.camera.analyzer_deg is not None:
                analyzer = mueller.polarizer(np.radians(scene.camera.analyzer_deg))
                stokes = stokes @ analyzer[:size, :size].T
            values = (weights[:, :, None] * stokes[:, None, :]).reshape(batch, len(pixels), channels, size)
            sums += values.sum(axis=0)
            squares += (values**2).sum(axis=0)
        done += batch
    mean = sums / samples
    error = np.sqrt(np.maximum(squares / samples - mean**2, 0.0) / (samples - 1))
    shape = (height, width, channels, size)
    return Film(mode=mode, mean=mean.reshape(shape), error=error.reshape(shape), samples=samples)


def camera_rays(
    camera: Camera, pixel: NDArray[np.intp], rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Origins, directions and axes of rays anywhere in pixels (numbered by rows from the top left), each (N, 3).

    The axis is the picture's horizontal, turned with the optical axis into the ray the shortest way.
    """
    width, height = camera.size_px
    forward = unit(np.subtract(camera.target, camera.position))
    right = unit(np.cross(forward, camera.up))
    up = np.cross(right, forward)
    x = (2.0 * (pixel % width + rng.random(len(pixel))) - width) / width
    y = (height - 2.0 * (pixel // width + rng.random(len(pixel)))) / width
    plane = x[:, None] * right + y[:, None] * up
    if camera.projection == "orthographic":
        origin = np.asarray(camera.position) + camera.width / 2.0 * plane
        return origin, np.tile(forward, (len(pixel), 1)), np.tile(right, (len(pixel), 1))
    direction = unit(forward + np.tan(np.radians(camera.width) / 2.0) * plane)
    share = (direction @ right) / (1.0 + direction @ forward)
    origin = np.tile(np.asarray(camera.position, dtype=np.float64), (len(pixel), 1))
    return origin, direction, right - (direction + forward) * share[:, None]


def _looks(scene: Scene, mode: Mode, paths: int, rng: np.random.Generator) -> Iterator[tuple[Look, Floats]]:
    """What spectra are on some paths, and what their light adds to the channels, shape (paths, C)."""
    if mode in colour.SPECTRAL:
        low, high = colour.GRID_NM[[0, -1]]
        at = rng.uniform(low, high, paths)
        weights = [np.interp(at, colour.GRID_NM, row) for row in colour.observer().rgb]
        yield _look(scene.camera, mode, at=at), (high - low) * np.stack(weights, axis=-1)
        return
    channels = 1 if mode == "scalar" else 3
    for channel in range(channels):
        yield _look(scene.camera, mode, channel=channel), np.tile(np.eye(channels)[channel], (paths, 1))


def _look(camera: Camera, mode: Mode, channel: int = 0, at: Floats | None = None) -> Look:
    """One channel's, or that of wavelengths ``at``, a path each."""

    def look(spectrum: Spectrum | Floats, path: NDArray[np.intp], what: str) -> Floats:
        if isinstance(spectrum, Spectrum):
            of = {"surface": colour.reflectance, "light": colour.emission}.get(what, colour.index)
            values = of(spectrum, mode, camera.channels_nm)[None, :]
        else:
            values = spectrum @ colour.basis(mode, light=what == "light")[-spectrum.shape[1] :]
        if at is None:
            # Rays of all channels are bent as the middle one is.
            column = len(values[0]) // 2 if what == "bend" else channel
            return np.broadcast_to(values[:, column], len(path)).astype(np.float64)
        cell = np.minimum(((at[path] - colour.GRID_NM[0]) / 5.0).astype(int), colour.GRID_NM.size - 2)
        share = (at[path] - colour.GRID_NM[cell]) / 5.0
        rows = np.arange(len(path)) if len(values) == len(path) else np.zeros(len(path), dtype=int)
        return np.asarray(values[rows, cell] * (1.0 - share) + values[rows, cell + 1] * share)

    return look
