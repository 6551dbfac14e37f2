"""Channels on one dispersion curve: the same likelihood as channel by channel, truth recovered, real glasses respected."""

from __future__ import annotations

from dataclasses import replace

import h5netcdf
import numpy as np
import pytest
from scipy.stats import chi2, norm

from reflectance_fit import fit
from reflectance_fit.inference import shared
from reflectance_fit.inference.likelihood import log_likelihoods
from reflectance_fit.inference.models import build
from reflectance_fit.inference.rows import pack
from reflectance_fit.inference.run import fit_channel
from reflectance_fit.inference.shared import share_dispersion
from reflectance_fit.materials import library
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.fresnel import reflectances

WAVELENGTHS = (450.0, 550.0, 650.0)
THETA = np.linspace(20.0, 80.0, 13)
AIR = 1.000277
OFFSET = {"angle_offset_deg": 0.5}


def scans(rows_of, eta, noise, generator, *, offset_deg=0.0):
    """s and p scans at every wavelength; each signal with a gain of its own."""
    parts = []
    for wavelength, index in zip(WAVELENGTHS, eta, strict=True):
        reflected = reflectances(np.cos(np.radians(THETA + offset_deg)), index / AIR)
        for name, power in (("signal_s", reflected.s), ("signal_p", reflected.p)):
            gain = generator.uniform(0.5, 2.0)
            value = gain * (power + noise * generator.standard_normal(len(THETA)))
            rows = rows_of(THETA, name, value, sigma=gain * noise, gain_group=name)
            n = len(THETA)
            parts.append(
                replace(rows, channel=np.full(n, f"{wavelength:g} nm"), wavelength_nm=np.full(n, wavelength))
            )
    return concatenate(parts)


def fitted_apart(observations, priors, nuisances=OFFSET, seed=0, **options):
    return [
        fit_channel(
            channel,
            rows,
            exterior_ior=AIR,
            priors=priors,
            nuisances=nuisances,
            method="importance",
            seed=(seed, i),
            **options,
        )
        for i, (channel, rows) in enumerate(observations.channels())
    ]


def together(fits, observations, priors, seed=0):
    return share_dispersion(
        fits, observations, exterior_ior=AIR, priors=priors, method="importance", seed=(seed, 9)
    )


def glass(name):
    return library.get(name).eta(np.array(WAVELENGTHS))


def test_one_likelihood_is_the_product_of_the_channels(rows_of, priors):
    """Gains, noise and Fresnel know nothing of other channels: logs add up, wherever a, b and the offset are."""
    generator = np.random.default_rng(3)
    observations = scans(rows_of, glass("N-BK7"), 0.004, generator)
    groups = np.char.add(np.char.add(observations.channel, "/"), observations.gain_group)
    joint = pack(replace(observations, gain_group=groups), AIR)
    one = build("dielectric", joint, priors, OFFSET, [])
    vectors = one.full(np.column_stack([generator.uniform(0.2, 0.7, 20), generator.normal(0, 0.5, 20)]))
    vectors[:, shared.SLOPE] = generator.uniform(-0.05, 0.05, 20)
    total = np.zeros(20)
    middle = np.mean((1e3 / np.array(WAVELENGTHS)) ** 2)
    for _, rows in observations.channels():
        own = vectors.copy()
        own[:, 0] += own[:, shared.SLOPE] * ((1e3 / rows.wavelength_nm[0]) ** 2 - middle)
        own[:, shared.SLOPE] = 0.0
        total += log_likelihoods(pack(rows, AIR), own)
    assert log_likelihoods(joint, vectors) == pytest.approx(total, rel=1e-12)


def test_no_index_below_zero(rows_of, priors):
    rows = pack(scans(rows_of, glass("N-BK7"), 0.004, np.random.default_rng(0)), AIR)
    vector = build("dielectric", rows, priors, {}, []).full(np.array([[np.log(0.1)]]))
    vector[:, shared.SLOPE] = 0.2  # 0.1 - 0.2 * 1.3 at 650 nm
    assert log_likelihoods(rows, vector)[0] == -np.inf


def test_truth_is_recovered_with_narrower_intervals(rows_of, priors):
    """z of every eta and of b: mean and squares inside the 99.9 % bands; half the sd where the offset is common."""
    truth = glass("N-BK7")
    b = np.polynomial.Polynomial.fit((1e3 / np.array(WAVELENGTHS)) ** 2, truth, 1).convert().coef[1]
    z, narrower, runs = [], [], 40
    for seed in range(runs):
        generator = np.random.default_rng([7, seed])
        observations = scans(rows_of, truth, 0.004, generator, offset_deg=0.5 * generator.standard_normal())
        apart = fitted_apart(observations, priors, seed=seed, model="dielectric")
        joint = together(apart, observations, priors, seed=seed)
        assert joint[0].shared is not None
        sd = np.array([f.intervals["eta"].sd for f in joint])
        error = np.array([f.intervals["eta"].median for f in joint]) - truth
        curve = joint[0].shared.cauchy_b_um2
        z.append([*(error / sd), (curve.mean() - b) / curve.std()])
        narrower.append(sd / [f.intervals["eta"].sd for f in apart])
    low, high = chi2.ppf([0.0005, 0.9995], runs)
    for column in np.transpose(z):
        assert low < np.sum(column**2) < high
        assert abs(np.mean(column)) < norm.ppf(0.9995) / np.sqrt(runs)
    assert np.median(narrower) < 0.9


def test_an_eta_off_the_curve_keeps_the_channels_apart(rows_of, priors):
    truth = glass("N-BK7") + np.array([0.0, 0.05, 0.0])
    observations = scans(rows_of, truth, 0.001, np.random.default_rng(1))
    apart = fitted_apart(observations, priors)
    joint = together(apart, observations, priors)
    assert all(a is b for a, b in zip(apart, joint, strict=True))


def test_a_curve_that_real_glasses_leave_by_more_than_the_noise_is_not_taken(rows_of, priors):
    """At this noise chi2 cannot see that N-SF11 is no Cauchy glass, yet eta would be off by half its sd."""
    truth = glass("N-SF11")
    observations = scans(rows_of, truth, 1.5e-3, np.random.default_rng(5))
    apart = fitted_apart(observations, priors, nuisances={})
    miss = shared._departure(np.array(WAVELENGTHS), 0.0166)
    assert miss == pytest.approx(6.6e-4, rel=0.1)
    assert min(f.intervals["eta"].sd for f in apart) < miss / shared._DEPARTURE
    assert together(apart, observations, priors)[0].shared is None


@pytest.mark.parametrize("nuisance", ["diffuse", "dark_offset"])
def test_what_a_channel_has_for_itself_keeps_it_apart(rows_of, priors, nuisance):
    observations = scans(rows_of, glass("N-BK7"), 0.004, np.random.default_rng(2))
    apart = fitted_apart(observations, priors, nuisances={nuisance: 0.01}, model="dielectric")
    assert all(a is b for a, b in zip(apart, together(apart, observations, priors), strict=True))


def test_from_a_table_to_one_fit_in_the_report(rows_of, tmp_path):
    generator = np.random.default_rng(11)
    observations = scans(rows_of, glass("PMMA"), 0.003, generator)
    for letter in "sp":
        mine = observations.select(observations.quantity == f"signal_{letter}")
        columns = np.column_stack([mine.wavelength_nm, mine.theta_deg, mine.value, mine.sigma])
        np.savetxt(tmp_path / f"{letter}.csv", columns, delimiter=",")
    tables = "".join(
        f"  - {{file: {x}.csv, delimiter: comma, columns: {{wavelength_nm: 0, theta_deg: 1, signal_{x}: 2, "
        f"signal_{x}_sigma: 3}}}}\n"
        for x in "sp"
    )
    manifest = tmp_path / "measurement.yaml"
    manifest.write_text(
        f"schema: reflectance_fit/measurement/1\nsample: {{name: a block}}\ntables:\n{tables}"
        "nuisances: {angle_offset_deg: {}}\n"
    )
    result = fit(manifest, posterior="importance")
    report = result.report
    assert [f.channels for f in report.fits] == [[f"{w:g} nm" for w in WAVELENGTHS]]
    assert [c.fit for c in report.channels] == [0, 0, 0]
    curve = report.fits[0].model.dispersion
    assert curve.cauchy_b_um2.median == pytest.approx(0.0049, abs=4 * curve.cauchy_b_um2.sd)
    for channel, eta in zip(report.channels, glass("PMMA"), strict=True):
        assert channel.eta.median == pytest.approx(eta, abs=4 * channel.eta.sd)
        at = curve.cauchy_a.median + curve.cauchy_b_um2.median * (1e3 / channel.wavelength_nm) ** 2
        assert channel.eta.median == pytest.approx(at, abs=0.1 * channel.eta.sd)
        assert channel.k.status == "upper_limit"
    result.write(tmp_path / "out")
    with h5netcdf.File(tmp_path / "out" / "posterior.nc") as file:
        draws = file["posterior"]["cauchy_b_um2"][...]
        assert draws[..., 0] == pytest.approx(draws[..., 2])
