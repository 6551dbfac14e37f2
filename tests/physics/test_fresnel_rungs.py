"""What each rung promises, against 1400 bits at the exact float inputs, in every regime that cancels something.

The reference takes the differences of the textbook amplitudes, which need no cancellation-free form in
1400 bits, so it shares no formula with ours.  The points include the worst the search of a few hundred
finds; longer searches belong to the scorecard.
"""

import subprocess
import sys
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from reflectance_fit.physics import differences, rungs, words
from reflectance_fit.physics.bulk import unpolarized
from reflectance_fit.physics.extremes import in_decimals, out_of_range
from reflectance_fit.physics.fresnel import (
    amplitudes,
    reflectances,
    reflectances_at_angle,
    reflectances_at_deg,
    reflectances_near_match,
)

N = 60
RUNGS = ("plain", "compensated", "double_word")
ALLOWED_ULPS = {"compensated": 16.0, "double_word": 1.5}


def decades(rng, low, high):
    return 10.0 ** rng.uniform(low, high, N)


def beside(rng, values, low, high):
    """Values moved by a relative 10^low to 10^high to either side."""
    return values * (1 + rng.choice([-1, 1], N) * decades(rng, low, high))


def above(c, by):
    """The index whose critical angle c is, raised by a fraction, and no k."""
    return np.sqrt((1 - c) * (1 + c)) * (1 + by), 0 * c


def regimes(seed):
    r = np.random.default_rng(seed)
    none, any_c, graze = np.zeros(N), r.uniform(0.01, 1, N), decades(r, -16, -2)
    normal, glass = 1 - decades(r, -16, -3), r.uniform(1.05, 4, N)
    dense, thin, metal = decades(r, 1, 8), r.uniform(0.05, 0.999, N), r.uniform(0.5, 9, N)
    small, near = decades(r, -8, -1), 1 + r.choice([-1, 1], N) * decades(r, -15, -3)
    critical = np.minimum(beside(r, np.sqrt(1 - thin**2), -16, -3), 1)
    both = r.uniform(0.1, 4, N)
    brewster = np.minimum(beside(r, 1 / np.sqrt(1 + both**2), -16.5, -3), 1)
    below = np.sqrt(1 - (small * r.uniform(0, 1, N)) ** 2)
    weak, k = decades(r, -17, -3), decades(r, -3, 1)
    return {
        "glass": (any_c, glass, none),
        "glass grazing": (graze, glass, none),
        "glass near normal": (normal, glass, none),
        "matched": (any_c, near, none),
        "matched grazing": (graze, near, none),
        "dense": (any_c, dense, none),
        "dense grazing": (graze, dense, none),
        "thin": (any_c, thin, none),
        "critical": (critical, thin, none),
        "brewster": (brewster, both, none),
        "near zero": (below, small, none),
        "near zero, critical": (
            last := 1 - 2.0**-53 * r.integers(1, 99, N),
            *above(last, decades(r, -14, -4)),
        ),
        "metal": (any_c, both, metal),
        "metal grazing": (graze, both, metal),
        "metal near normal": (normal, both, metal),
        "weakly absorbing": (any_c, both, decades(r, -300, -1)),
        "matched, absorbing": (any_c, near, weak),
        "matched, absorbing, grazing": (graze, near, decades(r, -150, -3)),
        "near zero, absorbing": (any_c, small, decades(r, -8, -1)),
        "near zero, absorbing, near normal": (normal, small, decades(r, -8, -1)),
        "critical, absorbing": (critical, thin, weak),
        "brewster, absorbing": (brewster, both, weak),
        "strongly absorbing": (any_c, both, dense),
        "dense, absorbing, grazing": (graze, dense, decades(r, 1, 8)),
        "Re eps = s^2": (any_c, beside(r, np.sqrt(k**2 + 1 - any_c**2), -16, -3), k),
        "total, absorbing": (any_c, np.sqrt(1 - any_c**2) * 0.99 + 1e-9, decades(r, -320, -6)),
        "hardly any interface": (decades(r, -200, 0), np.ones(N), decades(r, -250, -20)),
        "huge": (decades(r, -100, 0), decades(r, 15, 100), decades(r, 15, 100)),
        "tiny": (1 - decades(r, -40, 0), decades(r, -100, -15), decades(r, -100, -15)),
        "absurd": (decades(r, -200, 0), decades(r, -100, 100), decades(r, -200, 100)),
    }


REGIMES = regimes(20240923)
EXTREME = ("hardly any interface", "huge", "tiny", "absurd")


def exact(c, eta, k):
    """R_s, R_p, F, T_s, T_p, T with numerators and denominators of Snell's amplitudes, each squared apart."""
    with mpmath.workprec(1400):
        c, index = mpmath.mpf(float(c)), mpmath.mpc(eta, float(k))
        w2 = index**2 - (1 - c**2)
        w = mpmath.sqrt(w2) if k or w2.real >= 0 else mpmath.mpc(0, mpmath.sqrt(-w2.real))
        r = [abs((x - w) / (x + w)) ** 2 for x in (c, index**2 * c)]
        t = [1 - x for x in r]
        return [*r, (r[0] + r[1]) / 2, *t, (t[0] + t[1]) / 2]


EXACT = {
    name: [exact(*(mpmath.mpf(float(x)) for x in point)) for point in zip(*points, strict=True)]
    for name, points in REGIMES.items()
}


def in_order(r):
    return r.s, r.p, r.mean, r.transmitted_s, r.transmitted_p, r.transmitted


def ulps(value, exact_value):
    """Distance in units in the last place of the exact value, in the type of value."""
    place = np.spacing(abs(type(value)(float(exact_value))))
    with mpmath.workprec(1400):
        return abs(float((mpmath.mpf(float(value)) - exact_value) / mpmath.mpf(float(place))))


@pytest.mark.parametrize("rung", ALLOWED_ULPS)
@pytest.mark.parametrize("regime", REGIMES)
def test_every_output_keeps_its_digits(regime, rung):
    outputs = in_order(reflectances(*REGIMES[regime], rung=rung))
    errors = [[ulps(o[i], EXACT[regime][i][j]) for i in range(N)] for j, o in enumerate(outputs)]
    assert np.max(errors) <= ALLOWED_ULPS[rung]


@pytest.mark.parametrize("regime", [name for name in REGIMES if name not in EXTREME])
def test_float32_keeps_its_digits(regime):
    c, eta, k = (np.float32(np.clip(x, 0, 1e30)) for x in REGIMES[regime])
    eta = np.maximum(eta, np.float32(1e-30))
    outputs = in_order(reflectances(c, eta, k))
    for i in range(0, N, 4):
        references = exact(c[i], mpmath.mpf(float(eta[i])), k[i])
        assert max(ulps(o[i], e) for o, e in zip(outputs, references, strict=True)) <= 1.0


@pytest.mark.parametrize("rung", RUNGS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_no_power_is_lost_in_any_regime(rung, dtype):
    for points in REGIMES.values():
        c, eta, k = (np.clip(x, 0, 1e30).astype(dtype) for x in points)
        r = reflectances(c, np.maximum(eta, dtype(1e-30)), k, rung=rung)
        assert all(np.all((x >= 0) & (x <= 1)) and x.dtype == dtype for x in r)
        for back, on in ((r.s, r.transmitted_s), (r.p, r.transmitted_p), (r.mean, r.transmitted)):
            assert np.all(np.abs(back.astype(float) + on - 1) <= np.finfo(dtype).eps)


@pytest.mark.parametrize("rung", ALLOWED_ULPS)
@pytest.mark.parametrize("regime", REGIMES)
def test_the_mean_over_large_arrays_keeps_its_digits(regime, rung):
    for i in range(0, N, 3):
        c, eta, k = (float(x[i]) for x in REGIMES[regime])
        assert (
            ulps(unpolarized(np.array([c]), eta, k, rung=rung)[0], EXACT[regime][i][2]) <= ALLOWED_ULPS[rung]
        )


@pytest.mark.parametrize("rung", RUNGS)
@pytest.mark.parametrize("regime", [name for name in REGIMES if name not in EXTREME])
def test_amplitudes_square_to_the_powers_and_turn_as_the_textbook_says(regime, rung):
    c, eta, k = REGIMES[regime]
    fields, r = amplitudes(c, eta, k, rung=rung), reflectances(c, eta, k, rung=rung)
    if rung == "plain" and regime == "near zero, critical":
        return  # Plain loses most digits of both, each its own.
    for field, power in zip(fields, (r.s, r.p), strict=True):
        np.testing.assert_allclose(abs(field) ** 2, power, rtol=1e-13, atol=1e-300)
    if rung == "plain":
        return
    for i in range(0, N, 5):
        with mpmath.workprec(1400):
            index = mpmath.mpc(float(eta[i]), float(k[i]))
            w2 = index**2 - (1 - mpmath.mpf(float(c[i])) ** 2)
            w = mpmath.sqrt(w2) if k[i] or w2.real >= 0 else mpmath.mpc(0, mpmath.sqrt(-w2.real))
            for field, x in zip(fields, (mpmath.mpf(float(c[i])), index**2 * float(c[i])), strict=True):
                reference = (x - w) / (x + w)
                error = mpmath.mpc(complex(field[i])) - reference
                assert abs(error) <= 1e-14 * abs(reference)


@pytest.mark.parametrize("rung", RUNGS)
def test_the_readable_form_is_the_kernel(rung):
    """The cores run on arrays as they stand; compiled they give the same last bits."""
    for name, (c, eta, k) in REGIMES.items():
        inside = ~out_of_range(c, eta, eta - 1.0, k)
        arguments = [x[inside] for x in (c, np.full(N, -1.0), eta, eta - 1.0, k)]
        pairs = {"compensated": "double_word"}.get(rung, rung)
        for powers, core in ((True, f"{rung}_powers"), (False, f"{pairs}_amplitudes")):
            kernel = rungs.evaluate(powers, rung, *arguments)
            with np.errstate(divide="ignore", invalid="ignore"):
                readable = np.array(getattr(rungs, core)(*arguments))
            np.testing.assert_array_max_ulp(readable, kernel, maxulp=1), name


def test_at_the_edge_of_total_reflection_plain_words_find_no_wave_at_all():
    """eta^2 - sin^2 rounds to 0: neither part of w may come from dividing by the other."""
    c, eta = float.fromhex("0x1.3bdf1e6a0cb1ap-1"), float.fromhex("0x1.92f3585195fb3p-1")
    assert amplitudes(c, eta, rung="plain") == (1.0, 1.0)
    exact = amplitudes(c, eta)
    np.testing.assert_allclose(exact, [1.0, 1.0], rtol=0, atol=1e-7)
    assert exact[0] != 1.0


def test_decimals_agree_with_the_kernels_where_both_have_room():
    c, eta, k = (
        np.concatenate([p[i][:6] for name, p in REGIMES.items() if name not in EXTREME]) for i in range(3)
    )
    inside = ~out_of_range(c, eta, eta - 1.0, k)
    arguments = [x[inside] for x in (c, np.full(c.size, -1.0), eta, eta - 1.0, k)]
    for powers, core in ((True, rungs.plain_powers), (False, rungs.plain_amplitudes)):
        kernel = rungs.evaluate(powers, "double_word", *arguments)
        np.testing.assert_array_max_ulp(in_decimals(core, *arguments), kernel, maxulp=1)


@given(eta=st.floats(0.05, 20.0), k=st.floats(0.0, 9.0), theta_deg=st.floats(0.0, 90.0))
def test_radians_and_degrees_are_cosines(eta, k, theta_deg):
    theta = np.radians(theta_deg)
    # The powers of a rounded angle differ; beside the critical angle by the root of the rounding.
    assume(k > 1e-2 or abs(np.sin(theta) - eta) > 1e-3)
    by_cosine = reflectances(np.cos(theta), eta, k)
    for r in (reflectances_at_angle(theta, eta, k), reflectances_at_deg(theta_deg, eta, k)):
        np.testing.assert_allclose(r, by_cosine, rtol=0, atol=1e-12)


def test_angles_keep_their_digits_where_a_cosine_has_none():
    """Near normal incidence cos(theta) is 1 to all digits, and an index near zero sees theta all the same."""
    theta, eta = np.array([3e-9, 0.9e-8, 1.1e-8]), 1e-8
    r = reflectances_at_angle(theta, eta, 1e-12)
    for i, t in enumerate(theta):
        with mpmath.workprec(300):
            index = mpmath.mpc(eta, 1e-12)
            c, w = mpmath.cos(float(t)), mpmath.sqrt(index**2 - mpmath.sin(float(t)) ** 2)
            expected = [float(1 - abs((x - w) / (x + w)) ** 2) for x in (c, index**2 * c)]
        assert [r.transmitted_s[i], r.transmitted_p[i]] == pytest.approx(expected, rel=1e-13, abs=0)


def test_degrees_keep_their_digits_near_90():
    t = 90.0 - 2.0**-40
    with mpmath.workprec(300):
        c = mpmath.sin(mpmath.mpf(2) ** -40 * mpmath.pi / 180)
        w = mpmath.sqrt(mpmath.mpf(1.5) ** 2 - 1 + c**2)
        expected = [float(1 - ((x - w) / (x + w)) ** 2) for x in (c, mpmath.mpf(2.25) * c)]
    r = reflectances_at_deg(t, 1.5)
    assert [r.transmitted_s, r.transmitted_p] == pytest.approx(expected, rel=1e-14, abs=0)
    assert reflectances_at_deg(90.0, 1.5).mean == 1.0


@pytest.mark.parametrize("rung", ALLOWED_ULPS)
def test_an_index_closer_to_1_than_floats_are(rung):
    rng = np.random.default_rng(5)
    c = np.concatenate([rng.uniform(0.01, 1, N), decades(rng, -12, -1), np.full(N, np.sqrt(0.5))])
    distance = rng.choice([-1, 1], 3 * N) * 10.0 ** rng.uniform(-25, -0.5, 3 * N)
    distance = np.where(distance > -0.5, distance, 0.25)
    k = np.where(rng.random(3 * N) < 0.5, 0.0, 10.0 ** rng.uniform(-25, -1, 3 * N))
    outputs = in_order(reflectances_near_match(c, distance, k, rung=rung))
    for i in range(3 * N):
        with mpmath.workprec(1400):
            references = exact(c[i], 1 + mpmath.mpf(float(distance[i])), k[i])
        assert max(ulps(o[i], e) for o, e in zip(outputs, references, strict=True)) <= ALLOWED_ULPS[rung]


def test_a_float_index_is_the_same_either_way():
    c, eta, k = REGIMES["matched, absorbing"]
    for rung in RUNGS:
        assert np.array_equal(
            reflectances(c, eta, k, rung=rung), reflectances_near_match(c, eta - 1, k, rung=rung)
        )


@pytest.mark.parametrize("distance", [-0.6, 1.5, np.nan])
def test_an_index_far_from_1_is_no_near_match(distance):
    with pytest.raises(ValueError, match="eta_minus_one"):
        reflectances_near_match(0.5, distance)


@pytest.mark.parametrize("theta_deg", [-1.0, 90.5, np.nan])
def test_an_angle_outside_0_to_90_degrees_is_refused(theta_deg):
    with pytest.raises(ValueError, match="theta_i_deg"):
        reflectances_at_deg(theta_deg, 1.5)
    with pytest.raises(ValueError, match="theta_i"):
        reflectances_at_angle(np.radians(theta_deg), 1.5)


@pytest.mark.parametrize(
    "function",
    [amplitudes, reflectances, reflectances_at_angle, reflectances_at_deg, reflectances_near_match],
)
def test_an_unknown_rung_is_refused_by_the_names_of_the_three(function):
    with pytest.raises(ValueError, match=r"'quadruple'.*'plain', 'compensated' or 'double_word'"):
        function(0.5, 0.5, rung="quadruple")


def test_float32_is_kept_only_where_every_array_is():
    c = np.linspace(0, 1, 5, dtype=np.float32)
    assert reflectances(c, 1.5).mean.dtype == np.float32
    assert amplitudes(c, 1.5)[0].dtype == np.complex64
    assert reflectances(np.float32(0.5), 1.5).mean.dtype == np.float32
    assert reflectances(c, np.full(5, 1.5)).mean.dtype == np.float64
    assert reflectances([0.5], 1.5).mean.dtype == np.float64


def test_large_arrays_cross_the_blocks_whole():
    c = np.random.default_rng(2).random((3, 7001))
    eta = np.array([[1.3], [0.2], [1e40]])
    whole = reflectances(c, eta, 0.1)
    rows = [reflectances(c[i], eta[i, 0], 0.1) for i in range(3)]
    assert all(np.array_equal(whole[j], [row[j] for row in rows]) for j in range(6))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("rung", RUNGS)
@pytest.mark.parametrize("index", [(1.5, 0.0), (0.2, 3.0), (0.7, 0.0), (1.0, 0.0), (1e30, 0.0), (1.0, 1e-60)])
def test_large_arrays_have_the_reflectance_of_each_angle(index, rung, dtype):
    c = np.concatenate([np.random.default_rng(1).random(1000), [0.0, 1.0, 1e-30]]).astype(dtype)
    expected = reflectances(c.astype(float), *index, rung=rung).mean
    serial = unpolarized(c, *index, rung=rung)
    assert serial.dtype == dtype
    lost = 1e-9 if rung == "plain" else np.finfo(dtype).smallest_subnormal
    np.testing.assert_allclose(serial, expected, rtol=8 * np.finfo(dtype).eps, atol=lost)
    assert np.all((serial >= 0) & (serial <= 1))
    out = np.empty_like(c)
    assert unpolarized(c, *index, rung=rung, threads=3, out=out) is out
    assert np.array_equal(out, serial)


@pytest.mark.parametrize(
    ("arguments", "options", "says"),
    [
        ((np.array([0.5, np.nan]), 1.5), {}, "degrees"),
        ((np.array([0.5, 1.5]), 1.5), {"threads": 2}, "degrees"),
        ((np.array([0.5, -0.5]), 1e50), {}, "degrees"),
        ((np.array([0.5]), -1.5), {}, "eta"),
        ((np.array([0.5]), 1.5, -1.0), {}, "n - ik"),
        ((np.array([0.5]), 1.5), {"rung": "quadruple"}, "double_word"),
        ((np.array([0.5]), 1.5), {"threads": 0}, "threads"),
        ((np.array([[0.5]]), 1.5), {}, "one dimension"),
        ((np.array([1]), 1.5), {}, "float32 or float64"),
        ((np.array([0.5]), 1.5), {"out": np.empty(2)}, "out"),
    ],
)
def test_large_arrays_outside_the_domain_are_refused(arguments, options, says):
    with pytest.raises(ValueError, match=says):
        unpolarized(*arguments, **options)


def exact_difference(value, pair):
    """Relative error of an unevaluated sum."""
    return float(abs(sum(map(Fraction, map(float, pair))) / value - 1))


@pytest.mark.parametrize("leads", ["cosine", "sine", "near match"])
def test_differences_keep_their_digits_however_far_they_cancel(leads):
    """The index is the float that cancels best, and of many such the best are taken: down to 2^-70 of the terms."""
    rng = np.random.default_rng(11)
    c = rng.uniform(0.6, 0.9, 20_000) if leads == "near match" else rng.uniform(0.1, 0.99, 20_000)
    sine = np.sqrt((1 - c) * (1 + c))
    # a at the critical angle, d at Brewster's.
    for place, other in ((0, 1.0), (1, c)):
        # The float nearest to a sine is that sine, and a would be 0.
        exactly = leads == "sine" and place == 0
        eta = np.nextafter(sine, 2.0) if exactly else sine / other
        if leads == "near match":
            # eta - 1 = s - 1 or (s - c) / c, a float of its own: finer than eta.
            distance = (sine - other) / other * (1 + rng.uniform(-1e-16, 1e-16, c.size))
            eta = 1.0 + distance
            keep = (distance > -0.5) & (distance < 1.0)
        else:
            distance, keep = eta - 1.0, eta > 0
        contrast, opposite, _, _ = differences.exact_index(eta, distance, 0.0 * c)
        c2, s2 = differences.exact_squares(c, sine if leads == "sine" else np.full(c.size, -1.0))
        pair = differences.exact_d(c2, opposite) if place else differences.exact_a(c2, contrast)
        best = np.argsort(np.where(keep, abs(pair[0]) / eta**2, np.inf))[:200]
        assert np.median(abs(pair[0][best] / eta[best] ** 2)) < (1e-15 if exactly else 1e-18)
        for i in best:
            index = 1 + Fraction(distance[i]) if leads == "near match" else Fraction(eta[i])
            square = 1 - Fraction(sine[i]) ** 2 if leads == "sine" else Fraction(c[i]) ** 2
            value = (index**2 * square if place else index**2) - (1 - square)
            assert exact_difference(value, (pair[0][i], pair[1][i])) < 2.0**-88
            assert exact_difference(1 - square, (s2[0][i], s2[1][i])) < 2.0**-100


@given(
    distance=st.one_of(st.floats(-0.5, 1.0), st.floats(-25.0, 0.0).map(lambda x: 10.0**x)),
    eta=st.floats(1e-8, 1e8),
    k=st.one_of(st.just(0.0), st.floats(-20.0, 8.0).map(lambda x: 10.0**x)),
    near=st.booleans(),
)
def test_what_the_index_alone_gives_is_exact_to_pairs(distance, eta, k, near):
    assume(not near or abs(distance) > 1e-30)
    exact_eta = 1 + Fraction(distance) if near else Fraction(eta)
    arguments = (1.0 + distance, distance, k) if near else (eta, eta - 1.0, k)
    contrast, opposite, b, contrast2 = differences.exact_index(*arguments)
    re_eps, k2 = exact_eta**2 - Fraction(k) ** 2, Fraction(k) ** 2
    size = max(exact_eta**2, k2, 1)
    assert abs(sum(map(Fraction, map(float, contrast))) - (re_eps - 1)) <= size * Fraction(2) ** -150
    assert abs(sum(map(Fraction, map(float, opposite))) - (re_eps + 1)) <= size * Fraction(2) ** -150
    if k:
        assert exact_difference(2 * exact_eta * Fraction(k), b) < 2.0**-100
    if (value := (re_eps - 1) ** 2 + 4 * exact_eta**2 * k2) != 0:
        assert exact_difference(value, contrast2) < 2.0**-98


FLOATS = st.floats(-1e100, 1e100).filter(lambda x: x == 0 or abs(x) > 1e-100)


@given(a=FLOATS, b=FLOATS, c=FLOATS)
def test_error_free_transforms_lose_nothing(a, b, c):
    assert sum(map(Fraction, words.two_sum(a, b))) == Fraction(a) + Fraction(b)
    assert sum(map(Fraction, words.two_prod(a, b))) == Fraction(a) * Fraction(b)
    large, small = sorted((a, b), key=abs, reverse=True)
    assert sum(map(Fraction, words.fast_two_sum(large, small))) == Fraction(a) + Fraction(b)
    fused = Fraction(a) * Fraction(b) + Fraction(c)
    assert abs(Fraction(float(words.fma(a, b, c))) - fused) <= Fraction(np.spacing(abs(float(fused)))) * 3 / 4


def test_importing_compiles_nothing():
    code = (
        "from reflectance_fit.physics import bulk, bulk_kernels, fresnel, rungs\n"
        "tables = rungs._POWERS, rungs._AMPLITUDES, bulk_kernels.SERIAL, bulk_kernels.THREADED\n"
        "kernels = [kernel for table in tables for kernel in table.values()]\n"
        "assert len(kernels) == 18 and not any(kernel.signatures for kernel in kernels)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_processor_without_fma_is_told_once(monkeypatch):
    words.warn_without_fma.cache_clear()
    monkeypatch.setattr(words.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(words, "get_host_cpu_features", lambda: "+sse2,-fma,+fma4")
    with pytest.warns(RuntimeWarning, match="FMA"):
        words.warn_without_fma()
    words.warn_without_fma()
    words.warn_without_fma.cache_clear()
