"""The same posterior with emcee's defaults and a likelihood in numpy, one vector at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import emcee
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.priors import ETA_PRIOR, K_PRIOR

FloatArray = NDArray[np.float64]

WALKERS = 32
_BURN_IN = 0.2  # of the steps
_BALL = 0.01  # radius of the first walkers, relative to the optimum


@dataclass(frozen=True, slots=True)
class Naive:
    """Signals along s and p at ``theta_deg``, and their sigmas; parameters eta, k, offset in degrees, two gains."""

    theta_deg: FloatArray
    signal_s: FloatArray
    signal_p: FloatArray
    sigma_s: FloatArray
    sigma_p: FloatArray
    offset_sigma_deg: float

    def log_posterior(self, x: FloatArray) -> float:
        eta, k, offset, gain_s, gain_p = x
        if not (ETA_PRIOR[0] <= eta <= ETA_PRIOR[1] and K_PRIOR[0] <= k <= K_PRIOR[1]):
            return -math.inf
        if gain_s <= 0 or gain_p <= 0:
            return -math.inf
        theta = np.radians(self.theta_deg + offset)
        cos, sin = np.cos(theta), np.sin(theta)
        index = eta + 1j * k
        root = np.sqrt(index**2 - sin**2)
        r_s = np.abs((cos - root) / (cos + root)) ** 2
        r_p = np.abs((index**2 * cos - root) / (index**2 * cos + root)) ** 2
        chi2 = np.sum(((self.signal_s - gain_s * r_s) / self.sigma_s) ** 2)
        chi2 += np.sum(((self.signal_p - gain_p * r_p) / self.sigma_p) ** 2)
        prior = -math.log(eta) - math.log(gain_s) - math.log(gain_p)
        return float(prior - 0.5 * chi2 - 0.5 * (offset / self.offset_sigma_deg) ** 2)

    def sample(self, best: FloatArray, *, steps: int, seed: int) -> FloatArray:
        """Chains after burn-in, shape (step, walker, parameter)."""
        generator = np.random.RandomState(seed)
        start = best * (1 + _BALL * generator.standard_normal((WALKERS, len(best))))
        start[:, 1] = np.abs(start[:, 1])
        sampler = emcee.EnsembleSampler(WALKERS, len(best), self.log_posterior)
        state = emcee.State(start, random_state=generator.get_state())
        sampler.run_mcmc(state, steps, progress=False)
        return np.asarray(sampler.get_chain(discard=int(_BURN_IN * steps)))
