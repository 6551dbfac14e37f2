"""The compiled derivatives against the readable ones, and against differences of the model itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from reflectance_fit.inference.derivatives import gradient_at_angle, interface_gradients
from reflectance_fit.inference.forward import (
    FIRST_NUISANCE,
    FIRST_SIGMA,
    SLOPE,
    incidence,
    neutral_vector,
    predict_vectors,
    turns_of,
)
from reflectance_fit.inference.rows import pack
from reflectance_fit.observations import Quantity
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.gradients import reflectance_gradients
from reflectance_fit.physics.jit import kernel
from reflectance_fit.priors import NUISANCES

ANGLES = st.floats(0.01, 1.55)
ETA = st.floats(0.05, 10.0)
K = st.one_of(st.just(0.0), st.floats(1e-6, 20.0))
# Central differences of order 8: weights of the steps 1 to 4 to either side.
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)

OPTICS = ("source_dolp", "source_azimuth_deg", "analyzer_offset_deg", "diattenuation")


@kernel
def gradients(rows, p, optics=True):
    values = np.empty(len(rows.code))
    out = np.empty((len(rows.code), FIRST_SIGMA))
    turns = turns_of(p)
    for i in range(len(rows.code)):
        c, s = incidence(rows, i, turns)
        values[i] = gradient_at_angle(rows, i, c, s, p, turns, optics, out[i])
    return values, out


def differences(f, step):
    return sum(w * (f(m * step) - f(-m * step)) for m, w in enumerate(WEIGHTS, 1)) / step


@given(theta=ANGLES, eta=ETA, k=K)
def test_powers_change_as_the_compensated_forms_say(theta, eta, k):
    assume(k > 1e-2 or abs(eta - np.sin(theta)) > 1e-2)
    expected = reflectance_gradients(np.cos(theta), eta, k)
    _, by_theta, by_eta, by_k = interface_gradients(np.cos(theta), np.sin(theta), eta, k)
    found = (by_theta[0], by_eta[0], by_k[0], by_theta[1], by_eta[1], by_k[1])
    assert found == pytest.approx(expected[:6], rel=1e-9, abs=1e-11)


@given(theta=ANGLES, eta=ETA, k=st.one_of(st.just(0.0), st.floats(1e-3, 20.0)))
def test_the_cross_term_changes_as_the_complex_amplitudes_do(theta, eta, k):
    """Fresnel's equations differentiated as complex functions, which do not cancel where both differ."""
    assume(k > 1e-2 or abs(eta - np.sin(theta)) > 1e-2)
    c, s, n = np.cos(theta), np.sin(theta), complex(eta, k)
    eps = n * n
    w = np.sqrt(eps - s * s)
    r_s, r_p = amplitudes(c, eta, k)
    below = w * (eps * c + w) ** 2
    by_theta = 2 * s * r_s / w, 2 * s * eps * (1 - eps) / below
    by_n = -2 * c * n / (w * (c + w) ** 2), 2 * c * n * (eps - 2 * s * s) / below
    value, *found = interface_gradients(c, s, eta, k)
    assert complex(value[2], value[3]) == pytest.approx(r_s * np.conj(r_p), abs=1e-12)
    for change, (d_s, d_p) in zip(found, (by_theta, by_n, tuple(1j * d for d in by_n)), strict=True):
        expected = d_s * np.conj(r_p) + r_s * np.conj(d_p)
        assert complex(change[2], change[3]) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("quantity", list(Quantity))
@pytest.mark.parametrize("seed", range(12))
def test_every_row_changes_as_its_differences_say(rows_of, quantity, seed):
    """All quantities and all nuisances at once, with analyzer, retarder, polarized light and a range of angles."""
    generator = np.random.default_rng([seed, list(Quantity).index(quantity)])
    theta = generator.uniform(5.0, 80.0, 6)
    optics = {}
    if quantity is Quantity.SIGNAL and seed % 3:
        optics["analyzer_deg"] = generator.uniform(-90.0, 90.0)
        if seed % 3 == 2:
            optics["retarder_deg"] = generator.uniform(-90.0, 90.0)
    azimuth, part = generator.uniform(0.0, np.pi), generator.uniform(0.0, 0.7)
    light = (1.0, part * np.cos(azimuth), part * np.sin(azimuth), 0.2)
    row = rows_of(theta, quantity, 1.0, gain_group="g" if quantity.has_gain else "", light=light, **optics)
    spread = np.where(np.arange(6) % 2, 0.8, 0.0)
    wavelength = np.where(np.arange(6) % 3, 450.0, 650.0)
    rows = pack(
        replace(row, theta_deg_spread=spread, wavelength_nm=wavelength, diattenuation=np.full(6, 0.9)),
        1.000277,
    )
    p = neutral_vector()
    p[:2] = np.exp(generator.uniform(np.log(1.1), np.log(4.0))), generator.uniform(0.05, 4.0)
    p[SLOPE] = 0.01
    for name, value in {
        "angle_offset_deg": 0.4,
        "source_dolp": 0.1,
        "source_azimuth_deg": 20.0,
        "analyzer_offset_deg": 1.5,
        "diattenuation": 0.97,
    }.items():
        p[FIRST_NUISANCE + NUISANCES[name].index] = value
    values, found = gradients(rows, p)
    plain = p.copy()
    plain[[FIRST_NUISANCE + NUISANCES[name].index for name in ("dark_offset", "diffuse")]] = 0.0
    assert values == pytest.approx(predict_vectors(rows, plain[None], np.ones(rows.gains))[0], rel=1e-13)
    for j in range(FIRST_SIGMA):

        def moved(step, j=j):
            q = p.copy()
            q[j] += step
            return predict_vectors(rows, q[None], np.ones(rows.gains))[0]

        if j - FIRST_NUISANCE in (NUISANCES["dark_offset"].index, NUISANCES["diffuse"].index):
            assert not found[:, j].any()
            continue
        expected = differences(moved, 2e-3)
        # Per degree or per unit, so of order 1 or less; the differences are right to about 1e-12 of the value.
        assert found[:, j] == pytest.approx(expected, rel=1e-8, abs=1e-9), j
    few = gradients(rows, p, False)[1]
    optics = [FIRST_NUISANCE + NUISANCES[name].index for name in OPTICS]
    assert not few[:, optics].any()
    others = np.setdiff1d(np.arange(FIRST_SIGMA), optics)
    assert np.array_equal(few[:, others], found[:, others])


def test_at_normal_incidence_and_beyond_it_nothing_is_infinite(rows_of):
    """Symmetric about the normal: the derivative by the angle changes sign, the others do not."""
    p = neutral_vector()
    p[:2] = 0.7, 0.0
    offset = FIRST_NUISANCE + NUISANCES["angle_offset_deg"].index
    rows = pack(rows_of([0.0, 10.0], "reflectance_p", 1.0), 1.0)
    _, here = gradients(rows, p)
    assert here[0, offset] == 0.0
    assert np.isfinite(here).all()
    p[offset] = -20.0
    _, there = gradients(rows, p)
    assert there[1] == pytest.approx(np.where(np.arange(FIRST_SIGMA) == offset, -here[1], here[1]), rel=1e-12)
    assert np.isfinite(interface_gradients(np.cos(0.5), np.sin(0.5), np.sin(0.5), 0.0)).all()
