"""Synthetic goniometer and ellipsometer tables with known truth.

Written from the readable physics, not from the likelihood's kernels, so that a
fit of such a table tests both.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.materials.library import get
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances

FloatArray = NDArray[np.float64]

EXAMPLES = {"N-BK7": "goniometer", "Au": "ellipsometer"}
SCAN_DEG = np.arange(20.0, 84.0, 4.0)
ELLIPSOMETER_DEG = np.array([60.0, 65.0, 70.0, 75.0])


@dataclass(frozen=True, slots=True)
class Noise:
    """One standard deviation of each reading."""

    signal_share: float = 0.003  # of the largest signal
    theta_deg: float = 0.05
    psi_deg: float = 0.03
    delta_deg: float = 0.08


def write_example(folder: Path, material: str, *, seed: int = 0, wavelength_nm: float = 632.8) -> Path:
    """Write measurement.yaml, scan.csv and truth.yaml of a built-in material; returns the first.

    Dielectrics get a goniometer scan of s and p signals with one gain each,
    metals an ellipsometer table of psi and delta.  The sample stands in air.
    """
    constants = get(material)
    eta, k = (float(x) for x in constants.absolute_index(wavelength_nm))
    generator = np.random.default_rng(seed)
    metal = EXAMPLES.get(material) == "ellipsometer"
    if not metal:
        k = 0.0  # what a goniometer could see of a glass's 1e-8
    table, columns = (_ellipsometer if metal else _goniometer)(eta, k, Noise(), generator)
    folder.mkdir(parents=True, exist_ok=True)
    header = ",".join(columns)
    np.savetxt(folder / "scan.csv", table, fmt="%.6g", delimiter=",", header=header, comments="")
    manifest = {
        "schema": "reflectance_fit/measurement/1",
        "sample": {"name": f"{material} (synthetic)"},
        "wavelength_nm": wavelength_nm,
        "tables": [{"file": "scan.csv", "columns": {name: name for name in columns}}],
        "nuisances": {},
    }
    angle = np.degrees(float(brewster_angle(eta / AIR_INDEX, k / AIR_INDEX)))
    truth = {
        "schema": "reflectance_fit/truth/1",
        "material": material,
        "channels": [
            {
                "channel": f"{wavelength_nm:g} nm",
                "wavelength_nm": wavelength_nm,
                "eta": round(eta, 12),
                "k": round(k, 12),
                "brewster_deg": round(float(angle), 10),
            }
        ],
        "nuisances": {},
        "seed": seed,
    }
    for name, data in (("measurement.yaml", manifest), ("truth.yaml", truth)):
        (folder / name).write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return folder / "measurement.yaml"


def _goniometer(
    eta: float, k: float, noise: Noise, generator: np.random.Generator
) -> tuple[FloatArray, list[str]]:
    """Signals of s and p light with gains of their own, angle readings slightly off."""
    true_deg = SCAN_DEG + noise.theta_deg * generator.standard_normal(len(SCAN_DEG))
    cos_theta, _ = cos_sin_deg(true_deg)
    powers = reflectances(cos_theta, eta / AIR_INDEX, k / AIR_INDEX)
    columns = [SCAN_DEG, np.full_like(SCAN_DEG, noise.theta_deg)]
    for power, gain in ((powers.s, 1200.0), (powers.p, 2100.0)):
        sigma = noise.signal_share * gain * float(np.max(power))
        columns += [gain * power + sigma * generator.standard_normal(len(power)), np.full_like(power, sigma)]
    names = ["theta_deg", "theta_deg_sigma", "signal_s", "signal_s_sigma", "signal_p", "signal_p_sigma"]
    return np.column_stack(columns), names


def _ellipsometer(
    eta: float, k: float, noise: Noise, generator: np.random.Generator
) -> tuple[FloatArray, list[str]]:
    """Psi and Delta at a few angles that are exact."""
    cos_theta, _ = cos_sin_deg(ELLIPSOMETER_DEG)
    psi, delta = psi_delta(cos_theta, eta / AIR_INDEX, k / AIR_INDEX)
    columns = [ELLIPSOMETER_DEG]
    for angle, sigma in ((psi, noise.psi_deg), (delta, noise.delta_deg)):
        columns += [
            np.degrees(angle) + sigma * generator.standard_normal(len(angle)),
            np.full_like(ELLIPSOMETER_DEG, sigma),
        ]
    names = ["theta_deg", "psi_deg", "psi_deg_sigma", "delta_deg", "delta_deg_sigma"]
    return np.column_stack(columns), names
