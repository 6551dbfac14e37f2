"""From Fisher information to what a report may be expected to say, and to what it cannot say.

eta, the angles and a clear k come from the information's covariance.  Near
k = 0 that fails: what an analyzer sees is even in k, its first derivative
vanishes, and yet k has an upper limit.  So k's expected posterior is taken
along its whole range, exact in k, with everything else following linearly.
The statuses are those of a fit (``identify``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.fisher import Information, information, one_equation, posterior_covariance
from reflectance_fit.inference.forward import K
from reflectance_fit.inference.identify import AT_BOUND, UNINFORMED_SHARE, interval
from reflectance_fit.observations import Observations
from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.priors import Prior
from reflectance_fit.result import Interval

FloatArray = NDArray[np.float64]

# A 95 % interval is 3.92 sd wide and a flat prior sqrt(12) of its own: a direction whose sd is this share
# of the prior's has the width at which a fit calls a parameter not identified.
BLIND = UNINFORMED_SHARE * math.sqrt(12) / 3.92
# Below this relative sd a fit finds k identified: its 2.5 % quantile is clear of 0.
AWAY_FROM_0 = (1 - AT_BOUND) / 1.96
_ALONG_AN_AXIS = 0.95
_QUANTILES = (np.arange(4000) + 0.5) / 4000
_STEP = 1e-5


@dataclass(frozen=True, slots=True)
class Foresight:
    """What a report on a material of index eta + ik may be expected to say.

    ``eta_sd``, ``k_sd`` and ``brewster_sd_deg`` are standard deviations,
    None where the status forbids one; ``k_limit`` is the one-sided 95 % limit
    of a k that cannot be told from 0.  ``correlation`` is of log(eta) and k,
    None where k is 0.  ``cannot`` says in words what stays unknown.
    """

    eta: float
    k: float
    brewster_deg: float
    eta_sd: float | None
    k_sd: float | None
    k_limit: float | None
    brewster_sd_deg: float | None
    correlation: float | None
    eta_status: str
    k_status: str
    cannot: tuple[str, ...]

    @property
    def worst(self) -> float:
        """The larger relative sd of eta and k, of eta alone where k has none; inf without either."""
        if self.eta_sd is None or (self.k_sd is None and self.k_status != "upper_limit"):
            return math.inf
        eta = self.eta_sd / self.eta
        return eta if self.k_sd is None else max(eta, self.k_sd / self.k)


def foresee(
    observations: Observations,
    eta: float,
    k: float,
    *,
    exterior_ior: float,
    priors: Mapping[str, Prior],
    nuisances: Mapping[str, float],
) -> Foresight:
    """What a fit of ``observations`` would say, were the truth eta + ik and the nuisances neutral.

    Arguments as for ``fisher.information``; ``priors`` holds eta and k.  For
    k = 0 eta is that of the dielectric, which a fit prefers there.
    """
    both = information(observations, eta, k, exterior_ior=exterior_ior, priors=priors, nuisances=nuisances)
    covariance = both.covariance("eta", "k")
    draws = _k_draws(both, eta, k, priors["k"], math.sqrt(covariance[1, 1]))
    k_found = interval(draws, priors["k"], bounded=True)
    correlation = None
    if k == 0:
        without = [i for i, name in enumerate(both.names) if name != "k"]
        matrix = both.matrix[np.ix_(without, without)]
        covariance = np.diag([posterior_covariance(matrix, both.prior_sd[without])[0, 0], 0.0])
    else:
        correlation = float(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]))
    eta_sd, slope = math.sqrt(covariance[0, 0]), _brewster_slope(eta, k, exterior_ior)
    low, high = priors["eta"].coordinate_range
    # In log(eta), where a sd beyond the prior's width must not become infinite.
    eta_known = 3.92 * eta_sd <= UNINFORMED_SHARE * (high - low)
    if one_equation(both):
        # Priors make a curve's ends look like knowledge, and k = 0 would be taken for granted.
        eta_known, k_found = False, Interval(None, None, None, None, "not_identified")
    angle_sd = math.sqrt(slope @ covariance @ slope)
    limit = k_found.ci95[1] if k_found.status == "upper_limit" and k_found.ci95 else None
    return Foresight(
        eta=eta,
        k=k,
        brewster_deg=float(np.degrees(brewster_angle(eta / exterior_ior, k / exterior_ior))),
        eta_sd=eta * eta_sd if eta_known else None,
        k_sd=k_found.sd,
        k_limit=limit,
        brewster_sd_deg=angle_sd if 3.92 * angle_sd <= UNINFORMED_SHARE * 90 else None,
        correlation=correlation,
        eta_status="identified" if eta_known else "not_identified",
        k_status=k_found.status,
        cannot=_in_words(both, limit, k, eta_known=eta_known, k_known=k_found.status != "not_identified"),
    )


def _k_draws(info: Information, eta: float, k: float, prior: Prior, sd: float) -> FloatArray:
    """Evenly spread quantiles of k's expected posterior.

    Where k is well away from 0 they are normal.  Else chi2(k) is that of the
    rows' change by k after everything else has followed it: least squares in
    the other columns and their priors.
    """
    from scipy.special import ndtri

    if sd < AWAY_FROM_0 * k:
        return np.asarray(np.clip(k + sd * ndtri(_QUANTILES), prior.low, prior.high))
    small = 1e-7 * math.hypot(eta, k)
    grid = np.concatenate([[prior.low, k], np.geomspace(small, prior.high, 1200), k * np.linspace(0, 5, 801)])
    grid = np.unique(np.clip(grid, prior.low, prior.high))
    vectors = np.tile(info.vector, (len(grid), 1))
    vectors[:, K] = grid
    others = [i for i, name in enumerate(info.names) if name != "k"]
    # Priors are rows too.  By projection, because the normal equations would square the noise's tiny share.
    basis, _ = np.linalg.qr(np.vstack([info.columns[:, others], np.diag(1 / info.prior_sd[others])]))
    change = np.pad(info.difference(vectors), ((0, 0), (0, len(others))))
    for _ in range(2):
        change -= (change @ basis) @ basis.T
    chi2 = np.sum(change**2, axis=1)
    density = np.exp(-0.5 * (chi2 - chi2.min()))
    mass = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
    return np.asarray(np.interp(_QUANTILES, mass / mass[-1], grid))


def _brewster_slope(eta: float, k: float, exterior_ior: float) -> FloatArray:
    """Derivative of the angle of the smallest R_p, degrees, by log(eta) and by k; 0 by k at k = 0, where it is even."""
    step = _STEP * math.hypot(eta, k)
    points = np.array(
        [
            (eta * math.exp(_STEP), k),
            (eta * math.exp(-_STEP), k),
            (eta, k + step),
            (eta, abs(k - step)),
        ]
    )
    angle = np.degrees(brewster_angle(*(points / exterior_ior).T))
    return np.array([(angle[0] - angle[1]) / (2 * _STEP), (angle[2] - angle[3]) / (2 * step)])


def _in_words(
    info: Information, limit: float | None, k: float, *, eta_known: bool, k_known: bool
) -> tuple[str, ...]:
    """What the rows leave open: the directions of (log eta, k) whose sd stays near the prior's."""
    scale = info.prior_sd[:2]
    values, vectors = np.linalg.eigh(info.covariance("eta", "k") / np.outer(scale, scale))
    blind = np.sqrt(values) > BLIND
    along_eta, along_k = np.abs(vectors[:, -1])
    if one_equation(info):
        known = "k = 0 is taken for granted" if k == 0 else "the other is known"
        return (f"one equation for two unknowns: {'eta' if k == 0 else 'each of eta and k'} only if {known}",)
    if limit is not None and eta_known:
        return (f"k cannot be told from 0: only an upper limit of about {limit:.2g}",)
    if blind.all():
        return ("neither eta nor k: these rows say next to nothing about the material",)
    if blind.any() and max(along_eta, along_k) < _ALONG_AN_AXIS:
        return ("eta and k apart: only a curve of pairs that fit alike",)
    words = [name for name, known in (("eta", eta_known), ("k", k_known)) if not known]
    return (f"{' and '.join(words)} cannot be told",) if words else ()
