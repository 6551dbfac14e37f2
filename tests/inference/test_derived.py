"""Quantities of the interface as it was measured, from an index that is the sample's own."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.inference.derived import derived_draws
from reflectance_fit.physics.fresnel import amplitudes, reflectances


@pytest.mark.parametrize("exterior_ior", [1.0, 1.33])
def test_angles_and_r0_are_those_in_the_exterior(exterior_ior):
    """Found again on a fine grid of angles: the least R_p, the least R_p / R_s, the phase of 90 degrees."""
    eta, k = 1.1, 2.7
    found = {
        name: float(draw[0])
        for name, draw in derived_draws(np.array([eta]), np.array([k]), exterior_ior).items()
    }
    theta = np.linspace(0.0, 89.99, 400_000)
    cos, index = np.cos(np.radians(theta)), (eta / exterior_ior, k / exterior_ior)
    power = reflectances(cos, *index)
    r_s, r_p = amplitudes(cos, *index)
    assert found["r0"] == pytest.approx(power.s[0], rel=1e-12)
    assert found["brewster_deg"] == pytest.approx(theta[np.argmin(power.p)], abs=0.01)
    assert found["second_brewster_deg"] == pytest.approx(theta[np.argmin(power.p / power.s)], abs=0.01)
    crossing = theta[np.argmin(np.abs((r_p / r_s).real))]
    assert found["principal_angle_deg"] == pytest.approx(crossing, abs=0.01)


def test_a_dielectric_has_one_angle():
    assert set(derived_draws(np.array([1.5]), np.array([0.0]), 1.0)) == {"r0", "brewster_deg"}
