"""``map`` as a user meets it: a table, three files, and one line for what is wrong."""

import re

import pytest
from click.testing import CliRunner

from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.rig import MONO_CHANNELS
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec


def run(*arguments):
    result = CliRunner().invoke(cli, ["map", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def glass(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glass")
    sensor = Sensor(width=120, height=80, pattern="MONO")
    write_capture(folder, CaptureSpec("N-BK7", angles_deg=(50.0,), sensor=sensor, channels=MONO_CHANNELS))
    return folder / "capture.yaml"


def test_what_a_map_says(glass, tmp_path):
    result = run(glass, "-o", tmp_path / "map.nc", "--exr", tmp_path / "map.exr", "--jobs", 1, "--tile", 32)
    assert result.exit_code == 0, result.output
    line = next(line for line in result.output.splitlines() if line.startswith("550 "))
    # 60 x 40 sensor pixels are the middle half of the frame; N-BK7 has 1.5189 at 550 nm.
    assert re.search(r"dielectric +2400 of 2400 +1\.5[12]\d\d", line)
    assert re.search(r"1\.51[89]\d \+- ", line)
    assert result.output.splitlines()[-3:] == [
        f"wrote {tmp_path / name}" for name in ("map.nc", "map.png", "map.exr")
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.exr", "map.nc", "map.png"]
    assert run(glass, "-q", "-o", tmp_path / "again.nc", "--jobs", 1).output == ""


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["-o", "map.hdf"], 2, "'map.hdf' does not end in .nc"),
        (["-o", "map.nc", "--exr", "map.png"], 2, "'map.png' does not end in .exr"),
        (["-o", "map.nc", "--tile", "3"], 2, "16<=x<=4096"),
        (["-o", "map.nc", "--scheduler", "tcp://192.0.2.1:8786"], 1, "tls://"),
        ([], 2, "Missing option"),
    ],
)
def test_wrong_usage_is_one_line(glass, tmp_path, monkeypatch, options, code, says):
    monkeypatch.chdir(tmp_path)
    result = run(glass, *options)
    assert result.exit_code == code
    assert says in result.output
    assert list(tmp_path.iterdir()) == []


def test_without_a_noise_model_there_is_no_map(glass, tmp_path):
    """One sigma a pixel is what a map is for."""
    folder = tmp_path / "bare"
    sensor = Sensor(width=120, height=80, pattern="MONO")
    spec = CaptureSpec(
        "N-BK7",
        angles_deg=(50.0,),
        sensor=sensor,
        channels=MONO_CHANNELS,
        flats=0,
        darks=0,
        noise_profile=False,
    )
    write_capture(folder, spec)
    result = run(folder / "capture.yaml", "-o", tmp_path / "map.nc", "--jobs", 1)
    assert result.exit_code == 1
    assert "state camera.noise" in result.output
    assert not (tmp_path / "map.nc").exists()


def test_a_missing_capture(tmp_path):
    result = run(tmp_path / "nothing.yaml", "-o", tmp_path / "map.nc", "--jobs", 1)
    assert result.exit_code == 1
    assert result.output.startswith("Error: ")
    assert len(result.output.splitlines()) == 1
