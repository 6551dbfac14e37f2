"""``--mode auto``: the cheapest transport that gives the picture, and why.

Where a proof settles what a scene needs (`polarization_need`, `colour_need`) it
decides.  Where two interfaces or two colours may meet on a path, a small trial
measures what the cheaper mode would miss; it is chosen only where that is
shown to be little.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render import colour_need, polarization_need
from reflectance_fit.render.film import Film
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.settings import Mode, Settings

Floats = NDArray[np.float64]
Renderer = Callable[[Scene, Settings], Film]

LIMIT = 0.01
"""A picture is as good as the fullest mode's where they differ by less than this RMS, as a share of the mean."""

# The trial's picture is smaller and may blur an edge that differs; what it finds must stay below a third.
_TRIAL_LIMIT = LIMIT / 3
_TRIAL_PX = 64
_TRIAL_SAMPLES = (64, 256, 1024)


@dataclass(frozen=True, slots=True)
class Choice:
    """A mode, and the reason in one sentence."""

    mode: Mode
    reason: str


def choose(scene: Scene, pilot: Renderer, *, polarized: bool | None = None) -> Choice:
    """The cheapest mode whose picture is that of ``spectral_polarized`` to 1 % RMS of its mean.

    ``pilot`` renders the trials.  ``polarized`` True or False: Stokes vectors are asked for,
    or cannot be had (approximations of Fresnel's equations have no s and p).
    """
    if polarized is None:
        polarized, why = _polarization(scene, pilot)
    else:
        why = "Stokes vectors are asked for" if polarized else "an approximation has no s and p"
    if colour_need.is_gray(scene):
        gray = "nothing depends on wavelength"
        return Choice("polarized" if polarized else "scalar", f"{gray}; {why}")
    spectral, colour = _colour(scene, pilot, polarized)
    mode: Mode = (
        ("spectral_polarized" if polarized else "spectral")
        if spectral
        else ("polarized" if polarized else "rgb")
    )
    return Choice(mode, f"{colour}; {why}")


def _polarization(scene: Scene, pilot: Renderer) -> tuple[bool, str]:
    if certain := polarization_need.shows(scene):
        return True, certain
    if doubt := polarization_need.may_show(scene):
        matters, measured = _trial(scene, pilot, "rgb", "polarized")
        return matters, f"{doubt}, and without polarization {measured}"
    return False, "nothing tells s from p in light that was polarized before"


def _colour(scene: Scene, pilot: Renderer, polarized: bool) -> tuple[bool, str]:
    if certain := colour_need.shows(scene):
        return True, certain
    if doubt := colour_need.may_show(scene):
        modes: tuple[Mode, Mode] = ("polarized", "spectral_polarized") if polarized else ("rgb", "spectral")
        matters, measured = _trial(scene, pilot, *modes)
        return matters, f"{doubt}, and in RGB {measured}"
    return False, "no path meets two colours, so that RGB is exact"


def _trial(scene: Scene, pilot: Renderer, cheap: Mode, full: Mode) -> tuple[bool, str]:
    """Whether the cheaper mode misses more than a third of `LIMIT`, or may do so for all that is known; in words."""
    width, height = scene.camera.size_px
    scale = min(1.0, _TRIAL_PX / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = replace(scene, camera=replace(scene.camera, size_px=size))
    square, sigma = 0.0, math.inf
    for samples in _TRIAL_SAMPLES:
        square, sigma = _difference(small, pilot, cheap, full, samples)
        if square + 2 * sigma < _TRIAL_LIMIT**2:
            return False, f"the picture changes by less than {100 * _TRIAL_LIMIT:.1g} % in a trial"
        if square - 2 * sigma > _TRIAL_LIMIT**2:
            return True, f"the picture changes by {100 * math.sqrt(square):.2g} % in a trial"
    most = 100 * math.sqrt(max(square + 2 * sigma, 0.0))
    return True, f"the picture may change by {most:.2g} % for all that a trial tells"


def _difference(scene: Scene, pilot: Renderer, cheap: Mode, full: Mode, samples: int) -> tuple[float, float]:
    """Mean square difference over the squared mean, and its standard error.

    The product of two independent differences has no part that is noise: its mean
    is the true square, and may come out below 0.
    """
    differences: list[Floats] = []
    mean = 0.0
    # The same seed in both modes: where paths are the same, so is their noise.
    for seed in (1, 2):
        films = [
            pilot(scene, Settings(mode=mode, samples=samples, seed=seed)).mean[..., 0]
            for mode in (cheap, full)
        ]
        differences.append(films[1] - films[0])
        mean += float(films[1].mean()) / 2
    if mean <= 0:
        # The fullest mode's picture is black.
        return math.inf if any(map(np.any, differences)) else 0.0, 0.0
    product = np.mean(differences[0] * differences[1], axis=-1) / mean**2
    return float(product.mean()), float(product.std() / math.sqrt(product.size))
