"""What each approximation costs against the exact form: measured here and now."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ANGLES = 10_000
_ROUNDS = 9

Approximation = Callable[[NDArray[np.float64]], Any]


def nanoseconds_per_evaluation(functions: Mapping[str, Approximation]) -> dict[str, float]:
    """Median time of each function of cos(theta), in ns an angle; interleaved, so drift cancels.

    Arrays in, arrays out, as numpy does it here: what a shader pays has the same order, not the same ratios.
    """
    cosines = np.linspace(0.0, 1.0, _ANGLES)
    times: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(_ROUNDS):
        for name, function in functions.items():
            # Once untimed: else each pays for memory that the one before it used last, a cheap one several times over.
            function(cosines)
            start = time.perf_counter()
            function(cosines)
            times[name].append(time.perf_counter() - start)
    return {name: median(values) / _ANGLES * 1e9 for name, values in times.items()}
