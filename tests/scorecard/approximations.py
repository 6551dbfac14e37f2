"""What renderers use for Fresnel's equations: errors that were published, found again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from card import Figure
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials import library
from reflectance_fit.physics.approximation_error import ApproximationError, approximation_error
from reflectance_fit.physics.approximation_ladder import LADDER

FloatArray = NDArray[np.float64]

RUNGS = {rung.name: rung for rung in LADDER}
SCAN_ANGLES = {False: 100_001, True: 5_000_001}  # --full or not
SCAN_TOLERANCE = 1e-6  # absolute; a scan of 100,001 angles misses a maximum by less than 1e-8

# Schlick against eta, as printed: largest absolute error, largest relative error and albedo bias in percent.
DIELECTRICS = {
    1.05: (".3175", "668", "+247"),
    1.1: (".2105", "187", "+98"),
    1.2: (".113", "47", "+25"),
    1.33: (".060", "22.7", "+1.2"),
    1.5: (".036", "23.2", "-6.6"),
    1.7: (".032", "20", "-7.2"),
    2.0: (".044", "14", "-4.5"),
    2.42: (".076", "14", "-0.3"),
    3.0: (".125", "25", "+3.4"),
    4.0: (".201", "41", "+6.5"),
}
AT_DEG = {1.5: "85"}


@dataclass(frozen=True, slots=True)
class Metal:
    """Largest absolute errors as printed, for a median of the literature that was not printed with them."""

    name: str
    wavelength_nm: float
    schlick: str
    f82: str
    lecture_conductor: str


METALS = (
    Metal("Au", 450, ".019", ".020", ".007"),
    Metal("Au", 650, ".019", ".006", ".002"),
    Metal("Ag", 550, ".007", ".002", ".001"),
    Metal("Al", 450, ".064", ".006", ".003"),
    Metal("Al", 550, ".093", ".007", ".002"),
    Metal("Al", 650, ".117", ".017", ".002"),
    Metal("Cu", 550, ".029", ".007", ".007"),
    Metal("Cr", 550, ".206", ".024", ".004"),
    Metal("Fe", 550, ".174", ".018", ".005"),
    Metal("Ti", 550, ".112", ".008", ".007"),
    Metal("W", 550, ".203", ".030", ".005"),
    Metal("Si", 550, ".206", ".042", ".007"),
)
METAL_RUNGS = ("schlick", "f82", "lecture_conductor")


def about(*, full: bool) -> str:
    return (
        "Errors of the unpolarized reflectance over 0 to 90 degrees, approximation minus exact. The dielectric "
        "rows are judged by the digits printed for them. The metal rows were printed for medians of the literature that "
        "are not known; here they are for the built-in optical constants, relative to vacuum, given with each, "
        "and judged by a scan of the textbook formulas in complex numbers "
        f"({SCAN_ANGLES[full]:,} angles); the printed errors stand beside for comparison and judge nothing. No random numbers."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    for eta, printed in DIELECTRICS.items():
        error = approximation_error(eta, 0.0, RUNGS["schlick"].curve(eta, 0.0))
        yield from _dielectric(eta, printed, error)
    for metal in METALS:
        yield _metal(metal, SCAN_ANGLES[full])


def _dielectric(eta: float, printed: tuple[str, str, str], error: ApproximationError) -> Iterator[Figure]:
    at = AT_DEG.get(eta)
    absolute = _rounds_to(error.max_abs_error, printed[0]) and (at is None or _rounds_to(error.at_deg, at))
    yield Figure.judged(
        f"Schlick, eta = {eta:g}: largest error",
        f"{error.max_abs_error:.5f} at {error.at_deg:.2f} deg",
        printed[0] + (f" at {at} deg" if at else ""),
        absolute,
    )
    for name, value, text in (
        ("largest relative error", error.max_rel_error, printed[1]),
        ("bias of the hemispherical albedo", error.albedo_error, printed[2]),
    ):
        yield Figure.judged(
            f"Schlick, eta = {eta:g}: {name}",
            f"{100 * value:+.3f} %",
            f"{text} %",
            _rounds_to(100 * value, text),
        )


def _metal(metal: Metal, angles: int) -> Figure:
    name = f"{metal.name} at {metal.wavelength_nm:g} nm: largest errors of Schlick, F82, large-index form"
    printed = ", ".join(getattr(metal, rung) for rung in METAL_RUNGS)
    target = f"a scan within {SCAN_TOLERANCE:g}"
    try:
        index = library.get(metal.name).absolute_index(metal.wavelength_nm)
    except ReflectanceFitError as error:
        return Figure.not_run(name, target, str(error))
    eta, k = map(float, index)
    found = [approximation_error(eta, k, RUNGS[rung].curve(eta, k)).max_abs_error for rung in METAL_RUNGS]
    good = np.allclose(found, _scan(eta, k, angles), rtol=0, atol=SCAN_TOLERANCE)
    values = ", ".join(f"{value:.4f}" for value in found)
    return Figure.judged(
        name, f"{values} for {eta:.3f} + {k:.3f}i (printed for another: {printed})", target, bool(good)
    )


def _scan(eta: float, k: float, angles: int) -> FloatArray:
    """The largest error of each of METAL_RUNGS on a grid; shares no code with the package."""
    theta = np.linspace(0.0, np.pi / 2, angles)
    exact, c = _fresnel(eta, k, theta), np.cos(theta)
    r0 = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    plain = r0 + (1 - r0) * (1 - c) ** 5
    mu = 1 / 7
    edge = r0 + (1 - r0) * (1 - mu) ** 5
    tint = min(float(_fresnel(eta, k, np.arccos([mu]))[0]) / edge, 1.0)
    f82 = plain - c * (1 - c) ** 6 / (mu * (1 - mu) ** 6) * (edge - tint * edge)
    square = eta**2 + k**2
    large_s = (square - 2 * eta * c + c**2) / (square + 2 * eta * c + c**2)
    large_p = (square * c**2 - 2 * eta * c + 1) / (square * c**2 + 2 * eta * c + 1)
    return np.array([np.abs(f - exact).max() for f in (plain, f82, (large_s + large_p) / 2)])


def _fresnel(eta: float, k: float, theta: FloatArray) -> FloatArray:
    index, c = eta + 1j * k, np.cos(theta)
    inside = np.sqrt(1 - (np.sin(theta) / index) ** 2)
    r_s = (c - index * inside) / (c + index * inside)
    r_p = (index * c - inside) / (index * c + inside)
    return np.asarray((np.abs(r_s) ** 2 + np.abs(r_p) ** 2) / 2)


def _rounds_to(value: float, printed: str) -> bool:
    return round(value, len(printed.partition(".")[2])) == float(printed)
