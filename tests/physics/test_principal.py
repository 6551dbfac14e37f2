"""All principal angles: how many there are, and where two or three of them meet.

A cubic solved in float64 is off by 1e-8 there, or finds one root where there are three.
"""

import mpmath
import numpy as np
import pytest

from reflectance_fit.physics.brewster import critical_angle, principal_angle, principal_angles
from reflectance_fit.physics.ellipsometry import amplitude_ratio


def test_total_reflection_has_principal_angles_of_its_own():
    """Born & Wolf, 1.5.4: its Delta reaches 90 degrees for eta = sqrt(2) - 1, and twice below."""
    touching = np.sqrt(2) - 1
    assert np.count_nonzero(np.isnan(principal_angles([touching + 1e-12, 0.6, 1.5]))) == 6
    eta = np.array([0.2, 0.25, 0.3, touching - 1e-12])
    found = principal_angles(eta)
    assert found[:, 0] == pytest.approx(np.arctan(eta), rel=1e-15)
    assert np.all(found[:, 1] > critical_angle(eta))
    rho = amplitude_ratio(np.cos(found[:, 1:]), eta[:, np.newaxis])
    assert rho.real == pytest.approx(0.0, abs=1e-13)
    assert rho.imag == pytest.approx(-1.0, abs=1e-13)
    # Both meet where sin^2 = 2 eta^2 / (1 + eta^2), the angle of the largest delta.
    met = principal_angles(touching - 1e-14)[1:]
    assert met == pytest.approx(np.arcsin(np.sqrt(2 * touching**2 / (1 + touching**2))), abs=1e-6)
    assert principal_angle(eta) == pytest.approx(found[:, 2], rel=0)


@pytest.mark.parametrize("eta", [1e-6, 0.1, 0.3, 0.4, 0.5, 1.0, 2.0])
def test_principal_angles_are_continuous_down_to_k_0(eta):
    assert principal_angles(eta, [1e-300, 1e-100, 1e-40]) == pytest.approx(
        np.broadcast_to(principal_angles(eta), (3, 3)), abs=1e-14, nan_ok=True
    )


@pytest.mark.parametrize("eta", [1e-12, 1e-8, 1e-5, 1e-3])
def test_how_many_principal_angles_a_tiny_index_has(eta):
    """Two of three meet where S^2 = q to leading order in eta, at k = eta^3 / 2."""
    found = principal_angles(eta, eta**3 / 2 * np.array([0.999, 1.001]))
    assert list(np.count_nonzero(np.isnan(found), axis=-1)) == [0, 2]


def meeting_indices():
    """Close to where two principal angles meet: transparent, and towards the point where all three do."""
    touching = np.sqrt(2) - 1
    yield from ((touching * (1 - d), 0.0) for d in (1e-3, 1e-8, 1e-12, 1e-15))
    # z = 1/sqrt(3) three times: |eps| = 3^(-3/2), 4 sin^2(arg / 2) = 2 - sqrt(3) - |eps|.
    modulus = 3**-1.5
    q = 2 - np.sqrt(3) - modulus
    eta, k = np.sqrt(modulus * (1 - q / 4)), np.sqrt(modulus * q / 4)
    for d in (0.0, 1e-12, 1e-8, 1e-4, 1e-2):
        yield eta * (1 - d), k * (1 - d)
        yield eta * (1 + d), k * (1 - 3 * d)
        yield eta, k * (1 - d)
        yield eta, k * (1 + d)


def test_principal_angles_that_nearly_meet(oracle):
    """Re(rho) changes its sign within 1e-12 of each, to 70 digits: a root off by the usual 1e-8 would show."""
    counts = set()
    for eta, k in meeting_indices():
        found = principal_angles(eta, k)
        found = found[~np.isnan(found)]
        counts.add(len(found))
        assert len(found) % 2 == 1
        assert np.all(np.diff(found) >= 0)
        edges = [0.01, *(found[1:] + found[:-1]) / 2, 1.5]
        with mpmath.workdps(oracle.DIGITS):
            index = mpmath.mpc(float(eta), float(k))
            sides = []
            for root, low, high in zip(found, edges[:-1], edges[1:], strict=True):
                # Not beyond the middle between two roots that are closer than that.
                around = max(low, root - 1e-12), min(high, root + 1e-12)
                x = [mpmath.log(mpmath.tan(mpmath.mpf(float(theta)))) for theta in around]
                sides += [mpmath.sign(oracle.real_ratio(*oracle.amplitudes(point, index))) for point in x]
        assert sides == [(-1) ** (1 + (i + 1) // 2) for i in range(len(sides))], (eta, k)
    assert counts == {1, 3}
