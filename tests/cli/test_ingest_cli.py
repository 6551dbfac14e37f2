"""``ingest``, ``fit`` of photographs and ``demo`` as a user meets them."""

import os
import shutil
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner, Result

from reflectance_fit import demonstration, workflow_ingest
from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic import capture as synthesis
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec, standard_spec
from reflectance_fit.inference import posterior

SPEC = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=Sensor(width=96, height=64), seed=4)


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(cli, [str(a) for a in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def error_lines(result: Result) -> list[str]:
    assert result.exit_code == 1, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert all(line.startswith("Error: ") for line in lines)
    return lines


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glass")
    write_capture(folder, SPEC)
    return folder


@pytest.fixture
def capture(original, tmp_path):
    shutil.copytree(original, tmp_path / "glass")
    return tmp_path / "glass" / "capture.yaml"


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(posterior, "MIN_ESS", 500.0)
    monkeypatch.setattr(posterior, "BLOCK", 150)
    monkeypatch.setattr(posterior, "MAX_STEPS", 150)


def test_one_row_a_frame(capture, tmp_path):
    result = run("ingest", capture, "-o", tmp_path / "OBS.nc")
    assert result.exit_code == 0
    assert result.stderr == ""
    title, heading, *rows, last = result.stdout.splitlines()
    assert title.strip() == "N-BK7 (synthetic)"
    for word in (
        "frame",
        "role",
        "theta (deg)",
        "exposure (s)",
        "pixels",
        "clipped (%)",
        "G (DN/s)",
        "status",
    ):
        assert word in heading
    frames = yaml.safe_load(capture.read_text())["frames"]
    assert [row.split()[0] for row in rows] == [frame["file"] for frame in frames]
    assert [row.split()[1] for row in rows] == [frame["role"] for frame in frames]
    assert all(row.split()[-1] == "used" for row in rows)
    assert rows[1].split()[2:4] == ["45", "45"]
    assert rows[1].split()[5] == str(48 * 32)
    assert last == f"wrote {tmp_path / 'OBS.nc'}: 24 rows"
    assert (tmp_path / "OBS.nc").is_file()


def test_a_dark_that_serves_nothing_does_not_count_as_used(capture, tmp_path):
    data = yaml.safe_load(capture.read_text())
    dark = next(frame for frame in data["frames"] if frame["role"] == "dark")
    dark["exposure_s"] = str(3 * Fraction(dark["exposure_s"]))
    capture.write_text(yaml.safe_dump(data))
    result = run("ingest", capture, "-o", tmp_path / "OBS.nc")
    assert result.exit_code == 0
    (row,) = (line for line in result.stdout.splitlines() if line.startswith(dark["file"]))
    assert row.rstrip().endswith("unused: serves no frame")


def test_quiet(capture, tmp_path):
    result = run("ingest", "-q", capture, "-o", tmp_path / "OBS.nc")
    assert (result.exit_code, result.output) == (0, "")


def test_what_the_user_can_mend(capture, tmp_path):
    shutil.copy(capture.parent / "raw/000.dng", capture.parent / "raw/003.dng")
    (line,) = error_lines(run("ingest", capture, "-o", tmp_path / "OBS.nc"))
    assert line.startswith(f"Error: {capture}:")
    assert "raw/003.dng has changed" in line
    error_lines(run("fit", capture, "-o", tmp_path / "result"))
    error_lines(run("ingest", tmp_path / "none.yaml", "-o", tmp_path / "OBS.nc"))
    assert sorted(os.listdir(tmp_path)) == ["glass"]


def test_wrong_usage(capture):
    assert run("ingest", capture).exit_code == 2
    assert run("ingest").exit_code == 2


def test_an_out_that_cannot_be_written(capture, tmp_path):
    (tmp_path / "file").touch()
    (line,) = error_lines(run("ingest", capture, "-o", tmp_path / "file" / "OBS.nc"))
    assert "cannot write here" in line
    (tmp_path / "folder.nc").mkdir()
    (line,) = error_lines(run("ingest", capture, "-o", tmp_path / "folder.nc"))
    assert "a folder stands where the file should be" in line


def test_write_hashes_and_fit(capture, tmp_path, quick):
    data = yaml.safe_load(capture.read_text())
    data["camera"]["channels"] = {"G": {"wavelength_nm": 550}}
    for frame in data["frames"]:
        del frame["sha256"]
    capture.write_text("# mine\n" + yaml.safe_dump(data))
    first = run("ingest", capture, "-o", tmp_path / "first.nc")
    assert "NO_HASHES: a damaged photograph can pass unnoticed" in first.stdout
    second = run("ingest", capture, "-o", tmp_path / "second.nc", "--write-hashes")
    assert "NO_HASHES" not in second.stdout
    assert capture.read_text().startswith("# mine\n")
    assert capture.read_text().count("sha256: ") == len(data["frames"])
    arguments = ("--no-plots", "--no-timings", "--model", "dielectric")
    result = run("fit", capture, "-o", tmp_path / "result", *arguments)
    assert result.exit_code == 0, result.output
    assert sorted(os.listdir(tmp_path / "result")) == ["posterior.nc", "report.yaml"]
    report = yaml.safe_load((tmp_path / "result" / "report.yaml").read_text())
    assert [c["channel"] for c in report["channels"]] == ["G"]
    assert [i["file"] for i in report["provenance"]["inputs"]] == [
        "capture.yaml",
        *(frame["file"] for frame in data["frames"]),
    ]


@pytest.mark.parametrize("verb", ["ingest", "fit"])
def test_an_interrupted_reading_leaves_nothing(capture, tmp_path, monkeypatch, verb):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("reflectance_fit.capture.signals.calibrate", interrupted)
    result = run(verb, capture, "-o", tmp_path / "out.nc")
    assert result.exit_code == 130
    assert sorted(os.listdir(tmp_path)) == ["glass"]


def test_an_interrupted_write_of_hashes_leaves_the_file(capture, tmp_path, monkeypatch):
    before = capture.read_bytes()

    def interrupted(_manifest, out, _hashes):
        out.write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow_ingest, "write_hashes_into", interrupted)
    assert run("ingest", capture, "-o", tmp_path / "o.nc", "--write-hashes").exit_code == 130
    assert capture.read_bytes() == before
    assert sorted(os.listdir(capture.parent)) == ["capture.yaml", "raw", "truth.yaml"]


# --- demo


@pytest.fixture
def small(monkeypatch):
    def spec(material, **options):
        standard = standard_spec(material, **options)
        return replace(
            standard, sensor=replace(standard.sensor, width=96, height=64), angles_deg=(45.0, 56.0, 66.0)
        )

    monkeypatch.setattr(demonstration, "standard_spec", spec)


def test_demo_of_one_material(tmp_path, small, quick):
    result = run("demo", "-o", tmp_path / "d", "--material", "N-BK7", "--no-plots")
    assert result.exit_code == 0, result.output
    here = tmp_path / "d" / "N-BK7"
    assert {
        "capture/capture.yaml",
        "capture/truth.yaml",
        "result/report.yaml",
        "result/posterior.nc",
    } <= files(here)
    assert sorted(os.listdir(tmp_path / "d")) == ["N-BK7"]
    rows = [line.split() for line in result.stdout.splitlines() if line.startswith("N-BK7 ")]
    # A channel of few frames may be taken for a conductor of k near 0, whose angle is the minimum of R_p.
    assert [[row[1], row[2].removeprefix("pseudo-")] for row in rows] == [
        [channel, name] for channel in "RGB" for name in ("eta", "k", "brewster")
    ]
    off = [float(row[-2]) for row in rows if row[2] != "k"]
    assert all(abs(z) < 5 for z in off)
    assert result.stdout.splitlines()[-1] == f"wrote {here / 'result'}"


def test_demo_of_an_unknown_material(tmp_path):
    (line,) = error_lines(run("demo", "-o", tmp_path / "d", "--material", "N-BK8", "--no-plots"))
    assert "N-BK8" in line
    assert "N-BK7" in line  # did you mean
    assert not (tmp_path / "d").exists()


def test_an_interrupted_demo_leaves_no_half_capture(tmp_path, small, monkeypatch):
    write = synthesis.write_dng
    taken = []

    def interrupted(path, *arguments):
        if len(taken) == 5:
            raise KeyboardInterrupt
        taken.append(path)
        write(path, *arguments)

    monkeypatch.setattr(synthesis, "write_dng", interrupted)
    result = run("demo", "-o", tmp_path / "d", "--material", "N-BK7", "--no-plots")
    assert result.exit_code == 130
    assert "reflectance-fit" in result.stderr.splitlines()[-1]
    assert files(tmp_path) == set()


def test_demo_does_not_replace_photographs_of_a_camera(tmp_path, small):
    mine = tmp_path / "d" / "N-BK7" / "capture" / "raw"
    mine.mkdir(parents=True)
    (mine / "000.dng").write_bytes(b"mine")
    (line,) = error_lines(run("demo", "-o", tmp_path / "d", "--material", "N-BK7", "--no-plots"))
    assert "holds a capture that is not synthetic" in line
    assert (mine / "000.dng").read_bytes() == b"mine"
