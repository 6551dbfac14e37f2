"""Mueller against Jones: every matrix must do to Stokes vectors what the fields do.

Handedness has no invariant, so each sign is also held by one named experiment.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics import mueller
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import amplitudes, reflectances
from reflectance_fit.physics.stokes import analyzer_signal, aolp, circular, docp, dolp, linear, unpolarized

ANGLE = st.floats(-4.0, 4.0)
FIELD = st.tuples(*[st.floats(-1.0, 1.0)] * 4).map(lambda x: (complex(x[0], x[1]), complex(x[2], x[3])))


def stokes_of(e_s, e_p):
    """S2 + i S3 = 2 E_s conj(E_p), the definition."""
    cross = 2 * e_s * np.conj(e_p)
    powers = abs(e_s) ** 2, abs(e_p) ** 2
    return np.array([powers[0] + powers[1], powers[0] - powers[1], cross.real, cross.imag])


@given(field=FIELD, r_s=FIELD, theta=st.floats(0.0, 1.57))
def test_reflection_equals_the_jones_computation(field, r_s, theta):
    r_s, r_p = r_s
    assert mueller.reflection(r_s, r_p) @ stokes_of(*field) == pytest.approx(
        stokes_of(r_s * field[0], r_p * field[1]), abs=1e-12
    )


@given(field=FIELD, angle=ANGLE)
def test_rotator_equals_the_turned_frame(field, angle):
    cos, sin = np.cos(angle), np.sin(angle)
    turned = cos * field[0] + sin * field[1], -sin * field[0] + cos * field[1]
    assert mueller.rotator(angle) @ stokes_of(*field) == pytest.approx(stokes_of(*turned), abs=1e-12)


@given(field=FIELD, phi=ANGLE, diattenuation=st.floats(0.0, 1.0))
def test_polarizer_equals_the_projected_field(field, phi, diattenuation):
    along = np.array([np.cos(phi), np.sin(phi)])
    across = np.array([-np.sin(phi), np.cos(phi)])
    high, low = np.sqrt((1 + diattenuation) / 2), np.sqrt((1 - diattenuation) / 2)
    passed = high * along * (along @ field) + low * across * (across @ field)
    out = mueller.polarizer(phi, diattenuation) @ stokes_of(*field)
    assert out == pytest.approx(stokes_of(*passed), abs=1e-7)
    assert analyzer_signal(stokes_of(*field), phi, diattenuation) == pytest.approx(out[0], abs=1e-12)


@given(field=FIELD, fast=ANGLE, retardance=ANGLE)
def test_retarder_delays_the_slow_field(field, fast, retardance):
    """With exp(-i omega t), later means exp(+i retardance)."""
    along, across = np.array([np.cos(fast), np.sin(fast)]), np.array([-np.sin(fast), np.cos(fast)])
    out = along * (along @ field) + np.exp(1j * retardance) * across * (across @ field)
    assert mueller.retarder(fast, retardance) @ stokes_of(*field) == pytest.approx(stokes_of(*out), abs=1e-12)


def test_worked_examples():
    """The words of the docstrings."""
    right, diagonal = circular("right"), linear(np.pi / 4)
    assert mueller.rotator(np.pi / 4) @ linear(0.0) == pytest.approx([1, 0, -1, 0], abs=1e-15)
    assert mueller.polarizer(0.0) @ unpolarized() == pytest.approx([0.5, 0.5, 0, 0])
    quarter = mueller.retarder(0.0, np.pi / 2)
    assert quarter @ right == pytest.approx(diagonal, abs=1e-15)
    assert quarter @ diagonal == pytest.approx(circular("left"), abs=1e-15)


@given(angle=ANGLE, phi=ANGLE)
def test_malus(angle, phi):
    assert analyzer_signal(linear(angle), phi) == pytest.approx(np.cos(angle - phi) ** 2, abs=1e-12)


@given(phi=ANGLE)
def test_crossed_polarizers_are_dark(phi):
    crossed = mueller.polarizer(phi + np.pi / 2) @ mueller.polarizer(phi)
    assert np.abs(crossed).max() < 1e-12


@given(fast=ANGLE)
def test_a_quarter_wave_plate_at_45_degrees_makes_circular_light(fast):
    out = mueller.retarder(fast, np.pi / 2) @ linear(fast + np.pi / 4)
    assert docp(out) == pytest.approx(-1.0)
    assert dolp(out) == pytest.approx(0.0, abs=1e-12)


def test_diagonal_light_comes_off_gold_partly_right_circular():
    out = mueller.reflection(*amplitudes(0.5, 0.183, 3.43)) @ linear(np.pi / 4)
    assert out[3] > 0.5
    glass = mueller.reflection(*amplitudes(0.5, 1.5)) @ linear(np.pi / 4)
    assert glass[3] == 0.0


@given(theta=st.floats(0.1, 1.5), eta=st.floats(0.1, 5.0), k=st.floats(0.1, 5.0))
def test_delta_and_powers_can_be_read_off_the_matrix(theta, eta, k):
    c = np.cos(theta)
    m = mueller.reflection(*amplitudes(c, eta, k))
    power = reflectances(c, eta, k)
    assert m[0, 0] == pytest.approx(power.mean, abs=1e-13)
    assert m[0, 1] == pytest.approx((power.s - power.p) / 2, abs=1e-13)
    assert np.arctan2(m[3, 2], m[2, 2]) % (2 * np.pi) == pytest.approx(psi_delta(c, eta, k)[1], abs=1e-9)


def test_unpolarized_light_and_a_linear_analyzer_are_blind_to_the_sign_of_i():
    r_s, r_p = amplitudes(0.5, 0.183, 3.43)
    phi = np.linspace(0, np.pi, 7)
    signals = [
        analyzer_signal(mueller.reflection(s, p) @ unpolarized(), phi)
        for s, p in ((r_s, r_p), (r_s.conj(), r_p.conj()))
    ]
    assert np.array_equal(*signals)


@given(angle=st.floats(0.0, 3.14), share=st.floats(0.01, 1.0))
def test_degree_and_angle_of_polarization(angle, share):
    mixed = share * linear(angle) + (1 - share) * unpolarized()
    assert dolp(mixed) == pytest.approx(share)
    assert np.sin(aolp(mixed) - angle) == pytest.approx(0.0, abs=1e-9)
    assert 0 <= aolp(mixed) < np.pi
    assert (docp(circular("right")), docp(circular("left"))) == (1.0, -1.0)


def test_shapes_and_the_dark():
    assert mueller.polarizer(np.zeros((2, 3)), 0.9).shape == (2, 3, 4, 4)
    assert mueller.reflection(*amplitudes(np.linspace(0, 1, 5), 1.5)).shape == (5, 4, 4)
    assert linear(np.zeros((2, 3))).shape == (2, 3, 4)
    assert analyzer_signal(np.ones((5, 4)), 0.0).shape == (5,)
    assert np.isnan(dolp([0.0, 0, 0, 0]))
    assert aolp([1.0, 1.0, -1e-300, 0.0]) == 0.0


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: analyzer_signal(unpolarized(), 0.0, 1.5), "extinction ratio"),
        (lambda: mueller.polarizer(0.0, np.nan), "diattenuation"),
        (lambda: dolp([1.0, 0.0, 0.0]), "4 numbers"),
        (lambda: circular("up"), "'right' or 'left'"),
        (lambda: linear(np.nan), "finite"),
    ],
)
def test_what_is_outside_the_domain_is_refused(call, says):
    with pytest.raises(ValueError, match=says):
        call()
