"""`--mode auto` against the fullest mode: a choice is unsafe where its picture is another one."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from card import Figure, Table
from numpy.typing import NDArray
from render_mode_scenes import scenes
from tracer_kernels import specked

from reflectance_fit.render.choose import LIMIT, choose
from reflectance_fit.render.film import Film
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Mode, Settings

Floats = NDArray[np.float64]

SEED = 7
FULLEST: Mode = "spectral_polarized"
SIZE = (32, 24)
_SAMPLES = (1024, 4096, 16384, 65536)
_PAIRS = 8


def figures(*, full: bool) -> Iterator[Figure | Table]:
    rows, unsafe, undecided, cheaper = [], [], [], 0
    for name, scene in scenes().items():
        scene = replace(scene, camera=replace(scene.camera, size_px=SIZE))
        started = time.perf_counter()
        choice = choose(scene, _render)
        seconds = time.perf_counter() - started
        cheaper += choice.mode != FULLEST
        found, error = (0.0, 0.0) if choice.mode == FULLEST else _difference(scene, choice.mode, full)
        if found**2 - 3.0 * error > LIMIT**2:
            unsafe.append(name)
        elif found**2 + 3.0 * error > LIMIT**2:
            undecided.append(name)
        rows.append(
            (
                name,
                choice.mode,
                f"{found:.2%} (at most {np.sqrt(found**2 + 3.0 * error):.2%})",
                f"{seconds:.1f}",
                choice.reason,
            )
        )
    n = len(rows)
    value = f"{len(unsafe)}" + (f" ({', '.join(unsafe)})" if unsafe else "")
    yield Figure.judged(f"unsafe modes chosen, N = {n} scenes", value, "0", not unsafe and n >= 30)
    value = f"{len(undecided)}" + (f" ({', '.join(undecided)})" if undecided else "")
    yield Figure.reported(f"of them too noisy to tell at {LIMIT:.0%}", value)
    yield Figure.reported("of them rendered cheaper than the fullest mode", f"{cheaper}")
    header = ("scene", "mode", "RMS difference from the fullest, of the mean", "seconds to choose", "reason")
    yield Table("Modes chosen", header, tuple(rows))


def _render(scene: Scene, settings: Settings) -> Film:
    return render(specked(scene), settings)


def _difference(scene: Scene, mode: Mode, full: bool) -> tuple[float, float]:
    """RMS over pixels and channels of what differs in intensity, over the mean; and the standard error of its square.

    Products of two independent differences have no share of the noise; the
    error is from leaving out one pair of pictures at a time, whatever their distribution.
    """
    for samples in _SAMPLES if full else _SAMPLES[:-1]:
        pairs = []
        for number in range(_PAIRS):
            settings = [
                Settings(which, samples // _PAIRS, SEED + 2 * number + place, sampler="independent")
                for place, which in enumerate((mode, FULLEST))
            ]
            pairs.append([_render(scene, one).mean[..., 0] for one in settings])  # one channel is all three
        level = float(np.mean([whole for _, whole in pairs]))
        every = np.array([cheap - whole for cheap, whole in pairs])
        found = _square(every) / level**2
        without = np.array([_square(np.delete(every, number, axis=0)) for number in range(_PAIRS)]) / level**2
        error = float(np.sqrt((_PAIRS - 1) * np.var(without)))
        if abs(found - LIMIT**2) > 3.0 * error:
            break
    return float(np.sqrt(max(found, 0.0))), error


def _square(differences: Floats) -> float:
    """Mean over the picture of the squared expected difference, without bias."""
    n = len(differences)
    total = differences.sum(axis=0) ** 2 - (differences**2).sum(axis=0)
    return float(total.mean()) / (n * (n - 1))
