"""Runs that were killed, interrupted or ran out of disk: what they leave, and that a resumed one is the same."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from reflectance_fit import workflow
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference import checkpoint, posterior
from reflectance_fit.inference.checkpoint import Block, Journal, keeping
from reflectance_fit.physics.fresnel import reflectances

BLOCK, STEPS = 20, 120
# What a run is told, in this process and in those that are killed.
SHORT = (
    f"posterior.BLOCK, posterior.MAX_STEPS, posterior.WALKERS, posterior.MAX_RHAT = {BLOCK}, {STEPS}, 16, 0.0"
)
MANIFEST = """\
schema: reflectance_fit/measurement/1
sample: {name: absorber}
exterior_ior: 1
tables:
  - file: a.csv
    columns: {theta_deg: 0, signal_s: 1, signal_p: 2, signal_s_sigma: 3, signal_p_sigma: 3}
    constants: {wavelength_nm: 550}
  - file: a.csv
    columns: {theta_deg: 0, signal_s: 1, signal_p: 2, signal_s_sigma: 3, signal_p_sigma: 3}
    constants: {wavelength_nm: 650}
"""


@pytest.fixture(autouse=True)
def _short_runs(monkeypatch):
    # An R-hat that is never reached: every run has the same number of blocks.
    for name, value in (("BLOCK", BLOCK), ("MAX_STEPS", STEPS), ("WALKERS", 16), ("MAX_RHAT", 0.0)):
        monkeypatch.setattr(posterior, name, value)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    folder = tmp_path_factory.mktemp("source")
    theta = np.arange(20.0, 85.0, 5.0)
    r = reflectances(np.cos(np.radians(theta)), 1.5, 0.3)
    noise = np.random.default_rng(2).standard_normal((2, len(theta)))
    table = np.column_stack([theta, r.s + 1e-3 * noise[0], r.p + 1e-3 * noise[1], np.full(len(theta), 1e-3)])
    np.savetxt(folder / "a.csv", table, delimiter=",")
    (folder / "measurement.yaml").write_text(MANIFEST)
    return folder / "measurement.yaml"


def fit(source, out, *, resume=False, seed=0):
    workflow.fit_to_folder(
        source,
        out,
        model="conductor",
        seed=seed,
        plots=False,
        timings=False,
        progress=lambda *_: None,
        resume=resume,
    )
    return {name: (out / name).read_bytes() for name in ("report.yaml", "posterior.nc")}


@pytest.fixture(scope="module")
def uninterrupted(source, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("BLOCK", BLOCK), ("MAX_STEPS", STEPS), ("WALKERS", 16), ("MAX_RHAT", 0.0)):
            patch.setattr(posterior, name, value)
        return fit(source, tmp_path_factory.mktemp("whole"))


KILLED = """
import os, signal, sys, threading
from pathlib import Path
from reflectance_fit import workflow
from reflectance_fit.inference import checkpoint, posterior
{short}
def die(*_): os.kill(os.getpid(), signal.SIGKILL)
left = [{count}]
def after(function):
    def wrapped(*arguments):
        left[0] -= 1
        if left[0] == 0 and "{place}" == "before": die()
        if left[0] == 0 and "{place}" == "within":
            data = arguments[1].to_bytes()
            with open(arguments[0].path, "ab") as file:
                file.write(checkpoint._RECORD.pack(len(data), 0) + data[: len(data) // 2])
            die()
        found = function(*arguments)
        if left[0] == 0 and "{place}" == "after": die()
        return found
    return wrapped
if "{place}" == "any":
    threading.Timer({seconds}, die).start()
else:
    checkpoint.Journal.append = after(checkpoint.Journal.append)
workflow.fit_to_folder(Path(sys.argv[1]), Path(sys.argv[2]), model="conductor", seed=0, plots=False,
    timings=False, progress=lambda *_: None)
"""


def killed(source, out, *, place, count=1, seconds=0.0):
    script = KILLED.format(short=SHORT, place=place, count=count, seconds=seconds)
    return subprocess.run([sys.executable, "-c", script, source, out], capture_output=True, check=False)


@pytest.mark.parametrize(
    ("place", "count", "kept"),
    [("before", 1, 0), ("before", 3, 2), ("within", 4, 3), ("after", 9, 9)],
)
def test_a_killed_run_resumes_to_the_same_bytes(source, tmp_path, uninterrupted, place, count, kept):
    run = killed(source, tmp_path, place=place, count=count)
    assert run.returncode == -signal.SIGKILL, run.stderr
    assert not (tmp_path / "report.yaml").exists()
    files = list((tmp_path / checkpoint.FOLDER).glob("*.chain"))
    blocks = sum(max(len(checkpoint._valid(path.read_bytes())[0]) - 1, 0) for path in files)
    assert blocks == kept
    assert fit(source, tmp_path, resume=True) == uninterrupted
    assert not (tmp_path / checkpoint.FOLDER).exists()


@pytest.mark.parametrize("seconds", [0.05, 0.2, 0.5])
def test_a_run_killed_at_any_moment_resumes_to_the_same_bytes(source, tmp_path, uninterrupted, seconds):
    killed(source, tmp_path, place="any", seconds=seconds)
    assert fit(source, tmp_path, resume=True) == uninterrupted


def stopped_after(source, out, monkeypatch, count, error):
    """A run that ends with ``error`` after ``count`` blocks."""
    append, calls = Journal.append, []

    def limited(journal, block):
        if len(calls) == count:
            raise error
        calls.append(None)
        append(journal, block)

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "append", limited)
        with pytest.raises(type(error)):
            fit(source, out)


def only_chain(out):
    (path,) = (out / checkpoint.FOLDER).glob("*.chain")
    return path


@pytest.mark.parametrize("damage", ["torn", "flipped", "header", "empty"])
def test_a_damaged_file_counts_up_to_the_damage(source, tmp_path, uninterrupted, monkeypatch, damage):
    stopped_after(source, tmp_path, monkeypatch, 4, KeyboardInterrupt())
    path = only_chain(tmp_path)
    data = bytearray(path.read_bytes())
    _, ends = checkpoint._valid(bytes(data))
    assert len(ends) == 5
    if damage == "torn":
        data = data[:-7]
    elif damage == "flipped":
        data[(ends[2] + ends[3]) // 2] ^= 1
    elif damage == "header":
        data[_header_middle()] ^= 1
    else:
        data = bytearray()
    expected = {"torn": 3, "flipped": 2, "header": 0, "empty": 0}[damage]
    assert max(len(checkpoint._valid(bytes(data))[0]) - 1, 0) == expected
    path.write_bytes(data)
    assert fit(source, tmp_path, resume=True) == uninterrupted


def _header_middle():
    return checkpoint._RECORD.size + 5


def test_what_another_job_left_is_ignored_and_said(source, tmp_path, uninterrupted, monkeypatch, caplog):
    stopped_after(source, tmp_path, monkeypatch, 3, KeyboardInterrupt())
    with caplog.at_level("INFO"):
        other = fit(source, tmp_path, resume=True, seed=1)
    assert other["posterior.nc"] != uninterrupted["posterior.nc"]
    # Another seed has another name; the same name with other settings has another fingerprint.
    stopped_after(source, tmp_path, monkeypatch, 3, KeyboardInterrupt())
    monkeypatch.setattr(posterior, "STEPS_PER_TAU", 3)
    with caplog.at_level("INFO"):
        assert fit(source, tmp_path, resume=True)["posterior.nc"] == uninterrupted["posterior.nc"]
    assert "not continued" in caplog.text


def test_without_resume_a_run_starts_anew(source, tmp_path, uninterrupted, monkeypatch, caplog):
    stopped_after(source, tmp_path, monkeypatch, 3, KeyboardInterrupt())
    with caplog.at_level("INFO"):
        assert fit(source, tmp_path) == uninterrupted
    assert "continued" not in caplog.text
    stopped_after(source, tmp_path, monkeypatch, 3, KeyboardInterrupt())
    with caplog.at_level("INFO"):
        assert fit(source, tmp_path, resume=True) == uninterrupted
    assert "3 blocks of steps continued" in caplog.text


@pytest.mark.parametrize("nth", [1, 2, 5])
def test_a_full_disk_stops_with_one_line_and_loses_no_block(
    source, tmp_path, uninterrupted, monkeypatch, nth
):
    fsync, calls = os.fsync, []

    def full(descriptor):
        calls.append(None)
        if len(calls) == nth:
            # Half of the record had room.
            os.ftruncate(descriptor, os.fstat(descriptor).st_size - 1000)
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint.os, "fsync", full)
        with pytest.raises(ReflectanceFitError) as caught:
            fit(source, tmp_path)
    (line,) = caught.value.lines()
    assert str(tmp_path / checkpoint.FOLDER) in line
    assert "No space left on device" in line
    assert "--resume" in line
    assert len(checkpoint._valid(only_chain(tmp_path).read_bytes())[0]) == (max(1, nth))
    assert fit(source, tmp_path, resume=True) == uninterrupted


def test_ctrl_c_tells_the_command_that_continues(source, tmp_path, uninterrupted, monkeypatch):
    from click.testing import CliRunner

    from reflectance_fit.cli.main import cli

    out = tmp_path / "my result"
    given = ["fit", str(source), "-o", str(out), "--model", "conductor", "--no-plots", "--no-timings"]
    monkeypatch.setattr(sys, "argv", ["reflectance-fit", *given])
    append, calls = Journal.append, []

    def interrupted(journal, block):
        append(journal, block)
        calls.append(None)
        if len(calls) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "append", interrupted)
        result = CliRunner().invoke(cli, given)
    assert result.exit_code == 130
    *_, hint, command = result.stderr.splitlines()
    assert "what was sampled is kept" in hint
    assert (
        command
        == f"  reflectance-fit fit {source} -o '{out}' --model conductor --no-plots --no-timings --resume"
    )
    assert CliRunner().invoke(cli, [*given, "--resume"]).exit_code == 0
    assert {name: (out / name).read_bytes() for name in uninterrupted} == uninterrupted


def test_a_block_survives_its_bytes():
    generator = np.random.default_rng(0)
    block = Block(
        generator.standard_normal((3, 4, 2)),
        generator.standard_normal((3, 4)),
        generator.integers(9, size=4),
        generator.integers(2**32, size=624, dtype=np.uint32),
        np.array(7),
        np.array(1),
        np.array(0.25),
    )
    again = Block.from_bytes(block.to_bytes())
    for name in Block.__slots__:
        np.testing.assert_array_equal(getattr(again, name), getattr(block, name))
    journal = Journal("none", b"")
    journal.append(block)  # no place: nothing is kept
    assert journal.path is None


def test_an_appended_block_follows_the_last_valid_one(tmp_path):
    block = Block(*(np.arange(n, dtype=float) for n in range(1, 8)))

    def appended(times, *, resume):
        """What stood there before; the run ends in an interrupt."""
        with keeping(tmp_path / "c", resume=resume):
            journal = Journal("0", b"job")
            earlier = len(journal.blocks)
            for _ in range(times):
                journal.append(block)
            kept.append(earlier)
            raise KeyboardInterrupt

    kept: list[int] = []
    with pytest.raises(KeyboardInterrupt):
        appended(2, resume=False)
    path = tmp_path / "c" / "0.chain"
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(KeyboardInterrupt):
        appended(1, resume=True)
    assert kept == [0, 1]
    assert len(checkpoint._valid(path.read_bytes())[0]) == 3
