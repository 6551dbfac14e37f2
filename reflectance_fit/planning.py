"""Before photographing: which angles and settings, and what to expect of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.data_synthetic.spec import SENSORS, NoiseLevel
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference.design import (
    EQUIPMENT,
    KINDS,
    Design,
    Kind,
    Subject,
    best,
    common,
    planned,
    sigmas,
)
from reflectance_fit.inference.foresight import Foresight, foresee
from reflectance_fit.manifests import WAVELENGTHS_NM
from reflectance_fit.materials import library
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.nuisances import DARK_FRACTION
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, NUISANCES, Prior
from reflectance_fit.report.numbers import short

FloatArray = NDArray[np.float64]

PLAIN = ("s and p", "four axes", "lamp at 45, four axes", "lamp at 45, plate, four frames")
# Of light of power 1: below it no exposure is long enough, and a signal's noise stops falling with it.
DARKEST = 1e-3
# Of what a sensor holds: exposures a stop apart leave the brightest pixels at 40 to 80 %.
_FILLED = 0.6
# The region that is measured, of the sensor; half of a Bayer sensor's pixels are green.
_REGION, _GREEN = 0.25, 0.5
# All that a fit of photographs can allow for; a source's azimuth is flat.
NUISANCE_SIGMAS = {
    name: DARK_FRACTION if n.default_sigma is None else n.default_sigma for name, n in NUISANCES.items()
}
WAVELENGTH_NM = 550.0


@dataclass(frozen=True, slots=True)
class Option:
    """A design and what to expect of it."""

    design: Design
    expected: Foresight


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """``usual``: the plain kinds and those of ``best`` at 30, 45 and 60 degrees; ``best``: one option an equipment.

    ``noise`` is one standard deviation of a signal, relative.
    """

    title: str
    wavelength_nm: float
    noise: float
    frames: int
    subject: Subject
    usual: tuple[Option, ...]
    best: tuple[Option, ...]


def plan(
    *,
    eta: float | None = None,
    k: float = 0.0,
    material: str | None = None,
    wavelength_nm: float = WAVELENGTH_NM,
    noise: NoiseLevel | float = "typical",
    frames: int = 12,
) -> Plan:
    """Usual designs and the best for an assumed index in air, or for a built-in material.

    ``eta`` and ``k`` are relative to vacuum.  ``noise`` is that of a synthetic
    camera by its word, or one relative standard deviation of a signal.

    Raises ReflectanceFitError for an index, material or number of frames that cannot be.
    """
    if material is not None:
        constants = library.get(material)
        eta, k = (float(x) for x in constants.absolute_index(wavelength_nm))
        title = f"{constants.name}, {wavelength_nm:g} nm"
        # Tables give glasses a k of 1e-8, which no reflection shows and no fit looks for.
        k = 0.0 if library.entry(material).kind == "dielectric" else k
    elif eta is None:
        raise ReflectanceFitError("give an index or a material")
    else:
        title = "given index"
    _check(eta, k, wavelength_nm, frames)
    share = noise if isinstance(noise, float) else _camera_noise(noise)
    subject = Subject(
        eta=eta,
        k=k,
        exterior_ior=AIR_INDEX,
        noise=lambda signal: share * np.maximum(signal, DARKEST),
        priors={"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)},
        nuisances=NUISANCE_SIGMAS,
    )
    kinds = [kind for kind in KINDS if kind.frames <= frames]
    usual = [kind for kind in kinds if kind.name in PLAIN]
    chosen = [
        min(
            (best_option(kind, frames, subject) for kind in kinds if kind.equipment == equipment),
            key=lambda option: (option.expected.k_sd is None and k > 0, option.expected.worst),
        )
        for equipment in EQUIPMENT
        if any(kind.equipment == equipment for kind in kinds)
    ]
    usual += [o.design.kind for o in chosen if o.design.kind not in usual]
    return Plan(
        title=title,
        wavelength_nm=wavelength_nm,
        noise=share,
        frames=frames,
        subject=subject,
        usual=tuple(option(common(kind, frames), subject) for kind in usual),
        best=tuple(chosen),
    )


def option(design: Design, subject: Subject) -> Option:
    """``design`` with what to expect of it."""
    rows = planned(design, subject)
    expected = foresee(
        rows,
        subject.eta,
        subject.k,
        exterior_ior=subject.exterior_ior,
        priors=subject.priors,
        nuisances=sigmas(subject, float(rows.value.max())),
    )
    return Option(design, expected)


def recommended(found: Plan) -> Option:
    """The best option of all; the one that needs least where more equipment adds less than a tenth."""
    floor = min(o.expected.worst for o in found.best)
    if math.isinf(floor):
        return found.best[0]
    return next(o for o in found.best if o.expected.worst <= 1.1 * floor)


def _check(eta: float, k: float, wavelength_nm: float, frames: int) -> None:
    try:
        checked_index(eta, k)
    except ValueError as error:
        raise ReflectanceFitError(str(error)) from error
    if not (ETA_PRIOR[0] <= eta <= ETA_PRIOR[1] and k <= K_PRIOR[1]):
        low, high = ETA_PRIOR
        raise ReflectanceFitError(
            f"a fit looks for eta from {low:g} to {high:g} and k up to {K_PRIOR[1]:g}; plan for an index in there"
        )
    if not WAVELENGTHS_NM[0] <= wavelength_nm <= WAVELENGTHS_NM[1]:
        low, high = WAVELENGTHS_NM
        raise ReflectanceFitError(f"the wavelength must be from {low:g} to {high:g} nm")
    if frames < min(kind.frames for kind in KINDS):
        raise ReflectanceFitError("one photograph has no other to compare with; plan at least 2 frames")


def _camera_noise(level: NoiseLevel) -> float:
    """Relative noise of the mean over a region of the synthetic camera's picture, green channel."""
    sensor = SENSORS[level]
    electrons = _FILLED * sensor.largest_e
    variance = electrons + sensor.read_noise_e**2 + sensor.gain_e_per_dn**2 / 12
    pixels = sensor.width * sensor.height * _REGION * _GREEN
    return short(math.sqrt(variance / pixels) / electrons, 3)


def best_option(kind: Kind, frames: int, subject: Subject) -> Option:
    """For the worse of eta and k; for eta alone where k is not to be told."""
    found = option(best(kind, frames, subject, with_k=True), subject)
    if subject.k > 0 and found.expected.k_sd is None:
        found = option(best(kind, frames, subject, with_k=False), subject)
    return found
