"""What must hold for every interface, whatever the index.

A wrong sign of r_p, a wrong branch of the root or a typo in either
coefficient breaks one of these; only the sign of i escapes them, and
test_ellipsometry.py pins that.
"""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reflectance_fit.physics.fresnel import amplitudes, r0, radiance_transmission_factor, reflectances
from reflectance_fit.physics.snell import cos_theta_t, refraction_angle

THETA = st.floats(0.0, np.pi / 2)
ETA = st.floats(0.05, 20.0)
K = st.one_of(st.just(0.0), st.floats(1e-12, 20.0))
WILD_ETA = st.one_of(
    st.floats(-8.0, 8.0).map(lambda x: 10.0**x), st.floats(-1e-12, 1e-12).map(lambda x: 1.0 + x)
)
WILD_K = st.one_of(st.just(0.0), st.floats(-300.0, 8.0).map(lambda x: 10.0**x), st.floats(0.0, 1e100))
WILD_COS = st.one_of(
    st.floats(0.0, 1.0),
    st.floats(-320.0, 0.0).map(lambda x: 10.0**x),
    st.floats(0.0, 1e-3).map(lambda x: 1.0 - x),
)


@given(theta=THETA, eta=ETA, k=K)
def test_p_follows_from_s_without_the_index(theta, eta, k):
    """Azzam: r_s^2 - r_p = cos(2 theta) (r_s - r_s r_p).  https://scholarworks.uno.edu/ee_facpubs/50/"""
    r_s, r_p = amplitudes(np.cos(theta), eta, k)
    assert abs(r_s**2 - r_p - np.cos(2 * theta) * (r_s - r_s * r_p)) < 1e-11


@given(eta=ETA, k=K)
def test_at_45_degrees_p_is_the_square_of_s(eta, k):
    r = reflectances(np.sqrt(0.5), eta, k)
    assert r.p == pytest.approx(r.s**2, abs=1e-13)


@given(eta=ETA, k=K)
def test_s_and_p_are_opposite_at_normal_and_equal_at_grazing_incidence(eta, k):
    r_s, r_p = amplitudes([1.0, 0.0], eta, k)
    assert r_p[0] == pytest.approx(-r_s[0], abs=1e-15)
    if (eta, k) != (1.0, 0.0):
        assert r_s[1] == pytest.approx(-1.0, abs=1e-13)
        assert r_p[1] == pytest.approx(-1.0, abs=1e-13)


def test_p_is_positive_below_brewster_for_a_denser_medium():
    r_s, r_p = amplitudes(np.cos(np.radians([0.0, 50.0, 60.0])), 1.5)
    assert np.all(r_s.real < 0)
    assert list(np.sign(r_p.real)) == [1, 1, -1]


@given(cosine=WILD_COS, eta=WILD_ETA, k=WILD_K)
@example(cosine=0.0, eta=1.0, k=0.0)
@example(cosine=1e-200, eta=1.0, k=5e-324)
@example(cosine=1e-200, eta=1.0, k=0.0)
@example(cosine=5e-324, eta=1.0, k=0.0)
@example(cosine=0.0, eta=1.0, k=5e-324)
@example(cosine=1.0, eta=1e-8, k=0.0)
@example(cosine=1e-200, eta=1e8, k=1e100)
@example(cosine=float(np.cos(np.arcsin(0.75))), eta=0.75, k=0.0)
def test_every_power_is_within_0_and_1_and_none_is_lost(cosine, eta, k):
    r = reflectances(cosine, eta, k)
    assert all(0.0 <= x <= 1.0 for x in r)
    assert r.s + r.transmitted_s == pytest.approx(1.0, abs=3e-16)
    assert r.p + r.transmitted_p == pytest.approx(1.0, abs=3e-16)
    assert r.mean + r.transmitted == pytest.approx(1.0, abs=3e-16)
    assert not any(np.isnan(a) for a in amplitudes(cosine, eta, k))


@given(theta=THETA, eta=ETA, k=K)
def test_powers_are_the_squared_amplitudes(theta, eta, k):
    r_s, r_p = amplitudes(np.cos(theta), eta, k)
    r = reflectances(np.cos(theta), eta, k)
    assert r.s == pytest.approx(abs(r_s) ** 2, abs=1e-13)
    assert r.p == pytest.approx(abs(r_p) ** 2, abs=1e-13)
    assert r.mean == pytest.approx((r.s + r.p) / 2, abs=1e-16)


@given(theta=st.floats(0.0, 1.57), eta=ETA, k=K)
def test_power_entering_is_the_flux_of_the_transmitted_wave(theta, eta, k):
    """T from the field that continuity leaves inside, t_s = 1 + r_s and n t_p = 1 + r_p, not from 1 - R."""
    c = np.cos(theta)
    index, cos_t = eta + 1j * k, cos_theta_t(c, eta, k)
    r_s, r_p = amplitudes(c, eta, k)
    r = reflectances(c, eta, k)
    scale = 1e-12 * max(1.0, abs(index)) / c
    assert r.transmitted_s == pytest.approx((index * cos_t).real / c * abs(1 + r_s) ** 2, abs=scale)
    t_p = (1 + r_p) / index
    assert r.transmitted_p == pytest.approx((index * np.conj(cos_t)).real / c * abs(t_p) ** 2, abs=scale)


@given(theta=THETA, eta=ETA)
def test_a_conductor_with_vanishing_k_is_a_dielectric(theta, eta):
    """Against the real textbook formulas: a dielectric is k = 0, not a second code path."""
    sine = np.sin(theta) / eta
    # Near the critical angle a rounding of cos(theta) moves R by much more than itself.
    if sine >= 0.9:
        return
    c, cos_t = np.cos(theta), np.sqrt(1 - sine**2)
    r_s, r_p = (c - eta * cos_t) / (c + eta * cos_t), (eta * c - cos_t) / (eta * c + cos_t)
    for k in (0.0, 1e-300):
        r = reflectances(c, eta, k)
        assert (r.s, r.p) == (pytest.approx(r_s**2, abs=1e-11), pytest.approx(r_p**2, abs=1e-11))


@pytest.mark.parametrize("eta", [0.05, 0.5, 0.75, 0.999])
def test_total_reflection_is_total(eta):
    theta = np.linspace(np.arcsin(eta) + 1e-6, np.pi / 2, 101)
    r = reflectances(np.cos(theta), eta)
    assert np.all(r.s == 1.0)
    assert np.all(r.p == 1.0)
    assert np.all(r.transmitted == 0.0)


@given(theta=st.floats(0.0, 1.5), eta=st.floats(1.01, 10.0))
def test_power_transmission_is_reciprocal_and_radiance_is_not(theta, eta):
    theta_t = refraction_angle(theta, eta)
    into, back = reflectances(np.cos(theta), eta), reflectances(np.cos(theta_t), 1 / eta)
    assert into.transmitted_s == pytest.approx(back.transmitted_s, abs=1e-12)
    assert into.transmitted_p == pytest.approx(back.transmitted_p, abs=1e-12)
    radiance_into = into.transmitted * radiance_transmission_factor(eta)
    radiance_back = back.transmitted * radiance_transmission_factor(1 / eta)
    assert radiance_into / into.transmitted == pytest.approx(eta**2, rel=1e-12)
    assert radiance_into * radiance_back == pytest.approx(into.transmitted * back.transmitted, rel=1e-9)


@given(theta=st.floats(0.0, 1.5), eta=ETA, k=K)
def test_complex_snell(theta, eta, k):
    """sin^2 + cos^2 = 1 with sin(theta_t) = sin(theta_i) / (eta + ik); the wave decays and leaves."""
    cos_t, index = cos_theta_t(np.cos(theta), eta, k), eta + 1j * k
    assert index**2 * cos_t**2 + np.sin(theta) ** 2 == pytest.approx(
        index**2, abs=1e-12 * max(1, abs(index) ** 2)
    )
    assert (index * cos_t).real >= -1e-12 * abs(index)
    assert (index * cos_t).imag >= -1e-12 * abs(index)


def test_beyond_the_critical_angle_there_is_no_real_angle():
    with pytest.raises(ValueError, match="total internal reflection"):
        refraction_angle(1.0, 0.5)
    assert cos_theta_t(np.cos(1.0), 0.5).imag > 0


def test_scalars_give_scalars_and_arrays_broadcast():
    assert isinstance(reflectances(0.5, 1.5).mean, float)
    assert isinstance(amplitudes(0.5, 1.5)[0], complex)
    r = reflectances(np.linspace(0, 1, 5)[:, None], np.array([1.3, 1.5, 2.0]), 0.1)
    assert {x.shape for x in r} == {(5, 3)}
    assert r.mean[4] == pytest.approx(r0(np.array([1.3, 1.5, 2.0]), 0.1), rel=1e-14)


def test_inputs_are_not_modified():
    inputs = [np.linspace(0, 1, 4), np.full(4, 1.5), np.full(4, 0.5)]
    before = [x.copy() for x in inputs]
    reflectances(*inputs)
    amplitudes(*inputs)
    assert all(np.array_equal(a, b) for a, b in zip(inputs, before, strict=True))
