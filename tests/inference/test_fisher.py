"""Information against closed forms, published entries and posteriors: a wrong derivative misleads in silence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.inference import ladder, models, search
from reflectance_fit.inference.fisher import information, one_equation, posterior_covariance
from reflectance_fit.inference.forward import ETA, K, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.priors import Prior

# As good as none: what the data alone say.
WIDE = {"eta": Prior("normal", sigma=1e4), "k": Prior("normal", sigma=1e4)}
# Which nine angles the design table's "9 angles 20-80" are, found by its entries.
NINE = np.array([20.0, 30.0, 40.0, 50.0, 60.0, 65.0, 70.0, 75.0, 80.0])
# eta and k recovered from the special angles that the same notes print (two decimals).
GOLD_450, GOLD_650, AL_550, CR_550 = (1.4715, 1.8129), (0.1835, 3.6015), (0.9657, 6.4268), (3.0415, 4.1971)
S3_FRAMES = ((0, None), (90, None), (45, None), (135, None), (45, 0), (135, 0))


def exact(o, eta, k, share):
    """Rows with the model's values and a relative sigma."""
    o = replace(o, value=np.ones(len(o)), sigma=np.ones(len(o)))
    rows, vector = pack(o, 1.0), neutral_vector()
    vector[ETA], vector[K] = eta, k
    value = predict_vectors(rows, vector[None], np.ones(rows.gains))[0]
    return replace(o, value=value, sigma=share * np.maximum(np.abs(value), 1e-3))


def relative(o, eta, k, *, nuisances=None, priors=WIDE):
    """sd / value of eta and, where k > 0, k."""
    priors = priors if k > 0 else {"eta": priors["eta"]}
    info = information(o, eta, k, exterior_ior=1.0, priors=priors, nuisances=nuisances or {})
    variances = np.diag(info.covariance(*priors))
    return np.sqrt(variances) / [1.0, k or 1.0][: len(variances)]


def frames(rows_of, theta, eta, k, share, settings=((0, None), (90, None)), light=(1, 0, 0, 0)):
    """Photographs with a gain an angle."""
    parts = [
        rows_of(
            [angle], "signal", 1.0, gain_group=f"{i}", set_name=f"{i}", analyzer_deg=a, light=light,
            retarder_deg=np.nan if r is None else r,
        )
        for i, angle in enumerate(theta) for a, r in settings
    ]  # fmt: skip
    return exact(concatenate(parts), eta, k, share)


@pytest.mark.parametrize("k", [0.0, 0.3, 3.0])
def test_one_number_for_two_unknowns_is_told_from_two_that_are_nearly_one(rows_of, k):
    """Near normal incidence R_s and R_p differ by theta^2 only, yet they are two; a ratio is one at any angle."""

    def one(*rows):
        o = exact(concatenate([rows_of(*row) for row in rows]), 1.7, k, 1e-3)
        return one_equation(information(o, 1.7, k, exterior_ior=1.0, priors=WIDE, nuisances={}))

    assert one(([45.0], "reflectance", 1.0))
    assert one(([60.0], "ratio_ps", 1.0), ([60.0], "dolp", 1.0))
    assert one(([50.0], "reflectance_s", 1.0), ([50.0], "reflectance_s", 1.0))
    assert not one(([3.0], "reflectance_s", 1.0), ([3.0], "reflectance_p", 1.0))
    assert not one(([5.0, 10.0], "reflectance_s", 1.0))


# --- closed forms


@given(eta=st.floats(1.2, 4.0), sigma=st.floats(1e-6, 1e-2))
def test_one_reflectance_and_one_unknown(rows_of, eta, sigma):
    """R0 = ((eta - 1)/(eta + 1))^2 has dR0/d eta = 4 (eta - 1)/(eta + 1)^3."""
    o = rows_of([0.0], "reflectance", 1.0, sigma=sigma)
    slope = 4 * (eta - 1) / (eta + 1) ** 3
    assert relative(o, eta, 0.0)[0] * eta == pytest.approx(sigma / slope, rel=1e-6)


def test_a_percent_of_r0_is_a_fifth_of_a_percent_of_eta(rows_of):
    """The notes' 0.21 % of eta for 1 % of R0 at 1.5."""
    assert relative(rows_of([0.0], "reflectance", 1.0, sigma=0.01 * 0.04), 1.5, 0.0)[0] == pytest.approx(
        0.0021, abs=5e-5
    )


@given(eta=st.floats(0.2, 4.0), k=st.floats(0.1, 8.0))
def test_an_unknown_gain_leaves_the_ratio(rows_of, eta, k):
    """Two signals of relative noise e under one gain say what their ratio says with noise sqrt(2) e."""
    angles = [40.0, 70.0]
    signals = [
        rows_of([a], q, 1.0, gain_group=f"{a}", set_name=f"{a}")
        for a in angles
        for q in ("signal_s", "signal_p")
    ]
    signals = exact(concatenate(signals), eta, k, 0.01)
    signals = replace(signals, sigma=0.01 * signals.value)
    ratios = exact(rows_of(angles, "ratio_ps", 1.0), eta, k, 0.01)
    ratios = replace(ratios, sigma=0.01 * np.sqrt(2) * ratios.value)
    wide = {"eta": Prior("normal", sigma=10.0), "k": Prior("normal", sigma=100.0)}
    np.testing.assert_allclose(
        relative(signals, eta, k, priors=wide), relative(ratios, eta, k, priors=wide), rtol=1e-5
    )


def test_the_angle_of_one_setting_is_an_offset_of_that_prior(rows_of):
    """Two ways to say that one setting's angle is off by 0.3 degrees."""
    o = frames(rows_of, [55.0], 2.0, 1.5, 1e-3, S3_FRAMES, (1, 0, 1, 0))
    blurred = replace(o, theta_deg_sigma=np.full(len(o), 0.3))
    np.testing.assert_allclose(
        relative(blurred, 2.0, 1.5), relative(o, 2.0, 1.5, nuisances={"angle_offset_deg": 0.3}), rtol=1e-5
    )
    assert np.all(relative(blurred, 2.0, 1.5) > 1.5 * relative(o, 2.0, 1.5))


def test_a_slightly_polarized_source_is_another_light(rows_of):
    """Its derivative at degree 0, where degree and azimuth have none, is that by S1 and S2 of the light."""
    o = frames(rows_of, [50.0], 1.7, 0.4, 1e-3, S3_FRAMES)
    info = information(
        o,
        1.7,
        0.4,
        exterior_ior=1.0,
        priors=WIDE,
        nuisances={"source_dolp": 0.02, "source_azimuth_deg": np.inf},
    )
    assert info.names[2:] == ("source_s1", "source_s2")
    np.testing.assert_allclose(info.prior_sd[2:], 0.02 / np.sqrt(2))
    for name, axis in (("source_s1", 1), ("source_s2", 2)):
        light = np.tile([1.0, 0, 0, 0], (len(o), 1))
        light[:, axis] = 1e-3
        change = exact(replace(o, light=light), 1.7, 0.4, 1.0).value - o.value
        column = info.columns[:, info.names.index(name)]
        np.testing.assert_allclose(column, info.whitening @ change / 1e-3, atol=1e-6 * np.abs(column).max())


@given(st.integers(1, 6), st.integers(0, 6), st.integers(0, 1000))
def test_the_posterior_s_covariance_is_the_inverse_and_exists_without_data(size, rank, seed):
    generator = np.random.default_rng(seed)
    root = generator.standard_normal((size, rank)) * 100
    sd = generator.uniform(0.1, 10, size)
    found = posterior_covariance(root @ root.T, sd)
    np.testing.assert_allclose(found @ (root @ root.T + np.diag(sd**-2.0)), np.eye(size), atol=1e-6)
    np.testing.assert_allclose(posterior_covariance(np.zeros((size, size)), sd), np.diag(sd**2))


def test_at_k_0_an_analyzer_sees_nothing_of_k_and_a_plate_does(rows_of):
    light = (1.0, 0.0, 1.0, 0.0)
    blind = frames(rows_of, [45.0, 60.0], 1.5, 0.0, 1e-3, S3_FRAMES[:4], light)
    plate = frames(rows_of, [45.0, 60.0], 1.5, 0.0, 1e-3, S3_FRAMES, light)
    for o, seen in ((blind, False), (plate, True)):
        info = information(o, 1.5, 0.0, exterior_ior=1.0, priors=WIDE, nuisances={})
        by_eta, by_k = np.abs(info.columns).max(axis=0)
        assert bool(by_k > 1e-5 * by_eta) is seen


def test_what_cannot_be_is_refused(rows_of):
    o = rows_of([45.0], "reflectance", 0.05)
    with pytest.raises(ValueError, match="every row needs a sigma"):
        information(o, 1.5, 0.0, exterior_ior=1.0, priors=WIDE, nuisances={})
    with pytest.raises(ValueError, match="n - ik"):
        information(replace(o, sigma=np.ones(1)), 1.5, -1.0, exterior_ior=1.0, priors=WIDE, nuisances={})


# --- the design table: sigma / value in per cent, 1 % noise of each power (1.4 % of a ratio), NINE angles


@pytest.mark.parametrize(
    ("index", "absolute", "shared_gain", "ratio", "s_p_absolute", "s_p_shared_gain"),
    [
        ((1.5151, 0.0), (0.10,), (0.23,), None, (0.05,), (0.05,)),
        ((1.5, 0.01), (0.7, 4060), None, (0.1, 398), None, None),
        (GOLD_450, (2.1, 1.0), (14, 1.0), (0.9, 1.0), (0.6, 0.4), (0.6, 0.5)),
        (GOLD_650, (27, 17), (106, 17), (21, 18), (13, 8.8), (13, 9.8)),
        (AL_550, (19, 11), (20, 25), (15, 10), (8.9, 5.4), (9.5, 6.5)),
        (CR_550, (4.6, 1.7), (33, 17), (1.9, 1.3), (1.2, 0.6), (1.2, 0.9)),
    ],
)
def test_printed_bounds(rows_of, index, absolute, shared_gain, ratio, s_p_absolute, s_p_shared_gain):
    """To one unit of the last printed digit or 0.5 %: eta and k come from rounded angles."""

    def both(quantity, gain):
        return concatenate([rows_of(NINE, f"{quantity}_{x}", 1.0, gain_group=gain) for x in "sp"])

    for expected, o, share in (
        (absolute, rows_of(NINE, "reflectance", 1.0), 0.01),
        (shared_gain, rows_of(NINE, "signal", 1.0, gain_group="lamp"), 0.01),
        (ratio, rows_of(NINE, "ratio_ps", 1.0), 0.01 * np.sqrt(2)),
        (s_p_absolute, both("reflectance", ""), 0.01),
        (s_p_shared_gain, both("signal", "lamp"), 0.01),
    ):
        if expected is None:
            continue
        found = 100 * relative(exact(o, *index, share), *index)
        for value, printed in zip(found, expected, strict=True):
            text = f"{printed:g}"
            unit = 10.0 ** -len(text.partition(".")[2])
            assert value == pytest.approx(printed, rel=0.005, abs=unit), (index, expected, found)


# --- posteriors


@pytest.mark.parametrize(
    ("eta", "k", "angles", "settings", "light", "nuisances"),
    [
        (1.5, 0.0, (30, 45, 60), S3_FRAMES[:4], (1, 0, 0, 0), {"angle_offset_deg": 0.5, "analyzer_offset_deg": 1.0}),
        (1.5, 0.3, (30, 45, 60), S3_FRAMES[:4], (1, 0, 0, 0), {"angle_offset_deg": 0.5, "analyzer_offset_deg": 1.0}),
        (1.015, 6.6, (62.5, 80), S3_FRAMES, (1, 0, 1, 0), {"angle_offset_deg": 0.5, "dark_offset": 0.01}),
        (3.18, 3.33, (60, 77.5, 80), S3_FRAMES[:2], (1, 0, 0, 0), {}),
    ],
)  # fmt: skip
def test_the_posterior_is_as_wide_as_the_information_says(
    rows_of, priors, eta, k, angles, settings, light, nuisances
):
    """Importance sampling knows no derivatives; 6000 draws give a sd to 1 %, curvature leaves 3 % more."""
    o = frames(rows_of, angles, eta, k, 1e-3, settings, light)
    chosen = {name: priors[name] for name in (("eta", "k") if k > 0 else ("eta",))}
    expected = information(o, eta, k, exterior_ior=1.0, priors=chosen, nuisances=nuisances).covariance(
        *chosen
    )
    rows = pack(o, 1.0)
    model = models.build("conductor" if k > 0 else "dielectric", rows, priors, nuisances, [])
    _, basins = search.find(model, rows, gain_names(o))
    drawn = ladder.draw(model, rows, basins, "importance", (0,), min_ess=6000)
    assert drawn.method == "importance"
    draws = np.stack([np.log(drawn.flat("eta")), drawn.flat("k")][: len(chosen)])
    found = np.atleast_2d(np.cov(draws))
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.sqrt(np.diag(expected)), rtol=0.04)
    if k > 0:
        correlation = expected[0, 1] / np.sqrt(expected[0, 0] * expected[1, 1])
        assert np.corrcoef(draws)[0, 1] == pytest.approx(correlation, abs=0.04)


def test_repeated_fits_scatter_as_the_information_says(rows_of):
    """400 noisy tables, each solved for eta and k by another optimiser on the readable physics."""
    from scipy.optimize import least_squares

    eta, k, theta, share = 2.0, 1.0, np.array([40.0, 60.0, 75.0]), 1e-3
    cosine = np.cos(np.radians(theta))
    truth = reflectances(cosine, eta, k)
    value = np.concatenate([truth.s, truth.p])
    generator = np.random.default_rng(5)
    fits = np.array(
        [
            least_squares(
                lambda x, y=y: (np.concatenate(reflectances(cosine, *x)[:2]) - y) / (share * value), [eta, k]
            ).x
            for y in value * (1 + share * generator.standard_normal((400, len(value))))
        ]
    )
    o = concatenate([rows_of(theta, q, 1.0) for q in ("reflectance_s", "reflectance_p")])
    expected = relative(exact(o, eta, k, share), eta, k) * [eta, k]
    # The sd of 400 numbers is known to 3.5 %.
    np.testing.assert_allclose(fits.std(axis=0), expected, rtol=3 * 0.035)
