"""The text export of WVASE and CompleteEASE, in all the shapes the real files have."""

from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.measurement.manifest import Table
from reflectance_fit.measurement.tables import Columns, open_table
from reflectance_fit.measurement.woollam import read_woollam

HEADER = "10102006 Ta Metal 01\nVASEmethod[EllipsometerType=4, Isotropic]\nOriginal[a.dat]\nnm\n"
ROW = "500.0\t65.0\t25.2\t110.1\t0.03\t0.08"


def read(tmp_path: Path, text: str, **table) -> Columns:
    (tmp_path / "t.dat").write_bytes(text.encode())
    return read_woollam(
        open_table(tmp_path / "m.yaml", "t.dat"), Table(file="t.dat", format="woollam_vase", **table)
    )


def problem(tmp_path: Path, text: str, **table) -> tuple[int | None, str]:
    with pytest.raises(ReflectanceFitError) as caught:
        read(tmp_path, text, **table)
    (only,) = caught.value.problems
    return only.line, only.message


@pytest.mark.parametrize("tag", ["", "E\t", "AnE\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\t\r\n"])
def test_psi_and_delta(tmp_path, tag, end):
    columns = read(tmp_path, (HEADER + tag + ROW + "\n").replace("\n", end))
    row = {name: float(v[0]) for name, v in columns.values.items() if not np.isnan(v[0])}
    assert row == {
        "wavelength_nm": 500,
        "theta_deg": 65,
        "psi_deg": 25.2,
        "delta_deg": 110.1,
        "psi_deg_sigma": 0.03,
        "delta_deg_sigma": 0.08,
    }
    assert columns.lines.tolist() == [5]
    assert columns.warnings == ()


def test_sigmas_may_be_missing(tmp_path):
    columns = read(tmp_path, HEADER + "500 65 25 110 0.1\n500 70 25 110\n")
    np.testing.assert_array_equal(columns.values["psi_deg_sigma"], [0.1, np.nan])
    np.testing.assert_array_equal(columns.values["delta_deg_sigma"], [np.nan, np.nan])


def test_reflectances_stand_beside_psi(tmp_path):
    columns = read(tmp_path, HEADER + ROW + "\npR 500 65 0.25 0.01\nsR 500 65 0.5 0.02\n")
    np.testing.assert_array_equal(columns.values["psi_deg"], [25.2, np.nan, np.nan])
    np.testing.assert_array_equal(columns.values["reflectance_p"], [np.nan, 0.25, np.nan])
    np.testing.assert_array_equal(columns.values["reflectance_s"], [np.nan, np.nan, 0.5])
    np.testing.assert_array_equal(columns.values["reflectance_s_sigma"], [np.nan, np.nan, 0.02])


def test_only_the_quantities_asked_for(tmp_path):
    text = HEADER + ROW + "\npR 500 65 0.25 0.01\n"
    columns = read(tmp_path, text, quantities=["delta_deg"])
    assert columns.lines.tolist() == [5]
    assert np.isnan(columns.values["psi_deg"]).all()
    assert np.isnan(columns.values["psi_deg_sigma"]).all()
    assert problem(tmp_path, text, quantities=["reflectance_s"])[1] == "holds no rows of reflectance_s"


def test_other_tags_are_counted(tmp_path):
    text = HEADER + ROW + "\nuR 500 0 0.6 1\ndPolE 500 0 -5 1\nAps 500 65 1 2 3 4\nuR 501 0 0.6 1\n"
    columns = read(tmp_path, text)
    assert len(columns.lines) == 1
    (warning,) = columns.warnings
    assert "1 tagged Aps, 1 tagged dPolE, 2 tagged uR" in warning


def test_a_file_of_other_tags_only(tmp_path):
    line, message = problem(tmp_path, HEADER + "uT 500 0 0.6 1\n")
    assert line is None
    assert "there are 1 tagged uT" in message


@pytest.mark.parametrize(
    ("unit", "stated"),
    [("nm", 632.8), ("A", 6328), ("Angstroms", 6328), ("um", 0.6328), ("eV", 1.9592951711946944)],
)
def test_units(tmp_path, unit, stated):
    columns = read(tmp_path, f"x\n{unit}\r\n{stated} 65 25 110\n")
    assert columns.values["wavelength_nm"] == pytest.approx(632.8, rel=1e-12)


def test_no_unit_line(tmp_path):
    columns = read(tmp_path, "some title\n" + ROW + "\n")
    assert columns.lines.tolist() == [2]
    assert "taken to be in nm" in columns.warnings[0]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("500 65 25", "has 3 numbers; due are wavelength, angle, psi_deg, delta_deg, then their sigmas"),
        ("500 65 25 1 2 3 4", "has 7 numbers; due are"),
        ("pR 500 65 1 2 3", "has 5 numbers; due are wavelength, angle, reflectance_p, then"),
        ("500 65 x 110", "psi_deg: 'x' is not a number"),
        ("500 65 25,2 110", "psi_deg: '25,2' has a decimal comma"),
        ("500 65 nan 110", "psi_deg: 'nan' is not a finite number"),
        ("0 65 25 110", "wavelength_nm must be above 0"),
        ("<html> nothing of the kind here", "wavelength_nm: '<html>' is not a number"),
    ],
)
def test_rows_that_cannot_be_read(tmp_path, row, message):
    line, found = problem(tmp_path, HEADER + ROW + "\n" + row + "\n")
    assert line == 6
    assert found.startswith(message)


def test_another_kind_of_file(tmp_path):
    assert "is not a woollam_vase export" in problem(tmp_path, "angle,volts\n1,2\n")[1]
