"""Cosine law, hemisphere and cones: closed forms, quadrature and elementary identities against each other."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.cones import (
    cone_projected_solid_angle,
    cone_solid_angle,
    ring_projected_solid_angle,
)
from reflectance_fit.physics.fresnel import radiance_transmission_factor, reflectances
from reflectance_fit.physics.hemisphere import (
    direction,
    hemispherical_irradiance,
    lobe_irradiance,
    lobe_scalar_irradiance,
    scalar_irradiance,
    vector_irradiance,
)
from reflectance_fit.physics.radiometry import (
    beam_irradiance,
    exitance_to_radiance,
    lambertian_radiance,
    point_irradiance,
    radiance_to_exitance,
)

ANGLES = st.floats(0.0, np.pi)


def test_a_beam_follows_the_cosine_and_lights_no_back():
    theta = np.radians([0.0, 60.0, 90.0, 120.0])
    assert beam_irradiance(2.0, np.cos(theta)) == pytest.approx([2.0, 1.0, 0.0, 0.0], abs=1e-15)


def test_point_source_inverse_square_and_cosine():
    assert point_irradiance(12.0, [0, 0, 2], [0, 0, 0], [0, 0, 5]) == 3.0
    assert point_irradiance(12.0, [0, 3, 4], [0, 0, 0], [0, 0, 1]) == pytest.approx(
        12 / 25 * 0.8, rel=1e-15, abs=0
    )
    assert point_irradiance(12.0, [0, 0, -2], [0, 0, 0], [0, 0, 1]) == 0.0


def test_all_power_of_a_point_source_reaches_a_sphere_around_it():
    """Flux through any closed surface is 4 pi I: here over a sphere about another point."""

    def irradiance(theta, phi):
        out = direction(theta, phi)
        return point_irradiance(1.0, [0.2, -0.3, 0.1], out, -out)

    assert scalar_irradiance(irradiance).value == pytest.approx(4 * np.pi, rel=1e-12, abs=0)


def test_a_matte_reflector_gives_back_its_albedo():
    radiance = lambertian_radiance(0.37, 5.0)
    leaving = hemispherical_irradiance(lambda theta, phi: np.full_like(theta, radiance))
    assert leaving.value == pytest.approx(0.37 * 5.0, rel=1e-14, abs=0)
    assert radiance_to_exitance(radiance) == pytest.approx(0.37 * 5.0, rel=1e-15, abs=0)
    assert exitance_to_radiance(radiance_to_exitance(3.0)) == pytest.approx(3.0, rel=1e-15, abs=0)


@pytest.mark.parametrize("n", [0, 1, 2.5, 10, 400])
def test_lobes(n):
    def lobe(theta, phi):
        return np.maximum(np.cos(theta), 0.0) ** n if n else np.where(theta <= np.pi / 2, 1.0, 0.0)

    found = hemispherical_irradiance(lobe)
    assert found.converged
    assert found.value == pytest.approx(lobe_irradiance(n), rel=1e-12, abs=0)
    assert scalar_irradiance(lobe).value == pytest.approx(lobe_scalar_irradiance(n), rel=1e-12, abs=0)


def test_net_irradiance_is_the_vector_dotted_with_the_normal():
    """Of a smooth field: E(n) - E(-n) = n . vector, in a frame turned with n."""
    rng = np.random.default_rng(3)

    def field(w):
        return np.exp(w @ np.array([0.3, -0.5, 0.8])) + 0.2 * w[..., 0] ** 2

    vector = [part.value for part in vector_irradiance(lambda t, p: field(direction(t, p)))]
    for _ in range(5):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        front, back = (
            hemispherical_irradiance(lambda t, p, s=side, m=turn: field(s * direction(t, p) @ m)).value
            for side in (1.0, -1.0)
        )
        assert front - back == pytest.approx(turn[2] @ vector, abs=1e-12)


@given(sigma=ANGLES, theta=ANGLES)
def test_a_cone_and_what_it_leaves_out_fill_the_hemisphere(sigma, theta):
    rest = cone_projected_solid_angle(np.pi - sigma, np.pi - theta)
    assert cone_projected_solid_angle(sigma, theta) + rest == pytest.approx(np.pi, rel=1e-14, abs=0)
    assert cone_solid_angle(sigma) + cone_solid_angle(np.pi - sigma) == pytest.approx(
        4 * np.pi, rel=1e-14, abs=0
    )


@given(sigma=ANGLES, theta=ANGLES)
def test_front_less_back_of_a_cone_is_its_vector(sigma, theta):
    """int omega domega over a cone is pi sin^2(sigma) along its axis, whatever the horizon."""
    net = cone_projected_solid_angle(sigma, theta) - cone_projected_solid_angle(sigma, np.pi - theta)
    assert net == pytest.approx(np.pi * np.sin(sigma) ** 2 * np.cos(theta), abs=1e-14)


def slice_by_slice(sigma, theta):
    """40 digits: horizontal circles of elevation e, seen over the azimuth that lies inside the cone."""
    with mpmath.workdps(40):
        s, t = mpmath.mpf(sigma), mpmath.mpf(theta)
        top = min(mpmath.pi / 2, mpmath.pi / 2 - t + s)
        corner = mpmath.pi - t - s - mpmath.pi / 2 if t + s < mpmath.pi / 2 else 0

        def width(e):
            c = (mpmath.cos(s) - mpmath.cos(t) * mpmath.sin(e)) / (mpmath.sin(t) * mpmath.cos(e))
            return mpmath.acos(max(-1, min(1, c)))

        bounds = sorted({max(0, corner), max(0, mpmath.pi / 2 - t - s), max(0, mpmath.pi / 2 + t - s), top})
        bounds = [b for b in bounds if b <= top]
        if bounds[0] > 0 and t + s >= mpmath.pi / 2:
            bounds = [0, *bounds]
        integral = mpmath.quad(lambda e: 2 * width(e) * mpmath.sin(e) * mpmath.cos(e), bounds)
        return float(integral)


@pytest.mark.parametrize(
    ("sigma", "theta"),
    [
        (0.5, 1.4),
        (0.5, 1.9),
        (1e-3, np.pi / 2),
        (1e-6, np.pi / 2 + 5e-7),
        (1.2, 2.7),
        (1.0, np.pi / 2 + 0.999),
    ],
)
def test_a_setting_cone_keeps_its_digits(sigma, theta):
    # Tilting by an ulp moves what is left of the cone by 2.5 ulps over its relative height.
    left = (np.pi / 2 + sigma - theta) / sigma
    sensitivity = 2.5 * 2.2e-16 * (1 + theta / (sigma * left))
    assert cone_projected_solid_angle(sigma, theta) == pytest.approx(
        slice_by_slice(sigma, theta), rel=1e-14 + 4 * sensitivity, abs=0
    )


@given(first=st.floats(0.0, np.pi / 2), second=st.floats(0.0, np.pi / 2))
def test_rings_are_differences_of_cones(first, second):
    low, high = sorted((first, second))
    difference = cone_projected_solid_angle(high, 0.0) - cone_projected_solid_angle(low, 0.0)
    assert ring_projected_solid_angle(low, high) == pytest.approx(difference, abs=1e-14)


def test_a_narrow_ring_keeps_its_digits():
    theta, width = 0.75, 2.0**-40
    assert ring_projected_solid_angle(theta, theta + width) == pytest.approx(
        np.pi * width * np.sin(2 * theta + width), rel=1e-14, abs=0
    )


@pytest.mark.parametrize("eta", [1.33, 1.5, 2.4])
def test_refracted_power_is_the_same_on_both_sides(eta):
    """Uniform sky through a window: the flux below, T eta^2 inside the critical cone, is that above."""

    def above(theta, phi):
        return reflectances(np.cos(theta), eta).transmitted

    def below(theta, phi):
        # Substituted sin(theta) = u(theta') sin(critical), so that the cone's edge is the domain's.
        sine = np.sin(theta) / eta
        inside = np.sqrt(1.0 - sine**2)
        radiance = reflectances(inside, 1.0 / eta).transmitted * radiance_transmission_factor(eta)
        # cos sin dtheta of the inner angle is cos sin dtheta of the outer one over eta^2.
        return radiance / eta**2

    # T leaves the horizon with infinite slope on neither side: both integrands are the same smooth function.
    assert hemispherical_irradiance(below).value == pytest.approx(
        hemispherical_irradiance(above).value, rel=1e-12, abs=0
    )


@pytest.mark.parametrize("eta", [1.33, 1.5, 2.4])
def test_white_furnace_of_a_window(eta):
    """Radiance 1 above and eta^2 below is equilibrium: what leaves either way equals what is there."""
    cosine = np.linspace(0.01, 1.0, 50)
    outside = reflectances(cosine, eta)
    up = outside.mean + outside.transmitted * radiance_transmission_factor(1.0 / eta) * eta**2
    assert up == pytest.approx(np.ones(50), rel=1e-14, abs=0)
    inside = reflectances(cosine, 1.0 / eta)
    down = inside.mean * eta**2 + inside.transmitted * radiance_transmission_factor(eta)
    assert down == pytest.approx(np.full(50, eta**2), rel=1e-14, abs=0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: beam_irradiance(1.0, 60.0), "is it an angle"),
        (lambda: beam_irradiance(-1.0, 0.5), "negative"),
        (lambda: point_irradiance(1.0, [0, 0, 0], [0, 0, 0], [0, 0, 1]), "lies on the receiver"),
        (lambda: point_irradiance(1.0, [0, 0, 1], [0, 0, 0], [0, 0, 0]), "zero vector"),
        (lambda: point_irradiance(1.0, [0, 1], [0, 0, 0], [0, 0, 1]), "x, y and z"),
        (lambda: lambertian_radiance(50.0, 1.0), "percent"),
        (lambda: cone_solid_angle(90.0), "degrees"),
        (lambda: lobe_irradiance(-1.0), "exponent"),
        (lambda: hemispherical_irradiance(lambda t, p: t * np.nan), "NaN"),
    ],
)
def test_bad_input_says_what_to_mend(call, message):
    with pytest.raises(ValueError, match=message):
        call()
