"""Differential evolution for several ensembles of walkers in one emcee sampler.

emcee spends more time on a step than our likelihood does.  Stacked, the
ensembles share that time; a proposal looks at its own ensemble only, so they
stay as independent as in samplers of their own.
"""

from __future__ import annotations

import math
from typing import Any

import emcee
import numpy as np

_JITTER = 1e-5  # of gamma, relative; without it a walker could reach a lattice of points only


class SeparateEnsembles(emcee.moves.Move):  # type: ignore[misc]
    """emcee's differential-evolution move, inside each of ``ensembles`` equal blocks of walkers.

    A walker tries a step gamma (b - c), with b and c two walkers of the other
    half of its ensemble, the halves drawn anew at every step.  ``gamma`` is
    2.38 / sqrt(2 P) unless given; 1 carries a walker from mode to mode.

    Notes
    -----
    Ter Braak, Stat. Comput. 16 (2006) 239; halves as in Nelson et al., ApJS 210
    (2014) 11.  The proposal is symmetric: the acceptance is the ratio of densities.
    """

    def __init__(self, ensembles: int, gamma: float | None = None) -> None:
        self.ensembles = ensembles
        self.gamma = gamma

    def propose(self, model: Any, state: Any) -> tuple[Any, Any]:
        """One step of every walker; the interface of ``emcee.moves.Move``."""
        random = model.random
        walkers, dimensions = state.coords.shape
        size = walkers // self.ensembles
        gamma = self.gamma or 2.38 / math.sqrt(2 * dimensions)
        shuffled = np.argsort(random.rand(self.ensembles, size), axis=1)
        shuffled += size * np.arange(self.ensembles)[:, None]
        halves = shuffled[:, : size // 2], shuffled[:, size // 2 :]
        accepted = np.zeros(walkers, dtype=bool)
        for moving, resting in (halves, halves[::-1]):
            choices = resting.shape[1]
            first = random.randint(choices, size=moving.shape)
            second = (first + random.randint(1, choices, size=moving.shape)) % choices
            b, c = (np.take_along_axis(resting, pick, axis=1).ravel() for pick in (first, second))
            own = moving.ravel()
            stretch = gamma * (1 + _JITTER * random.standard_normal((len(own), 1)))
            tried = state.coords[own] + stretch * (state.coords[b] - state.coords[c])
            density = model.log_prob_fn(tried)
            # The logarithm of a uniform number is minus an exponential one.
            better = density - state.log_prob[own] > -random.standard_exponential(len(own))
            state.coords[own[better]] = tried[better]
            state.log_prob[own[better]] = density[better]
            accepted[own] = better
        return state, accepted
