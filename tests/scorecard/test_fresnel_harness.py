"""The scorecard's own parts: a wrong reference, a wrong ulp or a blind search would make every figure worthless."""

import math
import sys
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parent))

import fresnel as scorecard
import fresnel_oracle as oracle
import fresnel_peers as peers
import fresnel_regimes as regimes
import fresnel_search as search
import fresnel_trial as trial
from card import Figure, Table

from reflectance_fit.physics import fresnel
from reflectance_fit.physics.fresnel import Reflectances

DYADIC = st.integers(1, 2**53 - 1).map(lambda i: i / 2**50)
ALL = (*regimes.DIELECTRIC, *regimes.CONDUCTOR, *regimes.NEAR_MATCH)


def exact(split, *index):
    """The rational number that a Split stands for."""
    exponent, whole, part = (x[index] for x in split)
    return (Fraction(float(whole)) + Fraction(float(part))) * Fraction(2) ** int(exponent)


def at(entry, *point, dtype=np.float64):
    return oracle.reference(entry, [np.array([x], dtype=dtype) for x in point], dtype)


def close(a, b, relative=Fraction(1, 2**100)):
    return abs(a - b) <= relative * abs(b)


@given(eta=DYADIC, k=st.one_of(st.just(0.0), DYADIC))
def test_normal_incidence_in_closed_form(eta, k):
    """R = ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2), in rational numbers."""
    n2, k2 = Fraction(eta), Fraction(k) ** 2
    r = ((n2 - 1) ** 2 + k2) / ((n2 + 1) ** 2 + k2)
    powers = at("cosine", 1.0, eta, k).powers
    for i, expected in enumerate((r, r, r, 1 - r, 1 - r, 1 - r)):
        # A Split holds 64 bits behind the ulp, then a float's worth of them.
        assert abs(exact(powers, 0, i) - expected) <= Fraction(2) ** (int(powers.exponent[0, i]) - 50)


def test_brewster_in_closed_form():
    """3-4-5: at tan(theta) = 4/3, R_p vanishes and r_s = -(eta^2 - 1)/(eta^2 + 1) = -7/25."""
    with mpmath.workprec(oracle.BITS):
        eps = mpmath.mpf(16) / 9
        r_s, r_p = oracle.naive(mpmath.mpf(3) / 5, mpmath.mpc(eps), mpmath.mpc(eps - mpmath.mpf(16) / 25))
        assert abs(r_p) < mpmath.mpf(2) ** -1390
        assert abs(r_s + mpmath.mpf(7) / 25) < mpmath.mpf(2) ** -1390


@given(c=st.floats(1e-300, 0.6), eta=st.floats(0.1, 0.75))
def test_total_reflection(c, eta):
    """R = 1, T = 0, and the phase of r_s is -2 arctan(sqrt(sin^2 - eta^2) / cos): Born & Wolf 1.5.4 (60)."""
    found = at("cosine", c, eta, 0.0)
    assert found.powers.errors(np.array([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]])).max() < 2.0**-60
    r_s = complex(exact(found.real, 0, 0), exact(found.imag, 0, 0))
    evanescent = math.sqrt((1 - c * c) - eta * eta)
    assert abs(r_s - complex(c, -evanescent) / complex(c, evanescent)) < 1e-14


@given(theta_deg=st.floats(0.5, 89.5), eta=st.floats(1.01, 5.0))
def test_against_the_sine_and_tangent_laws(theta_deg, eta):
    """Fresnel's own form, which has no square root: r_s = -sin(i - t)/sin(i + t), r_p = tan(i - t)/tan(i + t)."""
    with mpmath.workprec(2000):
        i = mpmath.mpf(theta_deg) * mpmath.pi / 180
        t = mpmath.asin(mpmath.sin(i) / eta)
        expected = -mpmath.sin(i - t) / mpmath.sin(i + t), mpmath.tan(i - t) / mpmath.tan(i + t)
        found = oracle.ENTRIES["degrees"](*map(mpmath.mpf, (theta_deg, eta, 0.0)))
        for ours, theirs in zip(found, expected, strict=True):
            assert abs(ours - theirs) < mpmath.mpf(2) ** -1900


@given(theta=st.floats(0.01, 1.57), eta=st.floats(0.01, 5.0), k=st.floats(0.0, 5.0))
def test_azzams_relation(theta, eta, k):
    """r_s^2 - r_p = cos(2 theta) (r_s - r_s r_p) holds for every interface and knows no index."""
    with mpmath.workprec(1400):
        r_s, r_p = oracle.ENTRIES["angle"](*map(mpmath.mpf, (theta, eta, k)))
        left, right = r_s**2 - r_p, mpmath.cos(2 * mpmath.mpf(theta)) * (r_s - r_s * r_p)
        assert abs(left - right) < mpmath.mpf(2) ** -1200


@pytest.mark.parametrize("regime", ALL, ids=lambda one: f"{one.kind} {one.name}")
def test_more_bits_change_nothing(regime, monkeypatch):
    entry = "near match" if regime.near_match else "cosine"
    u = np.random.default_rng(1).random((regime.axes, 20))
    inputs = trial.Trial(regime.kind, regime.name, entry).inputs(u, np.zeros((0, 20), dtype=np.int64))
    before = oracle.reference(entry, inputs, np.float64)
    monkeypatch.setattr(oracle, "BITS", 8000)
    after = oracle.reference(entry, inputs, np.float64)
    for i in np.ndindex(20, 6):
        ulp = Fraction(2) ** int(after.powers.exponent[i])
        assert abs(exact(before.powers, *i) - exact(after.powers, *i)) <= ulp / 2**60


@pytest.mark.parametrize("entry", ["angle", "degrees"])
def test_the_spread_is_the_derivative_where_there_is_one(entry):
    """One ulp of x moves f by |f'| ulp(x); x is 90 degrees less the angle beyond 45 degrees."""
    for theta_deg in (20.0, 70.0):
        theta = theta_deg if entry == "degrees" else math.radians(theta_deg)
        right = 90.0 if entry == "degrees" else math.pi / 2
        found = at(entry, theta, 1.5, 0.3)
        h = 1e-6
        cosines = [math.cos(x * (math.pi / 180 if entry == "degrees" else 1)) for x in (theta - h, theta + h)]
        r = [float(fresnel.reflectances(c, 1.5, 0.3).s) for c in cosines]
        expected = abs(r[1] - r[0]) / (2 * h) * math.ulp(min(theta, right - theta)) / math.ulp(r[0])
        assert found.spread[0, 0] == pytest.approx(expected, rel=1e-5)
    assert not at("cosine", 0.5, 1.5, 0.3).spread.any()


def test_grazing_incidence_in_degrees_is_exact():
    assert at("degrees", 90.0, 1.5, 0.0).powers.errors(np.array([[1.0, 1, 1, 0, 0, 0]])).max() == 0


def split_of(value, dtype):
    info = np.finfo(dtype)
    lowest, digits = int(info.minexp) - int(info.nmant), int(info.nmant) + 1
    triple = oracle._split(value, oracle._exponent(value, digits, lowest))
    return oracle.Split(*(np.array([x], dtype=t) for x, t in zip(triple, (int, float, float), strict=True)))


@pytest.mark.parametrize(
    ("value", "computed", "ulp"),
    [
        ((1, -1), 0.5, 0.0),
        ((2**54 - 1, -54), 1.0, 0.5),  # just below 1 an ulp is 2^-53
        ((2**60 + 1, -60), 1.0, 2.0**-8),  # just above it is 2^-52
        ((2**60 + 1, -60), 1.0 + 2**-52, 1 - 2.0**-8),
        ((-3, -1), -1.5 - 2**-52, 1.0),
        ((5, -1075), 3 * 5e-324, 0.5),  # subnormal: an ulp is 2^-1074
        ((1, -1100), 5e-324, 1 - 2.0**-26),
        ((0, 0), 5e-324, 1.0),
        ((0, 0), 0.0, 0.0),
        ((1, 0), math.nan, math.inf),
        ((1, -1074), 1.0, math.inf),
    ],
)
def test_errors_in_ulp(value, computed, ulp):
    with mpmath.workprec(1400):
        found = split_of(mpmath.ldexp(*value), np.float64).errors(np.array([computed]))
    assert found[0] == ulp


@given(x=st.floats(2.0**-120, 1.0, width=32), steps=st.integers(-100, 100))
def test_an_ulp_of_float32_is_a_step_of_float32(x, steps):
    (there,) = search.moved(np.array([x], dtype=np.float32), np.array([steps]))
    if math.frexp(x)[1] == math.frexp(there)[1]:
        assert split_of(mpmath.mpf(x), np.float32).errors(np.array([there]))[0] == abs(steps)


def test_moved_stops_at_zero_and_keeps_the_sign():
    assert search.moved(np.array([1.0, -1.0, 5e-324, 0.0]), np.array([1, 1, -7, 2])).tolist() == [
        1 + 2**-52, -1 - 2**-52, 0.0, 1e-323
    ]  # fmt: skip


def test_the_search_climbs():
    """Needles 2^-25 wide in the cube and a few ulps wide beside it: 5,000 random points would come to 2^-13."""
    seen = []

    def errors(u, ulps):
        needles = -np.log2(np.column_stack([np.abs(u[0] - 0.3) + 2.0**-50, np.abs(ulps[1] - 12345) + 1.0]))
        seen.append(needles)
        return needles

    search.search(errors, 2, 2, 5000, np.random.default_rng(0), 32)
    found = np.concatenate(seen)
    assert len(found) == 5000
    assert found[:, 0].max() > 25
    assert found[:, 1].max() > -4


@pytest.mark.parametrize("regime", ALL, ids=lambda one: f"{one.kind} {one.name}")
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_regimes_stay_inside_the_domain(regime, dtype):
    one = trial.Trial(regime.kind, regime.name, "near match" if regime.near_match else "cosine", dtype)
    rng = np.random.default_rng(2)
    inputs = one.inputs(rng.random((regime.axes, 500)), rng.integers(-1024, 1024, (2, 500)))
    c, index, k = inputs
    assert {x.dtype for x in inputs} == {np.dtype(dtype)}
    assert np.all((c >= 0) & (c <= 1) & (k >= 0) & np.isfinite(index))
    assert regime.near_match or index.min() > 0
    assert (regime.kind == "dielectric") == (not k.any())


def correctly_rounded(c, eta, k=0.0, *, rung="compensated"):
    """The reference itself as an implementation."""
    inputs = np.broadcast_arrays(c, eta, k)
    dtype = np.float32 if c.dtype == np.float32 else np.float64
    powers = oracle.reference("cosine", [np.asarray(x, dtype=dtype) for x in inputs], dtype).powers
    values = np.ldexp(powers.whole, powers.exponent)
    return Reflectances(*values.T.astype(dtype))


@pytest.fixture
def planted(monkeypatch):
    """Run a short trial of Brewster's angle on another implementation of R_p."""

    def run(change, dtype=np.float64, kind="dielectric"):
        def implementation(c, eta, k=0.0, *, rung):
            powers = correctly_rounded(c, eta, k)
            return powers._replace(p=change(powers.p, c, eta, k).astype(c.dtype))

        monkeypatch.setitem(trial.ENTRIES, "cosine", implementation)
        monkeypatch.setattr(trial, "peers_of", lambda kind, dtype: [])
        return trial.run(trial.Trial(kind, "Brewster's angle", "cosine", dtype), 600)

    return run


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_the_right_answer_has_half_an_ulp(planted, dtype):
    found = planted(lambda r_p, *_: r_p, dtype)
    for output in oracle.POWERS:
        assert 0.4 < found.worst["compensated", output].error <= 0.5
    assert not any(found.outside.values())
    assert found.points == 600
    assert found.imbalance.error <= np.finfo(dtype).eps


def test_a_textbook_formula_is_found_out(planted):
    found = planted(lambda r_p, c, eta, k: peers.textbook(c, eta, np.zeros_like(c))["p"])
    worst = found.worst["double_word", "p"]
    assert worst.error > 1e14
    assert worst.at[0] == pytest.approx(1 / math.hypot(1, worst.at[1]), rel=1e-3)
    assert found.worst["double_word", "s"].error <= 0.5


def test_a_rounding_too_many_is_found_out(planted):
    """Rounded through 50 bits, R_p is wrong by up to 4 ulp."""
    found = planted(lambda r_p, *_: (r_p + 7 * r_p) - 7 * r_p)
    assert 2 < found.worst["compensated", "p"].error <= 5


def test_a_narrow_error_is_climbed_to(planted):
    """An error that grows towards Brewster's angle as eps c^2 - s^2 falls: random points reach 2^53 relative only."""
    found = planted(lambda r_p, c, eta, k: r_p * (1 + 1e-30 / np.abs((eta * c) ** 2 - (1 - c * c) + 1e-40)))
    assert found.worst["compensated", "p"].error > 1e8


def test_values_outside_are_counted(planted):
    found = planted(lambda r_p, *_: np.where(r_p > np.median(r_p), -r_p, np.nan))
    assert found.outside["plain"] == 600
    assert found.worst["plain", "p"].error == math.inf
    assert found.imbalance.error == math.inf


@pytest.mark.parametrize("peer", peers.PEERS, ids=lambda one: f"{one.name} {np.dtype(one.dtype)}")
def test_peers_are_called_as_they_want(peer):
    """Gold-like and glass at 60 degrees, to what their formats give away from every hard place."""
    if not peer.installed:
        pytest.skip(f"{peer.package} is not installed")
    for kind in peer.kinds:
        c, eta = (np.array([x, x], dtype=peer.dtype) for x in (0.5, 1.5))
        k = np.full_like(c, 3.4 if kind == "conductor" else 0.0)
        powers = peer.call(c, eta, k)
        expected = correctly_rounded(c, eta, k)
        for name, values in powers.items():
            np.testing.assert_allclose(values, getattr(expected, name), rtol=50 * np.finfo(peer.dtype).eps)


class Here:
    """In place of a pool of processes."""

    def __init__(self, *_):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    map = staticmethod(map)


def test_a_line_for_every_promise(monkeypatch):
    """A card of a few points has all figures, each with its place, and the tables with every regime."""
    monkeypatch.setattr(scorecard, "ProcessPoolExecutor", Here)
    monkeypatch.setattr(scorecard, "_evaluations", lambda entry, full: 3)
    monkeypatch.setattr(scorecard, "TIMED", 3)
    items = list(scorecard.figures(full=False))
    names = [item.name for item in items if isinstance(item, Figure)]
    assert len(set(names)) == len(names)
    judged = {item.name for item in items if isinstance(item, Figure) and item.target != "none"}
    assert judged >= {
        *(f"{kind}, float64, {rung}" for kind in scorecard.KINDS for rung in trial.JUDGED),
        *(f"{kind}, float32, compensated" for kind in scorecard.KINDS),
        *(f"outputs NaN, negative or above 1, {rung}" for rung in trial.RUNGS),
    }
    tables = [item for item in items if isinstance(item, Table)]
    assert [len(table.rows) - 2 for table in tables] == [
        len(regimes.DIELECTRIC), len(regimes.DIELECTRIC), len(regimes.CONDUCTOR), len(regimes.CONDUCTOR)
    ]  # fmt: skip
    assert all(len(row) == len(table.header) for table in tables for row in table.rows)
