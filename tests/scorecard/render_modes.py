"""`--mode auto` against the fullest mode: a choice is unsafe where its picture is another one."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from card import Figure, Table
from render_mode_scenes import scenes
from tracer_kernels import specked

from reflectance_fit.render.choose import LIMIT, choose
from reflectance_fit.render.film import Film
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Mode, Settings

SEED = 7
FULLEST: Mode = "spectral_polarized"
SIZE = (32, 24)
_SAMPLES = (64, 256, 1024, 4096)


def figures(*, full: bool) -> Iterator[Figure | Table]:
    rows, unsafe, undecided, cheaper = [], [], [], 0
    for name, scene in scenes().items():
        scene = replace(scene, camera=replace(scene.camera, size_px=SIZE))
        started = time.perf_counter()
        choice = choose(scene, _render)
        seconds = time.perf_counter() - started
        cheaper += choice.mode != FULLEST
        found, error = (0.0, 0.0) if choice.mode == FULLEST else _difference(scene, choice.mode, full)
        if found - 3.0 * error > LIMIT:
            unsafe.append(name)
        elif found + 3.0 * error > LIMIT:
            undecided.append(name)
        rows.append((name, choice.mode, f"{found:.2%} +- {error:.2%}", f"{seconds:.1f}", choice.reason))
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
    """RMS over pixels and channels of what differs in intensity, beyond noise, over the mean; and its standard error.

    The square of the difference of two independent pictures is too large by
    their variances, which are subtracted.
    """
    for samples in _SAMPLES if full else _SAMPLES[:-1]:
        films = [
            render(scene, Settings(which, samples, SEED + number))
            for number, which in enumerate((mode, FULLEST))
        ]
        difference = films[0].mean[..., 0] - films[1].mean[..., 0]  # one channel is all three
        variance = films[0].error[..., 0] ** 2 + films[1].error[..., 0] ** 2
        level = float(films[1].mean[..., 0].mean())
        square = float(np.mean(difference**2 - variance))
        # Of a squared normal variable about zero the variance is 2 sigma^4, about mu 4 mu^2 sigma^2 more.
        spread = np.sqrt(np.sum(2.0 * variance**2 + 4.0 * variance * max(square, 0.0))) / difference.size
        found = np.sqrt(max(square, 0.0)) / level
        error = float(np.sqrt(max(square, 0.0) + spread) / level - found)
        if abs(found - LIMIT) > 3.0 * error:
            break
    return float(found), error
