"""The likelihood of blocks against the likelihood of one vector, which defines it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.inference import batch, likelihood, models
from reflectance_fit.inference.forward import FIRST_SIGMA, SOURCE
from reflectance_fit.inference.rows import pack
from reflectance_fit.observations import Flag, concatenate

NUISANCES = {
    "angle_offset_deg": 2.0,
    "dark_offset": 0.01,
    "diffuse": 0.01,
    "source_dolp": 0.05,
    "source_azimuth_deg": np.inf,
    "analyzer_offset_deg": 2.0,
    "diattenuation": 0.02,
}
THETA = np.array([0.0, 30.0, 56.0, 70.0, 86.0])


def table(rows_of, quantities, **options):
    generator = np.random.default_rng(1)
    parts = []
    for quantity in quantities:
        gain = quantity if quantity.startswith("signal") else ""
        for analyzer in (0.0, 45.0, 110.0) if quantity == "signal" else (np.nan,):
            value = generator.uniform(0.1, 0.9, len(THETA))
            parts.append(
                rows_of(
                    THETA,
                    quantity,
                    value,
                    gain_group=gain,
                    analyzer_deg=analyzer,
                    **{"sigma": 0.05, **options},
                )
            )
    return concatenate(parts)


TABLES = {
    "reflectances": (["reflectance_s", "reflectance_p", "reflectance"], {}),
    "signals": (["signal_s", "signal_p", "signal"], {}),
    "polarized light": (["signal"], {"light": (1.0, 0.3, 0.5, -0.2)}),
    "retarder": (["signal"], {"light": (1.0, 0.0, 0.8, 0.0), "retarder_deg": 20.0}),
    "ratios": (["ratio_ps", "dolp", "signal_s"], {}),
    "estimated sigma": (["signal_s", "reflectance_p"], {"sigma": np.nan}),
}


def vectors_of(model, count):
    """Random vectors, some beyond the domain: dark above every reading, angles beyond grazing."""
    generator = np.random.default_rng(2)
    low, high = model.ranges.T
    x = low + (high - low) * generator.random((count, len(low)))
    x[: count // 2] = 0.9 * np.array([p.centre for p in model.priors]) + 0.1 * x[: count // 2]
    return model.full(np.clip(x, low, high))


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("spread", [[0.0], [1.5], [0.0, 1.5]])  # the last: not of all rows of an angle
@pytest.mark.parametrize("steady", [False, True])
def test_blocks_equal_one_vector_at_a_time(rows_of, priors, name, spread, steady):
    quantities, options = TABLES[name]
    o = table(rows_of, quantities, **options)
    o = replace(o, theta_deg_spread=np.resize(spread, len(o)))
    rows = pack(o, 1.0003)
    estimated = sorted(set(quantities)) if name == "estimated sigma" else []
    model = models.build("conductor", rows, priors, NUISANCES, estimated)
    vectors = vectors_of(model, 3 * 64 + 5)  # several blocks, the last not full
    if steady:  # the source, the analyzer and the diattenuation the same for all
        vectors[:, SOURCE:FIRST_SIGMA] = vectors[0, SOURCE:FIRST_SIGMA]
    expected = likelihood.log_likelihoods(rows, vectors)
    # Not by way of log_likelihood, which would take the slow way where blocks were wrong.
    found = batch.blocks(rows, vectors)
    finite = np.isfinite(expected)
    assert finite.sum() > 20
    np.testing.assert_array_equal(np.isfinite(found), finite)
    np.testing.assert_allclose(found[finite], expected[finite], rtol=1e-10, atol=1e-8)
    assert batch.serves(rows)
    np.testing.assert_array_equal(batch.log_likelihood(model, rows)(vectors), found)


def test_what_blocks_cannot_do_goes_to_the_one_that_can(rows_of, priors):
    plain = table(rows_of, ["signal_s", "signal_p"])
    flags = np.where(np.arange(len(plain)) == 3, str(Flag.SATURATED), str(Flag.USED))
    for o in (
        table(rows_of, ["psi_deg"]),
        table(rows_of, ["signal_s", "signal_p"], theta_sigma=0.3),
        replace(plain, flag=flags),
    ):
        rows = pack(o, 1.0)
        assert not batch.serves(rows)
        model = models.build("conductor", rows, priors, {"angle_offset_deg": 1.0}, [])
        vectors = vectors_of(model, 70)
        expected = likelihood.log_likelihoods(rows, vectors)
        np.testing.assert_array_equal(batch.log_likelihood(model, rows)(vectors), expected)


def test_another_likelihood_is_noticed(rows_of, priors, monkeypatch):
    """A likelihood that has learnt something new must win over blocks that have not."""
    rows = pack(table(rows_of, ["signal_s", "signal_p"]), 1.0)
    model = models.build("conductor", rows, priors, {}, [])
    vectors = vectors_of(model, 70)
    other = likelihood.log_likelihoods(rows, vectors) * 0.9
    monkeypatch.setattr(
        likelihood, "log_likelihoods", lambda r, v, f=likelihood.log_likelihoods: 0.9 * f(r, v)
    )
    np.testing.assert_array_equal(batch.log_likelihood(model, rows)(vectors), other)
