"""What a map promises of its pixels: honest sigma, reasons kept, and the same bits however it is cut."""

import dataclasses

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.pixels.closed_form import sin_cos
from reflectance_fit.pixels.estimate import estimate
from reflectance_fit.pixels.status import Status, flag_meanings, flag_values

MANY = 20_000
# Four standard deviations of a share of 0.95 among so many.
BAND = 4 * np.sqrt(0.95 * 0.05 / MANY)


def arrays(found):
    fields = (getattr(found, f.name) for f in dataclasses.fields(found))
    return [a for a in fields if a is not None]


def cut(rows, start, stop):
    """The rows of some pixels, as a tile has them."""
    own = {
        name: np.ascontiguousarray(getattr(rows, name)[:, start:stop])
        for name in ("values", "variance", "theta", "cos_2s", "sin_2s")
        if getattr(rows, name).shape[1] > 1
    }
    return dataclasses.replace(rows, **own)


def ball(make, n, eta, k, **optics):
    """Every pixel its own angle and plane of incidence."""
    generator = np.random.default_rng(5)
    theta = generator.uniform(5.0, 85.0, (1, n))
    return make(theta, n, eta, k, s_deg=generator.uniform(-90.0, 90.0, n), **optics)


SCENES = {
    "closed form, ball": ("dielectric", 1.5, 0.0, {}),
    "Gauss-Newton, dielectric ball": ("dielectric", 1.5, 0.0, {"light": (1.0, 0.0, 0.7, 0.0)}),
    "conductor ball": ("conductor", 1.2, 3.0, {"light": (1.0, 0.0, 0.7, 0.2), "retarder_deg": 20.0}),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_same_bits_however_it_is_cut(name, make):
    model, eta, k, optics = SCENES[name]
    n = 1031
    rows = ball(make, n, eta, k, snr=100.0, **optics)
    rows.values[0, ::17] = np.nan
    rows.values[:, 5] = 0.0
    reason = np.where(np.arange(n) % 11 == 0, Status.MASKED, 0).astype(np.uint8)
    whole = arrays(estimate(rows, model, reason))
    threads = numba.get_num_threads()
    for tile in (1, 63, 64, 257, 500):
        numba.set_num_threads(1 if tile % 2 else threads)
        parts = [
            arrays(estimate(cut(rows, i, min(i + tile, n)), model, reason[i : i + tile].copy()))
            # single pixels are slow
            for i in range(0, n if tile > 1 else 40, tile)
        ]
        numba.set_num_threads(threads)
        for one, pieces in zip(whole, zip(*parts, strict=True), strict=True):
            joined = np.concatenate(pieces)
            assert joined.tobytes() == one[: len(joined)].tobytes()


@pytest.mark.parametrize(("theta", "eta"), [(30.0, 1.5), (40.0, 1.33), (45.0, 2.4)])
def test_sigma_of_the_closed_form_covers(theta, eta, make):
    found = estimate(make([theta], MANY, eta, 0.0, snr=400.0), "dielectric")
    assert np.all(found.status == Status.IDENTIFIED)
    share = np.mean(np.abs(found.eta - eta) <= 1.96 * found.eta_sigma)
    assert abs(share - 0.95) <= BAND + 0.003  # eta is not quite linear in the noise
    assert np.mean(found.chi2 / found.dof) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("theta", [55.0, 56.31, 58.0])
def test_sigma_near_brewster_covers_both_sides(theta, make):
    """There R_p / R_s is not normal in eta, and which side is not known: no less than 95 %, and no infinity."""
    found = estimate(make([theta], MANY, 1.5, 0.0, snr=200.0), "dielectric")
    near = found.status == Status.NEAR_BREWSTER
    assert near.mean() > 0.5
    assert np.mean(np.abs(found.eta - 1.5)[near] <= 1.96 * found.eta_sigma[near]) >= 0.95
    assert np.median(found.eta_sigma[near]) < 0.2


def test_sigma_of_gauss_newton_covers(make):
    found = estimate(make([40.0, 65.0], MANY, 1.5, 0.0), "dielectric")
    share = np.mean(np.abs(found.eta - 1.5) <= 1.96 * found.eta_sigma)
    assert abs(share - 0.95) <= BAND + 0.003


def test_both_sigmas_and_the_correlation_of_a_conductor_cover(make):
    eta, k = 0.42, 2.4
    found = estimate(make([40.0, 60.0, 75.0], MANY, eta, k, snr=400.0), "conductor")
    assert np.all(found.status == Status.IDENTIFIED)
    of_eta, of_k = (found.eta - eta) / found.eta_sigma, (found.k - k) / found.k_sigma
    for z in (of_eta, of_k):
        assert abs(np.mean(np.abs(z) <= 1.96) - 0.95) <= BAND + 0.003
    assert np.corrcoef(of_eta, of_k)[0, 1] == pytest.approx(found.correlation.mean(), abs=0.02)


@pytest.mark.parametrize(
    "optics", [{}, {"light": (1.0, 0.0, 0.8, 0.3), "retarder_deg": 20.0}], ids=["plain", "retarder"]
)
@pytest.mark.parametrize("k", [0.0, 0.02])
def test_upper_limits_of_k_hold(k, optics, make):
    found = estimate(make([45.0, 65.0, 75.0], 5000, 1.5, k, **optics), "conductor")
    limited = found.status == Status.UPPER_LIMIT
    assert limited.mean() > 0.5
    limit = found.k[limited] + 1.645 * found.k_sigma[limited]
    assert np.mean(k <= limit) >= 0.94
    assert np.median(limit) < 0.5


def test_reasons_are_kept_and_their_pixels_not_estimated(make):
    n = len(Status)
    rows = make([40.0], n, 1.5, 0.0)
    reason = np.array([s if s >= Status.OUTSIDE else 0 for s in Status], dtype=np.uint8)
    for model in ("dielectric", "conductor"):
        found = estimate(rows, model, reason)
        asked = reason > 0
        assert np.array_equal(found.status[asked], reason[asked])
        assert np.all(np.isnan(found.eta[asked]))
        assert np.all(found.dof[asked] == 0)
        assert np.all(np.isfinite(found.eta[~asked]))


@pytest.mark.parametrize(
    "light", [(1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.5, 0.0)], ids=["closed form", "Gauss-Newton"]
)
def test_pixels_without_enough_say_so(light, make):
    rows = make([40.0], 6, 1.5, 0.0, light=light)
    rows.values[:, 0] = np.nan
    rows.values[1:, 1] = np.nan
    rows.values[:, 2] = 0.0
    rows.values[:, 3] *= -1
    rows.variance[:, 4] = np.nan
    found = estimate(rows, "dielectric")
    few, dark = Status.TOO_FEW, Status.NO_LIGHT
    assert found.status.tolist() == [few, few, dark, dark, few, Status.IDENTIFIED]
    assert np.all(np.isnan(found.eta[:5]))


def test_analyzers_all_one_way_are_one_reading(make):
    assert np.all(
        estimate(make([40.0], 3, 1.5, 0.0, analyzers=(30.0,) * 4), "dielectric").status == Status.TOO_FEW
    )


def test_one_equation_does_not_tell_eta_and_k(make):
    assert np.all(estimate(make([60.0], 50, 1.0, 3.0), "conductor").status == Status.NOT_IDENTIFIED)


def test_near_normal_incidence_nothing_is_known(make):
    assert np.all(estimate(make([1.0], 50, 1.5, 0.0), "dielectric").status == Status.NOT_IDENTIFIED)
    assert np.all(estimate(make([0.0], 50, 1.5, 0.0), "dielectric").status == Status.NOT_IDENTIFIED)


@pytest.mark.parametrize(
    ("theta", "eta", "expected", "status"),
    [
        # The twin of 1.5 at 30 degrees is below 1.
        (30.0, 1.5, 1.5, Status.IDENTIFIED),
        (70.0, 1.5, 1.5, Status.AMBIGUOUS),
        (60.0, 2.4, 2.4, Status.AMBIGUOUS),
    ],
)
def test_of_two_that_fit_equally_the_expected(theta, eta, expected, status, make):
    found = estimate(make([theta], 100, eta, 0.0, snr=2000.0), "dielectric", expected_eta=expected)
    assert np.all(found.status == status)
    np.testing.assert_allclose(found.eta, eta, rtol=0.02)


@settings(max_examples=40)
@given(
    eta=st.floats(0.3, 4.0),
    k=st.floats(0.05, 8.0),
    theta=st.floats(20.0, 50.0),
    angle=st.floats(-90.0, 90.0),
)
def test_without_noise_the_truth_is_found(make, eta, k, theta, angle):
    rows = make(
        [theta, theta + 15, theta + 30],
        3,
        eta,
        k,
        snr=0.0,
        s_deg=angle,
        light=(1.0, 0.2, 0.7, 0.3),
        retarder_deg=20.0,
    )
    found = estimate(rows, "conductor")
    # float32 signals: 6e-8 of their size, against the sigma of a thousandth that they are said to have
    assert np.all(np.abs(found.eta - eta) <= 0.002 * found.eta_sigma + 1e-6 * eta)
    assert np.all(np.abs(found.k - k) <= 0.002 * found.k_sigma + 1e-6 * k)


def test_extreme_signals_do_not_overflow(make):
    rows = make([50.0], 4, 1.5, 0.0)
    scale = np.array([1e-12, 1e-6, 1e6, 1e12], dtype=np.float32)
    big = dataclasses.replace(rows, values=rows.values * scale, variance=rows.variance * scale**2)
    for model in ("dielectric", "conductor"):
        one, two = estimate(rows, model), estimate(big, model)
        np.testing.assert_allclose(one.eta, two.eta, rtol=1e-5)
        assert np.array_equal(one.status, two.status)


def test_what_is_wrong_with_reasons_is_said(make):
    rows = make([50.0], 4, 1.5, 0.0)
    with pytest.raises(ValueError, match="reason must be uint8"):
        estimate(rows, "dielectric", np.full(4, Status.AMBIGUOUS, dtype=np.uint8))
    with pytest.raises(ValueError, match="expected_eta"):
        estimate(rows, "dielectric", expected_eta=0.0)


def test_every_status_has_a_meaning_and_a_flag():
    assert list(flag_values()) == sorted({int(s) for s in Status})
    assert len(flag_meanings().split()) == len(flag_values())
    assert all(s.meaning for s in Status)


def test_the_series_of_sine_and_cosine():
    theta = np.linspace(0.0, np.pi / 2, 1001)
    found = np.array([sin_cos.py_func(t) for t in theta])
    np.testing.assert_allclose(found, np.stack([np.sin(theta), np.cos(theta)], axis=1), atol=1e-11)
