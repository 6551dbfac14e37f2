"""How wrong Schlick and the conductor approximation are: numbers that the report states."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.approximations import approximation_error, conductor_approximation, schlick
from reflectance_fit.physics.fresnel import r0, reflectances


def schlick_error(eta, k=0.0):
    return approximation_error(eta, k, lambda c: schlick(c, r0(eta, k)))


@pytest.mark.parametrize(
    ("eta", "expected"),
    [
        (1.05, 0.3175),
        (1.1, 0.2105),
        (1.2, 0.113),
        (1.33, 0.060),
        (1.5, 0.036),
        (1.7, 0.032),
        (2.0, 0.044),
        (2.42, 0.076),
        (3.0, 0.125),
        (4.0, 0.201),
    ],
)
def test_largest_error_of_schlick(eta, expected):
    error = schlick_error(eta)
    assert error.max_abs_error == pytest.approx(expected, abs=10.0 ** -len(str(expected).split(".")[1]) / 1.9)
    assert error.max_abs_error == error.error  # Schlick is too bright where it is worst


def test_schlick_for_glass():
    error = schlick_error(1.5)
    assert error.at_deg == pytest.approx(85.0, abs=0.5)
    assert error.max_rel_error == pytest.approx(0.232, abs=5e-4)
    assert error.max_rel_at_deg == pytest.approx(55.5, abs=0.1)
    assert error.albedo_error == pytest.approx(-0.066, abs=5e-4)


@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.0), (0.7, 0.0), (0.183, 3.43), (1.05, 0.001)])
def test_the_error_is_the_brute_force_one(eta, k):
    theta = np.linspace(0, np.pi / 2, 400_001)
    c = np.cos(theta)
    exact = reflectances(c, eta, k).mean
    off = schlick(c, r0(eta, k)) - exact
    error = schlick_error(eta, k)
    assert error.max_abs_error == pytest.approx(np.abs(off).max(), rel=1e-5)
    assert error.error == pytest.approx(off[np.argmax(np.abs(off))], rel=1e-5)
    assert error.at_deg == pytest.approx(np.degrees(theta[np.argmax(np.abs(off))]), abs=3e-3)
    assert error.max_rel_error == pytest.approx((np.abs(off) / exact).max(), rel=1e-5)
    assert error.rms_error == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-3)
    albedo = [2 * np.trapezoid(f[::-1] * c[::-1], c[::-1]) for f in (off, exact)]
    assert error.albedo_error == pytest.approx(albedo[0] / albedo[1], rel=1e-4)


def test_an_index_match_has_no_relative_error():
    error = schlick_error(1.0)
    assert error.max_rel_error == np.inf
    assert error.albedo_error == np.inf


@given(r0=st.floats(0.0, 1.0))
def test_schlick_joins_r0_to_1(r0):
    assert schlick(1.0, r0) == r0
    assert schlick(0.0, r0) == pytest.approx(1.0)
    assert schlick(0.5, r0) == pytest.approx(r0 + (1 - r0) / 32)


@given(c=st.floats(0.0, 1.0), eta=st.floats(0.05, 10.0), k=st.floats(0.0, 10.0))
def test_conductor_approximation_is_the_printed_formula(c, eta, k):
    square, cross = eta**2 + k**2, 2 * eta * c
    found = conductor_approximation(c, eta, k)
    assert found.p == pytest.approx((square * c**2 - cross + 1) / (square * c**2 + cross + 1), abs=1e-12)
    assert found.s == pytest.approx((square - cross + c**2) / (square + cross + c**2), abs=1e-12)
    assert found.mean == pytest.approx((found.s + found.p) / 2)
    assert all(0 <= x <= 1 for x in found)


def test_conductor_approximation_is_exact_at_the_ends_and_close_for_metals():
    for eta, k in [(0.183, 3.43), (0.97, 6.43)]:
        c = np.array([1.0, 0.0])
        assert conductor_approximation(c, eta, k).s == pytest.approx(reflectances(c, eta, k).s, abs=1e-14)
        assert conductor_approximation(c, eta, k).p == pytest.approx(reflectances(c, eta, k).p, abs=1e-14)
        error = approximation_error(eta, k, lambda c, eta=eta, k=k: conductor_approximation(c, eta, k).mean)
        assert 1e-5 < error.max_abs_error < 0.01


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: schlick(60.0, 0.04), "degrees"),
        (lambda: schlick(0.5, 4.0), "percent"),
        (lambda: schlick(0.5, np.nan), "r0"),
        (lambda: conductor_approximation(0.5, 1.0, -1.0), "n - ik"),
    ],
)
def test_outside_the_domain(call, says):
    with pytest.raises(ValueError, match=says):
        call()
