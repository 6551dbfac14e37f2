"""The compiled kernels against the readable physics they are twins of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from reflectance_fit.inference.forward import FIRST_NUISANCE, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import Quantity, concatenate
from reflectance_fit.physics import mueller, stokes
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import amplitudes, reflectances
from reflectance_fit.physics.kernels import analyzer_signal, interface
from reflectance_fit.priors import NUISANCES

ANGLES = st.floats(0.0, 1.5)
ETA = st.floats(0.05, 10.0)
K = st.one_of(st.just(0.0), st.floats(1e-6, 20.0))


@given(theta=ANGLES, eta=ETA, k=K)
def test_interface_is_the_amplitudes_squared_and_crossed(theta, eta, k):
    # At the critical angle both forms keep half of their digits only.
    assume(k > 1e-3 or abs(eta - np.sin(theta)) > 1e-3)
    r_s, r_p = amplitudes(np.cos(theta), eta, k)
    cross = r_s * np.conj(r_p)
    expected = (abs(r_s) ** 2, abs(r_p) ** 2, cross.real, cross.imag)
    assert interface(np.cos(theta), np.sin(theta), eta, k) == pytest.approx(expected, abs=1e-12)


@given(
    theta=ANGLES,
    eta=ETA,
    k=K,
    dolp=st.floats(0.0, 1.0),
    azimuth=st.floats(0.0, 3.2),
    circular=st.floats(-1.0, 1.0),
    analyzer=st.floats(-3.0, 3.0),
    retarder=st.one_of(st.just(np.nan), st.floats(-3.0, 3.0)),
    retardance=st.floats(0.0, 6.0),
    diattenuation=st.floats(0.9, 1.0),
)
def test_analyzer_signal_is_the_mueller_chain(
    theta, eta, k, dolp, azimuth, circular, analyzer, retarder, retardance, diattenuation
):
    assume(k > 1e-3 or abs(eta - np.sin(theta)) > 1e-3)
    light = np.array([1.0, dolp * np.cos(2 * azimuth), dolp * np.sin(2 * azimuth), circular])
    seen = mueller.reflection(*amplitudes(np.cos(theta), eta, k)) @ light
    if not np.isnan(retarder):
        seen = mueller.retarder(retarder, retardance) @ seen
    expected = stokes.analyzer_signal(seen, analyzer, diattenuation)
    compiled = analyzer_signal(
        interface(np.cos(theta), np.sin(theta), eta, k),
        tuple(light),
        (np.cos(2 * analyzer), np.sin(2 * analyzer)),
        (np.cos(2 * retarder), np.sin(2 * retarder), np.cos(retardance), np.sin(retardance)),
        diattenuation,
    )
    assert compiled == pytest.approx(float(expected), abs=1e-12)


@pytest.mark.parametrize("k", [0.0, 2.5])
def test_every_quantity_is_what_its_name_says(rows_of, k):
    """One row each against the readable functions; the exterior's index divides eta and k."""
    theta, eta, exterior = 62.0, 1.7, 1.2
    r = reflectances(np.cos(np.radians(theta)), eta / exterior, k / exterior)
    psi, delta = np.degrees(psi_delta(np.cos(np.radians(theta)), eta / exterior, k / exterior))
    gain = 3.0
    expected = {
        Quantity.REFLECTANCE_S: r.s,
        Quantity.REFLECTANCE_P: r.p,
        Quantity.REFLECTANCE: r.mean,
        Quantity.SIGNAL_S: gain * r.s,
        Quantity.SIGNAL_P: gain * r.p,
        Quantity.SIGNAL: gain * r.mean,
        Quantity.RATIO_PS: r.p / r.s,
        Quantity.DOLP: (r.s - r.p) / (r.s + r.p),
        Quantity.PSI_DEG: psi,
        Quantity.DELTA_DEG: delta,
    }
    for quantity, value in expected.items():
        group = "g" if quantity.has_gain else ""
        rows = pack(rows_of(theta, quantity, 1.0, gain_group=group), exterior)
        vector = neutral_vector()
        vector[:2] = eta, k
        predicted = predict_vectors(rows, vector[None], np.full(rows.gains, gain))[0, 0]
        assert predicted == pytest.approx(float(value), rel=1e-12), quantity


def test_nuisances_do_what_the_contract_says(rows_of):
    light = rows_of([30.0, 60.0], "signal", [10.0, 40.0], gain_group="g", analyzer_deg=20.0)
    rows = pack(light, 1.0)

    def predicted(**nuisances):
        vector = neutral_vector()
        vector[:2] = 1.5, 0.0
        for name, value in nuisances.items():
            vector[FIRST_NUISANCE + NUISANCES[name].index] = value
        return predict_vectors(rows, vector[None], np.array([100.0]))[0]

    plain = predicted()
    assert predicted(dark_offset=0.7) == pytest.approx(plain + 0.7)
    # A fraction of the largest signal of the group.
    assert predicted(diffuse=0.01) == pytest.approx(plain + 0.01 * 40.0)
    moved = pack(rows_of([31.5, 61.5], "signal", 1.0, gain_group="g", analyzer_deg=20.0), 1.0)
    vector = neutral_vector()
    vector[:2] = 1.5, 0.0
    shifted = predict_vectors(moved, vector[None], np.array([100.0]))[0]
    assert predicted(angle_offset_deg=1.5) == pytest.approx(shifted, rel=1e-13)
    turned = pack(rows_of([30.0, 60.0], "signal", 1.0, gain_group="g", analyzer_deg=23.0), 1.0)
    expected = predict_vectors(turned, vector[None], np.array([100.0]))[0]
    assert predicted(analyzer_offset_deg=3.0) == pytest.approx(expected, rel=1e-13)
    polarized = pack(
        rows_of(
            [30.0, 60.0],
            "signal",
            1.0,
            gain_group="g",
            analyzer_deg=20.0,
            light=stokes_of(0.3, np.radians(25.0)),
        ),
        1.0,
    )
    expected = predict_vectors(polarized, vector[None], np.array([100.0]))[0]
    assert predicted(source_dolp=0.3, source_azimuth_deg=25.0) == pytest.approx(expected, rel=1e-13)


def stokes_of(dolp, azimuth):
    return (1.0, dolp * np.cos(2 * azimuth), dolp * np.sin(2 * azimuth), 0.0)


def test_a_range_of_angles_is_averaged(rows_of):
    """Against quadrature over a ring of 2 degrees, where its middle value alone is 500 times further off."""
    from dataclasses import replace

    theta = np.linspace(69.0, 71.0, 2001)
    exact = np.mean(reflectances(np.cos(np.radians(theta)), 1.5).p)
    row = rows_of([70.0], "reflectance_p", 1.0)
    vector = neutral_vector()
    vector[:2] = 1.5, 0.0

    def predicted(spread):
        rows = pack(replace(row, theta_deg_spread=np.array([spread])), 1.0)
        return predict_vectors(rows, vector[None], np.empty(0))[0, 0]

    assert predicted(np.std(theta)) == pytest.approx(exact, rel=3e-6)
    assert abs(predicted(0.0) / exact - 1) > 1e-3


def test_rows_pack_gains_settings_and_estimated_sigmas(rows_of):
    o = concatenate(
        [
            rows_of([50.0, 60.0], "signal_s", [1.0, 2.0], sigma=0.1, gain_group="b"),
            rows_of([50.0, 60.0], "signal_p", [1.0, 7.0], gain_group="a"),
            rows_of([50.0], "reflectance_s", [0.1], sigma=0.1, set_name="1"),
        ]
    )
    rows = pack(o, 1.0)
    assert gain_names(o) == ["a", "b"]
    assert rows.gain.tolist() == [1, 1, 0, 0, -1]
    assert rows.estimated.tolist() == [-1, -1, 0, 0, -1]
    # One setting of the goniometer is shared by both signals, not by another table.
    assert rows.setting[0] == rows.setting[2] != rows.setting[4]
    assert rows.largest.tolist() == [2.0, 2.0, 7.0, 7.0, 0.1]
