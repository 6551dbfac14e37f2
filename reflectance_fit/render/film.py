"""What a render found, before it is a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.render.settings import Mode

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """Means over a pixel's paths.

    ``mean`` and ``error`` have shape (height, width, C, S): C channels, 1 where
    ``scalar``, else 3 (linear sRGB; values below 0 are colours outside it), and
    S Stokes components, 4 where polarized, else 1.  Stokes vectors are in the
    picture's frame: S1 > 0 is horizontal.  With an analyzer they are those behind
    it.  ``error`` is the standard error of ``mean``.
    """

    mode: Mode
    mean: Floats
    error: Floats
    samples: int
    discarded: int = 0
