"""Textures and pictures of the surroundings as the kernels read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render import colour
from reflectance_fit.render.scene import ImageEnvironment, Texture
from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]
Words = NDArray[np.uint32]


def pixels(picture: Floats, mode: Mode, *, light: bool) -> Floats:
    """A picture's numbers for a mode, shape (height * width, C); of primaries, C = 3, for the spectral ones."""
    triples = np.broadcast_to(picture, (*picture.shape[:2], 3)).reshape(-1, 3)
    return triples if mode in colour.SPECTRAL else triples @ colour.basis(mode, light=light)


def textures_of(textures: list[Texture], mode: Mode) -> tuple[Floats, Words]:
    """All pixels, and for each texture the first, the width and the height."""
    if not textures:
        return np.zeros((1, 3)), np.zeros((1, 3), np.uint32)
    parts = [pixels(texture.pixels, mode, light=False) for texture in textures]
    first = np.cumsum([0, *(len(part) for part in parts[:-1])])
    ids = [(start, t.pixels.shape[1], t.pixels.shape[0]) for start, t in zip(first, textures, strict=True)]
    return np.concatenate(parts), np.array(ids, np.uint32)


def sky_of(light: ImageEnvironment, mode: Mode) -> tuple[list[Floats], list[Words]]:
    """Parts of ``sky`` and ``sky_ids``, in the order of kernels/sky.py."""
    height, width = light.pixels.shape[:2]
    values = pixels(light.pixels * light.scale, mode, light=True)
    cosines = np.cos(np.linspace(0.0, np.pi, height + 1))
    angle = np.repeat((cosines[:-1] - cosines[1:]) * 2.0 * np.pi / width, width)
    brightness = (light.pixels.mean(axis=2)).ravel() * angle
    if not brightness.sum() > 0.0:
        brightness = angle
    chance = (brightness / brightness.sum()).reshape(height, width)
    rows = chance.sum(axis=1)
    keeps, others = np.ones((height, width)), np.tile(np.arange(width, dtype=np.uint32), (height, 1))
    for line in np.flatnonzero(rows > 0.0):
        keeps[line], others[line] = alias_table(chance[line] / rows[line])
    row_keep, row_other = alias_table(rows)
    parts = [values.ravel(), chance.ravel() / angle, keeps.ravel(), row_keep, cosines]
    return parts, [others.ravel(), row_other]


def alias_table(chosen: Floats) -> tuple[Floats, Words]:
    """For each cell, the share that it keeps and the entry that gets the rest (Walker 1977, Vose 1991)."""
    count = chosen.size
    keep, other = chosen * count, np.arange(count, dtype=np.uint32)
    small, large = [k for k in range(count) if keep[k] < 1.0], [k for k in range(count) if keep[k] >= 1.0]
    while small and large:
        poor, rich = small.pop(), large[-1]
        other[poor] = rich
        keep[rich] -= 1.0 - keep[poor]
        if keep[rich] < 1.0:
            small.append(large.pop())
    # What rounding left over: alone in its cell.
    keep[[*small, *large]] = 1.0
    return keep, other
