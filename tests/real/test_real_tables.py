"""Tables that others measured, as they left them."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.measured import Measurement
from reflectance_fit.measurement.read import read_measurement

VASE = "ellipsometry/trujillo_vase"
PRISM = "measured_angle/bologna_glass_prism"


@pytest.fixture
def read(tmp_path: Path, data: Path):
    def read(tables: str, *files: str) -> Measurement:
        """The measurement of ``tables`` over copies of ``files``, named t0, t1, ..."""
        for i, name in enumerate(files):
            shutil.copyfile(data / name, tmp_path / f"t{i}")
        path = tmp_path / "measurement.yaml"
        path.write_text(f"schema: reflectance_fit/measurement/1\nsample: {{name: x}}\n{tables}")
        return read_measurement(path)

    return read


def test_prism_scans(read):
    m = read(
        "wavelength_nm: 650\n"
        "tables:\n"
        "  - {file: t0, columns: {theta_deg: 0, signal_p: 1, theta_deg_sigma: 2, signal_p_sigma: 3}}\n"
        "  - {file: t1, columns: {theta_deg: 0, signal_s: 1, theta_deg_sigma: 2, signal_s_sigma: 3}}\n",
        f"{PRISM}/pi/run3-adjusted.csv",
        f"{PRISM}/sigma/run1-adjusted.csv",
    )
    o = m.observations
    for name, first in (("signal_p", 934.2), ("signal_s", 830)):
        scan = o.select(o.quantity == name)
        assert len(scan) == 38
        assert (scan.theta_deg[0], scan.value[0], scan.theta_deg[-1]) == (83, first, 9)
        assert set(scan.theta_deg_sigma) == {0.5}
    assert set(o.gain_group) == {"0:signal_p", "1:signal_s"}
    assert m.warnings == ()


def test_tantalum_at_three_wavelengths(read):
    m = read(
        "wavelengths_nm: [450, 550, 633]\ntables: [{file: t0, format: woollam_vase}]\n",
        f"{VASE}/Ta_060810.dat",
    )
    o = m.observations
    assert len(o) == 18
    for asked, (channel, rows) in zip((450, 550, 633), o.channels(), strict=True):
        used = rows.wavelength_nm[0]
        assert channel == f"{used:g} nm"
        assert 0 < abs(used - asked) < 2
        assert sorted(rows.quantity) == ["delta_deg"] * 3 + ["psi_deg"] * 3
        np.testing.assert_allclose(np.unique(rows.theta_deg), [65, 70, 75], atol=0.001)
        assert (rows.sigma > 0).all()
        # In our sense Delta of a bare metal falls from 180 degrees at normal incidence.
        delta = rows.value[rows.quantity == "delta_deg"]
        assert (np.diff(delta) < 0).all()
        assert delta[0] < 180


def test_a_whole_spectrum(read):
    m = read("tables: [{file: t0, format: woollam_vase}]\n", f"{VASE}/Ta_w1_10102006.dat")
    assert len(m.observations) == 2028 * 2
    assert len(set(m.observations.channel)) == 676


@pytest.mark.parametrize("polarization", ["p", "s"])
def test_absolute_reflectances(read, polarization):
    m = read(
        "tables: [{file: t0, format: woollam_vase}]\n",
        f"{VASE}/pR_sR/bare_sio2_sample1_fl_{polarization}_pol_20080421.dat",
    )
    assert set(m.observations.quantity) == {f"reflectance_{polarization}"}
    assert len(m.observations) == 4056
    assert m.warnings == ()


@pytest.mark.parametrize("name", ["bare_sio2_sample1_20080421.dat", "bare_sio2_sample1_fl_20080421.dat"])
def test_anisotropic_rows_are_counted(read, name):
    m = read("tables: [{file: t0, format: woollam_vase}]\n", f"{VASE}/pR_sR/{name}")
    assert len(m.observations) == 4056 * 2
    ((_, warning),) = m.warnings
    assert "4056 tagged Aps, 4056 tagged Asp" in warning


def test_completeease(read):
    m = read(
        "tables: [{file: t0, format: woollam_vase, quantities: [psi_deg]}]\n",
        "ellipsometry/refellips/Woolam_staticTest.dat",
    )
    assert set(m.observations.quantity) == {"psi_deg"}
    assert len(m.observations) == 398
    assert m.observations.value[0] == 21.4553
    assert m.observations.sigma[0] == 0.0140
    assert "398 tagged dPolE, 398 tagged uR" in m.warnings[0].message


def test_wvase_example(read):
    m = read(
        "wavelengths_nm: [300]\ntables: [{file: t0, format: woollam_vase}]\n",
        "ellipsometry/pyelli/wvase_example.dat",
    )
    first = m.observations.select(m.observations.theta_deg == 65)
    assert first.value.tolist() == [12.140821, 1.5609661]
    assert first.sigma.tolist() == [0.37071, 3.46024]
    assert "284 tagged dpolE" in m.warnings[0].message


def test_instrument_export_with_title_and_header(read):
    m = read(
        "wavelength_nm: 650\ntables:\n  - file: t0\n    saturation: 4.2\n"
        "    columns: {theta_deg: Sensor Position (Degrees), signal_p: Light Intensity (Volts)}\n"
        "    theta_from: {scale: 0.5, zero_deg: -89}\n",
        "measured_angle/pasco_acrylic/adirao-projects/H_brewexp9.txt",
    )
    assert len(m.observations) > 1000


def test_rotating_analyzer_trace(read):
    m = read(
        "wavelength_nm: 632.8\ntables:\n"
        "  - {file: t0, columns: {analyzer_deg: analyser_deg, signal: adc12}, constants: {theta_deg: 30}}\n",
        "measured_angle/prahl_gaertner/bk7_30_00_1.csv",
    )
    assert m.observations.analyzer_deg[:2].tolist() == [0, 5]
    assert m.observations.value[:2].tolist() == [1378, 1401]
