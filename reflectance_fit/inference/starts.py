"""Where a search begins: a grid over eta and k, a line at k = 0, and what single rows give in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import ETA, K
from reflectance_fit.inference.models import Model, search_ranges
from reflectance_fit.inference.rows import CODES, Rows
from reflectance_fit.observations import Quantity
from reflectance_fit.physics.ellipsometry import rho_from_psi_delta
from reflectance_fit.physics.inversion import eta_from_r0, index_from_rho
from reflectance_fit.physics.jit import kernel
from reflectance_fit.priors import Prior

FloatArray = NDArray[np.float64]

_ETA_POINTS, _K_POINTS, _LINE_POINTS = 13, 9, 30
_BETWEEN = (0.15, 0.6)  # of the way from one critical angle's index to the next
_MOST_ROWS = 6  # of a kind that give a start each
_NORMAL = math.cos(math.radians(25))  # within it every reflectance of a dielectric is R0 to a percent or so


class Points(NamedTuple):
    """Coordinates, shape (D, P): first ``grid`` of a grid of ``shape``, then ``line`` dielectrics, then closed forms."""

    values: FloatArray
    shape: tuple[int, ...]
    grid: int
    line: int


class _Frame(NamedTuple):
    """What starts have of the model alone.  ``eta`` is its coordinate (-1: known), ``low`` and ``high`` the ranges.

    ``evenly`` are the etas of the line that need no rows.
    """

    free: list[int]
    eta: int
    low: FloatArray
    high: FloatArray
    centre: FloatArray
    grid: FloatArray
    shape: tuple[int, ...]
    evenly: FloatArray


def points(model: Model, rows: Rows) -> Points:
    """Where a search of ``model`` may begin, nuisances at their centres."""
    frame = _frame(model.priors, tuple(model.places.tolist()))
    along = _line(model, rows, frame) if frame.eta >= 0 else frame.grid[:0]
    values = np.concatenate([frame.grid, along, _closed_forms(model, rows, frame)])
    return Points(values, frame.shape, len(frame.grid), len(along))


@lru_cache(maxsize=64)
def _frame(priors: tuple[Prior, ...], places: tuple[int, ...]) -> _Frame:
    """The grid is over log eta and k, or whichever of them is free, denser towards k = 0.

    There the reflectances depend on k^2, and weak absorbers live.
    """
    free = [j for j, place in enumerate(places) if place in (ETA, K)]
    low, high = search_ranges(priors).T
    axes = []
    for j in free:
        count = (_K_POINTS if places[j] == K else _ETA_POINTS) if len(free) == 2 else _LINE_POINTS
        axes.append(low[j] + (high[j] - low[j]) * np.linspace(0, 1, count) ** (3 if places[j] == K else 1))
    centre = np.array([prior.centre for prior in priors])
    values = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    eta = places.index(ETA) if ETA in places else -1
    grid = np.clip(_points(centre, values, free), low, high)
    evenly = np.linspace(low[eta], high[eta], _LINE_POINTS)
    return _Frame(free, eta, low, high, centre, grid, tuple(len(axis) for axis in axes), evenly)


def _line(model: Model, rows: Rows, frame: _Frame) -> FloatArray:
    """Dielectrics in order of eta, (D, P): evenly in log eta, and between the critical angles of the rows.

    With eta < 1 every angle of the data is the critical angle of some eta, where the objective has a corner: it
    may have minima of its own between any two of them, often close above the lower one.
    """
    critical = np.sort(rows.exterior_ior * np.abs(rows.sin_theta))
    logarithmic = model.priors[frame.eta].kind == "log_uniform"
    eta = _among_critical(critical, frame.evenly, logarithmic)
    found = np.empty((len(eta), len(frame.centre)))
    found[:] = frame.centre
    found[:, frame.free] = frame.low[frame.free]
    found[:, frame.eta] = eta
    return found


@kernel
def _among_critical(critical: FloatArray, evenly: FloatArray, logarithmic: bool) -> FloatArray:
    """Coordinates of eta in order: ``evenly``, and within its range two between each two ``critical`` indices.

    Both come in order.
    """
    found, count, at = np.empty(len(evenly) + 2 * len(critical)), 0, 0
    for i in range(len(critical) - 1):
        gap = critical[i + 1] - critical[i]
        for share in _BETWEEN:
            eta = critical[i] + share * gap
            x = (math.log(eta) if eta > 0 else -math.inf) if logarithmic else eta
            if gap > 0 and evenly[0] <= x <= evenly[-1]:
                while evenly[at] <= x and at < len(evenly) - 1:
                    found[count] = evenly[at]
                    at, count = at + 1, count + 1
                found[count] = x
                count += 1
    for i in range(at, len(evenly)):
        found[count] = evenly[i]
        count += 1
    return found[:count]


def closed_forms(model: Model, rows: Rows) -> FloatArray:
    """Points, shape (D, P), from rows that give the index alone or in pairs; D may be 0."""
    return _closed_forms(model, rows, _frame(model.priors, tuple(model.places.tolist())))


def _closed_forms(model: Model, rows: Rows, frame: _Frame) -> FloatArray:
    there = set(rows.code.tolist())
    found = [form(rows) for form, needed in _FORMS if not there.isdisjoint(needed)]
    if not found:
        return frame.grid[:0]
    eta, k = rows.exterior_ior * np.concatenate(found, axis=1)
    possible = (eta > 0) & np.isfinite(eta) & np.isfinite(k)
    eta, k = eta[possible], k[possible]
    values = np.empty((len(eta), len(frame.centre)))
    values[:] = frame.centre
    for j in frame.free:
        values[:, j] = model.priors[j].to_coordinate(eta if j == frame.eta else k)
    return np.minimum(np.maximum(values, frame.low), frame.high)


def _points(centre: FloatArray, values: FloatArray, free: list[int]) -> FloatArray:
    points = np.empty((len(values), len(centre)))
    points[:] = centre
    points[:, free] = values
    return points


def _few(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    chosen = np.linspace(0, len(indices) - 1, min(len(indices), _MOST_ROWS)).astype(np.int64)
    return np.asarray(indices[chosen])


def _rows_of(rows: Rows, quantity: Quantity) -> NDArray[np.int64]:
    i = np.flatnonzero((rows.code == CODES[quantity]) & ~rows.censored)
    return np.asarray(i[np.minimum(rows.sin_theta[i], rows.cos_theta[i]) > 1e-3])


def _pairs(rows: Rows, first: Quantity, second: Quantity) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of two quantities at equal angles."""
    there = {float(rows.cos_theta[i]): i for i in _rows_of(rows, second)}
    pairs = [(i, there[c]) for i in _rows_of(rows, first) if (c := float(rows.cos_theta[i])) in there]
    chosen = _few(np.array(pairs, dtype=np.int64).reshape(-1, 2))
    return chosen[:, 0], chosen[:, 1]


def _ellipsometric(rows: Rows) -> FloatArray:
    """Psi and Delta at one angle give eta and k; Delta of the other sense, or noise, the sign of k only."""
    psi, delta = _pairs(rows, Quantity.PSI_DEG, Quantity.DELTA_DEG)
    rho = rho_from_psi_delta(np.radians(np.clip(rows.value[psi], 0.01, 89.99)), np.radians(rows.value[delta]))
    theta = np.arctan2(rows.sin_theta[psi], rows.cos_theta[psi])
    eta, k = index_from_rho(rho + (np.abs(rho + 1) < 1e-9) * 1e-9, theta)
    return np.stack([eta, np.abs(k)])


def _dielectric(rows: Rows) -> FloatArray:
    """k = 0: from R_p / R_s by tan(theta_i) tan(theta_t) = (1 - rho) / (1 + rho), either sign of rho; from R_s alone.

    rho = r_p / r_s is real; negative below Brewster's angle.
    """
    s, p = _pairs(rows, Quantity.REFLECTANCE_S, Quantity.REFLECTANCE_P)
    sources = [(s, rows.value[p] / np.where(rows.value[s] > 0, rows.value[s], np.nan))]
    for quantity in (Quantity.RATIO_PS, Quantity.DOLP, Quantity.PSI_DEG):
        i = _few(_rows_of(rows, quantity))
        value = rows.value[i]
        if quantity is Quantity.DOLP:
            value = (1 - value) / np.maximum(1 + value, 1e-9)
        elif quantity is Quantity.PSI_DEG:
            value = np.tan(np.radians(value)) ** 2
        sources.append((i, value))
    found = []
    for i, ratio in sources:
        tangent = rows.sin_theta[i] / rows.cos_theta[i]
        for rho in np.multiply.outer((1.0, -1.0), np.sqrt(np.clip(ratio, 0.0, 1.0 - 1e-12))):
            product = (1 - rho) / (1 + rho) / tangent
            found.append(rows.sin_theta[i] * np.sqrt(1 + 1 / product**2))
    i = _few(_rows_of(rows, Quantity.REFLECTANCE_S))
    for r in np.multiply.outer((1.0, -1.0), np.sqrt(np.clip(rows.value[i], 0.0, 1.0 - 1e-12))):
        # r_s = (c - w) / (c + w), w^2 = eta^2 - s^2
        found.append(np.hypot(rows.cos_theta[i] * (1 + r) / (1 - r), rows.sin_theta[i]))
    return _transparent(np.concatenate(found))


def _brewster(rows: Rows) -> FloatArray:
    """The angle where p is least, taken for Brewster's."""
    found = []
    there = set(rows.code.tolist())
    for quantity in (q for q in _P_ALONE if CODES[q] in there):
        i = _rows_of(rows, quantity)
        if len(i) > 2:
            least = i[np.argmin(rows.value[i])]
            found.append(rows.sin_theta[least] / rows.cos_theta[least])
    return _transparent(np.array(found))


def _normal_incidence(rows: Rows) -> FloatArray:
    """An absolute reflectance near the normal: both dielectrics with this R0."""
    codes = [CODES[q] for q in (Quantity.REFLECTANCE, *_ABSOLUTE)]
    near = np.flatnonzero(np.isin(rows.code, codes) & (rows.cos_theta > _NORMAL) & ~rows.censored)
    if len(near) == 0:
        return np.empty((2, 0))
    eta = eta_from_r0(np.clip(np.mean(rows.value[near]), 1e-6, 0.999))
    return _transparent(np.array([eta, 1 / eta]))


def _transparent(eta: FloatArray) -> FloatArray:
    index = np.zeros((2, len(eta)))
    index[0] = eta
    return index


_ABSOLUTE = (Quantity.REFLECTANCE_S, Quantity.REFLECTANCE_P)
_P_ALONE = (Quantity.REFLECTANCE_P, Quantity.SIGNAL_P, Quantity.RATIO_PS, Quantity.PSI_DEG)
# Each closed form, which gives eta and k, shape (2, D), and the quantities of which it needs one at least.
_FORMS: tuple[tuple[Callable[[Rows], FloatArray], frozenset[int]], ...] = tuple(
    (form, frozenset(CODES[quantity] for quantity in quantities))
    for form, quantities in (
        (_ellipsometric, (Quantity.DELTA_DEG,)),
        (_dielectric, (Quantity.REFLECTANCE_S, Quantity.RATIO_PS, Quantity.DOLP, Quantity.PSI_DEG)),
        (_brewster, _P_ALONE),
        (_normal_incidence, (Quantity.REFLECTANCE, *_ABSOLUTE)),
    )
)
