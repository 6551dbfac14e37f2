"""Fresnel's equations of one lane against those of arrays, in both precisions."""

import platform
import re

import numpy as np
import pytest
from numba import njit
from render_lanes import FLAGS, over_lanes

from reflectance_fit.physics import mueller
from reflectance_fit.physics.approximations import conductor_approximation, f82, schlick
from reflectance_fit.physics.brewster import brewster_angle, critical_angle
from reflectance_fit.physics.fresnel import amplitudes, r0, reflectances
from reflectance_fit.render.lobes import fresnel
from reflectance_fit.render.lobes.select import cos_sin_turn

DTYPES = (np.float64, np.float32)
# Roundings, in units of 1.0: some 12 ulp.
NEAR = {np.float64: 2e-15, np.float32: 1.5e-6}


def cosines(n=400):
    """Grazing and normal incidence, and what is between."""
    ends = np.geomspace(1e-8, 0.1, n // 4)
    return np.unique(np.concatenate([[0.0, 1.0], ends, 1.0 - ends, np.linspace(0.01, 0.99, n)]))


def lanes_of(c, *index, dtype):
    """Points as this type has them: what is compared is arithmetic, not the rounding of the question."""
    grids = np.meshgrid(c, *index, indexing="ij")
    return [np.asarray(g, dtype).reshape(-1) for g in grids]


# Towards 1 both ways, glass from both sides, water, diamond, a large one.
ETAS = (0.25, 1 / 1.5, 0.999, 1 - 1e-6, 1.0, 1 + 1e-6, 1.001, 1.33, 1.5, 2.4, 10.0)
KS = (0.0, 1e-6, 0.01, 1.0, 3.43, 10.0, 1e3)


def conditioning(c, eta, dtype):
    """How far one rounding of q^2 moves q and R near the critical angle, in roundings; a root's at most."""
    q2 = np.abs((eta - 1.0) * (eta + 1.0) + c * c)
    return np.where(eta < 1.0, 1.0 / np.sqrt(np.maximum(q2, np.finfo(dtype).eps)), 1.0)


@pytest.mark.parametrize("dtype", DTYPES)
def test_dielectric_powers_are_the_exact_ones(dtype):
    c, eta = lanes_of(cosines(), ETAS, dtype=dtype)
    s, p, cos_t = over_lanes(fresnel.dielectric_power, c, eta, dtype=dtype)
    c, eta = c.astype(float), eta.astype(float)
    exact = reflectances(c, eta)
    allowed = NEAR[dtype] * conditioning(c, eta, dtype)
    assert np.all(np.abs(s - exact.s) <= allowed)
    assert np.all(np.abs(p - exact.p) <= allowed)
    assert np.all((s >= 0) & (s <= 1) & (p >= 0) & (p <= 1))
    refracted = np.sqrt(np.maximum(0.0, 1.0 - (1.0 - c) * (1.0 + c) / eta**2))
    beyond = (eta < 1.0) & (refracted == 0.0)
    assert np.any(beyond)
    assert np.all(s[beyond] >= 1.0 - allowed[beyond])
    # An error of q^2 becomes its root where q is 0.
    assert np.all(np.abs(cos_t**2 - refracted**2) <= 4 * NEAR[dtype] / np.minimum(eta, 1.0) ** 2)


@pytest.mark.parametrize("dtype", DTYPES)
def test_reflectances_keep_their_digits_towards_an_index_match(dtype):
    """R falls with the square of the contrast, and so does its error."""
    contrast = np.array([2.0**-10, 2.0**-15, 2.0**-20], dtype)
    c, eta = lanes_of(np.linspace(0.05, 1.0, 200), 1 + contrast, dtype=dtype)
    s, p, _ = over_lanes(fresnel.dielectric_power, c, eta, dtype=dtype)
    exact = reflectances(c.astype(float), eta.astype(float))
    assert np.all(np.abs(s - exact.s) <= 10 * np.finfo(dtype).eps * exact.s)
    # p has its own zero, Brewster's angle.
    assert np.all(np.abs(p - exact.p) <= 20 * np.finfo(dtype).eps * exact.s)
    k = (eta - 1) / 2
    s, p = over_lanes(fresnel.conductor_power, c, eta, k, dtype=dtype)
    exact = reflectances(c.astype(float), eta.astype(float), k.astype(float))
    assert np.all(np.abs(s - exact.s) <= 10 * np.finfo(dtype).eps * exact.s)
    assert np.all(np.abs(p - exact.p) <= 20 * np.finfo(dtype).eps * exact.s)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("eta", [1.5, 2.4, 1 / 1.5])
def test_p_vanishes_at_brewsters_angle(dtype, eta):
    c = np.cos(brewster_angle(eta))
    _, p, _ = over_lanes(fresnel.dielectric_power, [c], [eta], dtype=dtype)
    assert p[0] <= (8 * np.finfo(dtype).eps) ** 2


def test_reflection_is_total_at_the_critical_angle_and_beyond():
    eta = 1 / 1.5
    c = np.cos(critical_angle(eta)) * np.array([0.0, 0.5, 0.999, 1.0 - 1e-12])
    s, p, cos_t = over_lanes(fresnel.dielectric_power, c, eta)
    assert np.all(s == 1.0)
    assert np.all(p == 1.0)
    assert np.all(cos_t == 0.0)
    assert np.all(np.array(over_lanes(fresnel.dielectric_transmission, c, eta)) == 0.0)
    a, b, re, im = over_lanes(fresnel.dielectric_mueller, c, eta)
    assert np.all(a == 1.0)
    assert np.all(b == 0.0)
    assert re**2 + im**2 == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("dtype", DTYPES)
def test_conductor_powers_are_the_exact_ones(dtype):
    c, eta, k = lanes_of(cosines(), ETAS, KS, dtype=dtype)
    s, p = over_lanes(fresnel.conductor_power, c, eta, k, dtype=dtype)
    c, eta, k = (x.astype(float) for x in (c, eta, k))
    exact = reflectances(c, eta, k)
    # k only smooths the edge of total reflection.
    allowed = 2 * NEAR[dtype] * conditioning(c, eta, dtype)
    assert np.all(np.abs(s - exact.s) <= allowed)
    assert np.all(np.abs(p - exact.p) <= allowed)
    assert np.all((s >= 0) & (s <= 1) & (p >= 0) & (p <= 1))


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_conductor_without_k_is_a_dielectric(dtype):
    c, eta = lanes_of(cosines(), ETAS, dtype=dtype)
    ours = over_lanes(fresnel.conductor_mueller, c, eta, 0.0, dtype=dtype)
    other = over_lanes(fresnel.dielectric_mueller, c, eta, dtype=dtype)
    allowed = 4 * NEAR[dtype] * conditioning(c.astype(float), eta.astype(float), dtype)
    assert np.all(np.abs(ours - other) <= allowed)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("kind", ["dielectric", "conductor"])
def test_blocks_are_those_of_the_mueller_matrix(dtype, kind):
    ks = (0.0,) if kind == "dielectric" else KS
    c, eta, k = lanes_of(cosines(120), ETAS, ks, dtype=dtype)
    if kind == "dielectric":
        block = over_lanes(fresnel.dielectric_mueller, c, eta, dtype=dtype)
    else:
        block = over_lanes(fresnel.conductor_mueller, c, eta, k, dtype=dtype)
    c, eta, k = (x.astype(float) for x in (c, eta, k))
    r_s, r_p = amplitudes(c, eta, k)
    matrix = mueller.reflection(r_s, r_p)
    exact = np.stack([matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 2, 2], matrix[:, 3, 2]])
    allowed = 4 * NEAR[dtype] * conditioning(c, eta, dtype)
    assert np.all(np.abs(block - exact) <= allowed)


@pytest.mark.parametrize("dtype", DTYPES)
def test_what_is_not_reflected_is_transmitted(dtype):
    c, eta = lanes_of(cosines(), ETAS, dtype=dtype)
    a, b, cross = over_lanes(fresnel.dielectric_transmission, c, eta, dtype=dtype)
    exact = reflectances(c.astype(float), eta.astype(float))
    apart = (c > 0) | (eta > 1)  # grazing along no interface: all of nothing is transmitted, and none of it
    allowed = 2 * NEAR[dtype] * conditioning(c.astype(float), eta.astype(float), dtype)
    assert np.all((np.abs(a + b - exact.transmitted_s) <= allowed)[apart])
    assert np.all((np.abs(a - b - exact.transmitted_p) <= allowed)[apart])
    # Pure transmission: A^2 = B^2 + C^2.
    assert np.all(np.abs(cross - np.sqrt((a + b) * (a - b))) <= 8 * NEAR[dtype])
    assert np.all(cross >= 0.0)


def test_transmission_follows_the_transmitted_fields():
    """t_s = 1 + r_s, t_p = (1 + r_p) / eta, power with the ratio of q."""
    c, eta = lanes_of(np.linspace(0.05, 1.0, 100), (1 / 1.5, 1.2, 1.5, 2.4), dtype=np.float64)
    q2 = eta**2 - 1 + c**2
    below = q2 > 1e-3
    c, eta, q = c[below], eta[below], np.sqrt(q2[below])
    r_s, r_p = amplitudes(c, eta)
    t_s, t_p = 1 + r_s.real, (1 + r_p.real) / eta
    a, b, cross = over_lanes(fresnel.dielectric_transmission, c, eta)
    assert a + b == pytest.approx(q / c * t_s**2, abs=1e-13)
    assert a - b == pytest.approx(q / c * t_p**2, abs=1e-13)
    assert cross == pytest.approx(q / c * t_s * t_p, abs=1e-13)


@pytest.mark.parametrize("dtype", DTYPES)
def test_the_approximate_form_holds_its_rungs(dtype):
    c = np.linspace(0.0, 1.0, 101)
    for eta, k in ((1.5, 0.0), (0.183, 3.43), (2.9, 3.0)):
        normal = float(r0(eta, k))
        near = {"abs": NEAR[dtype]}
        assert over_lanes(fresnel.approximate, c, normal, 0, 0, dtype=dtype) == pytest.approx(normal, **near)
        got = over_lanes(fresnel.approximate, c, normal, 1 - normal, 0, dtype=dtype)
        assert got == pytest.approx(schlick(c, normal), **near)
        at = 1 / 7
        a = (schlick(at, normal) - min(f82(eta, k)(at), schlick(at, normal))) / (at * (1 - at) ** 6)
        got = over_lanes(fresnel.approximate, c, normal, 1 - normal, a, dtype=dtype)
        assert got == pytest.approx(f82(eta, k)(c), **near)
        got = over_lanes(fresnel.large_index, c, eta, k, dtype=dtype)
        assert got == pytest.approx(conductor_approximation(c, eta, k).mean, **near)


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_turn_is_a_turn(dtype):
    u = np.linspace(0.0, 1.0, 100_001, dtype=dtype)
    got = np.array(over_lanes(cos_sin_turn, u, dtype=dtype), float)
    angle = 2 * np.pi * u.astype(float)
    assert np.abs(got - [np.cos(angle), np.sin(angle)]).max() <= 4 * np.finfo(dtype).eps
    assert np.abs(np.hypot(*got) - 1).max() <= 2 * np.finfo(dtype).eps


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
@pytest.mark.parametrize("dtype", DTYPES)
def test_a_loop_over_lanes_is_vector_code(dtype):
    """A literal of the wrong type, a call or a branch in any of these would leave scalar or converted arithmetic."""

    @njit(error_model="numpy", fastmath=FLAGS)
    def run(f):
        for j in range(128):
            c, s = cos_sin_turn(f[j])
            r_s, r_p, cos_t = fresnel.dielectric_power(f[j], f[128 + j])
            block = fresnel.conductor_mueller(f[j], f[128 + j], f[256 + j])
            other = fresnel.dielectric_mueller(f[j], f[128 + j])
            through = fresnel.dielectric_transmission(f[j], f[128 + j])
            f[384 + j] = c * r_s + s * r_p + cos_t + fresnel.large_index(f[j], f[128 + j], f[256 + j])
            f[512 + j] = block[0] * other[0] + block[1] * other[1] + block[2] * other[2] + block[3] * other[3]
            f[640 + j] = through[0] + through[1] * through[2]

    run(np.full(768, 0.5, dtype))
    assembly = "".join(run.inspect_asm().values())
    letter, wrong = ("s", "d") if dtype == np.float32 else ("d", "s")
    assert len(re.findall(rf"\tv?(?:mul|div|sqrt|fn?m\w+)p{letter}\b", assembly)) > 50
    assert not re.findall(rf"\tv?(?:mul|div|sqrt|fn?m\w+)[ps]{wrong}\b", assembly)
    assert not re.findall(rf"\tv?(?:mul|div|sqrt|fn?m\w+)s{letter}\b", assembly)
