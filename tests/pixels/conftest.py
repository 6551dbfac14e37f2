"""Pixels' readings made from the readable physics, and the fit of one pixel's rows alone."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.inference import models, search
from reflectance_fit.inference.problem import objectives, problem_of
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import Observations
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.mueller import polarizer, reflection, retarder
from reflectance_fit.pixels.rows import PixelRows
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior

PRIORS = {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}


def empty_rows(
    theta_deg,
    n,
    *,
    analyzers=(0.0, 45.0, 90.0, 135.0),
    light=(1.0, 0.0, 0.0, 0.0),
    retarder_deg=np.nan,
    s_deg=0.0,
    diattenuation=1.0,
    exterior_ior=1.0,
    gain=None,
):
    """Rows without values: each view of ``theta_deg`` (views,) or (views, n) behind every analyzer."""
    theta = np.radians(np.atleast_1d(theta_deg)).astype(np.float32)
    theta = theta[:, None] if theta.ndim == 1 else theta
    s = np.radians(
        np.broadcast_to(np.asarray(s_deg, dtype=float), (len(theta), np.size(s_deg) if np.ndim(s_deg) else 1))
    )
    views, count = len(theta), len(analyzers)
    m = views * count
    return PixelRows(
        values=np.full((m, n), np.nan, dtype=np.float32),
        variance=np.full((m, n), np.nan, dtype=np.float32),
        view=np.repeat(np.arange(views), count),
        gain=np.zeros(m, dtype=np.int64) if gain is None else np.repeat(np.asarray(gain), count),
        light=np.tile(np.array(light, dtype=float), (m, 1)),
        diattenuation=np.full(m, diattenuation),
        analyzer=np.radians(np.tile(np.asarray(analyzers, dtype=float), views)),
        retarder=np.full(m, np.radians(retarder_deg)),
        retardance=np.full(m, np.nan if np.isnan(retarder_deg) else 1.4),
        theta=theta,
        cos_2s=np.cos(2 * s).astype(np.float32),
        sin_2s=np.sin(2 * s).astype(np.float32),
        exterior_ior=exterior_ior,
    )


def mueller_signals(rows, eta, k):
    """Signals at gain 1, shape (m, n), by the Mueller chain of the readable physics; eta and k relative to vacuum."""
    m, n = rows.values.shape
    found = np.empty((m, n))
    s = 0.5 * np.arctan2(rows.sin_2s.astype(float), rows.cos_2s.astype(float))
    for j in range(m):
        theta = np.broadcast_to(rows.theta[rows.view[j]].astype(float), n)
        turn = np.broadcast_to(s[rows.view[j]], n)
        amplitude = amplitudes(
            np.cos(theta), np.asarray(eta) / rows.exterior_ior, np.asarray(k) / rows.exterior_ior
        )
        for i in range(n):
            r_s, r_p = (np.broadcast_to(a, n)[i] for a in amplitude[:2])
            stokes = reflection(r_s, r_p) @ rows.light[j]
            if not np.isnan(rows.retarder[j]):
                stokes = retarder(rows.retarder[j] - turn[i], rows.retardance[j]) @ stokes
            if not np.isnan(rows.analyzer[j]):
                stokes = polarizer(rows.analyzer[j] - turn[i], rows.diattenuation[j]) @ stokes
            found[j, i] = stokes[0]
    return found


def fill(rows, eta, k, *, snr=200.0, seed=0, gain=1000.0):
    """Values of one material under white noise of the largest signal over ``snr``; 0 in ``snr`` for none."""
    m, n = rows.values.shape
    views = PixelRows(
        **{name: getattr(rows, name) for name in rows.__slots__ if name not in ("values", "variance")},
        values=np.zeros((m, 1 if rows.theta.shape[1] == 1 and not rows.turns else n), dtype=np.float32),
        variance=np.zeros((m, 1 if rows.theta.shape[1] == 1 and not rows.turns else n), dtype=np.float32),
    )
    mean = np.where(rows.gain < 0, 1.0, gain * (1 + rows.gain))[:, None] * mueller_signals(views, eta, k)
    sigma = mean.max() / (snr or 1000.0)
    noise = sigma * np.random.default_rng(seed).standard_normal((m, n)) if snr else 0.0
    rows.values[:] = mean + noise
    rows.variance[:] = sigma**2
    return rows


def observations_of(rows, i):
    """Pixel i's readings as the fit of a table has them."""
    there = np.isfinite(rows.values[:, i])
    m = len(rows.view)
    at, turned = (i if x.shape[1] > 1 else 0 for x in (rows.theta, rows.cos_2s))
    s = 0.5 * np.arctan2(
        rows.sin_2s[rows.view, turned].astype(float), rows.cos_2s[rows.view, turned].astype(float)
    )
    return Observations(
        channel=np.full(m, "550 nm"),
        wavelength_nm=np.full(m, 550.0),
        set=np.full(m, "0"),
        gain_group=np.array([f"gain {g}" if g >= 0 else "" for g in rows.gain]),
        theta_deg=np.degrees(rows.theta[rows.view, at].astype(float)),
        theta_deg_sigma=np.zeros(m),
        theta_deg_spread=np.zeros(m),
        analyzer_deg=np.degrees(rows.analyzer - s),
        retarder_deg=np.degrees(rows.retarder - s),
        retardance_deg=np.degrees(rows.retardance),
        diattenuation=rows.diattenuation,
        light=rows.light,
        quantity=np.full(m, "signal"),
        value=rows.values[:, i].astype(float),
        sigma=np.sqrt(rows.variance[:, i].astype(float)),
        pixels=np.ones(m, dtype=np.int64),
        flag=np.full(m, "used"),
    ).select(there)


def fit_alone(rows, i, model):
    """(eta, k, chi2, dof) of each best point of the single fit: several where two fit equally.

    At one angle, in light without S2 and S3, a dielectric has an equal twin beyond Brewster's angle, of which the
    search need not report both: tan(theta_t) becomes 1 / (tan(theta_i)^2 tan(theta_t)).
    """
    o = observations_of(rows, i)
    packed = pack(o, rows.exterior_ior)
    built = models.build(model, packed, PRIORS, {}, [])
    optimum, basins = search.find(built, packed, gain_names(o))
    equal = [b for b in basins if b.objective <= basins[0].objective + 1e-6 * (1 + optimum.chi2)]
    points = [built.full(b.x)[0][:2].tolist() for b in equal]
    angles = np.unique(o.theta_deg)
    if model == "dielectric" and len(angles) == 1 and not rows.light[:, 2:].any() and rows.gain[0] >= 0:
        theta = np.radians(angles[0])
        for eta, _ in list(points):
            with np.errstate(invalid="ignore"):
                theta_t = np.arcsin(np.sin(theta) * rows.exterior_ior / eta)
            twin = np.arctan(1 / (np.tan(theta) ** 2 * np.tan(theta_t)))
            points.append([np.sin(theta) * rows.exterior_ior / np.sin(twin), 0.0])
    return [(*point, optimum.chi2, optimum.dof) for point in points]


def deviance_alone(rows, i, model, points):
    """-2 log likelihood of (eta, k) points of shape (D, 2), by the single fit's own objective."""
    o = observations_of(rows, i)
    packed = pack(o, rows.exterior_ior)
    built = models.build(model, packed, PRIORS, {}, [])
    coordinates = np.log(points[:, :1]) if model == "dielectric" else points * [1.0, 1.0]
    coordinates[:, 0] = np.log(points[:, 0])
    return objectives(packed, problem_of(built, packed), coordinates)


@pytest.fixture(scope="session")
def deviance():
    return deviance_alone


@pytest.fixture(scope="session")
def make():
    return lambda theta_deg, n, eta, k, *, snr=200.0, seed=0, **optics: fill(
        empty_rows(theta_deg, n, **optics), eta, k, snr=snr, seed=seed
    )


@pytest.fixture(scope="session")
def signals():
    return mueller_signals


@pytest.fixture(scope="session")
def alone():
    return fit_alone
