"""Truth in, pipeline, truth out: standardised errors over many noise realisations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from reflectance_fit import fit
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.inference import posterior
from reflectance_fit.strict_yaml import load

SEEDS = 20


@pytest.mark.parametrize(("material", "model"), [("N-BK7", "dielectric"), ("Au", "conductor")])
def test_standardised_errors_are_standard(material, model, tmp_path, monkeypatch):
    """sum of z^2 inside the 99.9 % band of chi2, mean of z inside that of a normal.

    An angle in radians, a swapped s and p, a lost factor of a gain or a sigma
    wrong by 60 % all leave it.
    """
    monkeypatch.setattr(posterior, "MIN_ESS", 1000.0)
    monkeypatch.setattr(posterior, "STEPS_PER_TAU", 20)
    z = {name: [] for name in ("eta", "k", "brewster_deg")}
    for seed in range(SEEDS):
        folder = tmp_path / str(seed)
        manifest = write_example(folder, material, seed=seed + 100)
        truth = load(folder / "truth.yaml").data["channels"][0]
        channel = fit(manifest, model=model, seed=seed, timings=False).report.channels[0]
        for name, values in z.items():
            found = getattr(channel, name)
            if found.sd:
                values.append((found.median - truth[name]) / found.sd)
    assert set(map(len, z.values())) <= {0, SEEDS}
    for name, values in z.items():
        if values:
            low, high = chi2.ppf([0.0005, 0.9995], SEEDS)
            assert low < np.sum(np.square(values)) < high, name
            assert abs(np.mean(values)) < norm.ppf(0.9995) / np.sqrt(SEEDS), name
