"""Optical constants of a tile of pixels from its readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.pixels.closed_form import dielectric
from reflectance_fit.pixels.descent import descend
from reflectance_fit.pixels.rows import Float32Array, FloatArray, PixelRows
from reflectance_fit.pixels.status import Status
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR

Model = Literal["dielectric", "conductor"]

# Decides between two eta above 1 that fit equally: glasses and plastics are near it.
EXPECTED_ETA = 1.5

# The grid: steps of eta over the prior for a dielectric; for a conductor steps of eta, and k.
_ETAS = 24
_COARSE = 10, (0.0, 0.15, 0.6, 1.5, 3.2, 7.0)
# At one angle and one gain two points may fit equally that lie close together.
_FINE = 20, (0.0, 0.1, 0.25, 0.5, 0.9, 1.4, 2.0, 2.8, 3.8, 5.2, 7.0, 10.0)


@dataclass(frozen=True, slots=True, eq=False)
class PixelResult:
    """What is known of n pixels, each array of shape (n,); NaN, and dof 0, where nothing was estimated.

    eta and k are relative to vacuum; each ``_sigma`` is one standard deviation, so that +- 1.96 of them hold 95 %.
    Where ``status`` is UPPER_LIMIT, k + 1.645 k_sigma is the 95 % limit of k.  ``k``, ``k_sigma`` and ``correlation``
    (of eta and k) are None for a dielectric.  ``status`` has the codes of `Status`.
    """

    eta: Float32Array
    eta_sigma: Float32Array
    k: Float32Array | None
    k_sigma: Float32Array | None
    correlation: Float32Array | None
    chi2: Float32Array
    dof: NDArray[np.uint16]
    status: NDArray[np.uint8]


def estimate(
    rows: PixelRows,
    model: Model,
    reason: NDArray[np.uint8] | None = None,
    *,
    expected_eta: float = EXPECTED_ETA,
) -> PixelResult:
    """The point of greatest likelihood of every pixel, its gains at their best.

    It is the optimum that ``inference.search.find`` gives for the same rows without nuisances: flat in log eta and
    in k as the priors are, these do not move it, and their limits hold (eta 0.05 to 10, k 0 to 20).  A dielectric at
    one angle of incidence in light without S2 and S3 has a closed form; all else is Gauss-Newton.

    Parameters
    ----------
    rows : PixelRows
        The readings of n pixels.
    model : "dielectric" or "conductor"
        k = 0, or k free.
    reason : uint8, shape (n,)
        Codes of `Status` from 10 on of pixels that are not to be estimated, which they keep; 0 of the others.
    expected_eta : float
        Relative to vacuum; decides between points of equal likelihood, where the pixel is AMBIGUOUS.

    Raises
    ------
    ValueError
        For reasons of the wrong shape or below 10, and an expected eta that is not positive.

    Notes
    -----
    At one angle a dielectric's ratio R_p / R_s belongs to two eta, one on either side of tan theta_i; where only one
    of them is above the outside's index, it is the answer.

    Examples
    --------
    >>> one = np.ones(1, dtype=np.float32)
    >>> rows = PixelRows(
    ...     values=np.array([[88.29], [44.59], [0.9]], dtype=np.float32),
    ...     variance=np.full((3, 1), 0.1, dtype=np.float32),
    ...     view=np.zeros(3, dtype=np.int64), gain=np.zeros(3, dtype=np.int64),
    ...     light=np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), diattenuation=np.ones(3),
    ...     analyzer=np.radians([0.0, 45.0, 90.0]), retarder=np.full(3, np.nan), retardance=np.full(3, np.nan),
    ...     theta=np.float32(np.radians(60.0)) * one[None], cos_2s=one[None], sin_2s=0 * one[None])
    >>> found = estimate(rows, "dielectric")
    >>> print(f"{found.eta[0]:.3f} +- {found.eta_sigma[0]:.3f}", Status(found.status[0]).name)
    1.500 +- 0.041 AMBIGUOUS
    """
    n = rows.values.shape[1]
    if reason is None:
        reason = np.zeros(n, dtype=np.uint8)
    elif reason.shape != (n,) or reason.dtype != np.uint8 or np.any((reason > 0) & (reason < Status.OUTSIDE)):
        raise ValueError(f"reason must be uint8 of shape ({n},): 0, or codes of Status from 10 on")
    if not expected_eta > 0:
        raise ValueError("expected_eta must be above 0")
    responses, cells = rows.responses(), _cells(rows)
    expected = expected_eta / rows.exterior_ior
    one_cell = len(cells.view) == 1 and rows.gain[0] >= 0
    if model == "dielectric" and one_cell and not rows.light[:, 2:].any():
        return _closed(rows, cells, responses, reason, expected)
    return _descended(rows, cells, responses, reason, expected, model == "conductor")


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Frames of one view and one gain: the cell of each frame, and each cell's view and gain by number."""

    of_frame: NDArray[np.int64]
    view: NDArray[np.int64]
    gain: NDArray[np.int64]
    gains: int


def _cells(rows: PixelRows) -> _Cells:
    groups = np.unique(rows.gain[rows.gain >= 0])
    gain = np.where(rows.gain >= 0, np.searchsorted(groups, rows.gain), len(groups))
    pairs, of_frame = np.unique(np.stack([rows.view, gain]), axis=1, return_inverse=True)
    view, gain = np.ascontiguousarray(pairs)
    return _Cells(of_frame.ravel(), view, gain, len(groups))


def _closed(
    rows: PixelRows, cells: _Cells, responses: FloatArray, reason: NDArray[np.uint8], expected: float
) -> PixelResult:
    n = rows.values.shape[1]
    found = np.empty((3, n), dtype=np.float32)
    dof, status = np.empty(n, dtype=np.uint16), np.empty(n, dtype=np.uint8)
    view = cells.view[0]
    dielectric(
        rows.values,
        rows.variance,
        responses,
        rows.theta[view],
        rows.cos_2s[view],
        rows.sin_2s[view],
        reason,
        rows.exterior_ior,
        ETA_PRIOR[0] / rows.exterior_ior,
        ETA_PRIOR[1] / rows.exterior_ior,
        expected,
        found[0],
        found[1],
        found[2],
        dof,
        status,
    )
    return PixelResult(found[0], found[1], None, None, None, found[2], dof, status)


def _descended(
    rows: PixelRows,
    cells: _Cells,
    responses: FloatArray,
    reason: NDArray[np.uint8],
    expected: float,
    free_k: bool,
) -> PixelResult:
    n, around = rows.values.shape[1], rows.exterior_ior
    found = np.empty((6 if free_k else 3, n), dtype=np.float32)
    dof, status = np.empty(n, dtype=np.uint16), np.empty(n, dtype=np.uint8)
    of_conductor = _FINE if len(cells.view) == 1 else _COARSE
    etas, ks = of_conductor if free_k else (_ETAS, (0.0,))
    descend(
        rows.values,
        rows.variance,
        responses,
        cells.of_frame,
        cells.view,
        cells.gain,
        cells.gains,
        bool(rows.light[:, 2:].any()),
        rows.theta,
        rows.cos_2s,
        rows.sin_2s,
        reason,
        np.geomspace(*ETA_PRIOR, etas) / around,
        np.array(ks) / around,
        np.array([*ETA_PRIOR, K_PRIOR[1]]) / around,
        expected,
        free_k,
        found,
        dof,
        status,
    )
    if around != 1.0:
        found[[0, 1, 3, 4] if free_k else [0, 1]] *= np.float32(around)
    k, k_sigma, correlation = found[3:] if free_k else (None, None, None)
    return PixelResult(found[0], found[1], k, k_sigma, correlation, found[2], dof, status)
