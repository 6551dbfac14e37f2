"""Is it a film?  Two questions to a finished fit of one plane interface.

A film hides: thin ones are fitted very well by a bulk of another index, its
pseudo-constants.  What gives a film away is

* an index that drifts with the angle of incidence, because the pseudo-constants
  of a film do and those of a bulk cannot.  A wrong angle zero makes them drift,
  too, so only what it cannot explain counts;
* a sample whose name says what the bulk is: where its tabulated index does not
  explain the rows, but does under a transparent film with one free number, the
  thickness, as well as a free eta and k do without.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2 as chi_squared
from scipy.stats import f as fisher_f

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.examination import Drift, Film
from reflectance_fit.inference.film_rows import film_values
from reflectance_fit.inference.fisher import Information
from reflectance_fit.inference.point import at_best, background_of, residuals
from reflectance_fit.inference.rows import wrapped
from reflectance_fit.materials.library import Entry, get
from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.priors import NUISANCES
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

# An oxide or quartz, sapphire or another metal's oxide, water: enough of a choice for a suspicion.
FILM_INDICES = (1.46, 1.77, 1.33)
# Thinner than an oxide grows, what is left of a table's own error looks like a film.
THINNEST_NM, THICKEST_NM = 1.0, 100.0
_THICKNESSES = np.geomspace(THINNEST_NM, THICKEST_NM, 60)
# chi2 by which the tabulated bulk must fail alone: 5 standard deviations.
CLEARLY = 25.0
# chi2 by which the film may be worse than the bulk, which has one more free number (p = 0.01).
AS_WELL = 6.6
DRIFT_P = 1e-3


def drift(fit: Fit) -> Drift | None:
    """The drift of eta and k with the angle, where it is certain and no angle zero explains it.

    Asked of psi with Delta, and of absolute s with p, at two angles or more:
    there each angle by itself gives an index.  A score test: a Gauss-Newton
    step of an index linear in the angle, all else that was fitted and an angle
    zero projected out, against the scatter that it leaves.
    """
    o = fit.observations
    if not _index_at_each_angle(o):
        return None
    info = at_best(fit, names=("eta", "k"), also=("angle_offset_deg",))
    fitted = [j for j, name in enumerate(info.names) if name != "k" or fit.optimum.model == "conductor"]
    along = (o.theta_deg - o.theta_deg.mean()) / np.ptp(o.theta_deg)
    drifting = info.whitening @ (along[:, None] * info.derivatives[:, :2])
    left = info.whitening @ residuals(fit)
    known, strength, _ = np.linalg.svd(info.columns[:, fitted], full_matrices=False)
    known = known[:, strength > 1e-9 * strength.max()]
    drifting, left = (x - known @ (known.T @ x) for x in (drifting, left))
    step, _, rank, _ = np.linalg.lstsq(drifting, left, rcond=1e-9)
    gained = float(left @ drifting @ step)
    scatter, freedom = float(left @ left) - gained, len(left) - known.shape[1] - int(rank)
    if rank == 0 or freedom < 0:
        return None
    p_value = float(chi_squared.sf(gained, rank))
    if 0 < freedom < scatter:
        # Against scatter larger than stated, whatever its cause.
        p_value = float(fisher_f.sf(gained / rank / (scatter / freedom), rank, freedom))
    if p_value >= DRIFT_P:
        return None
    return Drift(fit.optimum.eta * float(step[0]), float(step[1]), p_value)


def _index_at_each_angle(o: Observations) -> bool:
    for pair in ((Quantity.PSI_DEG, Quantity.DELTA_DEG), (Quantity.REFLECTANCE_S, Quantity.REFLECTANCE_P)):
        if set(o.quantity) == set(pair):
            return len(np.unique(o.theta_deg)) > 1
    return False


def film(fit: Fit, entry: Entry | None) -> Film | None:
    """The film on the material of ``entry`` that looks like the fit; None where none is needed, or none does."""
    if entry is None or entry.kind == "dielectric" or fit.optimum.model != "conductor":
        return None
    try:
        eta, k = get(entry.name).absolute_index(fit.wavelength_nm)
    except ReflectanceFitError:  # outside of the table
        return None
    info = at_best(fit)
    pull = _pull(fit, info)
    bulk = float(fit.optimum.residuals @ fit.optimum.residuals + pull @ pull)

    def deviance(index: float, thickness_nm: float) -> float:
        wavelengths = thickness_nm / fit.wavelength_nm
        f = film_values(info.rows, info.vector, complex(index), complex(float(eta), float(k)), wavelengths)
        return _chi2(fit, info, f, pull)

    bare = deviance(FILM_INDICES[0], 0.0)
    if bare - bulk < CLEARLY:
        return None
    index, thickness_nm, chi2 = min((_best(deviance, index) for index in FILM_INDICES), key=lambda x: x[2])
    if chi2 - bulk > AS_WELL:
        return None
    return Film(entry.name, index, thickness_nm, chi2, bulk, bare)


def _best(deviance: Callable[[float, float], float], index: float) -> tuple[float, float, float]:
    """(index, best thickness in nm, its chi2): a scan, then Brent's search around its minimum."""
    values = [deviance(index, float(t)) for t in _THICKNESSES]
    i = int(np.argmin(values))
    low, high = _THICKNESSES[max(i - 1, 0)], _THICKNESSES[min(i + 1, len(values) - 1)]
    found = minimize_scalar(lambda t: deviance(index, float(t)), bounds=(low, high), method="bounded")
    return index, float(found.x), float(found.fun)


def _chi2(fit: Fit, info: Information, f: FloatArray, pull: FloatArray) -> float:
    """Of rows whose model is ``f``, over gains exactly and fitted nuisances linearly, with their priors."""
    rows, sigma = info.rows, fit.optimum.sigma
    slopes = info.derivatives[:, len(info.names) - len(pull) :]
    members = (rows.gain[:, None] == np.arange(rows.gains)) * f[:, None]
    absolute = np.where(rows.gain < 0, f, 0.0)
    # What the fitted nuisances add to the rows apart from the reflection: dark and diffuse light.
    target = wrapped(rows, rows.value - background_of(info) - absolute)
    prior_sd = info.prior_sd[len(info.names) - len(pull) :]
    design = np.vstack(
        [
            np.column_stack([members, slopes]) / sigma[:, None],
            np.column_stack([np.zeros((len(pull), rows.gains)), np.diag(1 / prior_sd)]),
        ]
    )
    aim = np.concatenate([target / sigma, -pull])
    left = aim
    if design.shape[1]:
        left = aim - design @ np.linalg.lstsq(design, aim, rcond=None)[0]
    return float(left @ left)


def _pull(fit: Fit, info: Information) -> FloatArray:
    """How far the fitted nuisances are out in their priors, in the coordinates of ``info``."""
    best = fit.optimum.parameters
    degree, azimuth = best.get("source_dolp", 0.0), math.radians(2 * best.get("source_azimuth_deg", 0.0))
    source = {"source_s1": degree * math.cos(azimuth), "source_s2": degree * math.sin(azimuth)}
    names = [name for name in info.names if name not in ("eta", "k")]
    off = [source[n] if n in source else best[n] - NUISANCES[n].neutral for n in names]
    return np.array(off) / info.prior_sd[len(info.names) - len(names) :]
