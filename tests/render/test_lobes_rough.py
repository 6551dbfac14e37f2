"""The rough interface: its samplers draw what they say, nothing gains energy, and it polarizes as its facets do."""

import platform
import re

import numpy as np
import pytest
import render_lobes
from numba import njit
from render_chi2 import Sampler, examine, integrate, significance
from render_lanes import FLAGS, over_lanes
from render_matrices import KINDS, least_eigenvalue, matrix, perpendicular, random_matrices, unit
from render_samplers import reflection, towards, transmission, view, visible_normals

from reflectance_fit.physics import mueller
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.render.lobes import fresnel, ggx

DTYPES = (np.float64, np.float32)
RNG = np.random.default_rng(11)


def directions(n, rng=RNG):
    return towards(rng.random(n), rng.uniform(-np.pi, np.pi, n))


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_facets_cover_the_surface_once(alpha):
    """The integral of D(h) h_z is 1, whatever the roughness."""

    def projected(z, phi):
        return over_lanes(ggx.ndf, alpha, *towards(z, phi)) * z

    # Steps in the tangent: the peak is as wide as alpha.
    z = np.sort(1.0 / np.sqrt(1.0 + (alpha * np.geomspace(1e-3, 1e5, 40)) ** 2))
    total = integrate(projected, np.concatenate([[0.0], z, [1.0]]), np.linspace(-np.pi, np.pi, 5)).sum()
    assert total == pytest.approx(1.0, abs=1e-6)


def test_masking_is_smiths():
    """1 / (1 + Lambda), 1 / (1 + Lambda_v + Lambda_l), Lambda = (sqrt(1 + alpha^2 tan^2) - 1) / 2 (Heitz 2014, 72, 99)."""
    alpha, z, other = RNG.uniform(0.01, 1, 500), RNG.uniform(0.01, 1, 500), RNG.uniform(0.01, 1, 500)

    def smith(z):
        return (np.sqrt(1 + alpha**2 * (1 / z**2 - 1)) - 1) / 2

    assert over_lanes(ggx.g1, alpha, z) == pytest.approx(1 / (1 + smith(z)), rel=1e-12)
    share = (1 + smith(z)) / (1 + smith(z) + smith(other))
    assert over_lanes(ggx.reflection_weight, alpha, z, other) == pytest.approx(share, rel=1e-12)


SOME = (
    visible_normals(0.2, 0.1),
    visible_normals(1.0, 0.7),
    reflection(0.05, 0.7),
    reflection(0.6, 0.1),
    transmission(0.2, 0.7, 1.5),
    transmission(0.6, 0.7, 1 / 1.5),
)


@pytest.mark.parametrize("sampler", SOME, ids=lambda s: s.name)
def test_samples_follow_their_density(sampler):
    found = examine(sampler, 200_000, seed=1, cells=12)
    assert found.p_value > significance(len(SOME))
    assert found.mass <= 1.0 + 1e-5


def test_the_chi_square_sees_a_wrong_sampler():
    """Roughness off by 2 %, or heights instead of visible areas."""
    right, wrong = visible_normals(0.2, 0.7), visible_normals(0.204, 0.7)
    assert (
        examine(Sampler("", wrong.sample, right.density, right.bounds), 200_000, 1, cells=12).p_value < 1e-6
    )
    right, wrong = transmission(0.2, 0.7, 1.5), transmission(0.2, 0.7, 1.51)
    assert (
        examine(Sampler("", wrong.sample, right.density, right.bounds), 200_000, 1, cells=12).p_value < 1e-6
    )


def test_reciprocity():
    figures = list(render_lobes.reciprocity())
    assert len(figures) == 4
    assert [f for f in figures if f.verdict != "ok"] == []


@pytest.mark.parametrize(("alpha", "cosine"), [(0.2, 0.5), (1.0, 0.1)])
def test_weak_furnace(alpha, cosine):
    assert render_lobes._weak(alpha, cosine) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    "kind", ["perfect conductor", "dielectric", "dielectric from inside", "white plastic"]
)
@pytest.mark.parametrize(("alpha", "cosine"), [(0.1, 0.8), (0.6, 0.3)])
def test_furnace_gives_nothing_away(kind, alpha, cosine):
    mean, error = render_lobes.albedos(kind, alpha, cosine, n=100_000)
    assert mean <= 1.0 + 4 * error
    assert mean > 0.5


@pytest.mark.parametrize("alpha", [0.1, 0.5])
@pytest.mark.parametrize("eta", [1.5, 1 / 1.5])
def test_with_masking_only_nothing_is_lost(alpha, eta):
    """Reflection and transmission, each as if all that leaves a facet got away, integrate to 1 over the sphere."""
    v = view(0.6)

    def reflected(z, phi):
        *h, cosine = over_lanes(ggx.half, *v, *towards(z, phi))
        s, p, _ = over_lanes(fresnel.dielectric_power, np.minimum(cosine, 1.0), eta)
        pdf = over_lanes(ggx.reflection_pdf, alpha, v[2], over_lanes(ggx.ndf, alpha, *h))
        return np.where(h[2] > 0, 0.5 * (s + p) * pdf, 0.0)

    def passed(z, phi):
        # Transmission through facets beyond the horizon is a part of it, so l is not asked where it is.
        l = towards(z, phi)
        h = v[:, None] + eta * l
        length = np.maximum(np.linalg.norm(h, axis=0), 1e-9)
        h *= np.where(h[2] < 0, -1, 1) / length
        near, far = v @ h, -np.sum(l * h, axis=0)
        a, _, _ = over_lanes(fresnel.transmission_between, np.clip(near, 1e-9, 1), np.clip(far, 1e-9, 1), eta)
        d = over_lanes(ggx.ndf, alpha, *h)
        pdf = over_lanes(ggx.transmission_pdf, alpha, v[2], near, far, length, eta, d)
        return np.where((near > 0) & (far > 0), a * pdf, 0.0)

    edges = np.linspace(-1, 1, 17), np.linspace(-np.pi, np.pi, 17)
    total = integrate(reflected, *edges).sum() + integrate(passed, *edges).sum()
    assert total == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("eta", [1.5, 1 / 1.5])
def test_directions_obey_the_laws_of_reflection_and_refraction(dtype, eta):
    n = 2000
    v, alpha = directions(n), RNG.uniform(0.01, 1, n)
    h = over_lanes(ggx.sample_visible, alpha, *v, *RNG.random((2, n)), dtype=dtype)
    near = 16 * np.finfo(dtype).eps
    assert np.abs(np.linalg.norm(h, axis=0) - 1).max() <= near
    assert np.all(h[2] >= 0)
    cosine = np.sum(v * h, axis=0)
    assert np.all(cosine >= -near)
    *l, got = over_lanes(ggx.mirrored, *v, *h, dtype=dtype)
    assert np.abs(got - cosine).max() <= near
    assert np.abs(l - (2 * cosine * h - v)).max() <= near
    power_s, _, cos_t = over_lanes(fresnel.dielectric_power, np.clip(cosine, 0, 1), eta, dtype=dtype)
    l = over_lanes(ggx.refracted, *v, *h, eta, cos_t, dtype=dtype)
    ok = (power_s < 1) & (cos_t > 0.1)
    # Snell: v and eta l have the same part along the surface of the facet, on opposite sides.
    along_v, along_l = v - cosine * h, l - np.sum(l * h, axis=0) * h
    assert np.abs(along_v + eta * along_l)[:, ok].max() <= 10 * near
    assert np.all(np.sum(l * h, axis=0)[ok] < 0)
    assert np.abs(np.linalg.norm(l, axis=0) - 1)[ok].max() <= 30 * near
    # And from v and l back to the facet.
    ok &= (l[2] < -0.01) & (cosine > 0.05)
    *again, c, far, _ = over_lanes(ggx.refraction_half, *v, *l, eta, dtype=dtype)
    assert np.abs(again - h)[:, ok].max() <= 100 * near
    assert np.abs(c - cosine)[ok].max() <= 100 * near
    assert np.abs(far - cos_t)[ok].max() <= 300 * near


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5])
def test_a_weight_is_value_over_density(eta):
    n = 5000
    v, alpha = directions(n), RNG.uniform(0.05, 1, n)
    h = over_lanes(ggx.sample_visible, alpha, *v, *RNG.random((2, n)))
    *l, cosine = over_lanes(ggx.mirrored, *v, *h)
    up, d = l[2] > 0.01, over_lanes(ggx.ndf, alpha, *h)
    value = over_lanes(ggx.reflection_value, alpha, v[2], l[2], d)
    pdf = over_lanes(ggx.reflection_pdf, alpha, v[2], d)
    weight = over_lanes(ggx.reflection_weight, alpha, v[2], l[2])
    assert (value / pdf)[up] == pytest.approx(weight[up], rel=1e-12)
    assert np.all(weight <= 1 + 1e-15)
    assert np.all(weight[l[2] <= 0] == 0)
    assert np.all(value[l[2] <= 0] == 0)
    s, _, cos_t = over_lanes(fresnel.dielectric_power, np.clip(cosine, 0, 1), eta)
    l = over_lanes(ggx.refracted, *v, *h, eta, cos_t)
    *_, near, far, length = over_lanes(ggx.refraction_half, *v, *l, eta)
    value = over_lanes(ggx.transmission_value, alpha, v[2], l[2], near, far, length, d)
    pdf = over_lanes(ggx.transmission_pdf, alpha, v[2], near, far, length, eta, d)
    # What a drawn refraction weighs; radiance behind an interface is squeezed by eta^2.
    weight = over_lanes(ggx.g1, alpha, np.maximum(-l[2], 0.0)) / eta**2
    ok = (s < 1) & (l[2] < -0.01) & (cosine > 0.01) & (cos_t > 0.01)
    assert np.all(pdf[ok] > 0)
    assert value[ok] / pdf[ok] == pytest.approx(weight[ok], rel=1e-9)
    assert np.all(value[l[2] >= 0] == 0)


@pytest.mark.parametrize("dtype", DTYPES)
def test_extremes_stay_finite_and_in_range(dtype):
    """Grazing and normal directions, the ends of the random numbers, nearly smooth and fully rough."""
    last = 1 - np.finfo(dtype).eps / 2
    grid = np.meshgrid(
        [0.0, 1e-30, 1e-6, 0.3, 1.0], [0.001, 0.05, 1.0], [0.0, 0.25, 0.7, last], [0.0, 0.5, last]
    )
    z, alpha, u1, u2 = (g.reshape(-1) for g in grid)
    v = towards(z, np.full(z.size, 0.3))
    h = over_lanes(ggx.sample_visible, alpha, *v, u1, u2, dtype=dtype)
    *l, cosine = over_lanes(ggx.mirrored, *v, *h, dtype=dtype)
    d = over_lanes(ggx.ndf, alpha, *h, dtype=dtype)
    cos_t = over_lanes(fresnel.dielectric_power, np.clip(cosine, 0, 1), 1.5, dtype=dtype)[2]
    behind = over_lanes(ggx.refracted, *v, *h, 1.5, cos_t, dtype=dtype)
    weights = (
        over_lanes(ggx.reflection_weight, alpha, v[2], l[2], dtype=dtype),
        over_lanes(ggx.g1, alpha, np.maximum(-behind[2], 0.0), dtype=dtype),
    )
    for weight in weights:
        assert np.all((weight >= 0) & (weight <= 1 + 1e-5))
    *half, near, far, length = over_lanes(ggx.refraction_half, *v, *behind, 1.5, dtype=dtype)
    values = (
        h, d, half, near, far,
        over_lanes(ggx.half, *v, *l, dtype=dtype),
        over_lanes(ggx.reflection_pdf, alpha, v[2], d, dtype=dtype),
        over_lanes(ggx.reflection_value, alpha, v[2], l[2], d, dtype=dtype),
        over_lanes(ggx.transmission_pdf, alpha, v[2], near, far, length, 1.5, d, dtype=dtype),
        over_lanes(ggx.transmission_value, alpha, v[2], behind[2], near, far, length, d, dtype=dtype),
    )  # fmt: skip
    assert all(np.all(np.isfinite(value)) for value in values)
    assert all(np.all(np.asarray(value) >= 0) for value in values[4:5] + values[6:])


@pytest.mark.parametrize("alpha", [0.02, 0.3])
def test_single_precision_follows_double(alpha):
    v, u = directions(4000), RNG.random((2, 4000))
    v, u = v.astype(np.float32), u.astype(np.float32)
    one, two = (
        over_lanes(ggx.sample_visible, alpha, *v, *u, dtype=dtype) for dtype in (np.float32, np.float64)
    )
    # Where the cap narrows to a point (u2 towards 1) a rounding of u2 moves h by its root.
    assert np.quantile(np.abs(one - two), 0.99) <= 2e-6
    assert np.abs(one - two).max() <= 1e-3
    d = [over_lanes(ggx.ndf, alpha, *two, dtype=dtype) for dtype in (np.float32, np.float64)]
    assert np.abs(d[0] / d[1] - 1).max() <= 2e-6
    weights = [
        over_lanes(ggx.reflection_weight, alpha, v[2], u[0], dtype=t) for t in (np.float32, np.float64)
    ]
    assert np.abs(weights[0] - weights[1]).max() <= 2e-6


# ------------------------------------------------------------- polarization


def jones_matrix(kind, v, h, l, eta, k):
    """The 3 x 3 matrix that takes the field of the light along -l to that along v: s and p of the facet, in space.

    Of transmission the flux is kept: the field times sqrt(n cos).
    """
    s = unit(np.cross(v, h, axis=0))
    # Light travels along -l, then along v.
    p_in, p_out = np.cross(-l, s, axis=0), np.cross(v, s, axis=0)
    c = np.sum(v * h, axis=0)
    r_s, r_p = amplitudes(c, eta, k)
    if "transmission" in kind:
        # From l's side: Stokes' relations, t t' = 1 - r^2 with either side's flux.
        f_s, f_p = np.sqrt(1 - np.abs(r_s) ** 2), np.sqrt(1 - np.abs(r_p) ** 2)
    else:
        f_s, f_p = r_s, r_p
    return np.einsum("n,in,jn->nij", f_s, s, s) + np.einsum("n,in,jn->nij", f_p, p_out, p_in)


def stokes_of(field, axis, z):
    """In the frame of docs/conventions.md: s along axis, p = z x s, S3 = 2 Im(E_s conj E_p)."""
    e_s = np.einsum("ni,in->n", field, axis)
    e_p = np.einsum("ni,in->n", field, np.cross(z, axis, axis=0))
    cross = 2 * e_s * np.conj(e_p)
    s0, s1 = np.abs(e_s) ** 2 + np.abs(e_p) ** 2, np.abs(e_s) ** 2 - np.abs(e_p) ** 2
    return np.stack([s0, s1, cross.real, cross.imag], axis=1)


@pytest.mark.parametrize("kind", KINDS[:3])
def test_a_rough_surface_polarizes_as_its_facets_do(kind):
    """Against fields in space, without any Mueller matrix or angle between frames."""
    n = 300
    v, alpha = directions(n), RNG.uniform(0.05, 1, n)
    eta = RNG.uniform(1.1, 2.5, n) if "transmission" in kind else RNG.uniform(0.3, 2.5, n)
    k = RNG.uniform(0, 4, n) if "conductor" in kind else np.zeros(n)
    h = over_lanes(ggx.sample_visible, alpha, *v, *RNG.random((2, n)))
    if "transmission" in kind:
        _, _, cos_t = over_lanes(fresnel.dielectric_power, np.sum(v * h, axis=0), eta)
        l = over_lanes(ggx.refracted, *v, *h, eta, cos_t)
    else:
        l = over_lanes(ggx.mirrored, *v, *h)[:3]
    axis = perpendicular(RNG, v)
    rows, s = matrix(kind, v, h, l, axis, eta, k)
    assert np.abs(np.sum(s * l, axis=0)).max() <= 1e-9
    jones = jones_matrix(kind, v, h, l, eta, k)
    a, b = RNG.normal(size=(2, n)) + 1j * RNG.normal(size=(2, n))
    field = (a * s + b * np.cross(-l, s, axis=0)).T
    expected = stokes_of(np.einsum("nij,nj->ni", jones, field), axis, v)
    got = np.einsum("nij,nj->ni", rows, stokes_of(field, s, -l))
    assert np.abs(got - expected).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("kind", KINDS)
def test_no_light_becomes_impossible(kind):
    matrices = random_matrices(kind, 2000, RNG)
    assert least_eigenvalue(matrices).min() >= -1e-12
    ends = RNG.normal(size=(3, 2000))
    stokes = np.concatenate([np.ones((1, 2000)), unit(ends)])
    out = np.einsum("nij,jn->in", matrices, stokes)
    assert np.all(np.linalg.norm(out[1:], axis=0) <= out[0] * (1 + 1e-12) + 1e-15)


def test_the_eigenvalue_test_sees_an_impossible_matrix():
    """Light that leaves more polarized than light can be, and a transposed handedness, which is not a depolarizer."""
    over = np.diag([1.0, 1.01, 1.0, 1.0])[None]
    conjugated = np.diag([1.0, 1.0, 1.0, -1.0])[None]
    assert least_eigenvalue(over)[0] < -1e-3
    assert least_eigenvalue(conjugated)[0] < -0.1
    assert least_eigenvalue(mueller.polarizer(0.3, 0.9)[None])[0] >= -1e-15


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
@pytest.mark.parametrize("dtype", DTYPES)
def test_a_loop_over_lanes_is_vector_code(dtype):
    @njit(error_model="numpy", fastmath=FLAGS)
    def run(f):
        for j in range(128):
            a, x, y, z, u, v = f[j], f[128 + j], f[256 + j], f[384 + j], f[512 + j], f[640 + j]
            hx, hy, hz = ggx.sample_visible(a, x, y, z, u, v)
            lx, ly, lz, c = ggx.mirrored(x, y, z, hx, hy, hz)
            d = ggx.ndf(a, hx, hy, hz)
            tx, ty, tz = ggx.refracted(x, y, z, hx, hy, hz, u, v)
            gx, gy, gz, near, far, length = ggx.refraction_half(x, y, z, tx, ty, tz, u)
            f[768 + j] = ggx.reflection_value(a, z, lz, d) + ggx.reflection_pdf(a, z, d) + lx + ly
            f[896 + j] = ggx.reflection_weight(a, z, lz) + ggx.g1(a, tz) + c
            f[1024 + j] = ggx.transmission_value(a, z, tz, near, far, length, d) + gx + gy + gz
            f[1152 + j] = ggx.transmission_pdf(a, z, near, far, length, u, d)

    run(np.full(1280, 0.5, dtype))
    assembly = "".join(run.inspect_asm().values())
    letter, wrong = ("s", "d") if dtype == np.float32 else ("d", "s")
    assert len(re.findall(rf"\tv?(?:mul|div|sqrt|fn?m\w+)p{letter}\b", assembly)) > 50
    assert not re.findall(rf"\tv?(?:mul|div|sqrt|fn?m\w+)[ps]{wrong}\b", assembly)
    assert not re.findall(rf"\tv?(?:mul|div|sqrt|fn?m\w+)s{letter}\b", assembly)
