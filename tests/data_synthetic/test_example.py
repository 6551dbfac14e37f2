"""The shipped example is what the writer writes."""

import numpy as np
import pytest
import yaml

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.data_synthetic import example
from reflectance_fit.data_synthetic.example import copy_example, example_names
from reflectance_fit.data_synthetic.tables import EXAMPLES, Noise, write_example
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials.library import get
from reflectance_fit.measurement.read import read_measurement
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances


def columns(folder):
    table = np.genfromtxt(folder / "scan.csv", delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


def test_names():
    assert example_names() == ("N-BK7", "Au")
    assert set(EXAMPLES) == set(example_names())


@pytest.mark.parametrize("material", EXAMPLES)
def test_shipped_files_are_regenerated_byte_for_byte(tmp_path, material):
    write_example(tmp_path / "again", material)
    copy_example(material, tmp_path / "shipped")
    shipped = {path.name: path for path in (tmp_path / "shipped").iterdir()}
    again = {path.name: path for path in (tmp_path / "again").iterdir()}
    assert set(shipped) == set(again) == set(example.FILES)
    for name in ("measurement.yaml", "truth.yaml"):
        assert shipped[name].read_bytes() == again[name].read_bytes()
    # Libraries of mathematics differ in the last bit, which may round the last printed digit.
    for name, values in columns(tmp_path / "again").items():
        np.testing.assert_allclose(columns(tmp_path / "shipped")[name], values, rtol=1e-5)


@pytest.mark.parametrize("material", EXAMPLES)
def test_same_seed_same_files_other_seed_other_noise(tmp_path, material):
    for folder, seed in (("a", 7), ("b", 7), ("c", 8)):
        write_example(tmp_path / folder, material, seed=seed)
    a, b, c = ((tmp_path / folder / "scan.csv").read_bytes() for folder in "abc")
    assert a == b != c


@pytest.mark.parametrize("material", EXAMPLES)
def test_the_truth_is_that_of_the_built_in_table(tmp_path, material):
    truth = copy_example(material, tmp_path)
    eta, k = get(material).absolute_index(632.8)
    assert truth.eta == pytest.approx(float(eta), abs=1e-6)
    assert truth.k == pytest.approx(float(k), abs=1e-6)
    data = yaml.safe_load((tmp_path / "truth.yaml").read_text())
    assert data["schema"] == "reflectance_fit/truth/1"
    assert data["material"] == material


def test_brewster_of_the_glass_is_the_arctangent(tmp_path):
    """In air: atan(1.515509 / 1.000277)."""
    truth = copy_example("N-BK7", tmp_path)
    assert truth.brewster_deg == pytest.approx(np.degrees(np.arctan(truth.eta / 1.000277)), abs=1e-4)


@pytest.mark.parametrize("material", EXAMPLES)
def test_the_reader_takes_it_without_a_warning(tmp_path, material):
    copy_example(material, tmp_path)
    measurement = read_measurement(tmp_path / "measurement.yaml")
    assert measurement.warnings == ()
    assert measurement.nuisances == {}
    assert len(measurement.observations) == {"N-BK7": 32, "Au": 8}[material]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_is_as_large_as_stated(tmp_path, seed):
    """Residuals against the readable physics, in stated sigmas: a chi2 within 5 sd of its mean."""
    write_example(tmp_path / "Au", "Au", seed=seed)
    eta, k = (float(x) / 1.000277 for x in get("Au").absolute_index(632.8))
    gold = columns(tmp_path / "Au")
    psi, delta = map(np.degrees, psi_delta(cos_sin_deg(gold["theta_deg"])[0], eta, k))
    z = np.concatenate(
        [(gold["psi_deg"] - psi) / Noise().psi_deg, (gold["delta_deg"] - delta) / Noise().delta_deg]
    )
    assert abs(np.sum(z**2) - len(z)) < 5 * np.sqrt(2 * len(z))
    assert np.ptp(z) > 0.5

    write_example(tmp_path / "glass", "N-BK7", seed=seed)
    eta = float(get("N-BK7").absolute_index(632.8)[0]) / 1.000277
    glass = columns(tmp_path / "glass")
    for name, gain in (("s", 1200.0), ("p", 2100.0)):
        # The angle's own error adds slope times 0.05 degrees.
        theta = glass["theta_deg"]
        power, beside = (
            getattr(reflectances(cos_sin_deg(t)[0], eta, 0.0), name)
            for t in (theta, theta + Noise().theta_deg)
        )
        sigma = np.hypot(glass[f"signal_{name}_sigma"], gain * (beside - power))
        z = (glass[f"signal_{name}"] - gain * power) / sigma
        assert abs(np.sum(z**2) - len(z)) < 5 * np.sqrt(2 * len(z))
        assert np.ptp(z) > 0.5


def test_any_built_in_dielectric_can_be_written(tmp_path):
    path = write_example(tmp_path, "diamond", wavelength_nm=550.0)
    assert len(read_measurement(path).observations) == 32


def test_an_unknown_example(tmp_path):
    with pytest.raises(ReflectanceFitError, match="no example of 'Ag'; choose N-BK7 or Au"):
        copy_example("Ag", tmp_path / "x")
    assert not (tmp_path / "x").exists()
