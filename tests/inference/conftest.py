"""Observations for the fit's tests, made from the readable physics."""

from __future__ import annotations

import numpy as np
import pytest

from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior


def make_observations(
    theta_deg,
    quantity,
    value,
    *,
    sigma=np.nan,
    theta_sigma=0.0,
    gain_group="",
    analyzer_deg=np.nan,
    retarder_deg=np.nan,
    light=(1.0, 0.0, 0.0, 0.0),
    set_name="0",
):
    """One quantity's rows at ``theta_deg``."""
    theta = np.atleast_1d(np.asarray(theta_deg, dtype=float))
    n = len(theta)

    def full(x):
        return np.broadcast_to(np.asarray(x, dtype=float), n).copy()

    retarder = full(retarder_deg)
    return Observations(
        channel=np.full(n, "550 nm"),
        wavelength_nm=full(550.0),
        set=np.full(n, set_name),
        gain_group=np.full(n, gain_group),
        theta_deg=theta,
        theta_deg_sigma=full(theta_sigma),
        analyzer_deg=full(analyzer_deg),
        retarder_deg=retarder,
        retardance_deg=np.where(np.isnan(retarder), np.nan, 90.0),
        theta_deg_spread=np.zeros(n),
        diattenuation=np.ones(n),
        light=np.tile(np.asarray(light, dtype=float), (n, 1)),
        quantity=np.full(n, str(Quantity(quantity))),
        value=full(value),
        sigma=full(sigma),
        pixels=np.ones(n, dtype=np.int64),
        flag=np.full(n, "used"),
    )


@pytest.fixture(scope="session")
def rows_of():
    return make_observations


@pytest.fixture(scope="session")
def priors():
    return {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}
