"""Fisher information: how sharply observations, taken or only planned, can tell eta, k and the nuisances.

The rows of a fit are y = g f(eta, k, nuisances) + b + noise (``likelihood``).
Around one point the model is a plane, and with normal noise of covariance S
the information is F = J^T S^-1 J, J the rows' derivatives.  S is
diag(sigma^2) and, for each goniometer setting, sigma_theta^2 v v^T; that S
itself moves with the parameters is left out, which underrates F by a share of
order 1/N.  A gain of prior 1/g is flat in log g: its column is projected out.
Priors are informations too, so the posterior's covariance
(F + diag(1/sd^2))^-1 exists whatever the rows are blind to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import ETA, FIRST_NUISANCE, K, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import Rows, gain_names, pack, wrapped
from reflectance_fit.observations import Observations
from reflectance_fit.physics.domain import checked_index
from reflectance_fit.priors import NUISANCES, Prior

FloatArray = NDArray[np.float64]

# A source of a little linear polarization is a point in the plane (S1, S2) around the origin, where degree and
# azimuth have no derivative.
_S1, _S2 = "source_s1", "source_s2"
# Of the coordinates; the model's third derivatives leave an error of order step^2, rounding one of 1e-16 / step.
# In dark, diffuse, diattenuation, S1 and S2 it is linear.
_STEPS = {"eta": 1e-5, "angle_offset_deg": 1e-3, "analyzer_offset_deg": 1e-3}
_LINEAR_STEP = 1e-3
_K_STEP = 1e-5  # of |eta + ik|
_APART = 0.1  # of |eta + ik|: far enough from k = 0 for rows that are even in k
_SAME_DIRECTION = (
    1e-10  # of a squared length: the finite differences' error is far below, any second angle far above
)
_LEAST = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """What N rows say about P coordinates around one point, gains projected out.

    ``names`` are the coordinates: eta stands for log(eta); ``source_s1`` and
    ``source_s2`` for degree and azimuth of the source's polarization.
    ``derivatives`` (N, P) are those of the rows, ``columns`` (N, P) the same in units of their noise,
    ``prior_sd`` (P,) the standard deviations of the priors.
    ``rows``, ``vector`` and ``gains`` are the model's point, ``whitening`` (N, N)
    turns differences of rows into units of noise, gains projected out.
    """

    names: tuple[str, ...]
    derivatives: FloatArray
    columns: FloatArray
    prior_sd: FloatArray
    rows: Rows
    vector: FloatArray
    gains: FloatArray
    whitening: FloatArray

    @property
    def matrix(self) -> FloatArray:
        """Of the rows alone, without priors, shape (P, P)."""
        return np.asarray(self.columns.T @ self.columns)

    def covariance(self, *names: str) -> FloatArray:
        """Of the posterior in the coordinates ``names``, everything else integrated out; default: all."""
        places = [self.names.index(name) for name in names or self.names]
        return posterior_covariance(self.matrix, self.prior_sd)[np.ix_(places, places)]

    def difference(self, vectors: FloatArray) -> FloatArray:
        """How far full parameter vectors, shape (D, M), are from the point in units of noise, shape (D, N)."""
        centre = predict_vectors(self.rows, self.vector[None], self.gains)
        return np.asarray(
            wrapped(self.rows, predict_vectors(self.rows, vectors, self.gains) - centre) @ self.whitening.T
        )


def posterior_covariance(matrix: FloatArray, prior_sd: FloatArray) -> FloatArray:
    """Inverse of the information (..., P, P) plus that of priors with standard deviations (P,).

    In units of the priors it is the inverse of 1 + a positive matrix, whose
    eigenvalues are 1 or more: what the data do not see keeps its prior.
    """
    values, vectors = np.linalg.eigh(matrix * np.multiply.outer(prior_sd, prior_sd))
    scaled = vectors / np.sqrt(1 + np.maximum(values, 0.0))[..., None, :]
    half = prior_sd[:, None] * scaled
    return np.asarray(half @ np.swapaxes(half, -1, -2))


def information(
    observations: Observations,
    eta: float,
    k: float,
    *,
    exterior_ior: float,
    priors: Mapping[str, Prior],
    nuisances: Mapping[str, float],
    at: Mapping[str, float] | None = None,
    gains: Mapping[str, float] | None = None,
) -> Information:
    """Fisher information of the used rows of one channel about eta, k and nuisances.

    Parameters
    ----------
    observations : Observations
        Each row with its sigma.  Of the values only the largest of each gain
        group matters: it is the unit of the nuisance ``diffuse``.
    eta, k : float
        The point, relative to vacuum; k may be 0.
    exterior_ior : float
        Index around the sample.
    priors : mapping
        Of ``eta`` and, where k is free, ``k``.
    nuisances : mapping
        Name to the sigma of its prior, inf for flat.  A prior's physical
        bounds are no information here, so a nuisance that is 0 at its bound is
        taken for twice as uncertain as it is.
    at, gains : mapping or None
        Values of nuisances and of gain groups; default: neutral, and 1.

    Raises
    ------
    ValueError
        If a row has no sigma, eta is not positive or k negative.
    """
    checked_index(eta, k)
    o = observations.used
    if np.any(np.isnan(o.sigma)):
        raise ValueError("every row needs a sigma: state it, or take the one that a fit estimated")
    rows = pack(o, exterior_ior)
    vector = neutral_vector()
    vector[ETA], vector[K] = eta, k
    for name, value in (at or {}).items():
        vector[FIRST_NUISANCE + NUISANCES[name].index] = value
    gain_values = np.array([(gains or {}).get(name, 1.0) for name in gain_names(o)])
    prior_sd = {name: _flat_sd(prior) for name, prior in priors.items()} | _nuisance_sds(nuisances)
    names = tuple(prior_sd)
    derivatives = _derivatives(rows, vector, gain_values, (*names, "angle_offset_deg"))
    whitening = _whitening(rows, vector, gain_values, np.degrees(derivatives[:, -1]))
    return Information(
        names=names,
        derivatives=derivatives[:, :-1],
        columns=whitening @ derivatives[:, :-1],
        prior_sd=np.array(list(prior_sd.values())),
        rows=rows,
        vector=vector,
        gains=gain_values,
        whitening=whitening,
    )


def one_equation(info: Information) -> bool:
    """Whether eta and k move the rows in one and the same direction, gains aside: however low the noise.

    Looked at where k is not small: rows that are even in k do not move at k = 0.
    """
    vector = info.vector.copy()
    vector[K] = max(vector[K], _APART * math.hypot(vector[ETA], vector[K]))
    derivatives = _derivatives(info.rows, vector, info.gains, ("eta", "k", "angle_offset_deg"))
    whitening = _whitening(info.rows, vector, info.gains, np.degrees(derivatives[:, -1]))
    by_eta, by_k = (whitening @ derivatives[:, :2]).T
    rest = by_k - by_eta * (by_eta @ by_k) / max(by_eta @ by_eta, _LEAST)
    return bool(rest @ rest <= _SAME_DIRECTION * (by_k @ by_k))


def _flat_sd(prior: Prior) -> float:
    """Standard deviation of a prior of eta, as log(eta), or of k."""
    if prior.kind == "normal":
        return prior.sigma
    low, high = prior.coordinate_range
    return (high - low) / math.sqrt(12)


def _nuisance_sds(nuisances: Mapping[str, float]) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, sigma in nuisances.items():
        if name == "source_dolp":
            # A normal degree of flat azimuth has half its variance along each axis.
            free = "source_azimuth_deg" in nuisances
            found |= dict.fromkeys((_S1, _S2), sigma / math.sqrt(2)) if free else {_S1: sigma}
        elif name != "source_azimuth_deg":
            found[name] = _flat_sd(NUISANCES[name].prior(sigma))
    return found


def _derivatives(rows: Rows, vector: FloatArray, gains: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """Derivative of every row by each coordinate, shape (N, P), by differences of second order."""
    stencils = []
    for name in names:
        step = _STEPS.get(name, _LINEAR_STEP)
        if name == "k":
            step = _K_STEP * math.hypot(vector[ETA], vector[K])
        if name == "k" and vector[K] < step:
            # There is no model below k = 0.  Rows that are even in k have exactly 0 here: -3 f + 4 f - f.
            stencils.append([(4 / (2 * step), step), (-1 / (2 * step), 2 * step)])
        else:
            stencils.append([(1 / (2 * step), step), (-1 / (2 * step), -step)])
    moved = np.array(
        [_moved(vector, n, d) for n, points in zip(names, stencils, strict=True) for _, d in points]
    )
    values = predict_vectors(rows, np.vstack([vector, moved]), gains)
    change = wrapped(rows, values[1:] - values[0])
    weights = np.array([weight for points in stencils for weight, _ in points])
    return np.asarray((change * weights[:, None]).reshape(len(names), 2, -1).sum(axis=1).T)


def _moved(vector: FloatArray, name: str, amount: float) -> FloatArray:
    """The vector with one coordinate moved."""
    v = vector.copy()
    if name == "eta":
        v[ETA] *= math.exp(amount)
    elif name == "k":
        v[K] += amount
    elif name in (_S1, _S2):
        degree, azimuth = (FIRST_NUISANCE + NUISANCES[n].index for n in ("source_dolp", "source_azimuth_deg"))
        twice = 2 * math.radians(v[azimuth])
        s1 = v[degree] * math.cos(twice) + (amount if name == _S1 else 0.0)
        s2 = v[degree] * math.sin(twice) + (amount if name == _S2 else 0.0)
        v[degree], v[azimuth] = math.hypot(s1, s2), math.degrees(math.atan2(s2, s1)) / 2
    else:
        v[FIRST_NUISANCE + NUISANCES[name].index] += amount
    return v


def _whitening(rows: Rows, vector: FloatArray, gains: FloatArray, slope: FloatArray) -> FloatArray:
    """S^-1/2 without the directions of the gains, shape (N, N); ``slope`` (N,) is by theta in radians."""
    n = len(rows.value)
    white = np.diag(1 / rows.sigma)
    if rows.errors_in_angle:
        v = rows.theta_sigma * slope
        together = np.outer(v, v) * (rows.setting[:, None] == rows.setting)
        white = np.linalg.inv(np.linalg.cholesky(np.diag(rows.sigma**2) + together))
    if not rows.gains:
        return np.asarray(white)
    reflected = predict_vectors(rows, vector[None], gains) - predict_vectors(rows, vector[None], 0 * gains)
    members = rows.gain[:, None] == np.arange(rows.gains)
    # A group of rows that are all 0 has no direction to take away.
    left, strength, _ = np.linalg.svd(white @ (reflected.T * members), full_matrices=False)
    basis = left[:, strength > n * np.finfo(float).eps * strength.max(initial=0.0)]
    return np.asarray(white - basis @ (basis.T @ white))
