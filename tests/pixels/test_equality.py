"""A map is many single fits: every pixel is held to the fit of its rows alone, model and likelihood unshared."""

import dataclasses

import numpy as np
import pytest

from reflectance_fit.pixels import estimate as module
from reflectance_fit.pixels.estimate import estimate
from reflectance_fit.pixels.status import Status

EQUAL = 1e-6
COUNT = 12

POLARIZED = {"light": (1.0, 0.1, 0.8, 0.3), "retarder_deg": 20.0}
BALL = np.linspace(20.0, 75.0, COUNT)[None]

DIELECTRICS = {
    "glass below Brewster": ([40.0], 1.5, {}),
    "glass above Brewster": ([70.0], 1.5, {}),
    "glass at Brewster": ([56.3], 1.5, {}),
    "two analyzers": ([50.0], 1.5, {"analyzers": (0.0, 90.0)}),
    "imperfect analyzers": ([50.0], 1.5, {"analyzers": (10.0, 40.0, 75.0), "diattenuation": 0.9}),
    "partly polarized light": ([50.0], 1.7, {"light": (1.0, 0.3, 0.0, 0.0)}),
    "a ball": (BALL, 1.5, {"s_deg": np.linspace(-80.0, 90.0, COUNT)}),
    "a board at two angles": ([40.0, 65.0], 1.5, {}),
    "each angle its gain": ([40.0, 65.0], 1.5, {"gain": (0, 1)}),
    "light at 45 degrees": ([50.0], 1.5, POLARIZED),
    "absolute": ([50.0], 1.5, {"gain": (-1,)}),
    "under water": ([40.0, 65.0], 1.7, {"exterior_ior": 1.33}),
    "under water, one angle": ([40.0], 1.7, {"exterior_ior": 1.33}),
    "total reflection": ([30.0, 55.0, 65.0], 0.7, {}),
}
CONDUCTORS = {
    "gold": ([40.0, 60.0, 75.0], (0.42, 2.4), {}),
    "chromium": ([45.0, 65.0, 75.0], (3.1, 3.3), {}),
    "gold at one angle behind a retarder": ([65.0], (0.42, 2.4), POLARIZED),
    "a metal ball behind a retarder": (
        np.linspace(50.0, 80.0, COUNT)[None],
        (1.2, 3.0),
        {"s_deg": np.linspace(-80.0, 90.0, COUNT)} | POLARIZED,
    ),
    "plastic": ([45.0, 65.0, 75.0], (1.55, 0.3), {}),
    "glass, k free": ([45.0, 65.0, 75.0], (1.55, 0.0), {}),
    "absolute": ([20.0, 50.0, 75.0], (0.9, 1.5), {"gain": (-1, -1, -1)}),
    "gold under water": ([40.0, 60.0, 75.0], (0.42, 2.4), {"exterior_ior": 1.33}),
}


def held_to_single_fits(rows, model, alone, deviance, **options):
    """Equal to 1e-6; or, as the single fit stops at a ten-thousandth of a sigma, no less likely by its own
    measure."""
    found = estimate(rows, model, **options)
    for i in range(rows.values.shape[1]):
        k = 0.0 if found.k is None else found.k[i]
        eta, k_alone, chi2, dof = min(alone(rows, i, model), key=lambda v: abs(v[0] - found.eta[i]))
        both = np.array([[found.eta[i], k], [eta, k_alone]], dtype=float)
        if np.abs(both[0] - both[1]).max() > EQUAL:
            sigma = found.eta_sigma[i], found.eta_sigma[i] if found.k is None else found.k_sigma[i]
            assert np.all(np.abs(both[0] - both[1]) <= 1e-3 * np.array(sigma))
            ours, its = deviance(rows, i, model, both)
            assert ours < its + 1e-9
        assert found.chi2[i] == pytest.approx(chi2, rel=1e-4, abs=1e-4)
        assert found.dof[i] == dof
    return found


@pytest.mark.parametrize("name", DIELECTRICS)
def test_a_dielectric_equals_the_single_fit(name, make, alone, deviance):
    theta, eta, optics = DIELECTRICS[name]
    held_to_single_fits(make(theta, COUNT, eta, 0.0, **optics), "dielectric", alone, deviance)


@pytest.mark.parametrize("name", CONDUCTORS)
def test_a_conductor_equals_the_single_fit(name, make, alone, deviance):
    theta, (eta, k), optics = CONDUCTORS[name]
    found = held_to_single_fits(make(theta, COUNT, eta, k, **optics), "conductor", alone, deviance)
    assert np.all(found.status != Status.NOT_CONVERGED)
    # One angle behind one retarder: two numbers, and often two pairs of eta and k that give them.
    assert len(theta) == 1 or np.all(found.status <= Status.UPPER_LIMIT)


def test_missing_readings_are_as_if_never_taken(make, alone, deviance):
    rows = make([40.0, 65.0], COUNT, 1.5, 0.0)
    rows.values[np.arange(COUNT) % 8, np.arange(COUNT)] = np.nan
    found = held_to_single_fits(rows, "dielectric", alone, deviance)
    assert np.all(found.dof == 5)


@pytest.mark.parametrize("theta", [25.0, 50.0, 56.0, 70.0])
def test_the_closed_form_is_where_gauss_newton_comes_to(theta, make, monkeypatch):
    rows = make([theta], 200, 1.5, 0.0, snr=400.0)
    closed = estimate(rows, "dielectric")
    seen = []
    monkeypatch.setattr(module, "_closed", lambda rows, cells, responses, reason, expected: seen.append(1))
    assert estimate(rows, "dielectric") is None
    assert seen
    cells = module._cells(rows)
    descended = module._descended(
        rows, cells, rows.responses(), np.zeros(200, dtype=np.uint8), module.EXPECTED_ETA, False
    )
    clear = closed.status != Status.NEAR_BREWSTER
    same = np.abs(closed.eta - descended.eta) < 1e-6
    assert np.all(same[clear & (closed.status != Status.AMBIGUOUS)])
    np.testing.assert_allclose(closed.chi2[same], descended.chi2[same], rtol=1e-4, atol=1e-4)
    # A linear sigma from the curvature is the closed form's where R_p stands well out of the noise.
    if theta == 25.0:
        np.testing.assert_allclose(closed.eta_sigma, descended.eta_sigma, rtol=0.05)


def test_unequal_variances_are_weighed(make, alone, deviance):
    rows = make([50.0], COUNT, 1.5, 0.0, snr=50.0)
    rows.variance[1] *= 9
    rows.variance[:, ::2] *= 4
    held_to_single_fits(rows, "dielectric", alone, deviance)


def test_the_unit_of_the_signal_does_not_matter(make):
    rows = make([40.0, 60.0, 75.0], 20, 0.42, 2.4)
    other = dataclasses.replace(
        rows, values=rows.values * np.float32(64), variance=rows.variance * np.float32(4096)
    )
    one, two = estimate(rows, "conductor"), estimate(other, "conductor")
    np.testing.assert_allclose(one.eta, two.eta, rtol=1e-7)
    np.testing.assert_allclose(one.k_sigma, two.k_sigma, rtol=1e-6)
