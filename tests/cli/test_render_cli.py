"""``render`` as a user meets it: what it says, what it writes, and that nothing half-done is left."""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from reflectance_fit import workflow_render
from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.render.run import render
from reflectance_fit.report.read import read_report

SCENE = """\
schema: reflectance_fit/scene/1
exterior_ior: 1
camera: {position: [0, -5, 1], target: [0, 0, 1], size_px: [24, 16]}
materials:
  metal: {type: conductor, eta: 2.5, k: 2.5}
  gray: {type: lambertian, reflectance: 0.5}
surfaces:
  - {sphere: {center: [0, 0, 1], radius: 1}, material: metal, name: ball}
  - {plane: {point: [0, 0, 0], normal: [0, 0, 1]}, material: gray}
lights:
  - {type: environment, radiance: 0.3}
"""


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(cli, ["render", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def read(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return dict(file.header()), {name: channel.pixels.copy() for name, channel in file.channels().items()}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def plain(scene):
    out = scene.parent / "plain.exr"
    return out, run(scene, "-o", out, "--spp", 64)


def test_it_says_what_it_chose_what_it_cost_and_what_it_wrote(plain):
    out, result = plain
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert lines[0].startswith("mode scalar: nothing depends on wavelength; ")
    assert re.fullmatch(
        r"24 x 16 pixels, 64 samples each, in \d+\.\d s \([\d.e+-]+ million samples a second\); "
        r"standard error [\d.]+ % of the mean",
        lines[1],
    )
    assert lines[2].startswith("preview at ")  # nothing of samples that are no numbers
    assert lines[3:] == [f"wrote {out}", f"wrote {out.with_suffix('.png')}"]


def test_the_picture_has_its_channels_and_says_how_it_was_made(plain):
    out, result = plain
    header, found = read(out)
    assert set(found) == {"Y", "variance.Y"}
    assert found["Y"].shape == (16, 24)
    about = {k.removeprefix("reflectance_fit."): v for k, v in header.items() if k.startswith("reflectance")}
    shown = float(re.search(r"standard error ([\d.]+) %", result.stdout)[1])
    assert 100 * about.pop("error") == pytest.approx(shown, rel=0.06)
    assert 100 * np.sqrt(found["variance.Y"].mean()) / found["Y"].mean() == pytest.approx(shown, rel=0.06)
    assert about.pop("version")
    assert about == {
        "scene": "scene.yaml",
        "mode": "scalar",
        "samples": 64,
        "seed": 0,
        "sampler": "sobol",
        "precision": "single",
        "fresnel": "exact",
    }
    # Above the horizon there is nothing but the light.
    np.testing.assert_allclose(found["Y"][0], 0.3, rtol=1e-5)


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(scene, plain, tmp_path):
    pictures = []
    for seed in (0, 0, 1):
        assert run(scene, "-o", tmp_path / "a.exr", "--seed", seed).exit_code == 0
        pictures.append(read(tmp_path / "a.exr")[1]["Y"])
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert np.any(pictures[0] != pictures[2])
    np.testing.assert_array_equal(pictures[0], read(plain[0])[1]["Y"])


def test_the_exposure_is_what_was_asked_for(scene, tmp_path):
    for stops in (0, 1):
        assert run(scene, "-o", tmp_path / f"{stops}.exr", "--exposure", stops, "--spp", 16).exit_code == 0
    values = []
    for stops in (0, 1):
        with Image.open(tmp_path / f"{stops}.png") as file:
            code = np.asarray(file)[0, 0, 0] / 255
        values.append(((code + 0.055) / 1.055) ** 2.4)
    assert values[0] == pytest.approx(0.3, rel=0.02)
    assert values[1] == pytest.approx(0.6, rel=0.02)


def test_one_polarized_render_gives_every_analyzer_angle(scene, tmp_path):
    out = tmp_path / "a.exr"
    result = run(scene, "-o", out, "--analyzer", "0,60,120", "--spp", 32)
    assert result.exit_code == 0, result.output
    assert "mode polarized: nothing depends on wavelength; Stokes vectors are asked for" in result.stdout
    names = {"a.exr", "a.png", "a-polarization.png", "a-analyzer.png"}
    assert {p.name for p in tmp_path.iterdir()} == names
    assert set(re.findall(r"wrote .*/(\S+)", result.stdout)) == names
    _, found = read(out)
    assert {f"S{s}.{c}" for s in range(4) for c in "RGB"} | {"DoLP", "AoLP"} < set(found)
    # The sky is unpolarized, what the metal reflects is not.
    assert found["DoLP"][0].max() < 1e-5
    assert found["DoLP"].max() > 0.1
    assert np.all(found["DoLP"] <= 1 + 1e-6)


def test_the_comparison_prints_the_numbers_of_the_layers(scene, tmp_path):
    out = tmp_path / "a.exr"
    result = run(scene, "-o", out, "--compare", "--fresnel", "constant", "--spp", 64)
    assert result.exit_code == 0, result.output
    assert {p.name for p in tmp_path.iterdir()} == {"a.exr", "a.png", "a-compare.png"}
    header, found = read(out)
    assert header["reflectance_fit.fresnel"] == "exact"
    signed = found["constant.Y"] - found["Y"]
    rms = float(re.search(r"RMS ([\d.e-]+) ", result.stdout)[1])
    assert np.sqrt(np.mean(signed**2)) == pytest.approx(rms, rel=6e-3)
    largest, column, row = re.search(
        r"largest ([+-][\d.e-]+) .* column (\d+), row (\d+)", result.stdout
    ).groups()
    assert signed[int(row), int(column)] == pytest.approx(float(largest), rel=6e-3)
    assert np.abs(signed).max() == pytest.approx(abs(float(largest)), rel=6e-3)
    # Fresnel reflectance rises towards grazing incidence, R0 alone does not.
    assert signed.mean() < 0
    # The same random numbers: where no interface is, the two are the same.
    assert not signed[0].any()


def test_it_stops_at_the_error_that_was_asked_for(scene, tmp_path):
    few, many = (run(scene, "-o", tmp_path / "a.exr", "--error", error) for error in (0.05, 0.004))
    reached = [float(re.search(r"standard error ([\d.]+) %", r.stdout)[1]) for r in (few, many)]
    samples = [int(re.search(r"(\d+) samples each", r.stdout)[1]) for r in (few, many)]
    assert reached[0] <= 5
    assert reached[1] <= 0.4
    assert samples[0] < samples[1] < 65536


def test_samples_that_are_no_numbers_are_said(scene, tmp_path, monkeypatch):
    """Of both pictures that are compared."""

    def broken(*arguments, **named):
        return replace(render(*arguments, **named), discarded=3)

    monkeypatch.setattr(workflow_render, "render", broken)
    result = run(scene, "-o", tmp_path / "a.exr", "--spp", 1, "--compare")
    assert "note: 6 samples were not numbers and are left out; please report this scene\n" in result.stdout


def test_quiet_is_quiet(scene, tmp_path):
    result = run(scene, "-q", "-o", tmp_path / "a.exr", "--spp", 1)
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("eta: 2.5", "eta: 2.5, n: 3", 5, "n"),
        ("k: 2.5", "k: -2.5", 5, "k"),
        ("radius: 1", "radius: -1", 8, "radius"),
        ("material: gray", "material: grey", 9, "gray"),
    ],
)
def test_a_bad_scene_is_one_line_and_nothing_is_written(old, new, line, words, tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text(SCENE.replace(old, new))
    result = run(path, "-o", tmp_path / "a.exr")
    assert (result.exit_code, result.stdout) == (1, "")
    (message,) = result.stderr.splitlines()
    assert message.startswith(f"Error: {path}:{line}: ")
    assert words in message
    assert [p.name for p in tmp_path.iterdir()] == ["bad.yaml"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["-o", "a.png"], 2, "does not end in .exr"),
        (["-o", "a.exr", "--mode", "polarised"], 2, "'polarized'"),
        (["-o", "a.exr", "--spp", "0"], 2, "--spp"),
        (["-o", "a.exr", "--error", "nan"], 2, "--error"),
        (["-o", "a.exr", "--exposure", "inf"], 2, "--exposure"),
        (["-o", "a.exr", "--size", "640"], 2, "640x480"),
        (["-o", "a.exr", "--size", "0x5"], 2, "640x480"),
        (["-o", "a.exr", "--analyzer", "0,x"], 2, "list of degrees"),
        (["-o", "a.exr", "--compare", "--mode", "polarized"], 2, "no s and p"),
        (["-o", "a.exr", "--fresnel", "schlick", "--mode", "polarized"], 1, "s and p"),
        (["-o", "a.exr", "--fresnel", "schlick", "--analyzer", "0"], 1, "s and p"),
        (["-o", "a.exr", "--mode", "rgb", "--analyzer", "0"], 1, "Stokes"),
        (["-o", "a-file/a.exr"], 1, "a-file"),
    ],
)
def test_wrong_use_is_said_at_once(arguments, code, words, scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a-file").write_text("")
    result = run(scene, *arguments)
    assert (result.exit_code, result.stdout) == (code, "")
    assert words in result.stderr.splitlines()[-1]
    assert [p.name for p in tmp_path.iterdir()] == ["a-file"]


def test_an_analyzer_cannot_be_put_before_an_analyzer(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("size_px: [24, 16]", "size_px: [24, 16], analyzer_deg: 30"))
    result = run(path, "-o", tmp_path / "a.exr", "--analyzer", "0,90")
    assert result.exit_code == 1
    assert "analyzer_deg" in result.stderr


def test_a_failure_while_writing_leaves_what_was_there(scene, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    (tmp_path / "a.png").write_bytes(b"before")
    monkeypatch.setattr(workflow_render, "write_exr", fail)
    result = run(scene, "-o", tmp_path / "a.exr", "--spp", 1)
    assert result.exit_code == 1
    assert result.stderr == "Error: No space left on device\n"
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]
    assert (tmp_path / "a.png").read_bytes() == b"before"


def test_interrupted_it_leaves_nothing_and_says_how_to_go_on(scene, tmp_path):
    """A render that would take hours, Ctrl-C after its code is loaded."""
    command = [sys.executable, "-c", "from reflectance_fit.cli.main import cli; cli()", "render", str(scene)]
    command += ["-o", str(tmp_path / "a.exr"), "--spp", str(2**24), "--mode", "scalar", "--size", "512x512"]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(6)
    assert running.poll() is None
    os.kill(running.pid, signal.SIGINT)
    stdout, stderr = running.communicate(timeout=60)
    assert running.returncode == 130
    assert stdout == ""
    assert "no unfinished file is left" in stderr
    assert "Traceback" not in stderr
    assert list(tmp_path.iterdir()) == []


def test_from_a_fit_to_its_picture(tmp_path):
    """Table, fit, report.yaml, scene, and what Schlick's approximation would do to this very gold."""
    write_example(tmp_path, "Au")
    fitted = ["fit", str(tmp_path / "measurement.yaml"), "-o", str(tmp_path / "result"), "--no-plots"]
    assert CliRunner().invoke(cli, [*fitted, "--posterior", "laplace"]).exit_code == 0
    path = tmp_path / "scene.yaml"
    own = "{type: conductor, report: result/report.yaml}"
    path.write_text(SCENE.replace("{type: conductor, eta: 2.5, k: 2.5}", own))
    result = run(path, "-o", tmp_path / "gold.exr", "--compare", "--mode", "scalar", "--spp", 16)
    assert result.exit_code == 0, result.output
    assert "schlick − exact, luminance: RMS" in result.stdout
    (channel,) = read_report(tmp_path / "result" / "report.yaml").channels
    _, found = read(tmp_path / "gold.exr")
    # Above its middle the ball shows what lies behind the camera: the sky, of radiance 0.3.
    np.testing.assert_allclose(found["Y"][7, 11:13], 0.3 * channel.r0.median, rtol=2e-3)
