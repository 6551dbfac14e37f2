"""Measurements from real laboratories to a report, against independent analyses of the same files.

The figures are those of the data's own manifest: scipy least squares, made
apart from this program.
"""

import shutil

import numpy as np
import pytest

from reflectance_fit import fit

PRISM = "measured_angle/bologna_glass_prism"
VASE = "ellipsometry/trujillo_vase"


@pytest.fixture
def prism(tmp_path, data):
    """s and p scans of a glass prism, both with errors in angle and signal."""
    for name, source in (("p.csv", "pi/run3-adjusted.csv"), ("s.csv", "sigma/run1-adjusted.csv")):
        shutil.copyfile(data / PRISM / source, tmp_path / name)

    def manifest(nuisances):
        tables = "".join(
            f"  - {{file: {x}.csv, delimiter: space, columns: "
            f"{{theta_deg: 0, signal_{x}: 1, theta_deg_sigma: 2, signal_{x}_sigma: 3}}}}\n"
            for x in "ps"
        )
        path = tmp_path / "measurement.yaml"
        path.write_text(
            "schema: reflectance_fit/measurement/1\nsample: {name: K9}\nwavelength_nm: 650\n"
            f"tables:\n{tables}nuisances: {nuisances}\n"
        )
        return path

    return manifest


def test_prism_with_and_without_its_angle_zero(prism):
    fixed = fit(prism("{}")).report
    free = fit(prism("{angle_offset_deg: {sigma: 1.0}}")).report
    eta = fixed.channels[0].eta
    assert eta.median == pytest.approx(1.486, abs=0.015)
    assert 0.004 <= eta.sd <= 0.015
    assert 0.4 <= fixed.fits[0].fit.reduced_chi2 <= 0.9
    assert fixed.channels[0].brewster_deg.median == pytest.approx(56.0, abs=1.0)
    assert fixed.channels[0].brewster_deg.kind == "brewster"
    assert fixed.channels[0].k.status == "upper_limit"
    loose = free.channels[0].eta
    assert loose.median == pytest.approx(1.446, abs=0.02)
    assert np.diff(loose.ci95) >= 1.8 * np.diff(eta.ci95)
    offset = free.fits[0].fit.nuisances["angle_offset_deg"]
    assert offset.median == pytest.approx(-1.2, abs=0.4)
    assert offset.sd == pytest.approx(0.4, abs=0.1)
    # K9 is 1.514 at 650 nm, outside of both.
    for report in (fixed, free):
        assert "LITERATURE_DISAGREES" in {w.code for w in report.warnings}
        assert report.channels[0].literature.nearest == "N-BK7"


TANTALUM = {
    "Ta_060810.dat": {450: (2.105, 2.717), 550: (2.398, 3.175), 633: (2.699, 3.478)},
    "Ta_w1_10102006.dat": {450: (2.175, 2.762), 550: (2.467, 3.220), 633: (2.772, 3.510)},
}


@pytest.mark.parametrize("name", TANTALUM)
def test_tantalum(name, tmp_path, data):
    """psi and Delta together, then psi alone: the same metal, intervals about five times as wide."""
    shutil.copyfile(data / VASE / name, tmp_path / "t.dat")
    path = tmp_path / "measurement.yaml"

    def channels(quantities):
        path.write_text(
            "schema: reflectance_fit/measurement/1\nsample: {name: film}\ntables:\n"
            f"  - {{file: t.dat, format: woollam_vase, wavelengths_nm: [450, 550, 633]{quantities}}}\n"
        )
        return fit(path).report.channels

    both, psi = channels(""), channels(", quantities: [psi_deg]")
    for (eta, k), full, alone in zip(TANTALUM[name].values(), both, psi, strict=True):
        assert full.eta.median == pytest.approx(eta, abs=0.01)
        assert full.k.median == pytest.approx(k, abs=0.01)
        assert full.brewster_deg.kind == "pseudo_brewster"
        for quantity in ("eta", "k"):
            a, b = getattr(full, quantity), getattr(alone, quantity)
            assert abs(a.median - b.median) < 3 * np.hypot(a.sd, b.sd)
            assert 3 < b.sd / a.sd < 8
