"""Quantities computed from every draw of eta and k, so that their intervals are exact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.brewster import brewster_angle, principal_angle, second_brewster_angle
from reflectance_fit.physics.fresnel import r0

FloatArray = NDArray[np.float64]


def derived_draws(eta: FloatArray, k: FloatArray, exterior_ior: float) -> dict[str, FloatArray]:
    """r0 and the angles in degrees, of the shape of ``eta``.

    The angles are those of the interface as it was measured (the sample in
    its exterior).  Where k is 0 in every draw there is one Brewster angle and
    the other two are left out.
    """
    relative_eta, relative_k = eta / exterior_ior, k / exterior_ior
    draws = {
        "r0": np.asarray(r0(relative_eta, relative_k)),
        "brewster_deg": np.degrees(brewster_angle(relative_eta, relative_k)),
    }
    if np.any(k > 0):
        draws["second_brewster_deg"] = np.degrees(second_brewster_angle(relative_eta, relative_k))
        draws["principal_angle_deg"] = np.degrees(principal_angle(relative_eta, relative_k))
    return draws
