"""Fits that nobody measured: known truth, normal noise, and normal draws for a posterior."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.observations import Observations
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.priors import NUISANCES, Prior
from reflectance_fit.result import Candidate, Chains, Fit, Interval, Optimum, Posterior

PRIORS = {
    "eta": Prior("log_uniform", 0.05, 10.0),
    "k": Prior("uniform", 0.0, 20.0),
    "angle_offset_deg": NUISANCES["angle_offset_deg"].prior(0.5),
    "dark_offset": NUISANCES["dark_offset"].prior(0.01),
}


def predict(observations, eta, k, nuisances, gains):
    """The model of these tests: Fresnel, an angle offset, a dark offset, gains."""
    offset = nuisances.get("angle_offset_deg", np.zeros_like(eta))[:, None]
    theta = np.radians(observations.theta_deg + offset)
    assert np.all((theta >= 0) & (theta <= np.radians(90 + 1e-9)))
    r_s, r_p = amplitudes(np.clip(np.cos(theta), 0, 1), eta[:, None], k[:, None])
    power_s, power_p = np.abs(r_s) ** 2, np.abs(r_p) ** 2
    phi = np.radians(np.nan_to_num(observations.analyzer_deg))
    passed = 0.5 * (power_s * np.cos(phi) ** 2 + power_p * np.sin(phi) ** 2)
    none = np.isnan(observations.analyzer_deg)
    value = {
        "signal_s": power_s,
        "signal_p": power_p,
        "signal": np.where(none, (power_s + power_p) / 2, passed),
        "reflectance_s": power_s,
        "reflectance_p": power_p,
        "reflectance": (power_s + power_p) / 2,
        "ratio_ps": power_p / power_s,
        "dolp": (power_s - power_p) / (power_s + power_p),
        "psi_deg": np.degrees(np.arctan2(np.abs(r_p), np.abs(r_s))),
        "delta_deg": np.degrees(-np.angle(r_p / r_s)) % 360,
    }
    result = np.zeros((len(eta), len(observations)))
    for name in np.unique(observations.quantity):
        rows = observations.quantity == name
        result[:, rows] = value[str(name)][:, rows]
    known = np.array([gains.get(str(g), 1.0) for g in observations.gain_group])
    power = np.char.startswith(observations.quantity, "signal") | np.char.startswith(
        observations.quantity, "refl"
    )
    dark = nuisances.get("dark_offset", np.zeros_like(eta))[:, None]
    return result * known + np.where(power, dark, 0.0)


def observe(
    blocks,
    *,
    eta,
    k,
    sigma,
    gains=None,
    theta_sigma=0.0,
    analyzer=(np.nan,),
    channel="550 nm",
    seed=0,
    one_gain=True,
):
    """``blocks``: (quantity, angles, gain group); measured with relative and absolute noise."""
    rows = [(q, t, a, g) for q, angles, g in blocks for t in angles for a in analyzer]
    n = len(rows)
    group = [g if one_gain else f"{g}@{t:g}" for _, t, _, g in rows]
    empty = Observations(
        channel=np.full(n, channel),
        wavelength_nm=np.full(n, 550.0),
        set=np.full(n, "a"),
        gain_group=np.array(group),
        theta_deg=np.array([r[1] for r in rows], dtype=float),
        theta_deg_sigma=np.full(n, theta_sigma),
        theta_deg_spread=np.zeros(n),
        analyzer_deg=np.array([r[2] for r in rows], dtype=float),
        retarder_deg=np.full(n, np.nan),
        retardance_deg=np.full(n, np.nan),
        diattenuation=np.ones(n),
        light=np.tile([1.0, 0, 0, 0], (n, 1)),
        quantity=np.array([r[0] for r in rows]),
        value=np.zeros(n),
        sigma=np.zeros(n),
        pixels=np.ones(n, dtype=np.int64),
        flag=np.full(n, "used", dtype="<U12"),
    )
    truth = predict(empty, np.array([eta]), np.array([k]), {}, gains or {})[0]
    angle = np.char.endswith(empty.quantity, "_deg")
    largest = np.array([np.abs(truth[empty.quantity == q]).max() for q in empty.quantity])
    empty.sigma[:] = np.where(angle, 30 * sigma, sigma * (np.abs(truth) + 0.1 * largest))
    empty.value[:] = truth + empty.sigma * np.random.default_rng(seed).normal(size=n)
    empty.value[:] = np.where(empty.quantity == "delta_deg", empty.value % 360, empty.value)
    return empty


def fake_fit(
    observations, *, best, sd, k=0.0, gains=None, channel="550 nm", wavelength=550.0, saturated=0, seed=1
):
    """A fit whose posterior is normal about ``best`` (eta, nuisances, and k where it is free)."""
    rng = np.random.default_rng(seed)
    gains = gains or {}
    names = tuple(best)
    chains, draws, ensembles = 32, 250, 4
    samples = {n: best[n] + sd[n] * rng.normal(size=(chains, draws)) for n in names}
    model = "conductor" if "k" in best else "dielectric"
    samples.setdefault("k", np.zeros((chains, draws)))
    samples["k"] = np.abs(samples["k"])
    nuisances = {n: np.array([best[n]]) for n in names if n not in ("eta", "k")}
    k = best.get("k", k)
    predicted = predict(observations, np.array([best["eta"]]), np.array([k]), nuisances, gains)[0]
    difference = observations.value - predicted
    circular = observations.quantity == "delta_deg"
    difference = np.where(circular, (difference + 180) % 360 - 180, difference)
    residuals = difference / observations.sigma
    chi2, dof = float(np.sum(residuals**2)), len(residuals) - len(names)
    steps = 3000
    walk = np.zeros((ensembles, steps, len(names)))
    for i in range(1, steps):
        walk[:, i] = 0.97 * walk[:, i - 1] + 0.04 * rng.normal(size=(ensembles, len(names)))
    scale = np.array([sd[n] for n in names])
    start = 4 * np.exp(-np.arange(steps) / 80)[None, :, None] * rng.normal(size=(ensembles, 1, len(names)))
    trace = np.array([best[n] for n in names]) + scale * (walk + start)
    tau_steps = np.arange(200.0, steps + 1, 200)
    tau = 55 * (1 - np.exp(-tau_steps / 500)) + rng.normal(size=len(tau_steps))
    posterior = Posterior(
        model, "emcee", names, samples, -0.5 * rng.chisquare(2, (chains, draws)),
        np.repeat(np.arange(ensembles), chains // ensembles), dict.fromkeys(names, 2600.0), True,
        Chains(steps, 400, 0.42, dict.fromkeys(names, 1.001), tau_steps, tau, trace),
    )  # fmt: skip
    upper = None
    if model == "dielectric":
        upper = Posterior(
            "conductor", "importance", (*names, "k"),
            {**samples, "k": np.abs(0.004 * rng.normal(size=(chains, draws)))}, posterior.log_density,
            posterior.ensemble, dict.fromkeys(names, 2600.0), True, None, 0.1,
        )  # fmt: skip
    optimum = Optimum(
        model, dict(best), best["eta"], k, gains, chi2, chi2, dof, chi2 + 3, predicted,
        observations.sigma.copy(), residuals, "nlopt", 0,
    )  # fmt: skip
    angle = (
        np.degrees(np.arctan(samples["eta"]))
        if model == "dielectric"
        else 75 + 0.4 * rng.normal(size=(32, 250))
    )
    k_interval = (
        interval(samples["k"])
        if model == "conductor"
        else Interval(None, None, None, (0, 0.008), "upper_limit")
    )
    return Fit(
        channel, wavelength, 1.000277, observations, optimum, (Candidate(model, 2, chi2, dof, 9.0),), "",
        posterior, upper, {"eta": interval(samples["eta"]), "k": k_interval, "brewster_deg": interval(angle)},
        {"brewster_deg": angle}, {}, {n: PRIORS[n] for n in names}, saturated,
    )  # fmt: skip


def interval(draws):
    q = np.percentile(draws, (2.5, 16, 50, 84, 97.5))
    return Interval(float(q[2]), float(draws.std()), (q[1], q[3]), (q[0], q[4]), "identified")


@pytest.fixture(name="predict", scope="session")
def _predict():
    def predictor(fit):
        return lambda observations, eta, k, nuisances: predict(
            observations, eta, k, nuisances, fit.optimum.gains
        )

    return predictor


@pytest.fixture(scope="session")
def glass():
    """Laser signals of a dielectric, s and p, each with its own gain, at uncertain angles."""
    gains = {"s": 4.1, "p": 2.6}
    blocks = [("signal_s", np.arange(20, 86, 5.0), "s"), ("signal_p", np.arange(20, 86, 5.0), "p")]
    rows = observe(blocks, eta=1.5185, k=0.0, sigma=0.03, gains=gains, theta_sigma=0.3)
    best, sd = {"eta": 1.52, "angle_offset_deg": 0.05}, {"eta": 0.012, "angle_offset_deg": 0.2}
    return fake_fit(rows, best=best, sd=sd, gains=gains, saturated=2)


@pytest.fixture(scope="session")
def gold():
    """Psi and Delta of a conductor."""
    angles = np.arange(45, 81, 2.5)
    rows = observe([("psi_deg", angles, ""), ("delta_deg", angles, "")], eta=0.22, k=3.2, sigma=0.01)
    best, sd = (
        {"eta": 0.22, "k": 3.2, "angle_offset_deg": 0.02},
        {"eta": 0.01, "k": 0.02, "angle_offset_deg": 0.04},
    )
    return fake_fit(rows, best=best, sd=sd)


@pytest.fixture(scope="session")
def photographs():
    """Four analyzer settings at each angle, one unknown gain an angle."""
    angles = np.array([30.0, 40, 50, 55, 60, 70, 80])
    gains = {f"@{t:g}": 1000 * (1 + 0.3 * np.sin(i)) for i, t in enumerate(angles)}
    rows = observe(
        [("signal", angles, "")],
        eta=1.5,
        k=0.0,
        sigma=0.01,
        gains=gains,
        analyzer=(0, 45, 90, 135),
        one_gain=False,
    )
    best, sd = {"eta": 1.5, "angle_offset_deg": 0.0}, {"eta": 0.004, "angle_offset_deg": 0.1}
    return fake_fit(rows, best=best, sd=sd, gains=gains)


@pytest.fixture(scope="session")
def analyzer_scan():
    """A rotating analyzer at two angles of incidence."""
    gains = {"": 1.0, "lamp": 900.0}
    rows = observe(
        [("signal", [45.0, 60.0], "lamp")],
        eta=1.5,
        k=0,
        sigma=0.02,
        gains=gains,
        analyzer=np.arange(0, 180, 7.5),
    )
    best, sd = {"eta": 1.5}, {"eta": 0.01}
    return fake_fit(rows, best=best, sd=sd, gains=gains)


@pytest.fixture(scope="session")
def everything():
    """All kinds of ratio and power in one fit; Delta of glass, which jumps and wraps."""
    angles = np.arange(10, 86, 3.0)
    names = ("reflectance_s", "reflectance_p", "reflectance", "ratio_ps", "dolp", "psi_deg", "delta_deg")
    rows = observe([(n, angles, "") for n in names], eta=1.5, k=0.0, sigma=0.02)
    best, sd = {"eta": 1.5, "dark_offset": 0.001}, {"eta": 0.01, "dark_offset": 0.001}
    return fake_fit(rows, best=best, sd=sd)
