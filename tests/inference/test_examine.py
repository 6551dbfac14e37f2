"""What a finished fit cannot see itself: each check against physics computed apart, and how often it is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.inference.band import effective
from reflectance_fit.inference.examine import examine
from reflectance_fit.inference.film_rows import film_values
from reflectance_fit.inference.forward import ETA, K, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import pack
from reflectance_fit.inference.run import fit_channel
from reflectance_fit.materials.library import get
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.film import film_amplitudes
from reflectance_fit.physics.fresnel import amplitudes, reflectances

ELLIPSOMETER = np.array([60.0, 65.0, 70.0, 75.0])
NINE = np.array([20.0, 30.0, 40.0, 45.0, 55.0, 65.0, 70.0, 75.0, 80.0])


def fitted(o, priors, model="conductor", **nuisances):
    return fit_channel(
        "x", o, exterior_ior=1.0, priors=priors, nuisances=nuisances, model=model, method="laplace"
    )


def ellipsometry(rows_of, theta=ELLIPSOMETER):
    return concatenate(
        [rows_of(theta, "psi_deg", 1.0, sigma=0.03), rows_of(theta, "delta_deg", 1.0, sigma=0.08)]
    )


def absolute(rows_of, theta=NINE):
    return concatenate([rows_of(theta, f"reflectance_{x}", 1.0, sigma=0.002) for x in "sp"])


def noisy(o, values, seed):
    return replace(o, value=values + o.sigma * np.random.default_rng(seed).standard_normal(len(o)))


def bulk(o, index):
    rows, vector = pack(o, 1.0), neutral_vector()
    vector[ETA], vector[K] = index.real, index.imag
    return predict_vectors(rows, vector[None], np.ones(rows.gains))[0]


def filmed(o, film, substrate, thickness_nm):
    return film_values(pack(o, 1.0), neutral_vector(), film, substrate, thickness_nm / 550.0)


def index_of(name):
    return complex(*(float(x) for x in get(name).absolute_index(550.0)))


# --- the film itself


@given(
    st.floats(0.0, 1.55),
    st.floats(1.1, 4.0),
    st.floats(0.0, 3.0),
    st.floats(0.3, 4.0),
    st.floats(0.0, 5.0),
    st.floats(0, 2),
)
def test_films_that_are_no_films(theta, n1, k1, n2, k2, thickness):
    """Without thickness it is the substrate alone; of the substrate's index, too; very thick and absorbing, the film."""
    c, film, substrate = np.cos(theta), complex(n1, k1), complex(n2, k2)
    bare = amplitudes(c, n2, k2)
    for index, d in ((film, 0.0), (substrate, thickness)):
        assert np.allclose(film_amplitudes(c, index, substrate, d), bare, atol=1e-9)
    if k1 > 0.5:
        assert np.allclose(film_amplitudes(c, film, substrate, 20.0), amplitudes(c, n1, k1), atol=1e-9)


@given(st.floats(0.0, 1.5), st.floats(1.1, 4.0), st.floats(0.3, 4.0), st.floats(0.0, 5.0))
def test_half_a_wave_is_absent_and_a_quarter_wave_matches(theta, film, n2, k2):
    """A half wave, path and angle counted, is absent; at normal incidence a quarter wave of index sqrt(n) kills R."""
    c = np.cos(theta)
    half = 0.5 / np.sqrt(film**2 - np.sin(theta) ** 2)
    bare = amplitudes(c, n2, k2)
    assert np.allclose(film_amplitudes(c, complex(film), complex(n2, k2), half), bare, atol=1e-9)
    matched = film_amplitudes(1.0, complex(film), complex(film**2), 0.25 / film)
    assert np.allclose(matched, 0.0, atol=1e-12)


@given(st.floats(0.0, 1.5), st.floats(1.1, 4.0), st.floats(0.0, 3.0), st.floats(0.0, 2.0))
def test_energy_is_kept_by_a_lossless_film(theta, film, n2, thickness):
    """R of both polarizations is at most 1, and from the other side through a lossless stack it is the same."""
    n2 = 1.0 + n2
    sine = np.sin(theta)
    r = film_amplitudes(np.cos(theta), complex(film), complex(n2), thickness)
    other = film_amplitudes(
        np.sqrt(1 - (sine / n2) ** 2), complex(film / n2), complex(1 / n2), thickness * n2
    )
    for a, b in zip(r, other, strict=True):
        assert abs(a) <= 1 + 1e-12
        assert abs(abs(a) - abs(b)) < 1e-9


def test_rows_of_a_film_without_thickness_are_the_fits_own(rows_of):
    o = concatenate([ellipsometry(rows_of), absolute(rows_of)])
    o = replace(o, theta_deg_spread=np.full(len(o), 1.5))
    index = 0.5 + 2.2j
    assert np.allclose(filmed(o, 1.46 + 0j, index, 0.0), bulk(o, index), atol=1e-10)


# --- films found


def optical(n, thickness_nm):
    """What a thin film adds to Delta, whatever its index: (n^2 - 1) / n^2 times its thickness."""
    return (n**2 - 1) / n**2 * thickness_nm


@pytest.mark.parametrize(
    ("name", "film", "thickness_nm"),
    [("Si", 1.46, 2.0), ("Al", 1.77, 3.0), ("Cu", 1.46, 2.0), ("Si", 1.33, 10.0)],
)
def test_an_oxide_on_what_the_name_says_is_found(rows_of, priors, name, film, thickness_nm):
    o = ellipsometry(rows_of)
    fit = fitted(noisy(o, filmed(o, complex(film), index_of(name), thickness_nm), 1), priors)
    found = examine(fit, f"{name} wafer").film
    assert found is not None
    assert optical(found.eta, found.thickness_nm) == pytest.approx(optical(film, thickness_nm), rel=0.1)
    assert found.chi2 <= found.bulk_chi2 + 6.6 < found.bare_chi2
    assert examine(fit, "something").film is None


def test_a_gain_and_a_nuisance_do_not_hide_the_oxide(rows_of, priors):
    """Signals of one lamp through an analyzer, the angle zero fitted."""
    o = concatenate(
        [
            rows_of(NINE, "signal", 1.0, sigma=2e-4, gain_group="lamp", analyzer_deg=a, light=(1, 0, 1, 0),
                    retarder_deg=r)
            for a, r in ((0, np.nan), (45, np.nan), (90, np.nan), (45, 0.0))
        ]
    )  # fmt: skip
    values = 3.0 * filmed(o, 1.46 + 0j, index_of("Si"), 4.0)
    fit = fitted(noisy(o, values, 2), priors, angle_offset_deg=0.5)
    found = examine(fit, "Si").film
    assert found is not None
    assert optical(found.eta, found.thickness_nm) == pytest.approx(optical(1.46, 4.0), rel=0.1)


def test_the_pseudo_constants_of_a_thicker_film_drift(rows_of, priors):
    o = ellipsometry(rows_of, np.arange(45.0, 81.0, 5.0))
    fit = fitted(noisy(o, filmed(o, 1.46 + 0j, index_of("Si"), 30.0), 1), priors)
    drift = examine(fit, "x").drift
    assert drift is not None
    assert drift.p_value < 1e-3


def test_a_wrong_angle_zero_is_no_film(rows_of, priors):
    """It bends the index, too, and is not called a film."""
    o = ellipsometry(rows_of, np.arange(45.0, 80.0, 5.0))
    index = 0.5 + 2.2j
    values = bulk(replace(o, theta_deg=o.theta_deg + 0.3), index)
    fit = fitted(noisy(o, values, 1), priors)
    assert fit.p_value < 1e-3
    assert examine(fit, "x").drift is None


@pytest.mark.parametrize("kind", [ellipsometry, absolute])
def test_clean_interfaces_are_not_called_a_film(rows_of, priors, kind):
    """Ten materials with noise as stated, half of them not quite of the table's grade.

    At a rate of 1 % an alarm among 20 is one run in five, two are one in sixty.
    """
    o = kind(rows_of)
    generator = np.random.default_rng(20260101)
    names = ("Si", "Al", "Cu", "Au", "Ag", "Ge", "Cr", "Ta", "Fe", "Ti")
    alarms = 0
    for seed in range(20):
        index = index_of(names[seed % len(names)])
        grade = 1 + (seed % 2) * 0.005 * generator.standard_normal(2)
        index = complex(index.real * grade[0], index.imag * grade[1])
        seen = examine(fitted(noisy(o, bulk(o, index), seed), priors), names[seed % len(names)])
        alarms += seen.film is not None or seen.drift is not None
    assert alarms <= 1


# --- residuals that do not scatter


def test_without_sigma_residuals_that_bend_are_told_from_scatter(rows_of, priors):
    """Normal where rows are independent, far out where the angles are 4 degrees off."""
    theta = np.linspace(20.0, 80.0, 61)
    o = concatenate([rows_of(theta, f"signal_{x}", 1.0, sigma=0.003, gain_group=x) for x in "sp"])
    clean = bulk(o, 1.5 + 0j)
    z = []
    for seed in range(12):
        unstated = replace(noisy(o, clean, seed), sigma=np.full(len(o), np.nan))
        z.append(examine(fitted(unstated, priors, "dielectric"), "x").missing_runs)
    # Signs around a fitted curve alternate a little too often: a few parameters' worth.
    assert abs(np.mean(z)) < 1.2
    assert 0.4 < np.std(z) < 1.7
    assert np.max(z) < 4
    turned = bulk(replace(o, theta_deg=o.theta_deg + 4.0), 1.5 + 0j)
    bent = replace(noisy(o, turned, 1), sigma=np.full(len(o), np.nan))
    assert examine(fitted(bent, priors, "dielectric"), "x").missing_runs > 4
    assert examine(fitted(noisy(o, clean, 1), priors, "dielectric"), "x").missing_runs is None


# --- R_p = R_s^2


@pytest.mark.parametrize("theta", [45.0, 44.2, 45.9])
@pytest.mark.parametrize("index", [1.5 + 0j, 0.5 + 2.2j, 3.0 + 4.2j])
def test_a_sound_scale_is_healthy_and_a_wrong_one_is_told(rows_of, priors, theta, index):
    angles = np.where(NINE == 45.0, theta, NINE)
    o = absolute(rows_of, angles)
    o = replace(o, sigma=np.full(len(o), 2e-4))
    model = "conductor" if index.imag else "dielectric"
    power = reflectances(np.cos(np.radians(theta)), index.real, index.imag)
    for factor in (1.0, 1.05):
        (check,) = examine(fitted(noisy(o, factor * bulk(o, index), 3), priors, model), "x").health
        assert check.theta_deg == theta
        assert check.value == pytest.approx(factor * power.p, abs=4 * 2e-4)
        # R_p grows by the factor, R_s^2 by its square.
        sigma = 2e-4 * np.hypot(1, 2 * factor * power.s)
        assert check.z == pytest.approx((factor - factor**2) * power.p / sigma, abs=4)
        assert (abs(check.z) > 4) == (factor != 1.0 and abs(factor - factor**2) * power.p > 8 * sigma) or (
            factor != 1.0
        )


def test_signals_of_one_lamp_give_its_gain(rows_of, priors):
    index = 0.5 + 2.2j
    for quantity, settings in (
        ("signal", ((0, 0), (90, 90))),
        (None, (("signal_s", None), ("signal_p", None))),
    ):
        o = concatenate(
            [
                rows_of(NINE, quantity or kind, 1.0, sigma=1e-3, gain_group="lamp",
                        analyzer_deg=np.nan if a is None else a)
                for kind, a in settings
            ]
        )  # fmt: skip
        (check,) = examine(fitted(noisy(o, 7.0 * bulk(o, index), 4), priors), "x").health
        assert check.expected == pytest.approx(7.0, rel=0.01)
        assert check.value == pytest.approx(7.0, rel=0.01)
        assert abs(check.z) < 4
        # An analyzer, or a grating behind it, that passes 3 % more of p.
        p = (o.quantity == "signal_p") | (o.analyzer_deg == 90.0)
        uneven = noisy(o, np.where(p, 1.03, 1.0) * 7.0 * bulk(o, index), 4)
        assert examine(fitted(uneven, priors), "x").health[0].z > 4
    # A gain an angle says nothing of the scale.
    own = replace(o, gain_group=np.array([f"{t}" for t in o.theta_deg]))
    assert examine(fitted(noisy(own, bulk(own, index), 4), priors), "x").health == ()


def test_health_is_normal_where_all_is_well(rows_of, priors):
    o = absolute(rows_of)
    z = np.array(
        [examine(fitted(noisy(o, bulk(o, 0.5 + 2.2j), s), priors), "x").health[0].z for s in range(50)]
    )
    # Mean and standard deviation of 50 normal numbers, 4 standard errors.
    assert abs(z.mean()) < 4 / np.sqrt(50)
    assert abs(z.std() - 1) < 4 / np.sqrt(100)


# --- wide channels


def test_gold_through_a_camera(rows_of, priors):
    """Design notes, 90 nm: G 530 (0.61, 2.18) for (0.56, 2.20) at the centre, R 610 (0.24, 2.91) for (0.23, 3.19)."""
    o = absolute(rows_of)
    for centre, k_shift in ((530.0, -0.02), (610.0, -0.28)):
        here = replace(o, wavelength_nm=np.full(len(o), centre), fwhm_nm=np.full(len(o), 90.0))
        index = complex(*(float(x) for x in get("Au").absolute_index(centre)))
        band = examine(fitted(noisy(here, bulk(here, index), 0), priors), "Au mirror").band
        assert band is not None
        assert (band.material, band.named, band.fwhm_nm) == ("Au", True, 90.0)
        assert band.k == pytest.approx(k_shift, abs=0.04)
        # By brute force: the rows averaged over the band, fitted.
        wavelengths = np.linspace(centre - 120, centre + 120, 481)
        weight = np.exp(-4 * np.log(2) * ((wavelengths - centre) / 90) ** 2)
        eta, k = get("Au").absolute_index(wavelengths)
        values = np.array([bulk(here, complex(*pair)) for pair in zip(eta, k, strict=True)])
        found = fitted(replace(here, value=weight @ values / weight.sum()), priors).optimum
        assert index.real + band.eta == pytest.approx(found.eta, abs=0.01)
        assert index.imag + band.k == pytest.approx(found.k, abs=0.01)


def test_glass_through_a_camera_needs_no_word(rows_of, priors):
    """90 nm shift the index of a glass by 1e-4, against 1e-3 that photographs give."""
    o = absolute(rows_of)
    o = replace(o, fwhm_nm=np.full(len(o), 90.0))
    fit = fitted(noisy(o, bulk(o, index_of("N-BK7")), 0), priors, "dielectric")
    named, unnamed = examine(fit, "BK7").band, examine(fit, "x").band
    assert abs(named.eta) < 3e-4 < fit.intervals["eta"].sd
    assert named.k == 0
    assert not unnamed.named
    assert abs(unnamed.eta) < fit.intervals["eta"].sd


def test_a_line_has_no_width(rows_of, priors):
    o = absolute(rows_of)
    assert examine(fitted(noisy(o, bulk(o, 1.5 + 0j), 0), priors, "dielectric"), "Au").band is None


def test_an_index_that_does_not_change_is_its_own_average(rows_of, priors):
    o = absolute(rows_of)
    fit = fitted(noisy(o, bulk(o, 0.5 + 2.2j), 0), priors)
    same = effective(fit, 0.5 + 2.2j, np.full(3, 0.5 + 2.2j), np.full(3, 1 / 3))
    assert same == pytest.approx((0.5, 2.2), abs=1e-9)
