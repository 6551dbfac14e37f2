"""Eight faults that tests of a posterior must catch, planted one at a time, before the same judges as the healthy fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from unittest import mock

import numpy as np
from card import Figure, Table
from inference_calibration import Trial, caught, trial
from inference_captures import DEFAULT_PRIORS, SEED, FloatArray, photographed, searched
from inference_families import FAMILIES, Family
from inference_quadrature import SCENES, against_grid
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.inference import ladder, posterior
from reflectance_fit.observations import Observations
from reflectance_fit.physics import fresnel
from reflectance_fit.priors import Prior

ComplexPair = tuple[NDArray[np.complex128], NDArray[np.complex128]]

SIGMA_FACTOR = 1.1
BLACK_ERROR = 2.0  # in units of sigma
SHIFT_DEG = 0.3
OTHER_GAIN = 1.03

_BY_NAME = {family.name: family for family in FAMILIES}
# In little light k is open over its prior, so that a prior of the wrong shape shows.
DIM = replace(_BY_NAME["absorbing plastic"], name="absorbing plastic in little light", gains=(30.0, 300.0))


class SquaredUniform(Prior):
    """k uniform in k^2: what a fit that moves in k^2 and forgets 2 k dk takes for uniform in k."""

    __slots__ = ()

    def from_coordinate(self, x: ArrayLike) -> FloatArray:
        share = (np.asarray(x) - self.low) / (self.high - self.low)
        return np.asarray(np.sqrt(self.low**2 + share * (self.high**2 - self.low**2)))


def _conjugate(c: ArrayLike, eta: ArrayLike, k: ArrayLike) -> ComplexPair:
    r_s, r_p = fresnel.amplitudes(c, eta, k)
    return np.conj(r_s), np.conj(r_p)


def _swapped(c: ArrayLike, eta: ArrayLike, k: ArrayLike) -> ComplexPair:
    r_s, r_p = fresnel.amplitudes(c, eta, k)
    return r_p, r_s


Arguments = tuple[Observations, Mapping[str, float], float, np.random.Generator]


def _quieter(*arguments: *Arguments) -> Observations:
    o, *others = arguments
    return replace(photographed(replace(o, sigma=o.sigma / SIGMA_FACTOR), *others), sigma=o.sigma)


def _black(*arguments: *Arguments) -> Observations:
    o = photographed(*arguments)
    return replace(o, value=o.value + BLACK_ERROR * o.sigma)


def _turned(*arguments: *Arguments) -> Observations:
    o, *others = arguments
    taken = photographed(replace(o, theta_deg=o.theta_deg + SHIFT_DEG), *others)
    return replace(taken, theta_deg=o.theta_deg)


def _two_lamps(*arguments: *Arguments) -> Observations:
    brighter = np.where(arguments[0].quantity == "signal_p", OTHER_GAIN, 1.0)
    return photographed(*arguments, gain_of_row=brighter)


@dataclass(frozen=True, slots=True)
class Fault:
    """What is wrong, in the captures or in where truths come from, and on which family it is tried."""

    name: str
    family: Family
    capture: Callable[..., Observations] = photographed
    truths: Family | None = None
    share: int = 1  # of the trials that the others get

    def trials(self, n: int) -> int:
        return self.share * n


FAULTS = (
    Fault("sign of k", _BY_NAME["near Brewster"], partial(photographed, amplitudes=_conjugate)),
    Fault("s and p swapped", DIM, partial(photographed, amplitudes=_swapped)),
    # The smallest of them: its signature is the log-likelihood, to which all of the metal's four
    # coordinates contribute; it needs as many truths as the calibration itself.
    Fault(f"sigma x {SIGMA_FACTOR:g}", _BY_NAME["metal"], _quieter, share=5),
    Fault(f"black level off by {BLACK_ERROR:g} sigma", _BY_NAME["sparse angles"], _black),
    Fault(
        "dropped Jacobian of k^2",
        DIM,
        truths=replace(DIM, priors={**DIM.priors, "k": SquaredUniform("uniform", 0.0, DIM.priors["k"].high)}),
    ),
    Fault(f"angles shifted by {SHIFT_DEG:g} deg", _BY_NAME["sparse angles"], _turned),
    Fault(f"two gains {OTHER_GAIN - 1:.0%} apart in one group", _BY_NAME["sparse angles"], _two_lamps),
)
TRUNCATED = "truncated chain"


def planted(fault: Fault, number: int) -> Trial:
    """One trial with the fault."""
    return trial(fault.family, "importance", number, fault.capture, fault.truths)


def control(number: int) -> Trial:
    """One healthy trial of the only family that the calibration has not."""
    return trial(DIM, "importance", number)


def truncated(number: int) -> str:
    """What the comparison of a scene with a grid finds of emcee stopped after its first steps.

    Whether the run says itself that it did not converge is told, not judged.
    """
    scene = SCENES[number]
    o = scene.rows()
    model, rows, _, basins = searched(scene.model, o, DEFAULT_PRIORS, scene.nuisances)
    with mock.patch.multiple(posterior, BLOCK=4, MAX_STEPS=8):
        run = ladder.draw(model, rows, basins, "emcee", (SEED,), min_ess=1000.0)
    comparisons = against_grid(o, model, [replace(run, converged=True)])
    worst = max(comparisons, key=lambda one: one.variation)
    said = "says itself that it has not converged" if not run.converged else "says that it converged"
    return "" if worst.good else f"total variation of {worst.parameter} {worst.variation:.2f}; {said}"


def fault_figures(
    found: Mapping[str, Sequence[Trial]], healthy: Mapping[str, Sequence[Trial]], of_truncated: str
) -> Iterator[Figure | Table]:
    """Caught faults, and what the same judge says of as many healthy trials of the same families."""
    rows, caught_faults, false = [], [], []
    for fault in FAULTS:
        trials = found[fault.name]
        verdict = caught(fault.family, trials)
        clean = caught(fault.family, healthy[fault.family.name][: len(trials)])
        rows.append((fault.name, fault.family.name, f"{len(trials)}", verdict or "-", clean or "-"))
        caught_faults += [fault.name] * bool(verdict)
        false += [f"{fault.family.name} ({clean})"] * bool(clean)
    rows.append((TRUNCATED, SCENES[0].name, "1", of_truncated or "-", "see emcee against a grid"))
    caught_faults += [TRUNCATED] * bool(of_truncated)
    names = [*(fault.name for fault in FAULTS), TRUNCATED]
    missed = [name for name in names if name not in caught_faults]
    yield Figure.judged(
        "planted faults caught",
        f"{len(caught_faults)} of {len(names)}" + (f"; missed: {', '.join(missed)}" if missed else ""),
        "all",
        not missed,
    )
    yield Figure.judged(
        "the same trials without a fault, caught",
        f"{len(set(false))} of {len({fault.family.name for fault in FAULTS})} families"
        + (f": {', '.join(sorted(set(false)))}" if false else ""),
        "0",
        not false,
    )
    yield Table("Planted faults", ("fault", "scenes", "N", "caught by", "without the fault"), tuple(rows))
