"""Random tables of one material each, of every kind of quantity, to find the best point of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import models
from reflectance_fit.inference.rows import Rows, gain_names, pack
from reflectance_fit.observations import Observations, Quantity, concatenate
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior

Floats = NDArray[np.float64]

PRIORS = {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}
KINDS = ("signals", "absolute", "ratio", "dolp", "unpolarized", "psi", "psi and delta")
_LEAST_SIGMA = 1e-3  # stated where there is no noise, relative to the largest value


class Scene(NamedTuple):
    """The truth, the table and the conductor fitted to it."""

    eta: float
    k: float
    kind: str
    noise: float
    rows: Rows
    model: models.Model
    gains: list[str]

    @property
    def hard(self) -> bool:
        """A dielectric with total reflection: a corner of the objective at each angle of the table."""
        return self.eta < 1 and self.k == 0


def scene(seed: int) -> Scene:
    """eta log-uniform in [0.1, 4] (a fifth: a dielectric in [1.1, 4]), k 0 or log-uniform in [0.01, 8].

    3 to 40 angles, noise of 0 (one in ten) to 5 %.
    """
    generator = np.random.default_rng([seed, 5])
    if generator.random() < 0.2:
        eta, k = _log_uniform(generator, 1.1, 4.0), 0.0
    else:
        eta = _log_uniform(generator, 0.1, 4.0)
        k = 0.0 if generator.random() < 1 / 3 else _log_uniform(generator, 0.01, 8.0)
    angles = int(generator.integers(3, 41))
    if generator.random() < 0.5:
        theta = np.sort(generator.uniform(5.0, 85.0, angles))
    else:
        theta = np.linspace(generator.uniform(5.0, 30.0), generator.uniform(60.0, 85.0), angles)
    noise = 0.0 if generator.random() < 0.1 else generator.uniform(0.0, 0.05)
    kind = KINDS[generator.integers(len(KINDS))]
    return build(eta, k, kind, theta, noise, generator)


def build(
    eta: float,
    k: float,
    kind: str,
    theta: Floats,
    noise: float,
    generator: np.random.Generator,
    **nuisances: float,
) -> Scene:
    """The table of ``kind`` at ``theta`` degrees, each value with its noise relative to the largest."""
    cos = np.cos(np.radians(theta))
    r = reflectances(cos, eta, k)
    psi, delta = np.degrees(psi_delta(cos, eta, k))
    values = {
        "signals": {"signal_s": 70 * r.s, "signal_p": 90 * r.p},
        "absolute": {"reflectance_s": r.s, "reflectance_p": r.p},
        "ratio": {"ratio_ps": r.p / r.s},
        "dolp": {"dolp": (r.s - r.p) / (r.s + r.p)},
        "unpolarized": {"reflectance": r.mean},
        "psi": {"psi_deg": psi},
        "psi and delta": {"psi_deg": psi, "delta_deg": delta},
    }[kind]
    scales = {"psi_deg": 45.0, "delta_deg": 45.0, "ratio_ps": 1.0, "dolp": 1.0}
    parts = []
    for quantity, value in values.items():
        scale = scales.get(quantity, float(np.max(value)))
        noisy = value + noise * scale * generator.standard_normal(len(theta))
        parts.append(_table(theta, quantity, noisy, max(noise, _LEAST_SIGMA) * scale))
    observations = concatenate(parts)
    rows = pack(observations, 1.0)
    model = models.build("conductor", rows, PRIORS, nuisances, [])
    return Scene(eta, k, kind, noise, rows, model, gain_names(observations))


def _log_uniform(generator: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _table(theta: Floats, quantity: str, value: Floats, sigma: float) -> Observations:
    n = len(theta)
    nothing = np.full(n, np.nan)
    return Observations(
        channel=np.full(n, "550 nm"),
        wavelength_nm=np.full(n, 550.0),
        set=np.full(n, "0"),
        gain_group=np.full(n, quantity if Quantity(quantity).has_gain else ""),
        theta_deg=theta,
        theta_deg_sigma=np.zeros(n),
        analyzer_deg=nothing,
        retarder_deg=nothing,
        retardance_deg=nothing,
        theta_deg_spread=np.zeros(n),
        diattenuation=np.ones(n),
        light=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        quantity=np.full(n, quantity),
        value=value,
        sigma=np.full(n, sigma),
        pixels=np.ones(n, dtype=np.int64),
        flag=np.full(n, "used"),
    )
