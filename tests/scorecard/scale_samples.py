"""Synthetic samples of 40 rows each, as many as are asked for: glasses on a goniometer, metals in an ellipsometer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances

ANGLES_DEG = np.linspace(15.0, 81.0, 20)  # two quantities at each: 40 rows
SIGNAL_SIGMA, PSI_SIGMA_DEG, DELTA_SIGMA_DEG = 0.002, 0.03, 0.08


def write_samples(folder: Path, count: int, seed: int = 0) -> Path:
    """``folder``/s0000/measurement.yaml and so on, every fourth a metal; the same count and seed, the same bytes."""
    for index in range(count):
        _write(folder / f"s{index:04d}", index, np.random.default_rng((seed, index)))
    return folder


def _write(folder: Path, index: int, generator: np.random.Generator) -> None:
    noise = generator.standard_normal((2, len(ANGLES_DEG)))
    cosine, _ = cos_sin_deg(ANGLES_DEG)
    if metal := index % 4 == 3:
        eta, k = generator.uniform(0.2, 3.0), generator.uniform(2.0, 6.0)
        psi, delta = psi_delta(cosine, eta, k)
        names = ("psi_deg", "delta_deg")
        columns = [np.degrees(psi) + PSI_SIGMA_DEG * noise[0], np.degrees(delta) + DELTA_SIGMA_DEG * noise[1]]
        sigmas = {"psi_deg_sigma": PSI_SIGMA_DEG, "delta_deg_sigma": DELTA_SIGMA_DEG}
    else:
        power = reflectances(cosine, generator.uniform(1.3, 2.2), 0.0)
        names = ("signal_s", "signal_p")
        columns = [power.s + SIGNAL_SIGMA * noise[0], power.p + SIGNAL_SIGMA * noise[1]]
        sigmas = {"signal_s_sigma": SIGNAL_SIGMA, "signal_p_sigma": SIGNAL_SIGMA}
    folder.mkdir(parents=True)
    table = np.column_stack([ANGLES_DEG, *columns])
    np.savetxt(
        folder / "scan.csv",
        table,
        fmt="%.7g",
        delimiter=",",
        header=",".join(["theta_deg", *names]),
        comments="",
    )
    manifest = {
        "schema": "reflectance_fit/measurement/1",
        "sample": {"name": f"{'metal' if metal else 'glass'} {index}"},
        "exterior_ior": 1.0,
        "wavelength_nm": 589.3,
        "tables": [
            {"file": "scan.csv", "columns": {n: n for n in ("theta_deg", *names)}, "constants": sigmas}
        ],
        "nuisances": {},
    }
    (folder / "measurement.yaml").write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
