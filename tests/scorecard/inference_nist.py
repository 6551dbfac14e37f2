"""NIST's certified nonlinear regressions (StRD): files, models, and how many digits a minimiser recovers.

https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml, all 27 sets, 11 certified digits, two starts each.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.least_squares import least_squares

Floats = NDArray[np.float64]

CERTIFIED_DIGITS = 11.0


def _box_bod(x, b):
    return b[0] * (1 - np.exp(-b[1] * x))


def _chwirut(x, b):
    return np.exp(-b[0] * x) / (b[1] + b[2] * x)


def _gauss(x, b):
    peaks = b[2] * np.exp(-(((x - b[3]) / b[4]) ** 2)) + b[5] * np.exp(-(((x - b[6]) / b[7]) ** 2))
    return b[0] * np.exp(-b[1] * x) + peaks


def _lanczos(x, b):
    return sum(b[i] * np.exp(-b[i + 1] * x) for i in (0, 2, 4))


def _cubics(x, b):
    return (b[0] + b[1] * x + b[2] * x**2 + b[3] * x**3) / (1 + b[4] * x + b[5] * x**2 + b[6] * x**3)


def _enso(x, b):
    turn = 2 * np.pi * x
    return (
        b[0]
        + b[1] * np.cos(turn / 12)
        + b[2] * np.sin(turn / 12)
        + b[4] * np.cos(turn / b[3])
        + b[5] * np.sin(turn / b[3])
        + b[7] * np.cos(turn / b[6])
        + b[8] * np.sin(turn / b[6])
    )


MODELS: dict[str, Callable[[Floats, Floats], Floats]] = {
    "Bennett5": lambda x, b: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": _box_bod,
    "Chwirut1": _chwirut,
    "Chwirut2": _chwirut,
    "DanWood": lambda x, b: b[0] * x ** b[1],
    "ENSO": _enso,
    "Eckerle4": lambda x, b: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "Gauss3": _gauss,
    "Hahn1": _cubics,
    "Kirby2": lambda x, b: (b[0] + b[1] * x + b[2] * x**2) / (1 + b[3] * x + b[4] * x**2),
    "Lanczos1": _lanczos,
    "Lanczos2": _lanczos,
    "Lanczos3": _lanczos,
    "MGH09": lambda x, b: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "MGH10": lambda x, b: b[0] * np.exp(b[1] / (x + b[2])),
    "MGH17": lambda x, b: b[0] + b[1] * np.exp(-x * b[3]) + b[2] * np.exp(-x * b[4]),
    "Misra1a": _box_bod,
    "Misra1b": lambda x, b: b[0] * (1 - (1 + b[1] * x / 2) ** -2),
    "Misra1c": lambda x, b: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5),
    "Misra1d": lambda x, b: b[0] * b[1] * x / (1 + b[1] * x),
    "Nelson": lambda x, b: b[0] - b[1] * x[0] * np.exp(-b[2] * x[1]),  # of log(y)
    "Rat42": lambda x, b: b[0] / (1 + np.exp(b[1] - b[2] * x)),
    "Rat43": lambda x, b: b[0] / (1 + np.exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda x, b: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi,
    "Thurber": _cubics,
}


class Problem(NamedTuple):
    """One set: starts (2, P), certified values (P,), predictor (N,) or (2, N), response (N,)."""

    starts: Floats
    certified: Floats
    x: Floats
    y: Floats
    sum_of_squares: float


def read(path: Path) -> Problem:
    """Starts and certified values from the header of an StRD file, the data from the lines it names."""
    text = path.read_text(encoding="ascii")
    lines = text.splitlines()
    table = re.findall(r"^\s*b\d+\s*=\s*(\S+)\s+(\S+)\s+(\S+)\s+\S+\s*$", text, re.MULTILINE)
    first, last = map(int, re.search(r"Data\s+\(lines\s+(\d+)\s+to\s+(\d+)\)", text).groups())
    data = np.array([line.split() for line in lines[first - 1 : last]], dtype=float).T
    numbers = np.array(table, dtype=float).T
    squares = float(re.search(r"Residual Sum of Squares:\s*(\S+)", text)[1])
    y = np.log(data[0]) if path.stem == "Nelson" else data[0]
    return Problem(numbers[:2], numbers[2], data[1] if len(data) == 2 else data[1:], y, squares)


def digits(found: Floats, certified: Floats) -> float:
    """LRE: the digits of the worst parameter, at most the 11 that are certified."""
    error = float(np.max(np.abs(found / certified - 1)))
    return min(-math.log10(error), CERTIFIED_DIGITS) if error > 0 else CERTIFIED_DIGITS


def recovered(name: str, problem: Problem) -> list[float]:
    """Digits from each start."""
    model = MODELS[name]
    return [
        digits(least_squares(lambda b: problem.y - model(problem.x, b), start).x, problem.certified)
        for start in problem.starts
    ]
