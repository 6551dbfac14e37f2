"""What is free in a fit: a model with its nuisances, as coordinates.

A dielectric has k = 0, a conductor eta and k; fixed_k and fixed_eta take one of
the two as known and solve for the other.

A coordinate vector x holds the free parameters only, each in the coordinate
of its prior (log eta, k, nuisances, log sigma).  ``full`` spreads x over the
kernel's parameter vector.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import ETA, FIRST_NUISANCE, FIRST_SIGMA, K, neutral_vector
from reflectance_fit.inference.rows import LAST_POWER, Rows
from reflectance_fit.priors import NUISANCES, Prior

FloatArray = NDArray[np.float64]

# What each model solves for, simplest first.
FREE = {"dielectric": ("eta",), "fixed_k": ("eta",), "fixed_eta": ("k",), "conductor": ("eta", "k")}
_PLACES = {"eta": ETA, "k": K}


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """The free parameters of one fit, in order, with their priors.

    ``names``: eta, k or both, nuisances, and ``sigma[QUANTITY]`` for each
    quantity of which no sigma was stated.  ``places`` are their indices in the
    kernel's vector, ``template`` that vector with everything else fixed.
    """

    name: str
    names: tuple[str, ...]
    priors: tuple[Prior, ...]
    places: NDArray[np.int64]
    template: FloatArray

    def full(self, x: FloatArray) -> FloatArray:
        """Coordinates, shape (D, P) or (P,), to kernel vectors, shape (D, M)."""
        x = np.atleast_2d(x)
        vectors = np.empty((len(x), len(self.template)))
        vectors[:] = self.template
        vectors[:, self.places] = x
        for j, place in enumerate(self.places.tolist()):
            # The kernel itself takes log(sigma).
            if place < FIRST_SIGMA and self.priors[j].kind == "log_uniform":
                np.exp(x[:, j], out=vectors[:, place])
        return vectors

    def log_prior(self, x: FloatArray) -> FloatArray:
        """Log prior density of coordinates of shape (D, P), up to a constant."""
        return np.asarray(sum(prior.log_density(x[:, j]) for j, prior in enumerate(self.priors)))

    def in_report_units(self, x: FloatArray) -> dict[str, FloatArray]:
        """Name -> values, from coordinates of shape (..., P)."""
        return {
            name: prior.from_coordinate(x[..., j])
            for j, (name, prior) in enumerate(zip(self.names, self.priors, strict=True))
        }

    def samples(self, x: FloatArray) -> dict[str, FloatArray]:
        """``in_report_units`` with eta and k in every case, the one that is known as a constant."""
        index = {name: np.full(x.shape[:-1], self.template[place]) for name, place in _PLACES.items()}
        return index | self.in_report_units(x)

    @property
    def penalised(self) -> list[int]:
        """The coordinates whose prior is normal: each such prior counts as a datum."""
        return [j for j, prior in enumerate(self.priors) if prior.kind == "normal"]

    @property
    def ranges(self) -> FloatArray:
        """Search range of each coordinate, shape (P, 2): a normal prior's 8 sigma, clipped."""
        return search_ranges(self.priors)


def search_ranges(priors: Sequence[Prior]) -> FloatArray:
    """``Model.ranges`` of any priors, shape (P, 2)."""
    return np.array([_range(prior) for prior in priors])


def _range(prior: Prior) -> tuple[float, float]:
    low, high = prior.coordinate_range
    if prior.kind == "normal":
        return max(low, prior.mean - 8 * prior.sigma), min(high, prior.mean + 8 * prior.sigma)
    return low, high


def candidates(priors: Mapping[str, Prior]) -> tuple[str, ...]:
    """The models that the priors of eta and k leave to choose from, simplest first."""
    if priors["eta"].kind == "fixed":
        return ("fixed_eta",)
    if priors["k"].kind == "fixed":
        return ("fixed_k",) if priors["k"].low > 0 else ("dielectric",)
    return ("dielectric", "conductor")


def build(
    name: str,
    rows: Rows,
    priors: Mapping[str, Prior],
    nuisances: Mapping[str, float],
    estimated: list[str],
) -> Model:
    """The model ``name`` with the given nuisances (name -> sigma of the prior).

    ``estimated`` names the quantities whose sigma is to be found.
    """
    names = list(FREE[name])
    chosen = [priors[n] for n in names]
    places = [_PLACES[n] for n in names]
    template = neutral_vector(len(estimated))
    for index, place in _PLACES.items():
        if index not in names and name != "dielectric":
            template[place] = priors[index].low
    for nuisance, sigma in nuisances.items():
        names.append(nuisance)
        chosen.append(_nuisance_prior(nuisance, sigma, rows))
        places.append(FIRST_NUISANCE + NUISANCES[nuisance].index)
    for j, quantity in enumerate(estimated):
        scale = _scale(rows, j)
        names.append(f"sigma[{quantity}]")
        chosen.append(Prior("log_uniform", 1e-6 * scale, 10 * scale))
        places.append(FIRST_SIGMA + j)
    return Model(name, tuple(names), tuple(chosen), np.array(places), template)


def _nuisance_prior(name: str, sigma: float, rows: Rows) -> Prior:
    """Of a polarizer that is not taken for ideal, the diattenuation may be larger than stated: up to 1 in all."""
    prior = NUISANCES[name].prior(sigma)
    return replace(prior, high=1.0 / float(rows.diattenuation.max())) if name == "diattenuation" else prior


def _scale(rows: Rows, estimated: int) -> float:
    """The largest value among the rows of one estimated sigma; 90 degrees for psi and delta."""
    members = rows.estimated == estimated
    if np.all(rows.code[members] > LAST_POWER):
        return 90.0 if np.max(np.abs(rows.value[members])) > 1.5 else 1.0
    return float(np.max(np.abs(rows.value[members]))) or math.ulp(1.0)
