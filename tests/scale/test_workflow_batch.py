"""A batch does what is missing or changed, whatever stopped it before, and its table is whole."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from reflectance_fit import workflow_batch
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.files import alone
from reflectance_fit.report.write import report_yaml
from reflectance_fit.workflow import fit
from reflectance_fit.workflow_batch import Options, batch

QUICK = Options(posterior="laplace", plots=False)
SAMPLES = 6


def write_samples(folder: Path, count: int = SAMPLES) -> Path:
    for i in range(count):
        write_example(folder / f"s{i}", ("Au", "N-BK7")[i % 2], seed=i)
    return folder


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The samples, and what an uninterrupted run in one process makes of them."""
    folder = tmp_path_factory.mktemp("reference")
    return folder, run(folder / "out", write_samples(folder / "in"))


@pytest.fixture
def inputs(tmp_path):
    return write_samples(tmp_path / "in")


def run(out, *paths, options=QUICK, jobs=1):
    return batch(paths, out, options, progress=silent, jobs=jobs)


def silent(what, done, total):
    pass


def stamps(out):
    """When each sample's results were written, and every file of them."""
    return {path.relative_to(out): path.stat().st_mtime_ns for path in out.glob("*/*")}


def table(out):
    """The bytes of summary.csv, less the column that says where the inputs are, and of summary.yaml likewise."""
    rows = list(csv.DictReader((out / "summary.csv").read_text().splitlines()))
    tree = yaml.safe_load((out / "summary.yaml").read_text())
    for row in [*rows, *tree["samples"]]:
        del row["input"]
    return rows, tree


def test_the_table_says_what_the_reports_say(reference):
    folder, done = reference
    assert (done.fitted, done.failed) == (SAMPLES, ())
    rows = list(csv.DictReader((folder / "out/summary.csv").read_text().splitlines()))
    tree = yaml.safe_load((folder / "out/summary.yaml").read_text())
    assert [row["sample"] for row in rows] == [f"s{i}" for i in range(SAMPLES)]
    for row, entry in zip(rows, tree["samples"], strict=True):
        report = yaml.safe_load((folder / "out" / row["sample"] / "report.yaml").read_text())
        (channel,) = report["channels"]
        assert row["input"] == entry["input"] == str(folder / "in" / row["sample"] / "measurement.yaml")
        assert row["name"] == entry["name"] == report["sample"]["name"]
        assert row["model"] == report["fits"][0]["model"]["name"]
        assert row["warnings"].split() == sorted({w["code"] for w in report["warnings"]})
        for name in ("eta", "k", "brewster_deg"):
            stated = channel[name]
            low, high = stated["ci95"] or (None, None)
            numbers = {"": stated["median"], "_sd": stated["sd"], "_ci95_low": low, "_ci95_high": high}
            for part, number in numbers.items():
                assert row[name + part] == ("" if number is None else repr(number))
                assert entry["channels"][0][name + part] == number
            assert row[f"{name}_status"] == stated["status"]
        assert row["failure"] == ""


def test_a_sample_is_fitted_as_fit_does(reference):
    folder, _ = reference
    path = folder / "in/s1/measurement.yaml"
    by_itself = fit(path, posterior="laplace", timings=False)
    assert (folder / "out/s1/report.yaml").read_text() == report_yaml(by_itself.report)


def test_processes_give_the_same_bytes(reference, tmp_path):
    folder, _ = reference
    done = run(tmp_path / "out", folder / "in", jobs=2)
    assert done.fitted == SAMPLES
    for path in sorted((folder / "out").rglob("*")):
        if path.is_file() and path.suffix != ".nc":
            assert (tmp_path / "out" / path.relative_to(folder / "out")).read_bytes() == path.read_bytes()


def test_nothing_is_done_twice(reference):
    folder, _ = reference
    before, whole = stamps(folder / "out"), table(folder / "out")
    assert run(folder / "out", folder / "in").fitted == 0
    assert stamps(folder / "out") == before
    assert table(folder / "out") == whole


def append(path, text):
    path.write_text(path.read_text() + text)


CHANGES = {
    "table": lambda folder: append(folder / "scan.csv", "\n"),
    "manifest": lambda folder: append(folder / "measurement.yaml", "# a remark\n"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_file_is_its_samples_only(inputs, tmp_path, change):
    out = tmp_path / "out"
    run(out, inputs)
    before = stamps(out)
    CHANGES[change](inputs / "s2")
    assert run(out, inputs).fitted == 1
    changed = {path.parts[0] for path, stamp in stamps(out).items() if before[path] != stamp}
    assert changed == {"s2"}


def test_other_options_or_another_version_are_other_results(inputs, tmp_path, monkeypatch):
    out, sample = tmp_path / "out", inputs / "s0"
    assert run(out, sample).fitted == 1
    assert run(out, sample, options=Options(posterior="laplace", plots=False, seed=1)).fitted == 1
    assert run(out, sample, options=Options(posterior="laplace", plots=False, seed=1)).fitted == 0
    monkeypatch.setattr(workflow_batch, "version", lambda name: "9.9")
    assert run(out, sample, options=Options(posterior="laplace", plots=False, seed=1)).fitted == 1


@pytest.mark.parametrize("lost", ["report.yaml", "batch.json"])
def test_results_that_are_gone_are_made_again(inputs, tmp_path, lost):
    out = tmp_path / "out"
    run(out, inputs / "s0", inputs / "s1")
    (out / "s1" / lost).unlink()
    assert run(out, inputs / "s0", inputs / "s1").fitted == 1
    assert (out / "s1" / lost).exists()


def test_results_that_were_half_replaced_are_vouched_for_by_nothing(inputs, tmp_path, monkeypatch):
    """A run dies amid new results of a changed file; the file becomes what it was."""
    out, scan = tmp_path / "out", inputs / "s0/scan.csv"
    run(out, inputs / "s0")
    first = scan.read_text()
    append(scan, "\n")

    def half(source, folder, **options):
        (folder / "report.yaml").write_text("of the changed file")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(workflow_batch, "fit_to_folder", half)
        with pytest.raises(KeyboardInterrupt):
            run(out, inputs / "s0")
    scan.write_text(first)
    assert run(out, inputs / "s0").fitted == 1


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"version": 1, "options": 2, "inputs": 3}'])
def test_a_record_that_says_nothing_is_none(inputs, tmp_path, text):
    out = tmp_path / "out"
    run(out, inputs / "s0")
    (out / "s0/batch.json").write_text(text)
    assert run(out, inputs / "s0").fitted == 1


def test_a_sample_that_goes_leaves_the_table(inputs, tmp_path):
    out = tmp_path / "out"
    run(out, inputs)
    (inputs / "s3/measurement.yaml").unlink()
    run(out, inputs)
    rows, tree = table(out)
    assert [row["sample"] for row in rows] == [s["sample"] for s in tree["samples"]]
    assert [row["sample"] for row in rows] == ["s0", "s1", "s2", "s4", "s5"]
    assert (out / "s3/report.yaml").exists()


def test_a_bad_sample_fails_alone_in_the_users_words(inputs, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run(out, inputs)
    monkeypatch.chdir(tmp_path)
    (inputs / "s2/scan.csv").unlink()
    (inputs / "s4/measurement.yaml").write_text("schema: reflectance_fit/measurement/1\nsamples: 1\n")
    done = run(out, Path("in"))
    assert [line.sample for line in done.failed] == ["s2", "s4"]
    rows, tree = table(out)
    assert [row["sample"] for row in rows] == [f"s{i}" for i in range(SAMPLES)]
    assert rows[2]["failure"].startswith("in/s2/measurement.yaml:")
    assert "scan.csv" in rows[2]["failure"]
    assert "in/s4/measurement.yaml:2: " in rows[4]["failure"]
    assert str(tmp_path) not in (out / "summary.csv").read_text()
    assert tree["samples"][2] == {"sample": "s2", "failure": rows[2]["failure"]}
    assert rows[2]["eta"] == rows[2]["channel"] == ""
    # What stood there was of other inputs.
    assert not (out / "s2/report.yaml").exists()
    # It is tried again, and done once it can be.
    write_samples(tmp_path / "in")
    assert run(out, Path("in")).fitted == 2
    assert table(out)[0][2]["failure"] == ""


def test_a_sample_that_kills_its_worker_fails_alone(inputs, tmp_path, monkeypatch, chores):
    monkeypatch.setattr(workflow_batch, "fit_sample", chores.fit_or_die)
    out = tmp_path / "out"
    done = run(out, inputs, jobs=2)
    assert [(line.sample, line.failure) for line in done.failed] == [
        ("s2", "its worker died 3 times (SIGKILL; perhaps the system is out of memory)")
    ]
    assert [row["sample"] for row in table(out)[0]] == [f"s{i}" for i in range(SAMPLES)]
    assert not list(out.rglob(".unfinished*"))
    monkeypatch.undo()
    assert run(out, inputs).fitted == 1


def test_two_runs_do_not_share_a_folder(inputs, tmp_path):
    out = tmp_path / "out"
    with alone(out), pytest.raises(ReflectanceFitError, match="another run writes here"):
        run(out, inputs)
    assert not (out / "summary.csv").exists()
    assert run(out, inputs / "s0").fitted == 1


COMMAND = [
    sys.executable,
    "-c",
    "from reflectance_fit.cli.main import cli; cli(prog_name='reflectance-fit')",
    "batch",
]


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_was_stopped_is_continued(reference, tmp_path, ending):
    folder, _ = reference
    out = tmp_path / "out"
    words = [folder / "in", "-o", out, "--no-plots", "--posterior", "laplace", "--jobs", 2]
    command = [*COMMAND, *map(str, words)]
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(list(out.glob("*/batch.json"))) < 2:
        assert running.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    if ending == signal.SIGINT:
        os.killpg(running.pid, ending)
    else:
        running.send_signal(ending)
    errors = running.communicate(timeout=30)[1]
    assert running.returncode == (130 if ending == signal.SIGINT else -ending)
    if ending == signal.SIGINT:
        assert "reflectance-fit batch" in errors
        assert not list(out.rglob(".unfinished*"))
    done = {path.parent.name for path in out.glob("*/batch.json")}
    assert 2 <= len(done) < SAMPLES
    assert not (out / "summary.csv").exists()
    before = {path: stamp for path, stamp in stamps(out).items() if path.parts[0] in done}
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"{SAMPLES} samples: {SAMPLES - len(done)} fitted, {len(done)} as before, 0 failed" in again.stdout
    after = stamps(out)
    assert {path: after[path] for path in before} == before
    for name in ("summary.csv", "summary.yaml"):
        assert (out / name).read_bytes() == (folder / "out" / name).read_bytes()
    assert not list(out.rglob(".unfinished*"))


def test_the_command_ends_with_what_the_user_can_mend(inputs, tmp_path):
    (inputs / "s0/scan.csv").write_text("nothing\n")
    words = [
        inputs / "s0",
        inputs / "s1",
        "-o",
        tmp_path / "out",
        "--no-plots",
        "--posterior",
        "laplace",
        "--jobs",
        1,
    ]
    done = subprocess.run([*COMMAND, *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout.splitlines()[0] == "2 samples: 1 fitted, 0 as before, 1 failed"
    (error,) = done.stderr.splitlines()
    assert error.startswith(f"Error: {inputs / 's0'}/")
    assert json.loads((tmp_path / "out/s1/batch.json").read_text())["inputs"][0][0] == "measurement.yaml"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--scheduler", "tcp://10.0.0.7:8786"], 1, "is another machine"),
        (["--scheduler", "nowhere.json"], 1, "nowhere.json: no such scheduler file"),
        (["--scheduler", "127.0.0.1:9", "--jobs", "2"], 2, "--jobs is for this machine"),
        (["--jobs", "0"], 2, "0 is not in the range"),
    ],
)
def test_a_cluster_that_cannot_be(inputs, tmp_path, words, code, message):
    command = [*COMMAND, str(inputs), "-o", str(tmp_path / "out"), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert message in done.stderr.splitlines()[-1]
    assert len(done.stderr.splitlines()) == 1 or code == 2
