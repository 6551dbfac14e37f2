"""What a fit hands on: frozen data, no behaviour beyond reading it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.observations import Observations
from reflectance_fit.priors import Prior

FloatArray = NDArray[np.float64]
Noise = Literal["normal", "student_t"]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One model that was tried, at its optimum."""

    name: str  # dielectric | conductor | fixed_k | fixed_eta
    parameters: int
    chi2: float  # of student_t, like dof, without outliers
    dof: int
    bic: float
    nuisances: tuple[str, ...] = ()
    noise: Noise = "normal"
    elpd_loo: float | None = None  # of the chosen one and its rival


@dataclass(frozen=True, slots=True)
class LeaveOneOut:
    """How much better the chosen model foretells rows left out than its ``rival``: elpd, standard error, Pareto k."""

    rival: str
    elpd_difference: float
    se: float
    pareto_k: float

    @property
    def trusted(self) -> bool:
        return self.pareto_k <= 0.7

    @property
    def agrees(self) -> bool:
        """Unless the rival is clearly better (Sivula et al. 2020), by weights that can be trusted."""
        return not (self.trusted and self.elpd_difference < -max(4.0, 2.0 * self.se))


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """The best point found for one model, and how the data stand to it.

    ``predicted``, ``sigma`` and ``residuals`` have one entry per observation:
    the model value in the observation's own unit (gain applied), the standard
    deviation with the angle's share included, and (value - predicted) / sigma.
    ``parameters`` maps the names that were free (eta, k, nuisances) to their
    best values in report units; ``gains`` maps each gain group to its gain.
    """

    model: str
    parameters: dict[str, float]
    eta: float
    k: float
    gains: dict[str, float]
    objective: float  # -2 log likelihood, priors of nuisances included, up to a constant
    chi2: float
    dof: int
    bic: float
    predicted: FloatArray
    sigma: FloatArray
    residuals: FloatArray
    optimizer: str
    nan_count: int

    @property
    def reduced_chi2(self) -> float | None:
        return self.chi2 / self.dof if self.dof > 0 else None


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """How an ensemble sampler ran.

    ``tau_steps`` and ``tau`` trace the autocorrelation time (emcee's estimate,
    the largest over parameters) as the run went on.  ``trace`` is the
    unthinned mean over walkers, shape (ensemble, step, parameter), in the order
    of the parameters' names.
    """

    steps: int
    burn_in: int
    acceptance: float
    rhat_nested: dict[str, float]
    tau_steps: FloatArray
    tau: FloatArray
    trace: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Samples of one model's posterior, and how far to trust them.

    ``samples`` maps each free parameter ("eta", "k", "angle_offset_deg", ...)
    to an array of shape (chain, draw); k is present and zero for dielectrics.
    ``log_density`` has the same shape.  ``ensemble`` gives each chain's
    ensemble (int, shape (chain,)): walkers of one ensemble are not independent,
    the ensembles are.  ``chains`` tells how emcee ran, ``pareto_k`` the tail
    index of importance weights; each is None for the other methods.
    """

    model: str
    method: Literal["emcee", "importance", "laplace"]
    names: tuple[str, ...]
    samples: dict[str, FloatArray]
    log_density: FloatArray
    ensemble: NDArray[np.int64]
    ess: dict[str, float]
    converged: bool
    chains: Chains | None = None
    pareto_k: float | None = None

    @property
    def ensembles(self) -> int:
        return int(self.ensemble.max()) + 1

    def flat(self, name: str) -> FloatArray:
        """All draws of one parameter, shape (chain * draw,)."""
        return self.samples[name].ravel()


@dataclass(frozen=True, slots=True)
class Interval:
    """A posterior in five numbers and a verdict; None where nothing honest can be said.

    ``status``: identified, upper_limit, not_identified, multimodal or fixed.
    """

    median: float | None
    sd: float | None
    ci68: tuple[float, float] | None
    ci95: tuple[float, float] | None
    status: str
    modes: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Shared:
    """What the channels of one fit have in common: eta = a + b / wavelength^2, the wavelength in um.

    Draws have shape (chain, draw); ``gains`` are those of all channels.
    """

    channels: tuple[str, ...]
    gains: dict[str, float]
    cauchy_a: FloatArray
    cauchy_b_um2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One independent fit: one channel's rows, the model chosen and its posterior.

    ``posterior`` belongs to the chosen model.  ``k_posterior`` is the
    conductor's, kept when k = 0 was chosen, because the upper limit of k
    comes from it; else it is None.  ``intervals`` holds eta, k, r0 and the
    angles (brewster_deg, second_brewster_deg, principal_angle_deg), and
    ``derived`` the draws behind the derived ones, shape (chain, draw).
    ``shared`` is None unless several channels lie on one dispersion curve: then
    chi2, dof and bic of the optimum are those of all of them.
    """

    channel: str
    wavelength_nm: float
    exterior_ior: float
    observations: Observations
    optimum: Optimum
    candidates: tuple[Candidate, ...]
    chosen_because: str
    posterior: Posterior
    k_posterior: Posterior | None
    intervals: dict[str, Interval]
    derived: dict[str, FloatArray]
    estimated_sigma: dict[str, float]  # quantity -> sigma, where no sigma was stated
    priors: dict[str, Prior]  # of every sampled parameter
    saturated: int  # rows of which only a bound is known, because the detector was
    refused_outliers: int = 0  # rows that stand out, but together, so that they are no outliers
    noise: Noise = "normal"
    loo: LeaveOneOut | None = None  # None where there was no rival worth it
    shared: Shared | None = None

    @property
    def p_value(self) -> float | None:
        """Chance of a chi2 this large; None where the residuals themselves gave a sigma."""
        if self.estimated_sigma or self.optimum.dof <= 0:
            return None
        from scipy.special import gammaincc

        return float(gammaincc(self.optimum.dof / 2, self.optimum.chi2 / 2))
