"""Scenes for the inference card: what a capture reads, by the readable physics, which shares no code with the fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.inference import models, search
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.optimize import Basin
from reflectance_fit.inference.rows import Rows, fitted, gain_names, pack
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.observations import Flag, Observations, Quantity
from reflectance_fit.physics import fresnel, mueller, stokes
from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior
from reflectance_fit.result import Optimum

FloatArray = NDArray[np.float64]
Amplitudes = Callable[..., tuple[NDArray[np.complex128], NDArray[np.complex128]]]

SEED = 20260
EXTERIOR = AIR_INDEX
DEFAULT_PRIORS = {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}
UNPOLARIZED, LINEAR_45 = (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Reading:
    """One row an angle: a quantity, and for a ``signal`` what stands before the detector."""

    quantity: str
    analyzer_deg: float = math.nan
    retarder_deg: float = math.nan  # of a quarter-wave plate


S_AND_P = (Reading("signal_s"), Reading("signal_p"))
FOUR_ANALYZERS = tuple(Reading("signal", angle) for angle in (0.0, 45.0, 90.0, 135.0))
WITH_S3 = (*FOUR_ANALYZERS, Reading("signal", 45.0, 0.0), Reading("signal", 135.0, 0.0))


@dataclass(frozen=True, slots=True)
class Design:
    """Every reading at every angle; rows of one ``gain`` share it, the empty one is absolute."""

    theta_deg: tuple[float, ...]
    readings: tuple[Reading, ...]
    light: tuple[float, float, float, float] = UNPOLARIZED
    gain: str = "lamp"
    sigma: float = 1.0
    theta_sigma_deg: float = 0.0

    def rows(self) -> Observations:
        """The rows with their sigma, of value 0."""
        pairs = [(theta, reading) for theta in self.theta_deg for reading in self.readings]
        n = len(pairs)
        retarder = np.array([reading.retarder_deg for _, reading in pairs])
        return Observations(
            channel=np.full(n, "G"),
            wavelength_nm=np.full(n, 550.0),
            set=np.full(n, "0"),
            gain_group=np.full(n, self.gain),
            theta_deg=np.array([theta for theta, _ in pairs]),
            theta_deg_sigma=np.full(n, self.theta_sigma_deg),
            theta_deg_spread=np.zeros(n),
            analyzer_deg=np.array([reading.analyzer_deg for _, reading in pairs]),
            retarder_deg=retarder,
            retardance_deg=np.where(np.isnan(retarder), np.nan, 90.0),
            diattenuation=np.ones(n),
            light=np.tile(np.array(self.light), (n, 1)),
            quantity=np.array([str(Quantity(reading.quantity)) for _, reading in pairs]),
            value=np.zeros(n),
            sigma=np.full(n, self.sigma),
            pixels=np.ones(n, dtype=np.int64),
            flag=np.full(n, str(Flag.USED)),
        )


def reflected(
    o: Observations,
    eta: ArrayLike,
    k: ArrayLike,
    nuisances: Mapping[str, ArrayLike],
    amplitudes: Amplitudes = fresnel.amplitudes,
) -> FloatArray:
    """What each of N rows reads at gain 1 without dark or diffuse light, shape (D, N), for D points."""

    def column(x: ArrayLike) -> FloatArray:
        return np.atleast_1d(np.asarray(x, dtype=float))[:, None]

    def nuisance(name: str, neutral: float = 0.0) -> FloatArray:
        return column(nuisances.get(name, neutral))

    theta = np.radians(o.theta_deg + nuisance("angle_offset_deg"))
    r_s, r_p = amplitudes(np.cos(theta), column(eta) / EXTERIOR, column(k) / EXTERIOR)
    power_s, power_p = np.abs(r_s) ** 2, np.abs(r_p) ** 2
    azimuth = 2 * np.radians(nuisance("source_azimuth_deg"))
    # A source that is slightly polarized: its unpolarized part becomes so.
    depolarized = o.light[:, 0] - np.linalg.norm(o.light[:, 1:], axis=1)
    added = (nuisance("source_dolp") * depolarized)[..., None]
    turn = np.stack([0 * azimuth, np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=-1)
    seen = (mueller.reflection(r_s, r_p) @ (o.light + added * turn)[..., None])[..., 0]
    plate = mueller.retarder(np.radians(o.retarder_deg), np.radians(o.retardance_deg))
    behind_plate = (np.nan_to_num(plate) @ seen[..., None])[..., 0]
    seen = np.where(np.isnan(o.retarder_deg)[:, None], seen, behind_plate)
    analyzer = np.select([o.quantity == "signal_s", o.quantity == "signal_p"], [0.0, 90.0], o.analyzer_deg)
    angle = np.radians(np.nan_to_num(analyzer) + nuisance("analyzer_offset_deg"))
    signal = stokes.analyzer_signal(seen, angle, o.diattenuation * nuisance("diattenuation", 1.0))
    return np.asarray(
        np.select(
            [
                o.quantity == "reflectance_s",
                o.quantity == "reflectance_p",
                o.quantity == "reflectance",
                o.quantity == "psi_deg",
                o.quantity == "delta_deg",
                (o.quantity == "signal") & np.isnan(o.analyzer_deg),
                o.quantity == "signal",
            ],
            [
                power_s,
                power_p,
                (power_s + power_p) / 2,
                np.degrees(np.arctan2(np.abs(r_p), np.abs(r_s))),
                np.degrees(np.angle(r_s * np.conj(r_p))) % 360.0,
                seen[..., 0],
                signal,
            ],
            2 * signal,  # signal_s and signal_p are R_s and R_p; an analyzer passes half of unpolarized light
        )
    )


def photographed(
    o: Observations,
    truth: Mapping[str, float],
    gain: float,
    generator: np.random.Generator,
    *,
    amplitudes: Amplitudes = fresnel.amplitudes,
    gain_of_row: ArrayLike = 1.0,
) -> Observations:
    """The rows with the values of one capture: ``truth`` holds eta, k and nuisances."""
    error = o.theta_deg_sigma[0] * generator.standard_normal(len(np.unique(o.theta_deg)))
    _, setting = np.unique(o.theta_deg, return_inverse=True)
    turned = replace(o, theta_deg=o.theta_deg + error[setting])
    clean = gain * gain_of_row * reflected(turned, truth["eta"], truth["k"], truth, amplitudes)[0]
    # Diffuse light is a fraction of the largest reading, of which it is a part.
    diffuse = truth.get("diffuse", 0.0)
    clean = clean + diffuse / (1 - diffuse) * clean.max() + truth.get("dark_offset", 0.0)
    return replace(o, value=clean + o.sigma * generator.standard_normal(len(o)))


def brewster_deg(eta: ArrayLike, k: ArrayLike) -> FloatArray:
    return np.degrees(brewster_angle(np.asarray(eta) / EXTERIOR, np.asarray(k) / EXTERIOR))


def searched(
    name: str, o: Observations, priors: Mapping[str, Prior], nuisances: Mapping[str, float]
) -> tuple[Model, Rows, Optimum, list[Basin]]:
    """The model ``name`` of these rows, and where its likelihood is best."""
    rows = pack(fitted(o), EXTERIOR)
    model = models.build(name, rows, priors, nuisances, [])
    optimum, basins = search.find(model, rows, gain_names(o))
    return model, rows, optimum, basins
