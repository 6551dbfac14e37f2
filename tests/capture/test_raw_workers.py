"""A file that kills its decoder, hangs or asks for too much costs that one frame, by name."""

import importlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.workers import FrameError, RawWorkers
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng

METADATA = DngMetadata("RGGB", 14, (512, 513, 514, 515), 16000, Fraction(1, 125), 200)


@pytest.fixture
def frame(tmp_path: Path) -> Callable[..., Path]:
    def frame(name: str = "a.dng", seed: int = 0) -> Path:
        """A noisy 48 x 64 frame in the test's folder."""
        cfa = np.random.default_rng(seed).integers(0, 2**14, (48, 64), dtype=np.uint16)
        write_dng(tmp_path / name, cfa, METADATA)
        return tmp_path / name

    return frame


@pytest.fixture(scope="module")
def reducers():
    """``reducers.py`` beside this file, by a name that the workers can import too."""
    folder = str(Path(__file__).parent)
    sys.path.insert(0, folder)
    yield importlib.import_module("reducers")
    sys.path.remove(folder)
    del sys.modules["reducers"]


@pytest.fixture(scope="module")
def workers(reducers):
    with RawWorkers(2, timeout_s=20) as workers:
        yield workers


def test_results_come_in_the_order_of_the_jobs(workers, reducers, frame):
    paths = [frame(f"{i}.dng", seed=i) for i in range(8)]
    # The first job ends last.
    jobs = [(paths[0], reducers.sleep, (0.5,))] + [(p, reducers.total, (2,)) for p in paths[1:]]
    expected = [0.5] + [2 * int(decode(p).cfa.sum()) for p in paths[1:]]
    assert list(workers.map(jobs)) == expected


def test_two_jobs_run_at_a_time_and_workers_are_kept(workers, reducers, frame):
    path = frame()
    list(workers.map([(path, reducers.total, ())] * 2))  # both are up
    start = time.monotonic()
    assert list(workers.map([(path, reducers.sleep, (1.0,))] * 2)) == [1.0, 1.0]
    assert time.monotonic() - start < 1.8
    pids = [{r["pid"] for r in workers.map([(path, reducers.surroundings, ())] * 4)} for _ in range(2)]
    assert len(pids[0] | pids[1]) <= 2


def test_jobs_are_taken_as_workers_become_free(workers, reducers, frame):
    path, taken = frame(), []

    def jobs():
        for i in range(20):
            taken.append(i)
            yield path, reducers.total, ()

    results = workers.map(jobs())
    next(results)
    assert len(taken) < 8
    results.close()


@pytest.mark.parametrize(
    ("function", "arguments", "reason"),
    [
        ("die_of", (signal.SIGKILL,), "SIGKILL; perhaps the system is out of memory"),
        ("die_of", (signal.SIGSEGV,), "SIGSEGV"),
        ("leave", (), "exit code 3"),
        ("allocate", (), "needs more memory"),
        ("refuse", (), r"the region\nlies outside"),
        ("spin", (), "SIGXCPU"),
    ],
)
def test_one_bad_frame_costs_one_frame(workers, reducers, frame, function, arguments, reason):
    paths = [frame(f"{i}.dng", seed=i) for i in range(6)]
    jobs = [(p, reducers.total, ()) for p in paths]
    jobs[2] = (paths[2], getattr(reducers, function), arguments)
    results = list(workers.map(jobs))
    bad = results.pop(2)
    assert isinstance(bad, FrameError)
    assert bad.path == paths[2]
    assert reason in bad.reason
    assert "\n" not in bad.reason
    assert results == [int(decode(p).cfa.sum()) for p in paths if p != paths[2]]


def test_a_frame_that_takes_too_long(reducers, frame):
    paths = [frame(f"{i}.dng", seed=i) for i in range(4)]
    jobs = [(p, reducers.total, ()) for p in paths]
    jobs[1] = (paths[1], reducers.sleep, (60.0,))
    start = time.monotonic()
    with RawWorkers(2, timeout_s=1.5) as workers:
        results = list(workers.map(jobs))
    assert time.monotonic() - start < 20
    assert results.pop(1) == FrameError(paths[1], "took longer than 1.5 s")
    assert results == [int(decode(p).cfa.sum()) for p in paths if p != paths[1]]


def test_a_slow_consumer_is_no_timeout(reducers, frame):
    path = frame()
    with RawWorkers(1, timeout_s=0.5) as workers:
        results = workers.map([(path, reducers.total, ())] * 3)
        first = next(results)
        time.sleep(1)
        assert list(results) == [first, first]


def test_every_frame_bad_and_the_pool_lives_on(workers, reducers, frame):
    path = frame()
    results = list(workers.map([(path, reducers.die_of, (signal.SIGKILL,))] * 5))
    assert [type(r) for r in results] == [FrameError] * 5
    (good,) = workers.map([(path, reducers.total, ())])
    assert good == int(decode(path).cfa.sum())


def test_files_that_are_no_raw(workers, reducers, frame, tmp_path):
    good, cut = frame("good.dng"), frame("cut.dng")
    cut.write_bytes(cut.read_bytes()[:-100])
    (tmp_path / "folder.dng").mkdir()
    os.mkfifo(tmp_path / "pipe.dng")
    (tmp_path / "empty.dng").touch()
    bad = [cut, *(tmp_path / name for name in ("none.dng", "folder.dng", "pipe.dng", "empty.dng", "nul\0"))]
    *errors, result = workers.map([(p, reducers.total, ()) for p in (*bad, good)])
    assert [error.path for error in errors] == bad
    words = ("cut off", "no such file", "no ordinary file", "no ordinary file", "empty", "")
    assert all(word in error.reason for word, error in zip(words, errors, strict=True))
    assert result == int(decode(good).cfa.sum())


def test_damaged_files_give_a_result_or_a_reason(workers, reducers, frame, tmp_path):
    """LibRaw too reads what our checks let pass."""
    whole = frame().read_bytes()
    generator = np.random.default_rng(0)
    paths = []
    for i in range(400):
        data = bytearray(whole)
        for at in generator.integers(0, 800, size=generator.integers(1, 4)):
            data[at] = generator.integers(0, 256)
        paths.append(tmp_path / f"{i}.dng")
        paths[-1].write_bytes(data)
    results = list(workers.map([(p, reducers.total, ()) for p in paths]))
    refused = [r for r in results if isinstance(r, FrameError)]
    assert 20 < len(refused) < 380
    assert all(r.reason.isprintable() and len(r.reason) < 200 for r in refused)
    assert [r.reason for r in refused if "ended the process" in r.reason or "took longer" in r.reason] == []


def test_a_name_that_is_no_text(workers, reducers, frame, tmp_path):
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.dng"))
    frame().rename(path)
    (result,) = workers.map([(path, reducers.total, ())])
    assert result.reason.startswith("LibRaw cannot decode it (")
    assert result.reason.isprintable()


def test_a_bug_keeps_its_traceback(workers, reducers, frame):
    with pytest.raises(RuntimeError, match=r"(?s)a\.dng failed:.*in fail.*KeyError: 'a bug'"):
        list(workers.map([(frame(), reducers.fail, ())]))
    assert list(workers.map([(frame(), reducers.sleep, (0.0,))])) == [0.0]


def test_a_worker_that_died_between_two_maps_costs_nothing(reducers, frame):
    path = frame()
    with RawWorkers(1) as workers:
        (before,) = workers.map([(path, reducers.surroundings, ())])
        os.kill(before["pid"], signal.SIGKILL)
        time.sleep(0.2)
        (after,) = workers.map([(path, reducers.surroundings, ())])
    assert after["pid"] != before["pid"]


def test_a_closed_iterator_and_a_closed_pool_leave_no_process(reducers, frame):
    path = frame()
    with RawWorkers(2) as workers:
        pids = {r["pid"] for r in workers.map([(path, reducers.surroundings, ())] * 4)}
        results = workers.map([(path, reducers.sleep, (0.0,)), *[(path, reducers.sleep, (60.0,))] * 2])
        assert next(results) == 0.0
        results.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_workers_are_limited_and_light(workers, reducers, frame):
    path = frame()
    (found,) = workers.map([(path, reducers.surroundings, ())])
    assert found["core"] == (0, 0)
    assert found["interrupt"]
    assert 20 < found["processor_s"] <= 22
    if sys.platform == "linux":
        assert found["address_space"] == 1_500_000_000 + 32 * path.stat().st_size
    heavy = {"scipy", "numba", "cv2", "pydantic", "click", "matplotlib", "pytest", "colour"}
    assert heavy & {name.partition(".")[0] for name in found["modules"]} == set()


def test_workers_print_nothing(reducers, frame, capfd):
    # Processes started here, which inherit the streams of this test.
    with RawWorkers(1) as workers:
        assert list(workers.map([(frame(), reducers.write_streams, ())])) == [1]
    assert capfd.readouterr() == ("", "")


def test_large_results_pass(workers, reducers, frame):
    for result in workers.map([(frame(), reducers.large, ())] * 3):
        np.testing.assert_array_equal(result, np.arange(5_000_000))


PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from pathlib import Path
from reducers import total
from reflectance_fit.capture.workers import RawWorkers
print("program")
with RawWorkers(1) as workers:
    print(*workers.map([(Path({path!r}), total, ())]))
"""


@pytest.mark.parametrize("how", ["-c", "stdin", "script without a guard"])
def test_any_kind_of_program_can_use_workers(how, frame, tmp_path):
    path = frame()
    code = PROGRAM.format(folder=str(Path(__file__).parent), path=str(path))
    script = tmp_path / "script"
    script.write_text(code)
    words = {"-c": ["-c", code], "stdin": ["-"]}.get(how, [str(script)])
    done = subprocess.run([sys.executable, *words], input=code, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == (f"program\n{int(decode(path).cfa.sum())}\n", "")
