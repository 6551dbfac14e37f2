"""What renderers use for Fresnel's equations: each form against its printed formula, and what it promises."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from reflectance_fit.physics import approximations, fitted_approximations
from reflectance_fit.physics.approximation_error import approximation_error
from reflectance_fit.physics.approximation_ladder import LADDER
from reflectance_fit.physics.approximations import conductor_approximation, schlick
from reflectance_fit.physics.fresnel import r0, reflectances

RUNGS = {rung.name: rung for rung in LADDER}
COSINES = st.floats(0.0, 1.0)
ETA, K = st.floats(0.05, 10.0), st.floats(0.0, 10.0)
METALS = [(0.16, 3.6), (0.06, 3.6), (1.02, 6.63), (3.18, 3.33), (1.38, 1.92), (2.54, 3.44)]
EXTREMES = [
    (1e-100, 0.0),
    (1e-100, 1e100),
    (1e100, 1e100),
    (1.0, 0.0),
    (1 + 2**-52, 0.0),
    (1.0, 1e-300),
    (0.5, 0.0),
]


def schlick_error(eta, k=0.0):
    return approximation_error(eta, k, lambda c: schlick(c, r0(eta, k)))


# --- Schlick


@given(r0=st.floats(0.0, 1.0))
def test_schlick_joins_r0_to_1(r0):
    assert schlick(1.0, r0) == r0
    assert schlick(0.0, r0) == pytest.approx(1.0)
    assert schlick(0.5, r0) == pytest.approx(r0 + (1 - r0) / 32)


def test_schlick_for_glass():
    error = schlick_error(1.5)
    assert error.at_deg == pytest.approx(85.0, abs=0.05)
    assert error.max_rel_error == pytest.approx(0.232, abs=5e-4)
    assert error.max_rel_at_deg == pytest.approx(55.5, abs=0.1)
    assert error.albedo_error == pytest.approx(-0.066, abs=5e-4)


@given(c=COSINES, eta=ETA, k=K)
def test_schlick_with_the_exact_r0_is_the_base_form_of_lazanyi(c, eta, k):
    base = ((eta - 1) ** 2 + 4 * eta * (1 - c) ** 5 + k**2) / ((eta + 1) ** 2 + k**2)
    assert RUNGS["schlick"](c, eta, k) == pytest.approx(base, abs=1e-14)


@given(c=COSINES, eta=ETA, k=K)
def test_schlick_with_the_real_r0_knows_no_k(c, eta, k):
    found = RUNGS["schlick_real_r0"](c, eta, k)
    assert found == RUNGS["schlick"](c, eta, 0.0)
    assert found == pytest.approx(schlick(c, ((eta - 1) / (eta + 1)) ** 2), abs=1e-15)


# --- the large-index form, and Gulbrandsen's


@given(c=COSINES, eta=ETA, k=K)
def test_conductor_approximation_is_the_printed_formula(c, eta, k):
    square, cross = eta**2 + k**2, 2 * eta * c
    found = conductor_approximation(c, eta, k)
    assert found.p == pytest.approx((square * c**2 - cross + 1) / (square * c**2 + cross + 1), abs=1e-12)
    assert found.s == pytest.approx((square - cross + c**2) / (square + cross + c**2), abs=1e-12)
    assert found.mean == pytest.approx((found.s + found.p) / 2)
    assert RUNGS["lecture_conductor"](c, eta, k) == found.mean
    assert all(0 <= x <= 1 for x in found)


def test_conductor_approximation_is_exact_at_the_ends_and_close_for_metals():
    for eta, k in [(0.183, 3.43), (0.97, 6.43)]:
        c = np.array([1.0, 0.0])
        assert conductor_approximation(c, eta, k).s == pytest.approx(reflectances(c, eta, k).s, abs=1e-14)
        assert conductor_approximation(c, eta, k).p == pytest.approx(reflectances(c, eta, k).p, abs=1e-14)
        error = approximation_error(eta, k, RUNGS["lecture_conductor"].curve(eta, k))
        assert 1e-5 < error.max_abs_error < 0.01


def through_r_and_g(eta, k):
    """Gulbrandsen (2014) as printed: an index to reflectivity and edge tint, both within [0, 1], and back."""
    r = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    eta_min, eta_max = (1 - r) / (1 + r), (1 + np.sqrt(r)) / (1 - np.sqrt(r))
    g = np.clip((eta_max - eta) / (eta_max - eta_min), 0.0, 1.0)
    eta = g * eta_min + (1 - g) * eta_max
    k2 = (r * (eta + 1) ** 2 - (eta - 1) ** 2) / (1 - r)
    return eta, np.sqrt(max(k2, 0.0))


# Not near a match, where the printed way back cancels all of k^2.
@given(c=COSINES, eta=ETA, k=st.floats(0.1, 10.0))
def test_gulbrandsen_is_the_large_index_form_of_the_nearest_r_and_g(c, eta, k):
    printed = conductor_approximation(c, *through_r_and_g(eta, k)).mean
    assert RUNGS["gulbrandsen"](c, eta, k) == pytest.approx(printed, abs=1e-9)


@given(c=COSINES, eta=ETA, k=K)
def test_gulbrandsen_keeps_every_index_of_modulus_1_or_more(c, eta, k):
    found, large_index = RUNGS["gulbrandsen"](c, eta, k), RUNGS["lecture_conductor"](c, eta, k)
    if np.hypot(eta, k) >= 1:
        assert found == large_index
    elif c not in (0.0, 1.0) and abs(np.hypot(eta, k) - 1) > 0.01 and 0.01 < c < 0.9:
        assert found != large_index


# --- F82


@given(eta=ETA, k=K)
def test_f82_is_exact_at_82_degrees_unless_that_is_above_schlick(eta, k):
    found, plain = RUNGS["f82"](1 / 7, eta, k), RUNGS["schlick"](1 / 7, eta, k)
    assert found == pytest.approx(min(reflectances(1 / 7, eta, k).mean, plain), abs=1e-14)


@given(c=COSINES, eta=ETA, k=K)
def test_f82_is_the_printed_formula_and_never_above_schlick(c, eta, k):
    """As OpenPBR 1.0 prints it, with specular_color the tint of the edge, in [0, 1]."""
    plain, edge = RUNGS["schlick"](c, eta, k), RUNGS["schlick"](1 / 7, eta, k)
    specular_color = min(reflectances(1 / 7, eta, k).mean / edge, 1.0)
    share = c * (1 - c) ** 6 / (1 / 7 * (6 / 7) ** 6)
    found = RUNGS["f82"](c, eta, k)
    assert found == pytest.approx(plain - share * (edge - specular_color * edge), abs=1e-13)
    assert found <= plain + 1e-15


# --- Lazanyi


@pytest.mark.parametrize(
    ("eta", "k"), [*METALS, (1.05, 0.0), (1.5, 0.0), (4.0, 0.0), (0.667, 0.0), (30.0, 100.0)]
)
def test_lazanyis_residual_is_the_least_squares_one(eta, k):
    """No other a and alpha do better by 1e-4 of the sum of squares: a general optimizer from many starts."""
    theta = np.radians((np.arange(180) + 0.5) / 2)
    c = np.cos(theta)
    residual = schlick(c, r0(eta, k)) - reflectances(c, eta, k).mean

    def misfit(x):
        return residual - x[0] * c * (1 - c) ** x[1]

    a, alpha = fitted_approximations.lazanyi_coefficients(eta, k)
    bounds = ([-np.inf, 0.1], [np.inf, 100.0])
    starts = [(0.1, 0.5), (1.0, 2.0), (1.0, 6.0), (10.0, 12.0), (30.0, 50.0), (-1.0, 1.0), (-10.0, 12.0)]
    best = min(least_squares(misfit, start, bounds=bounds).cost for start in starts)
    assert np.sum(misfit((a, alpha)) ** 2) / 2 <= best * (1 + 1e-4)
    assert RUNGS["lazanyi"](c, eta, k) - reflectances(c, eta, k).mean == pytest.approx(
        misfit((a, alpha)), abs=1e-14
    )


@pytest.mark.parametrize(("eta", "k"), METALS)
def test_lazanyis_residual_pays_for_metals(eta, k):
    before, after = (
        approximation_error(eta, k, RUNGS[name].curve(eta, k)) for name in ("schlick", "lazanyi")
    )
    assert after.rms_error < before.rms_error * 0.8


# --- the table


@given(c=COSINES, eta=st.floats(1.05, 10.0), k=K)
def test_the_table_is_linear_between_exact_values(c, eta, k):
    found = RUNGS["table"](c, eta, k)
    cell = np.floor(np.sqrt(c) * 256)
    low, high = cell / 256, min((cell + 1) / 256, 1.0)
    between = reflectances(np.array([low, high]) ** 2, eta, k).mean
    share = 256 * (np.sqrt(c) - low)
    assert found == pytest.approx(between[0] + share * (between[1] - between[0]), abs=1e-12)
    assert abs(found - reflectances(c, eta, k).mean) < 2e-4


def test_equal_steps_of_the_root_are_better_than_of_the_cosine():
    c = np.linspace(0.0, 1.0, 100_001)
    nodes = np.linspace(0.0, 1.0, fitted_approximations.TABLE_CELLS + 1)
    for eta, k in [*METALS, (1.0001, 0.0), (1.05, 0.0), (1.5, 0.0), (2.4, 0.0)]:
        exact = reflectances(c, eta, k).mean
        plain = np.abs(np.interp(c, nodes, reflectances(nodes, eta, k).mean) - exact).max()
        assert np.abs(RUNGS["table"](c, eta, k) - exact).max() < plain / 1.9


# --- all of them


def test_every_rung_has_a_name_a_source_and_a_domain_of_its_own():
    assert len(RUNGS) == len(LADDER) == 9
    for texts in ([r.source for r in LADDER], [r.valid_for for r in LADDER]):
        assert all(texts)
        assert len(set(texts)) == len(texts)
    assert LADDER[-1].name == "exact"


@pytest.mark.parametrize("name", RUNGS)
@given(eta=ETA, k=K)
def test_the_ends_are_exact(name, eta, k):
    normal, grazing = RUNGS[name](np.array([1.0, 0.0]), eta, k)
    expected = r0(eta, 0.0 if name == "schlick_real_r0" else k)
    assert normal == pytest.approx(expected, rel=1e-12, abs=1e-15)
    if name == "r0_constant":
        assert grazing == normal
    elif (eta, k) != (1.0, 0.0):
        assert grazing == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("name", RUNGS)
def test_many_materials_at_once_are_as_each_alone(name):
    eta, k = np.array([*METALS, (1.5, 0.0), (0.67, 0.0), (0.3, 0.2)]).T
    c = np.linspace(0.0, 1.0, 57)
    found = RUNGS[name](c, eta[:, np.newaxis], k[:, np.newaxis])
    assert found.shape == (9, 57)
    # numpy's sums over angles may take another order for one row than for nine.
    assert found == pytest.approx(
        np.array([RUNGS[name](c, *each) for each in zip(eta, k, strict=True)]), abs=1e-13
    )


@pytest.mark.parametrize(("eta", "k"), EXTREMES)
@pytest.mark.parametrize("name", RUNGS)
def test_extremes_give_numbers(name, eta, k):
    found = RUNGS[name](np.concatenate([np.linspace(0.0, 1.0, 101), np.geomspace(1e-300, 1e-3, 101)]), eta, k)
    assert np.all(np.isfinite(found))
    # Lazanyi's residual is not bound by anything.
    assert name == "lazanyi" or found.max() <= 1 + 1e-14


@pytest.mark.parametrize("name", RUNGS)
def test_scalars_give_scalars(name):
    assert np.ndim(RUNGS[name](0.5, 1.5, 0.1)) == 0


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: schlick(60.0, 0.04), "degrees"),
        (lambda: schlick(0.5, 4.0), "percent"),
        (lambda: schlick(0.5, np.nan), "r0"),
        (lambda: conductor_approximation(0.5, 1.0, -1.0), "n - ik"),
        (lambda: approximations.f82(np.array([1.5, 1.6]), 0.0), r"\(M, 1\)"),
    ],
)
def test_outside_the_domain(call, says):
    with pytest.raises(ValueError, match=says):
        call()


@pytest.mark.parametrize("name", RUNGS)
def test_every_rung_refuses_what_is_no_material_or_no_cosine(name):
    with pytest.raises(ValueError, match="eta"):
        RUNGS[name].curve(0.0, 0.0)
    with pytest.raises(ValueError, match="n - ik"):
        RUNGS[name].curve(1.5, -0.1)
    with pytest.raises(ValueError, match="cosine"):
        RUNGS[name](np.array([0.5, np.nan]), 1.5, 0.0)
