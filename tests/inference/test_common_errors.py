"""An error that all rows share and of which the sigma was measured: the fit allows for it, in every model."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from reflectance_fit.inference import run
from reflectance_fit.inference.forward import FIRST_NUISANCE, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import pack
from reflectance_fit.observations import concatenate
from reflectance_fit.priors import NUISANCES

ETA = 1.52
ANGLES = (45.0, 50.0, 55.0, 60.0, 65.0)
AXES = (0.0, 45.0, 90.0, 135.0)
COMMON_DEG = 0.1
TRIALS = 40


def signals(rows_of, **faults):
    """A flat sample behind an analyzer, one gain an angle, as of a board; noise 1e-4 of the largest signal."""
    parts = [
        rows_of([theta] * len(AXES), "signal", 1.0, gain_group=f"{theta:g}", analyzer_deg=AXES)
        for theta in ANGLES
    ]
    rows = concatenate(parts)
    vector = neutral_vector(0)
    vector[0] = ETA
    for name, value in faults.items():
        vector[FIRST_NUISANCE + NUISANCES[name].index] = value
    packed = pack(rows, 1.0)
    values = predict_vectors(packed, vector[None], np.ones(packed.gains))[0]
    return replace(rows, value=values, sigma=np.full(len(rows), 1e-4 * values.max()))


def noisy(o, generator):
    return replace(o, value=o.value + o.sigma * generator.standard_normal(len(o)))


def fit(o, priors, *, nuisances=None, **options):
    return run.fit_channel(
        "550 nm",
        o,
        exterior_ior=1.0,
        priors=priors,
        nuisances={} if nuisances is None else nuisances,
        model="dielectric",
        method="laplace",
        **options,
    )


def pulls(rows_of, priors, name, sigma, **options):
    """Errors of eta over their sd, of captures whose common error has the stated sigma."""
    generator = np.random.default_rng(1)
    found = []
    for _ in range(TRIALS):
        error = NUISANCES[name].neutral + sigma * generator.standard_normal()
        o = noisy(signals(rows_of, **{name: error}), generator)
        eta = fit(o, priors, **options).intervals["eta"]
        found.append((eta.median - ETA) / eta.sd)
    return np.array(found)


def test_a_common_error_of_the_angles_is_covered(rows_of, priors):
    errors = pulls(rows_of, priors, "angle_offset_deg", COMMON_DEG, known={"angle_offset_deg": COMMON_DEG})
    low, high = chi2.ppf([0.0005, 0.9995], TRIALS)
    assert low < np.sum(errors**2) < high
    assert np.mean(np.abs(errors) < 1.96) >= 0.85


def test_widening_each_angle_by_itself_would_not_cover_it(rows_of, priors):
    """What five angles are off by together is not averaged away: each by itself promises too small an error."""
    generator = np.random.default_rng(1)
    o = noisy(signals(rows_of), generator)
    together = fit(o, priors, known={"angle_offset_deg": COMMON_DEG}).intervals["eta"].sd
    apart = fit(replace(o, theta_deg_sigma=np.full(len(o), COMMON_DEG)), priors).intervals["eta"].sd
    assert together > 1.3 * apart


def test_the_measured_leakage_may_lie_to_either_side(rows_of, priors):
    """An analyzer of measured D = 0.95 +- 0.01 may as well be better than measured."""
    generator = np.random.default_rng(2)
    found = []
    for _ in range(TRIALS):
        true = 0.95 + 0.01 * generator.standard_normal()
        o = noisy(signals(rows_of, diattenuation=true), generator)
        o = replace(o, diattenuation=np.full(len(o), 0.95))
        eta = fit(o, priors, known={"diattenuation": 0.01 / 0.95}).intervals["eta"]
        found.append((eta.median - ETA) / eta.sd)
    low, high = chi2.ppf([0.0005, 0.9995], TRIALS)
    assert low < np.sum(np.square(found)) < high
    assert abs(np.mean(found)) < 3.3 / math.sqrt(TRIALS)


@pytest.mark.parametrize("nuisances", [{}, {"diffuse": 0.01}])
def test_the_known_is_in_every_model_and_in_the_report(rows_of, priors, nuisances):
    o = noisy(signals(rows_of), np.random.default_rng(3))
    found = fit(o, priors, nuisances=nuisances, known={"angle_offset_deg": COMMON_DEG})
    assert found.priors["angle_offset_deg"].sigma == COMMON_DEG
    assert set(found.posterior.samples) == {"eta", "k", "angle_offset_deg", *nuisances}
    # Five angles with gains of their own say next to nothing about the zero.
    sd = float(np.std(found.posterior.samples["angle_offset_deg"]))
    assert 0.3 * COMMON_DEG < sd < 1.05 * COMMON_DEG


def test_auto_widens_what_was_measured_too_narrowly(rows_of, priors):
    """A wedge under the board is no part of what the board's own errors are: the rows reject it, auto finds it."""
    o = noisy(signals(rows_of, angle_offset_deg=0.8), np.random.default_rng(4))
    found = run.fit_channel(
        "550 nm",
        o,
        exterior_ior=1.0,
        priors=priors,
        nuisances=None,
        known={"angle_offset_deg": 0.02},
        method="laplace",
    )
    assert found.chosen_because.startswith("angle_offset_deg is needed")
    assert found.priors["angle_offset_deg"].sigma == NUISANCES["angle_offset_deg"].default_sigma
    eta = found.intervals["eta"]
    assert abs(eta.median - ETA) < 4 * eta.sd
