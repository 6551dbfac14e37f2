"""How far one film is from another, in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render.film import Film
from reflectance_fit.render.image import luminance

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """Approximate minus exact luminance, in the scene's unit of radiance.

    ``signed`` has shape (height, width); ``largest`` is its entry of largest size,
    at ``column`` and ``row`` from the top left; ``relative_largest`` is that over the
    exact luminance there.  ``rms`` and ``mean`` are over all pixels, ``level`` is the
    mean of the exact luminance.  ``noise`` is what the standard error of a pixel's difference
    stays below: it adds the two pictures' as if they were independent, which by their
    common random numbers they are not.
    """

    signed: Floats
    largest: float
    column: int
    row: int
    relative_largest: float
    rms: float
    mean: float
    level: float
    noise: float


def difference(exact: Film, approximate: Film) -> Difference:
    """Of two films of one scene and size."""
    reference = luminance(exact.mean[..., 0])
    signed = luminance(approximate.mean[..., 0]) - reference
    row, column = np.unravel_index(np.argmax(np.abs(signed)), signed.shape)
    largest, there = float(signed[row, column]), float(reference[row, column])
    noise = luminance(exact.error[..., 0]) ** 2 + luminance(approximate.error[..., 0]) ** 2
    return Difference(
        signed=signed,
        largest=largest,
        column=int(column),
        row=int(row),
        relative_largest=largest / there if there > 0 else float(np.inf),
        rms=float(np.sqrt(np.mean(signed**2))),
        mean=float(signed.mean()),
        level=float(reference.mean()),
        noise=float(np.sqrt(np.mean(noise))),
    )


def relative_error(film: Film) -> float:
    """Standard error of the picture, RMS over its pixels and channels, as a share of its mean; inf of a black one."""
    mean = float(film.mean[..., 0].mean())
    return float(np.sqrt(np.mean(film.error[..., 0] ** 2))) / mean if mean > 0 else float(np.inf)
