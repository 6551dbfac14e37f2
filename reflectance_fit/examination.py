"""What is found when a finished fit is looked at again: how errors move it, and what it cannot see itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How far the best values move where one thing that was not fitted is off by ``amount``.

    ``brewster_deg`` in degrees; ``eta`` and ``k`` are 0 where they were not fitted.
    """

    disturbance: str
    amount: float
    unit: str
    eta: float
    k: float
    brewster_deg: float


@dataclass(frozen=True, slots=True)
class Health:
    """One identity that holds for every material: ``value`` against ``expected``, ``z`` standard deviations apart."""

    check: str
    theta_deg: float
    value: float
    expected: float
    z: float


@dataclass(frozen=True, slots=True)
class Film:
    """A film of index ``eta`` and ``thickness_nm`` on a tabulated material: it explains the rows as a free bulk does.

    ``chi2`` of that explanation beside ``bulk_chi2`` of the fit and
    ``bare_chi2`` of the tabulated material alone.
    """

    substrate: str
    eta: float
    thickness_nm: float
    chi2: float
    bulk_chi2: float
    bare_chi2: float


@dataclass(frozen=True, slots=True)
class Drift:
    """An index that changes with the angle of incidence: by how much from the first angle to the last."""

    eta: float
    k: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Band:
    """How far a channel's width moves the index that is fitted from the one at its centre."""

    material: str
    named: bool  # by the sample, else only the nearest of the built-in
    fwhm_nm: float
    eta: float
    k: float


@dataclass(frozen=True, slots=True)
class Examination:
    """All of it for one fit; empty and None where there is nothing to say."""

    sensitivity: tuple[Sensitivity, ...] = ()
    health: tuple[Health, ...] = ()
    film: Film | None = None
    drift: Drift | None = None
    band: Band | None = None
    missing_runs: float | None = None  # of residuals of equal sign, in standard deviations
