"""Runs a function of one lane over arrays, in a loop compiled as the renderer's are."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from typing import Any, get_args, get_type_hints

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import ArrayLike, NDArray

FLAGS = {"contract", "nsz", "arcp", "reassoc"}  # those of physics.jit.vectorised


@cache
def _loop(function: Callable[..., Any], several: bool) -> Callable[..., None]:
    """``run(out, lanes)``: row j of ``out`` has the results of row j of ``lanes``."""
    inputs = len(signature(function.py_func).parameters)  # type: ignore[attr-defined]

    def run(out: NDArray[Any], lanes: NDArray[Any]) -> None:
        for j in range(len(out)):
            got = function(*to_fixed_tuple(lanes[j], inputs))
            for i in range(len(got)):
                out[j, i] = got[i]

    def run_one(out: NDArray[Any], lanes: NDArray[Any]) -> None:
        for j in range(len(out)):
            out[j, 0] = function(*to_fixed_tuple(lanes[j], inputs))

    return njit(error_model="numpy", fastmath=FLAGS)(run if several else run_one)  # type: ignore[no-any-return]


def over_lanes(
    function: Callable[..., Any], *arguments: ArrayLike, dtype: type[np.floating[Any]] = np.float64
) -> NDArray[Any]:
    """Results of shape (outputs, lanes), or (lanes,) of a function with one result."""
    lanes = np.stack([x.reshape(-1) for x in np.broadcast_arrays(*arguments)], axis=-1).astype(dtype)
    outputs = get_args(get_type_hints(function.py_func)["return"])  # type: ignore[attr-defined]
    several = len(outputs) > 0
    out = np.empty((len(lanes), len(outputs) if several else 1), dtype)
    _loop(function, several)(out, lanes)
    return out.T if several else out[:, 0]
