"""measurement.yaml and its tables to Observations: each key does what the contract says."""

import hashlib
import math
import re
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.measured import Measurement
from reflectance_fit.measurement.read import read_measurement
from reflectance_fit.observations import Observations

DOCS = Path(__file__).parents[2] / "docs" / "formats" / "measurement.md"
HEAD = "schema: reflectance_fit/measurement/1\nsample: {name: glass}\n"


def read(
    tmp_path: Path, table: str, rows: str = "10 0.3\n20 0.4\n", top: str = "wavelength_nm: 650"
) -> Measurement:
    """One table of ``rows``; ``table`` are its keys, ``top`` those of the file."""
    (tmp_path / "t.csv").write_text(rows)
    path = tmp_path / "m.yaml"
    path.write_text(f"{HEAD}{top}\ntables:\n  - file: t.csv\n    {table}\n")
    return read_measurement(path)


def observe(*args, **kwargs) -> Observations:
    return read(*args, **kwargs).observations


def problem(*args, **kwargs) -> str:
    """The only problem, as file:line: message, the file without its folder."""
    with pytest.raises(ReflectanceFitError) as caught:
        read(*args, **kwargs)
    (only,) = caught.value.problems
    return f"{Path(only.file or '').name}:{only.line}: {only.message}"


PSI = "columns: {theta_deg: 0, psi_deg: 1}"
SIGNAL = "columns: {theta_deg: 0, signal_p: 1}"


def test_each_value_is_a_row_in_the_order_of_the_lines(tmp_path):
    table = "columns: {theta_deg: 0, delta_deg: 2, psi_deg: 1}"
    o = observe(tmp_path, table, "".join(f"{i} 30 180\n" for i in range(80)))
    assert o.quantity.tolist() == ["psi_deg", "delta_deg"] * 80
    o = observe(tmp_path, table, "10 30 180\n20 31 179\n")
    assert o.quantity.tolist() == ["psi_deg", "delta_deg"] * 2
    assert o.value.tolist() == [30, 180, 31, 179]
    assert o.theta_deg.tolist() == [10, 10, 20, 20]
    assert o.channel.tolist() == ["650 nm"] * 4
    assert o.set.tolist() == ["0"] * 4
    assert o.gain_group.tolist() == [""] * 4
    assert o.light.tolist() == [[1, 0, 0, 0]] * 4
    assert o.flag.tolist() == ["used"] * 4
    assert np.isnan(o.sigma).all()
    assert np.isnan(o.analyzer_deg).all()
    assert np.isnan(o.retardance_deg).all()
    assert o.theta_deg_sigma.tolist() == [0] * 4


def test_what_stands_beside_the_observations(tmp_path):
    m = read(tmp_path, PSI)
    assert m.path == tmp_path / "m.yaml"
    assert (m.sample_name, m.exterior_ior, m.nuisances, m.warnings) == ("glass", 1.000277, None, ())
    assert m.priors["eta"].as_yaml() == {"log_uniform": [0.05, 10.0]}
    assert m.priors["k"].as_yaml() == {"uniform": [0.0, 20.0]}
    assert m.inputs == tuple(
        (name, hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()) for name in ("m.yaml", "t.csv")
    )


def test_stated_priors(tmp_path):
    m = read(tmp_path, PSI, top="wavelength_nm: 1\n".replace("1", "500") + "priors: {eta: {uniform: [1, 2]}}")
    assert m.priors["eta"].as_yaml() == {"uniform": [1.0, 2.0]}
    m = read(tmp_path, PSI, top="wavelength_nm: 500\npriors: {k: {log_uniform: [0.1, 2]}}")
    assert m.priors["k"].as_yaml() == {"log_uniform": [0.1, 2.0]}
    m = read(tmp_path, PSI, top="wavelength_nm: 500\npriors: {k: {fixed: 3}}")
    assert m.priors["k"].as_yaml() == {"fixed": 3.0}


def test_sigmas_from_columns_and_constants(tmp_path):
    table = "columns: {theta_deg: 0, psi_deg: 1, psi_deg_sigma: 2}\n    constants: {theta_deg_sigma: 0.5}"
    o = observe(tmp_path, table, "10 30 0.1\n20 31 0.2\n")
    assert o.sigma.tolist() == [0.1, 0.2]
    assert o.theta_deg_sigma.tolist() == [0.5, 0.5]


def test_constants_fill_only_what_a_woollam_row_leaves_out(tmp_path):
    table = "format: woollam_vase\n    constants: {psi_deg_sigma: 0.5, theta_deg_sigma: 0.1}"
    o = observe(tmp_path, table, "nm\n500 0 30 180 0.2\n500 65 25 110\n")
    assert o.sigma[o.quantity == "psi_deg"].tolist() == [0.2, 0.5]
    assert np.isnan(o.sigma[o.quantity == "delta_deg"]).all()
    assert o.theta_deg_sigma.tolist() == [0.1] * 4


@pytest.mark.parametrize("where", ["column", "constant"])
def test_theta_from_scales_its_sigma_too(tmp_path, where):
    table = "columns: {theta_deg: 0, psi_deg: 1" + (", theta_deg_sigma: 2}" if where == "column" else "}")
    table += "\n    theta_from: {scale: -0.5, zero_deg: 90}"
    table += "" if where == "column" else "\n    constants: {theta_deg_sigma: 4}"
    o = observe(tmp_path, table, "30 30 4\n160 30 4\n")
    assert o.theta_deg.tolist() == [75, 10]
    assert o.theta_deg_sigma.tolist() == [2, 2]


def test_gain_groups(tmp_path):
    table = "columns: {theta_deg: 0, signal_p: 1, signal_s: 2, dolp: 1}"
    o = observe(tmp_path, table, "10 0.3 0.4\n")
    assert dict(zip(o.quantity.tolist(), o.gain_group.tolist(), strict=True)) == {
        "signal_p": "0:signal_p",
        "signal_s": "0:signal_s",
        "dolp": "",
    }
    o = observe(tmp_path, table + "\n    gain_group: lamp", "10 0.3 0.4\n")
    assert sorted(o.gain_group.tolist()) == ["", "lamp", "lamp"]


def test_tables_are_sets_with_gains_of_their_own(tmp_path):
    o = observe(tmp_path, SIGNAL + "\n  - file: t.csv\n    " + SIGNAL)
    assert o.set.tolist() == ["0", "0", "1", "1"]
    assert o.gain_group.tolist() == ["0:signal_p"] * 2 + ["1:signal_p"] * 2


def test_delta_sense_and_range(tmp_path):
    table = "columns: {theta_deg: 0, delta_deg: 1}"
    rows = "10 -90\n20 725\n30 360\n40 -1e-20\n"
    assert observe(tmp_path, table, rows).value.tolist() == [270, 5, 0, 0]
    assert observe(tmp_path, table + "\n    delta_sense: -1", rows).value.tolist() == [90, 355, 0, 1e-20]


def test_saturation_acts_on_powers_at_and_above(tmp_path):
    table = "columns: {theta_deg: 0, signal_p: 1, dolp: 1}\n    saturation: 0.4"
    o = observe(tmp_path, table, "10 0.3\n20 0.4\n30 0.5\n")
    assert o.flag[o.quantity == "signal_p"].tolist() == ["used", "saturated", "saturated"]
    assert o.flag[o.quantity == "dolp"].tolist() == ["used"] * 3


def test_light_of_the_table_comes_before_that_of_the_file(tmp_path):
    table = SIGNAL + "\n    light: {circular: right}\n  - file: t.csv\n    " + SIGNAL
    o = observe(tmp_path, table, top="wavelength_nm: 650\nlight: {linear_deg: 0}")
    assert o.light.tolist() == [[1, 0, 0, 1]] * 2 + [[1, 1, 0, 0]] * 2


def test_analyzer_and_retarder_belong_to_signal(tmp_path):
    table = "columns: {theta_deg: 0, signal: 1, signal_s: 1, analyzer_deg: 2, retarder_deg: 3}"
    o = observe(tmp_path, table, "10 0.3 45 30\n")
    plain, analyzed = o.select(o.quantity == "signal_s"), o.select(o.quantity == "signal")
    assert (analyzed.analyzer_deg, analyzed.retarder_deg, analyzed.retardance_deg) == (45, 30, 90)
    for column in (plain.analyzer_deg, plain.retarder_deg, plain.retardance_deg):
        assert np.isnan(column).all()
    o = observe(tmp_path, table + "\n    constants: {retardance_deg: 88}", "10 0.3 45 30\n")
    assert o.retardance_deg[o.quantity == "signal"] == 88


@pytest.mark.parametrize(
    ("table", "top", "expected"),
    [
        (PSI, "wavelength_nm: 650", 650),
        (PSI + "\n    wavelength_nm: 500", "wavelength_nm: 650", 500),
        (PSI + "\n    constants: {wavelength_nm: 400}", "wavelength_nm: 650", 400),
        ("columns: {theta_deg: 0, psi_deg: 1, wavelength_nm: 2}", "wavelength_nm: 650", 300.123),
    ],
)
def test_where_the_wavelength_comes_from(tmp_path, table, top, expected):
    o = observe(tmp_path, table, "10 30 300.12345\n", top)
    assert o.wavelength_nm.tolist() == [expected]
    assert o.channel.tolist() == [f"{expected:g} nm"]


def test_channels_of_long_wavelengths_stay_apart(tmp_path):
    table = "columns: {theta_deg: 0, psi_deg: 1, wavelength_nm: 2}"
    o = observe(tmp_path, table, "10 30 10600.12\n10 30 10600.13\n")
    assert o.channel.tolist() == ["10600.12 nm", "10600.13 nm"]


def test_no_wavelength(tmp_path):
    assert problem(tmp_path, PSI, top="") == (
        "m.yaml:5: tables.0: the wavelength is missing; add wavelength_nm, in nm, to the table or to the top"
    )


def test_wavelengths_are_picked_not_interpolated(tmp_path):
    table = "columns: {theta_deg: 0, psi_deg: 1, wavelength_nm: 2}"
    rows = "".join(f"{theta} {nm / 20} {nm}\n" for theta in (50, 60) for nm in (448.5, 450.5, 452.5, 550))
    o = observe(tmp_path, table, rows, "wavelengths_nm: [450, 548]")
    assert o.wavelength_nm.tolist() == [450.5, 550, 450.5, 550]
    assert o.theta_deg.tolist() == [50, 50, 60, 60]
    assert o.value.tolist() == [22.525, 27.5] * 2
    assert problem(tmp_path, table, rows, "wavelengths_nm: [450, 547.9]") == (
        f"m.yaml:3: 547.9 nm: {tmp_path / 't.csv'} has no row within 2 nm of it; "
        "its 4 wavelengths span 448.5 to 550 nm, the nearest is 550"
    )
    own = table + "\n    wavelengths_nm: [550]"
    assert set(observe(tmp_path, own, rows, "wavelengths_nm: [450]").wavelength_nm) == {550}


def test_a_default_choice_leaves_tables_of_one_wavelength_alone(tmp_path):
    assert len(observe(tmp_path, PSI, top="wavelength_nm: 650\nwavelengths_nm: [450]")) == 2


@pytest.mark.parametrize(
    ("quantity", "row", "message"),
    [
        ("psi_deg", "95 30", "theta_deg must be below 90"),
        ("psi_deg", "90 30", "theta_deg must be below 90"),
        ("psi_deg", "-1 30", "theta_deg must be 0 or above"),
        ("psi_deg", "50 91", "psi_deg must be 0 to 90"),
        ("psi_deg", "50 -1", "psi_deg must be 0 to 90"),
        ("dolp", "50 -80", "dolp must be -1 to 1; is it a percentage?"),
        ("ratio_ps", "50 30", "ratio_ps is R_p / R_s, never above 1"),
        ("reflectance", "50 4.2", "reflectance must be 0 to 1; is it a percentage"),
        ("reflectance_s", "50 4.2", "reflectance_s must be 0 to 1; is it a percentage"),
        ("reflectance_p", "50 4.2", "reflectance_p must be 0 to 1; is it a percentage"),
    ],
)
def test_impossible_values_have_their_line(tmp_path, quantity, row, message):
    table = f"columns: {{theta_deg: 0, {quantity}: 1}}"
    assert problem(tmp_path, table, f"# c\n10 0.3\n{row}\n").startswith(f"t.csv:3: {message}")


def test_impossible_sigmas_and_wavelengths(tmp_path):
    table = "columns: {theta_deg: 0, psi_deg: 1, %s: 2}"
    assert problem(tmp_path, table % "psi_deg_sigma", "1 1 0\n").startswith("t.csv:1: psi_deg_sigma must be")
    assert problem(tmp_path, table % "theta_deg_sigma", "1 1 -1\n").startswith(
        "t.csv:1: theta_deg_sigma must"
    )
    assert problem(tmp_path, table % "wavelength_nm", "1 1 0.65\n").endswith(
        "is it in nanometres? (found 0.65)"
    )
    assert len(observe(tmp_path, table % "theta_deg_sigma", "1 1 0\n")) == 1


def test_noise_may_make_powers_negative(tmp_path):
    assert observe(tmp_path, SIGNAL, "10 -0.3\n").value.tolist() == [-0.3]
    table = "columns: {theta_deg: 0, reflectance_p: 1, dolp: 2}"
    assert len(observe(tmp_path, table, "10 -0.003 1.01\n")) == 2


def test_nuisances_and_their_defaults(tmp_path):
    names = (
        "angle_offset_deg",
        "dark_offset",
        "diffuse",
        "source_dolp",
        "source_azimuth_deg",
        "analyzer_offset_deg",
        "diattenuation",
    )
    top = "wavelength_nm: 650\nnuisances: {" + ", ".join(f"{name}: {{}}" for name in names) + "}"
    rows = "10 30\n20 900\n30 800\n"
    table = SIGNAL + "\n    saturation: 850"
    m = read(tmp_path, table, rows, top)
    assert m.nuisances == dict(zip(names, (0.5, 8.0, 0.01, 0.02, math.inf, 1.0, 0.005), strict=True))
    m = read(tmp_path, PSI, top="wavelength_nm: 650\nnuisances: {angle_offset_deg: {sigma: 2}}")
    assert m.nuisances == {"angle_offset_deg": 2}
    assert read(tmp_path, PSI, top="wavelength_nm: 650\nnuisances: {}").nuisances == {}


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("dark_offset", "psi_deg"),
        ("diffuse", "dolp"),
        ("source_dolp", "reflectance"),
        ("source_azimuth_deg", "delta_deg"),
        ("analyzer_offset_deg", "signal"),
        ("diattenuation", "signal"),
    ],
)
def test_a_nuisance_that_no_value_feels(tmp_path, name, quantity):
    found = problem(
        tmp_path,
        f"columns: {{theta_deg: 0, {quantity}: 1}}",
        top=f"wavelength_nm: 650\nnuisances: {{{name}: {{}}}}",
    )
    assert found.startswith(f"m.yaml:4: {name} acts only on ")


def test_dark_offset_of_no_signal(tmp_path):
    found = problem(tmp_path, SIGNAL, "10 0\n", "wavelength_nm: 650\nnuisances: {dark_offset: {}}")
    assert found == "m.yaml:4: dark_offset: every signal is 0; state its sigma"


def test_problems_of_all_tables_come_together(tmp_path):
    (tmp_path / "u.csv").write_text("1 x\n")
    with pytest.raises(ReflectanceFitError) as caught:
        read(tmp_path, PSI + "\n  - file: u.csv\n    " + PSI, "95 1\n")
    assert [Path(p.file or "").name for p in caught.value.problems] == ["t.csv", "u.csv"]


def test_the_examples_of_the_documentation(tmp_path):
    text = DOCS.read_text()
    prism, tantalum = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    for folder, name in (("pi", "run3-adjusted.csv"), ("sigma", "run1-adjusted.csv")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).write_text("83  934.2  0.5  14.5\n09  90  0.5  7.7\n")
    (tmp_path / "m.yaml").write_text(prism)
    m = read_measurement(tmp_path / "m.yaml")
    assert m.observations.quantity.tolist() == ["signal_p"] * 2 + ["signal_s"] * 2
    assert m.observations.sigma.tolist() == [14.5, 7.7] * 2
    rows = "".join(f"{nm} 65 25 110 0.1 0.1\n" for nm in (450, 551.5, 632))
    (tmp_path / "Ta_060810.dat").write_text("nm\n" + rows)
    (tmp_path / "m.yaml").write_text(tantalum)
    assert len(read_measurement(tmp_path / "m.yaml").observations) == 6
