"""The command as a user meets it: exit codes, lines, silence, and what stands on disk afterwards."""

import json
import logging
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner, Result

from reflectance_fit import demonstration, workflow
from reflectance_fit.cli.main import VERBS, cli
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import standard_spec
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inference import posterior
from reflectance_fit.physics.approximation_ladder import LADDER
from reflectance_fit.plot import figures

NAMES = {"report.yaml", "posterior.nc", "plots"}


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(cli, [str(a) for a in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def real(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own."""
    code = "from reflectance_fit.cli.main import cli; cli(prog_name='reflectance-fit')"
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]


def error_lines(result: Result) -> list[str]:
    """The lines of a failure the user can mend: on stderr only, every one an ``Error:``."""
    assert result.exit_code == 1, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert 1 <= len(lines) <= 20
    assert all(line.startswith("Error: ") for line in lines)
    return lines


def tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def source(tmp_path):
    write_example(tmp_path / "in", "Au")
    return tmp_path / "in" / "measurement.yaml"


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A finished fit, made once."""
    folder = tmp_path_factory.mktemp("gold")
    write_example(folder, "Au")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior, "MIN_ESS", 500.0)
        patch.setattr(posterior, "BLOCK", 150)
        patch.setattr(posterior, "MAX_STEPS", 150)
        return workflow.fit(folder / "measurement.yaml")


@pytest.fixture
def canned(monkeypatch, fitted):
    """``fit`` returns at once, so that tests of what is around it are fast."""

    def fit(*_, progress=None, **__):
        if progress:
            progress("632.8 nm", 100, 1000)
        return fitted

    monkeypatch.setattr(workflow, "fit", fit)


@pytest.fixture
def two_pictures(monkeypatch):
    """Pictures by name only."""

    def draw_all(_fits, folder, _predictor, *, progress=None):
        folder.mkdir()
        for name in ("fit", "corner"):
            if progress:
                progress(name)
            (folder / f"{name}.png").write_bytes(b"new")

    monkeypatch.setattr(figures, "draw_all", draw_all)


# --- exit codes


def test_success_is_0_with_results_on_stdout(source, tmp_path, canned):
    result = run("fit", source, "-o", tmp_path / "out", "--no-plots")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert "632.8 nm" in result.stdout
    assert result.stdout.splitlines()[-1] == f"wrote {tmp_path / 'out' / 'report.yaml'}"
    assert set(os.listdir(tmp_path / "out")) == NAMES - {"plots"}


def test_what_the_user_can_mend_is_1_with_file_and_line(source, tmp_path):
    source.write_text(source.read_text().replace("wavelength_nm: 632.8", "wavelenght_nm: 632.8"))
    (line,) = error_lines(run("fit", source, "-o", tmp_path / "out"))
    assert line == f"Error: {source}:4: unknown key 'wavelenght_nm', did you mean 'wavelength_nm'?"
    assert not (tmp_path / "out").exists()


def test_at_most_20_lines(source, tmp_path):
    source.write_text(source.read_text() + "".join(f"extra{i}: 1\n" for i in range(50)))
    lines = error_lines(run("fit", source, "-o", tmp_path / "out"))
    assert len(lines) == 20
    assert lines[-1] == "Error: and 31 more problems"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "Usage:"),
        (("fti",), "Error: No such command 'fti'. Did you mean 'fit'?"),
        (("shlick",), "Did you mean 'schlick'?"),
        (("xyzzy",), "Error: No such command 'xyzzy'."),
        (("fit",), "Error: Missing argument 'INPUT'."),
        (("fit", "a.yaml"), "Error: Missing option '-o' / '--out'."),
        (("fit", "a.yaml", "-o", "x", "--modle", "auto"), "--model"),
        (("fit", "a.yaml", "-o", "x", "--model", "metal"), "'auto', 'dielectric', 'conductor'"),
        (("fit", "a.yaml", "-o", "x", "--seed", "-1"), "--seed"),
        (("schlick",), "exactly one of --eta, --material and REPORT.yaml"),
        (("schlick", "--eta", "1.5", "--material", "gold"), "exactly one of"),
        (("schlick", "r.yaml", "--eta", "1.5"), "exactly one of"),
        (("schlick", "--eta", "abc"), "'abc' is not a valid float"),
        (("schema", "measurment"), "'measurement'"),
        (("materials", "shwo"), "show"),
    ],
)
def test_wrong_usage_is_2(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_is_130_with_the_command_to_give_again(source, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow, "fit", interrupted)
    monkeypatch.setattr(sys, "argv", ["reflectance-fit", "fit", "my file.yaml", "-o", "out"])
    result = run("fit", source, "-o", tmp_path / "out")
    assert result.exit_code == 130
    assert result.stderr.splitlines()[-1] == "  reflectance-fit fit 'my file.yaml' -o out"
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()


def test_an_error_of_ours_is_one_line_without_a_traceback(source, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("first\x1b[31m\nsecond")

    monkeypatch.setattr(workflow, "fit", broken)
    (line,) = error_lines(run("fit", source, "-o", tmp_path / "out"))
    assert "an error of ours, not yours: ZeroDivisionError: first\\x1b[31m;" in line
    assert "-v" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("order", ["before", "after"])
def test_v_shows_the_traceback_of_an_error_of_ours(source, tmp_path, monkeypatch, order):
    def broken(*_, **__):
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(workflow, "fit", broken)
    arguments = ["fit", str(source), "-o", str(tmp_path / "out")]
    result = CliRunner().invoke(cli, ["-v", *arguments] if order == "before" else [*arguments, "-v"])
    # Not caught, so that Python prints it.
    assert isinstance(result.exception, ZeroDivisionError)
    # And forgotten afterwards.
    assert len(error_lines(run(*arguments))) == 1


# --- -q, -v, --log-file, NO_COLOR


@pytest.mark.parametrize("order", ["before", "after"])
def test_quiet_is_silent(source, tmp_path, canned, two_pictures, order):
    arguments = ["fit", source, "-o", tmp_path / "out"]
    result = run(*(["-q", *arguments] if order == "before" else [*arguments, "-q"]))
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")
    assert set(os.listdir(tmp_path / "out")) == NAMES
    # Quiet for that command only.
    assert run(*arguments).stdout != ""


def test_quiet_still_says_errors(tmp_path):
    assert len(error_lines(run("-q", "fit", tmp_path / "none.yaml", "-o", tmp_path / "out"))) == 1


def test_quiet_schlick_and_demo(tmp_path, canned):
    for arguments in (("schlick", "--eta", "1.5"), ("demo", "-o", tmp_path / "demo", "--no-plots")):
        result = run(*arguments, "-q")
        assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


@pytest.mark.parametrize("order", ["before", "after"])
def test_v_says_more_on_stderr(source, tmp_path, canned, order):
    arguments = ["fit", source, "-o", tmp_path / "out", "--no-plots"]
    result = run(*(["-v", *arguments] if order == "before" else [*arguments, "-v"]))
    assert result.exit_code == 0
    assert f"wrote {tmp_path / 'out' / 'report.yaml'}" in result.stderr.splitlines()
    assert logging.getLogger("reflectance_fit").handlers == [
        h for h in logging.getLogger("reflectance_fit").handlers if isinstance(h, logging.NullHandler)
    ]


@pytest.mark.parametrize("order", ["before", "after"])
def test_log_file(source, tmp_path, canned, order):
    log = tmp_path / "log.txt"
    arguments = ["fit", source, "-o", tmp_path / "out", "--no-plots"]
    option = ["--log-file", log]
    result = run(*([*option, *arguments] if order == "before" else [*arguments, *option]))
    assert result.stderr == ""
    assert " INFO wrote " in log.read_text()


def test_log_file_keeps_errors_and_the_traceback_of_ours(source, tmp_path, monkeypatch):
    log = tmp_path / "log.txt"
    error_lines(run("--log-file", log, "fit", tmp_path / "none.yaml", "-o", tmp_path / "out"))
    assert log.read_text().endswith(f"ERROR {tmp_path / 'none.yaml'}: there is no such file\n")

    def broken(*_, **__):
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(workflow, "fit", broken)
    error_lines(run("--log-file", log, "fit", source, "-o", tmp_path / "out"))
    assert "Traceback" in log.read_text()


def test_a_log_file_that_cannot_be_written(tmp_path):
    result = run("--log-file", tmp_path / "no" / "log.txt", "schlick", "--eta", "1.5")
    assert result.exit_code == 2
    assert "No such file or directory" in result.stderr


@pytest.mark.parametrize("colours", [True, False])
def test_no_color(source, tmp_path, monkeypatch, fitted, canned, colours):
    warning = type(fitted.report.warnings)(
        [
            workflow.Report.model_fields["warnings"].annotation.__args__[0](
                code="SATURATED", channel=None, message="m"
            )
        ]
    )
    monkeypatch.setattr(fitted.report, "warnings", warning)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "200")
    if not colours:
        monkeypatch.setenv("NO_COLOR", "1")
    result = CliRunner().invoke(
        cli, ["fit", str(source), "-o", str(tmp_path / "o"), "--no-plots"], color=True
    )
    assert result.exit_code == 0
    assert ("\x1b[33m" in result.stdout) is colours


# --- the output folder


@pytest.mark.parametrize("where", ["file", "file/below", "file/below/further", "/proc/x"])
@pytest.mark.parametrize("verb", ["fit", "demo", "schlick"])
def test_a_folder_that_cannot_be_written(source, tmp_path, monkeypatch, where, verb):
    monkeypatch.setattr(workflow, "fit", lambda *_, **__: pytest.fail("the work was begun"))
    (tmp_path / "file").write_text("mine")
    out = tmp_path / where
    arguments = {"fit": ["fit", source], "demo": ["demo"], "schlick": ["schlick", "--eta", "1.5"]}[verb]
    before = tree(tmp_path)
    (line,) = error_lines(run(*arguments, "-o", out))
    assert line.startswith(f"Error: {out}: cannot write here: ")
    assert line.endswith("; choose another -o")
    assert tree(tmp_path) == before


def test_a_file_where_the_pictures_should_go(source, tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "fit", lambda *_, **__: pytest.fail("the work was begun"))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "plots").write_text("mine")
    (line,) = error_lines(run("fit", source, "-o", tmp_path / "out"))
    assert line.startswith(f"Error: {tmp_path / 'out' / 'plots'}: cannot write here")
    assert tree(tmp_path / "out") == {"plots": b"mine"}


def test_a_folder_where_the_report_should_go(source, tmp_path, canned):
    (tmp_path / "out" / "report.yaml").mkdir(parents=True)
    (line,) = error_lines(run("fit", source, "-o", tmp_path / "out", "--no-plots"))
    assert "a folder stands where the file should be" in line
    assert os.listdir(tmp_path / "out") == ["report.yaml"]


@pytest.mark.parametrize(
    "failure", [RuntimeError("broken"), KeyboardInterrupt(), OSError(28, "No space left")]
)
@pytest.mark.parametrize("existing", [True, False])
def test_a_failing_fit_leaves_nothing_behind(source, tmp_path, canned, monkeypatch, failure, existing):
    def draw_all(_fits, folder, _predictor, *, progress=None):
        folder.mkdir()
        (folder / "fit.png").write_bytes(b"new")
        raise failure

    monkeypatch.setattr(figures, "draw_all", draw_all)
    out = tmp_path / "deep" / "out"
    if existing:
        (out / "plots").mkdir(parents=True)
        (out / "report.yaml").write_text("earlier")
        (out / "plots" / "fit.png").write_text("earlier")
    before = tree(tmp_path)
    result = run("fit", source, "-o", out)
    assert result.exit_code == (130 if isinstance(failure, KeyboardInterrupt) else 1)
    assert "Traceback" not in result.output
    assert tree(tmp_path) == before
    assert (tmp_path / "deep").exists() is existing
    assert {p.name for p in tmp_path.iterdir()} <= {"in", "deep"}


def test_a_second_run_replaces_and_leaves_foreign_files(source, tmp_path, canned, two_pictures):
    out = tmp_path / "out"
    (out / "plots").mkdir(parents=True)
    mine = {
        "notes.txt": b"mine",
        "plots/sketch.png": b"mine",
        "plots/fit.txt": b"mine",
        "report.yaml.bak": b"mine",
    }
    old = ("report.yaml", "plots/fit.png", "plots/spectrum.svg", "plots/corner-450nm.png")
    for name in (*mine, *old):
        (out / name).write_bytes(b"mine" if name in mine else b"old")
    assert run("fit", source, "-o", out).exit_code == 0
    found = tree(out)
    assert {name: found[name] for name in mine} == mine
    # Pictures of an earlier fit would lie about this one.
    assert set(found) == {*mine, "report.yaml", "posterior.nc", "plots/fit.png", "plots/corner.png"}
    assert found["plots/fit.png"] == b"new"
    assert found["report.yaml"] != b"old"


def test_pictures_that_are_not_wanted_do_not_outlive_their_report(source, tmp_path, canned, two_pictures):
    out = tmp_path / "out"
    run("fit", source, "-o", out)
    run("fit", source, "-o", out, "--no-plots")
    assert set(tree(out)) == {"report.yaml", "posterior.nc"}


def test_every_picture_has_a_name_that_a_later_fit_replaces(fitted, tmp_path, monkeypatch):
    """Three channels, so that every picture there is gets drawn."""
    from reflectance_fit.plot import style

    monkeypatch.setattr(style, "PNG_DPI", 20)
    paths = []
    monkeypatch.setattr(
        figures, "save", lambda _figure, folder, name: paths.append(folder / f"{name}.png") or []
    )
    figures.draw_all([fitted.fits[0]] * 3, tmp_path, workflow.predictor)
    assert len(paths) == 3 * 8 + 1
    assert [p.name for p in paths if not workflow._PICTURE.fullmatch(p.name)] == []


def test_files_are_as_open_as_the_user_s_others(source, tmp_path, canned, two_pictures):
    umask = os.umask(0o027)
    try:
        run("fit", source, "-o", tmp_path / "out")
    finally:
        os.umask(umask)
    modes = {p.name: p.stat().st_mode & 0o777 for p in (tmp_path / "out").rglob("*")}
    assert modes == {
        "plots": 0o750,
        **dict.fromkeys(("report.yaml", "posterior.nc", "fit.png", "corner.png"), 0o640),
    }


# --- pipes


@pytest.mark.parametrize(
    "arguments", [("schlick", "--eta", "1.5"), ("materials", "list"), ("schema", "report")]
)
def test_a_reader_that_goes_away_is_no_error(arguments):
    code = "from reflectance_fit.cli.main import cli; cli()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout
    assert process.stderr
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 0


def test_the_real_command_says_errors_on_stderr(tmp_path):
    done = real("fit", "none.yaml", "-o", "out", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "Error: none.yaml: there is no such file\n"
    assert list(tmp_path.iterdir()) == []


# --- schema


@pytest.mark.parametrize("name", ["measurement", "report"])
def test_schema_prints_a_json_schema(name):
    result = run("schema", name)
    schema = json.loads(result.stdout)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["type"] == "object"
    assert schema["additionalProperties"] is False
    first = {"measurement": "measurement/1", "report": "material-report/1"}[name]
    assert schema["properties"]["schema"]["const"] == f"reflectance_fit/{first}"
    assert {"sample"} <= set(schema["required"])
    # Every reference leads somewhere.
    for reference in json.dumps(schema).split('"$ref": "#/$defs/')[1:]:
        assert reference.partition('"')[0] in schema["$defs"]


# --- schlick


ROWS = {rung.name for rung in LADDER}


def test_schlick_of_an_index():
    result = run("schlick", "--eta", "1.5")
    assert result.exit_code == 0
    cells = {line.split()[0]: line.split() for line in result.stdout.splitlines()[2:]}
    assert set(cells) == ROWS
    assert cells["schlick"][1:3] == ["0.0357", "85.0"]
    assert cells["exact"][1] == "0.0000"


def test_schlick_of_a_material_writes_a_plot_and_yaml(tmp_path):
    result = run("schlick", "--material", "BK7", "--wavelength-nm", "550", "-o", tmp_path / "out")
    assert result.exit_code == 0
    assert result.stdout.startswith("N-BK7, 550 nm: eta = 1.5185, k = 0.0000 (relative)\n")
    assert set(tree(tmp_path / "out")) == {"schlick.yaml", "schlick.png", "schlick.svg"}
    assert result.stdout.splitlines()[-1] == f"wrote {tmp_path / 'out'}"


def test_schlick_of_a_report(source, tmp_path, canned, fitted):
    """With the posterior beside it: intervals in the table and the YAML, a band in the plot."""
    run("fit", source, "-o", tmp_path / "out", "--no-plots")
    result = run("schlick", tmp_path / "out" / "report.yaml", "-o", tmp_path / "s")
    assert result.exit_code == 0
    eta = fitted.report.channels[0].eta.median / fitted.report.exterior_ior
    title, headings, *rows = result.stdout.splitlines()
    assert title.startswith(f"Au (synthetic), 632.8 nm: eta = {eta:.4f}, ")
    assert "95 % of it" in headings
    assert max(map(len, rows[:-1])) <= 100
    cells = {row.split()[0]: row.split() for row in rows[:-1]}
    low, high = map(float, cells["schlick"][2].split(".."))
    assert low < float(cells["schlick"][1]) < high
    written = yaml.safe_load((tmp_path / "s" / "schlick.yaml").read_text())
    (channel,) = written["channels"]
    assert (
        {row["name"] for row in channel["schlick"]["approximations"]}
        == ROWS
        == set(written["approximations"])
    )
    spread = channel["schlick"]["max_abs_error_posterior"]
    assert spread["ci95"] == pytest.approx([low, high], abs=6e-5)
    # The fit has said the same: it has the same draws.
    assert spread == fitted.report.channels[0].schlick.max_abs_error_posterior.model_dump()


def test_schlick_of_a_report_alone(source, tmp_path, canned):
    run("fit", source, "-o", tmp_path / "out", "--no-plots")
    nc = tmp_path / "out" / "posterior.nc"
    nc.unlink()
    result = run("schlick", tmp_path / "out" / "report.yaml", "-o", tmp_path / "s")
    assert result.exit_code == 0
    assert "95 % of it" not in result.stdout
    assert result.stdout.splitlines()[-2:] == [
        f"no {nc}: errors without intervals",
        f"wrote {tmp_path / 's'}",
    ]
    assert "max_abs_error_posterior" not in (tmp_path / "s" / "schlick.yaml").read_text()


def test_schlick_of_a_report_beside_another_posterior(source, tmp_path, canned):
    run("fit", source, "-o", tmp_path / "out", "--no-plots")
    report = tmp_path / "out" / "report.yaml"
    report.write_text(report.read_text().replace("channel: 632.8 nm", "channel: G"))
    (line,) = error_lines(run("schlick", report, "-o", tmp_path / "s"))
    assert line.startswith(f"Error: {tmp_path / 'out' / 'posterior.nc'}: has other channels than ")
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--eta", "0"), "Error: eta must be positive"),
        (("--eta", "-1.5"), "Error: eta must be positive"),
        (("--eta", "nan"), "Error: eta must be positive"),
        (("--eta", "inf"), "Error: eta must be positive"),
        (("--eta", "1e300"), "Error: eta must be positive (from 1e-100 to 1e100)"),
        (("--eta", "1.5", "--k", "-1"), "is yours n - ik?"),
        (("--eta", "1.5", "--k", "nan"), "Error: k must not be negative"),
        (("--material", "N-BK"), "Error: no built-in material 'N-BK', did you mean 'N-BK7'?"),
        (("--material", "xyzzy"), "`reflectance-fit materials list` shows them all"),
        (("--material", "N-BK7", "--wavelength-nm", "5"), "its source covers 300 to 2500 nm"),
        (("--material", "N-BK7", "--wavelength-nm", "nan"), "its source covers 300 to 2500 nm"),
        (("none.yaml",), "Error: none.yaml: there is no such file"),
    ],
)
def test_schlick_refuses(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (line,) = error_lines(run("schlick", *arguments, "-o", "out"))
    assert message in line
    assert list(tmp_path.iterdir()) == []


# --- demo


def test_demo_of_an_unknown_material(tmp_path):
    (line,) = error_lines(run("demo", "-o", tmp_path / "demo", "--material", "Kryptonite"))
    assert "Kryptonite" in line
    assert not (tmp_path / "demo").exists()


def test_demo_compares_with_the_truth(tmp_path, monkeypatch):
    """The real job on a small sensor, at two angles."""

    def small(material, **options):
        sensor = Sensor(width=200, height=160)
        return replace(standard_spec(material, **options), sensor=sensor, angles_deg=(60.0, 75.0))

    monkeypatch.setattr(demonstration, "standard_spec", small)
    result = run("demo", "-o", tmp_path / "demo", "--material", "Au", "--no-plots")
    assert result.exit_code == 0
    cells = [line.split() for line in result.stdout.splitlines()[2:11]]
    assert [row[1] for row in cells] == [c for c in "RGB" for _ in range(3)]
    assert [row[2] for row in cells] == ["eta", "k", "pseudo-brewster"] * 3
    assert [row[-1] for row in cells] == ["sd"] * 9
    assert all(abs(float(row[-2])) < 4 for row in cells)
    assert (tmp_path / "demo" / "Au" / "capture" / "truth.yaml").is_file()
    assert (tmp_path / "demo" / "Au" / "result" / "report.yaml").is_file()


def test_every_verb_has_a_file_of_its_own():
    folder = Path(sys.modules["reflectance_fit.cli.main"].__file__ or "").parent
    assert {f"{verb}.py" for verb in VERBS} <= set(os.listdir(folder))


def test_problems_without_a_file_are_one_line_too(source, tmp_path, monkeypatch):
    def fit(*_, **__):
        raise ReflectanceFitError([Problem(None, None, "a\nb"), Problem("f.csv", 3, "c")])

    monkeypatch.setattr(workflow, "fit", fit)
    assert error_lines(run("fit", source, "-o", tmp_path / "o")) == ["Error: a\\nb", "Error: f.csv:3: c"]


def test_the_disk_s_own_errors_name_the_file(source, tmp_path, monkeypatch):
    def fit(*_, **__):
        raise PermissionError(13, "Permission denied", "secret\n.csv")

    monkeypatch.setattr(workflow, "fit", fit)
    (line,) = error_lines(run("fit", source, "-o", tmp_path / "o"))
    assert line == "Error: secret\\n.csv: Permission denied"


def test_input_is_never_changed(source, tmp_path, canned):
    """Not even where the result goes beside it."""
    before = tree(source.parent)
    run("fit", source, "-o", source.parent, "--no-plots")
    assert {name: content for name, content in tree(source.parent).items() if name in before} == before
    shutil.rmtree(source.parent)
