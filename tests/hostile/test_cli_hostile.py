"""Bad input through the command: results or lines a user can act on.  Never a traceback, nothing left behind."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner, Result

from reflectance_fit import workflow
from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.inference import posterior
from reflectance_fit.inference.run import fit_channel
from reflectance_fit.report.read import read_report


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(cli, [str(a) for a in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    return result


def refused(folder: Path, *arguments: object) -> str:
    """The one error line of a ``fit`` that must write nothing."""
    before = sorted(folder.rglob("*"))
    result = run("fit", *arguments, "-o", folder / "out")
    assert result.exit_code == 1, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.isprintable()
    assert line.startswith("Error: ")
    assert "error of ours" not in line
    assert sorted(folder.rglob("*")) == before
    return line.removeprefix("Error: ").replace(f"{folder}{os.sep}", "")


@pytest.fixture
def source(tmp_path):
    write_example(tmp_path, "Au")
    return tmp_path / "measurement.yaml"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("tables:", "table:", "measurement.yaml:5: unknown key 'table', did you mean 'tables'?"),
        ("tables:", "sample: {name: b}\ntables:", "measurement.yaml:5: duplicate key 'sample'"),
        ("name: Au", "name: &a Au", "measurement.yaml:3: anchors (&a) are refused"),
        ("632.8", "!!float 632.8", "measurement.yaml:4: tags ("),
        ("632.8", "!!python/object/apply:os.system [id]", "measurement.yaml:4: tags ("),
        ("scan.csv", "../scan.csv", "measurement.yaml:6: '../scan.csv' leads outside the folder"),
        ("scan.csv", "/etc/passwd", "measurement.yaml:6: '/etc/passwd' leads outside the folder"),
        ("scan.csv", "none.csv", "measurement.yaml:6: none.csv: there is no such file"),
        ("632.8", ".nan", "measurement.yaml:4: wavelength_nm: must be a finite number"),
        ("632.8", "-5", "measurement.yaml:4: wavelength_nm: must be"),
        ("measurement/1", "measurement/9", "measurement.yaml:1: schema reflectance_fit/measurement/9 is not"),
        ("Au (synthetic)", '""', "measurement.yaml:3: sample.name: must not be empty"),
        ("Au (synthetic)", '"\\ud800"', "measurement.yaml:3: sample.name: must be text"),
        ("Au (synthetic)", "[red]x[/red]", "measurement.yaml:3: not valid YAML"),
    ],
)
def test_manifest(source, tmp_path, old, new, expected):
    text = source.read_text()
    assert old in text
    source.write_text(text.replace(old, new, 1))
    # A key spelt wrong is also a key that is missing: the first line counts.
    result = run("fit", source, "-o", tmp_path / "out")
    assert result.exit_code == 1
    lines = result.stderr.replace(f"{tmp_path}{os.sep}", "").splitlines()
    assert [line for line in lines if line.startswith(f"Error: {expected}")], lines
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("nan,43,0.03,134,0.08", "scan.csv:6: theta_deg: 'nan' is not a finite number"),
        ("95,43,0.03,134,0.08", "scan.csv:6: theta_deg must be below 90"),
        ("80,x\x1b[2J,0.03,134,0.08", "scan.csv:6: psi_deg: 'x\\x1b[2J' is not a number"),
        ("80,43,-1,134,0.08", "scan.csv:6: psi_deg_sigma must be above 0"),
        ("80,143,0.03,134,0.08", "scan.csv:6: psi_deg must be 0 to 90 degrees"),
    ],
)
def test_rows(source, tmp_path, row, expected):
    table = tmp_path / "scan.csv"
    table.write_text(f"{table.read_text().rstrip()}\n{row}\n")
    assert refused(tmp_path, source).startswith(expected)


@pytest.mark.parametrize(
    ("content", "message"), [(b"", "is empty"), (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", "is not text (UTF-8)")]
)
def test_empty_and_binary_files(source, tmp_path, content, message):
    (tmp_path / "scan.csv").write_bytes(content)
    assert message in refused(tmp_path, source)
    source.write_bytes(content)
    assert refused(tmp_path, source).startswith(f"measurement.yaml: {message}")


@pytest.mark.parametrize("reading", ["0", "-0.2"])
def test_signals_that_no_gain_explains(tmp_path, reading):
    (tmp_path / "dark.csv").write_text(f"angle,s\n20,{reading}\n40,{reading}\n60,{reading}\n")
    source = tmp_path / "dark.yaml"
    source.write_text(
        "schema: reflectance_fit/measurement/1\nsample: {name: dark}\nwavelength_nm: 550\n"
        "tables:\n  - {file: dark.csv, columns: {theta_deg: angle, signal_s: s}}\n"
    )
    assert "no reading of gain group" in refused(tmp_path, source)


def test_input_that_is_no_measurement(source, tmp_path):
    assert refused(tmp_path, tmp_path / "none.yaml") == "none.yaml: there is no such file"
    (tmp_path / "folder").mkdir()
    assert refused(tmp_path, tmp_path / "folder") == "folder: is a folder, not a file"
    assert "is a truth file" in refused(tmp_path, tmp_path / "truth.yaml")
    report = tmp_path / "report.yaml"
    report.write_text("schema: reflectance_fit/material-report/1\n")
    assert refused(tmp_path, report).startswith("report.yaml:1: is a material-report file")
    assert refused(tmp_path, tmp_path / "scan.csv").startswith("scan.csv:1: is not a measurement file")
    assert refused(tmp_path, "/dev/zero") == "/dev/zero: is not a regular file"
    os.mkfifo(tmp_path / "fifo")
    assert refused(tmp_path, tmp_path / "fifo") == "fifo: is not a regular file"
    assert "cannot be read" in refused(tmp_path, tmp_path / ("x" * 999))


def test_an_output_folder_with_an_impossible_name(source, tmp_path):
    result = run("fit", source, "-o", tmp_path / ("x" * 999))
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "File name too long" in result.stderr


def test_in_a_process_of_its_own(source, tmp_path):
    """Nothing that CliRunner would hide, such as a traceback while Python ends."""
    source.write_text(source.read_text().replace("632.8", "&a 632.8"))
    code = "from reflectance_fit.cli.main import cli; cli(prog_name='reflectance-fit')"
    command = [sys.executable, "-W", "error", "-c", code, "fit", "measurement.yaml", "-o", "out"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "Error: measurement.yaml:4: anchors (&a) are refused; write the value out\n"


# --- names


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """One real fit, handed to every measurement of the module."""
    folder = tmp_path_factory.mktemp("gold")
    write_example(folder, "Au")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior, "MIN_ESS", 500.0)
        patch.setattr(posterior, "BLOCK", 150)
        patch.setattr(posterior, "MAX_STEPS", 150)
        (fit,) = workflow.fit(folder / "measurement.yaml").fits
        patch.setattr(workflow, "fit_channel", lambda *_, **__: fit)
        yield


NAMES = {
    "mathtext": "a$x_{$b",
    "html": "<script>alert(1)</script>",
    "bidi": "user\u202etxt.exe",
    "newline": "first\nError: second",
    "long": "x" * 10_000,
    "rich markup": "[red]x[/red]",
    "rich closing": "[/]",
    "escape": "\x1b[31mred\x1b]0;title\x07",
    "nul-like": "\x85\u2028\ufeff",
    "number": "1e5",
    "octal": "0o17",
    "bool": "yes",
    "null": "~",
    "time": "1:30",
    "comment": "# no",
    "mapping": "a: {b: [c",
    "alias": "*a",
    "tag": "!!python/none",
    "document": "---",
    "space": " ",
    "format": "{0} %s %(x)d {report}",
    "quote": "'\"'",
    "combining": "e\u0301" * 40,
}


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES.keys())
def test_sample_names(source, tmp_path, quick, name):
    source.write_text(source.read_text().replace("Au (synthetic)", json.dumps(name)))
    result = run("fit", source, "-o", tmp_path / "out", "--no-plots", "--no-timings")
    assert result.exit_code == 0, result.output
    assert all(line.isprintable() for line in result.stdout.splitlines())
    title, headings, *_ = result.stdout.split("\n")
    assert headings.startswith("channel")
    assert len(title) <= 200
    for word in ("$x_{$b", "<script>", "[red]x[/red]", "{0} %s %(x)d {report}", "[/]"):
        assert (word in title) is (word in name)
    # It comes back as it was given, from both kinds of YAML and from our own reader.
    report = tmp_path / "out" / "report.yaml"
    assert yaml.safe_load(report.read_text(encoding="utf-8"))["sample"]["name"] == name
    again = run("schlick", report)
    assert again.exit_code == 0, again.output
    assert all(line.isprintable() for line in again.stdout.splitlines())
    assert read_report(report).sample.name == name


def test_names_on_pictures(tmp_path, monkeypatch):
    """The group of a gain reaches a legend: mathtext and escapes in it must not stop the drawing."""
    monkeypatch.setattr(posterior, "MIN_ESS", 300.0)
    monkeypatch.setattr(posterior, "BLOCK", 150)
    monkeypatch.setattr(posterior, "MAX_STEPS", 150)
    monkeypatch.setattr(workflow, "fit_channel", fit_channel)
    write_example(tmp_path, "N-BK7")
    source = tmp_path / "measurement.yaml"
    text = source.read_text().replace("- file:", '- gain_group: "$\\\\frac{_\\u202e\\e[31m[red]"\n  file:')
    source.write_text(text.replace("N-BK7 (synthetic)", "$x_{$"))
    result = run("fit", source, "-o", tmp_path / "out", "--model", "dielectric")
    assert result.exit_code == 0, result.output
    assert all(line.isprintable() for line in result.stdout.splitlines())
    assert len(list((tmp_path / "out" / "plots").glob("*.png"))) == 8


# --- reports of strangers


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("material-report/1", "material-report/2", "schema"),
        ("material-report/1", "something/1", "is not a report.yaml"),
        ("exterior_ior: 1.000277", "exterior_ior: 0", "exterior_ior"),
        ("exterior_ior: 1.000277", "exterior_ior: .inf", "exterior_ior"),
        ("exterior_ior: 1.000277", "extra: &a 1", "anchors"),
    ],
)
def test_reports_changed_by_hand(source, tmp_path, quick, old, new, message):
    run("fit", source, "-o", tmp_path / "out", "--no-plots")
    report = tmp_path / "out" / "report.yaml"
    text = report.read_text()
    assert old in text
    report.write_text(text.replace(old, new, 1))
    result = run("schlick", report, "-o", tmp_path / "s")
    assert result.exit_code == 1
    assert message in result.stderr.splitlines()[0]
    assert "error of ours" not in result.stderr
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(("name", "value"), [("eta", -1.5), ("eta", 0.0), ("eta", 1e200), ("k", -1.0)])
def test_reports_of_impossible_materials(source, tmp_path, quick, name, value):
    run("fit", source, "-o", tmp_path / "out", "--no-plots")
    report = tmp_path / "out" / "report.yaml"
    data = yaml.safe_load(report.read_text())
    data["channels"][0][name]["median"] = value
    report.write_text(yaml.safe_dump(data))
    result = run("schlick", report)
    assert result.exit_code == 1
    assert result.stderr.startswith(f"Error: {report}: {name} must ")


def test_reports_without_an_identified_index(source, tmp_path, quick):
    run("fit", source, "-o", tmp_path / "out", "--no-plots")
    report = tmp_path / "out" / "report.yaml"
    data = yaml.safe_load(report.read_text())
    data["channels"][0]["eta"]["median"] = None
    report.write_text(yaml.safe_dump(data))
    result = run("schlick", report)
    assert result.exit_code == 1
    assert "eta is identified in no channel" in result.stderr
