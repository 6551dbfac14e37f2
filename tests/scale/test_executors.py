"""Every task has one outcome, whatever the tasks do to their workers; nothing is left running."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from reflectance_fit import children
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.scale.executors import Outcome, Serial, Task, executor
from reflectance_fit.scale.processes import Processes


@pytest.fixture(scope="module")
def processes():
    with executor(2) as processes:
        assert isinstance(processes, Processes)
        yield processes


@pytest.fixture(params=["serial", "processes"])
def either(request, processes):
    return processes if request.param == "processes" else Serial()


def by_key(outcomes):
    outcomes = list(outcomes)
    found = {outcome.key: outcome for outcome in outcomes}
    assert len(found) == len(outcomes)
    return found


def test_every_task_gives_its_value(either, chores):
    found = by_key(either.run(Task(f"t{i}", chores.double, (i,)) for i in range(50)))
    assert found == {f"t{i}": Outcome(f"t{i}", 2 * i, None) for i in range(50)}


def test_no_tasks_no_outcomes(either):
    assert list(either.run([])) == []


def test_an_exception_is_the_failure_of_its_task(either, chores, caplog):
    caplog.set_level("INFO", "reflectance_fit")
    tasks = [
        Task("wrong", chores.wrong, ("a.csv",)),
        Task("bug", chores.bug, ()),
        Task("good", chores.double, (4,)),
    ]
    found = by_key(either.run(tasks))
    assert found["wrong"].failure == r"a.csv:3: no such column; and \x1b[31mmore"
    assert found["bug"].failure == r"KeyError: 'first\nsecond'"
    assert found["good"] == Outcome("good", 8, None)
    # The traceback of the bug, and only of the bug, is in the log.
    assert "in bug" in caplog.text
    assert "in wrong" not in caplog.text


def test_what_cannot_be_pickled_is_a_failure(processes, chores):
    found = by_key(processes.run([Task("u", chores.unpicklable, ()), Task("good", chores.double, (1,))]))
    assert "pickle" in str(found["u"].failure)
    assert found["good"].value == 2


def test_a_task_that_kills_its_workers_fails_and_the_others_do_not(processes, chores):
    tasks = [Task(f"t{i}", chores.double, (i,)) for i in range(20)]
    tasks[3:3] = [Task("poison", chores.die, ())]
    tasks[9:9] = [Task("segfault", chores.die, (signal.SIGSEGV,)), Task("exit", chores.leave, ())]
    found = by_key(processes.run(tasks))
    assert found.pop("poison").failure == (
        "its worker died 3 times (SIGKILL; perhaps the system is out of memory)"
    )
    assert found.pop("segfault").failure == "its worker died 3 times (SIGSEGV)"
    assert found.pop("exit").failure == "its worker died 3 times (exit code 7)"
    assert {outcome.value for outcome in found.values()} == {2 * i for i in range(20)}


def test_a_task_is_tried_three_times(processes, chores, tmp_path):
    tasks = [Task(f"{n}", chores.die_at_first, (tmp_path, f"{n}", n)) for n in range(5)]
    found = by_key(processes.run(tasks))
    assert [found[f"{n}"].value for n in range(5)] == ["0", "1", "2", None, None]
    assert [len(list(tmp_path.glob(f"{n}.*"))) for n in range(5)] == [1, 2, 3, 3, 3]


def test_an_interrupt_is_the_parents_to_handle(processes, chores):
    """A terminal sends it to the workers too; a task that it ended would count as one that kills its worker."""
    (outcome,) = processes.run([Task("t", chores.interrupted, ())])
    assert outcome.value == "still here"


def test_two_run_at_a_time_and_workers_are_kept(processes, chores):
    first = {o.value["pid"] for o in processes.run(Task(f"{i}", chores.surroundings, ()) for i in range(6))}
    start = time.monotonic()
    assert [o.value for o in processes.run(Task(f"{i}", chores.sleep, (1.0,)) for i in range(2))] == [1, 1]
    assert time.monotonic() - start < 1.8
    again = {o.value["pid"] for o in processes.run(Task(f"{i}", chores.surroundings, ()) for i in range(6))}
    assert len(first | again) <= 2
    assert os.getpid() not in first


def test_a_worker_has_one_thread(processes, chores):
    (outcome,) = processes.run([Task("t", chores.surroundings, ())])
    assert outcome.value["threads"] == ("1", 1)
    assert outcome.value["decoders"] == 1


def test_the_command_itself_decodes_on_every_core(chores):
    assert chores.surroundings()["decoders"] == min(8, os.cpu_count() or 1)


def test_tasks_are_read_as_workers_become_free(processes, chores):
    taken = []

    def tasks():
        for i in range(50):
            taken.append(i)
            yield Task(f"{i}", chores.double, (i,))

    outcomes = processes.run(tasks())
    next(outcomes)
    assert len(taken) <= 4
    outcomes.close()


def test_one_job_is_this_process(chores):
    with executor(1) as serial:
        (outcome,) = serial.run([Task("t", chores.surroundings, ())])
        assert outcome.value["pid"] == os.getpid()


def test_a_machine_where_no_worker_starts_is_an_error(chores, monkeypatch):
    monkeypatch.setattr(children.sys, "executable", "/bin/false")
    with (
        executor(2) as processes,
        pytest.raises(ReflectanceFitError, match=r"no worker process starts \(exit code 1\)"),
    ):
        list(processes.run([Task("t", chores.double, (1,))]))


PARENT = """
import sys
from pathlib import Path
sys.path.insert(0, {folder!r})
import chores
from reflectance_fit.scale.executors import Task, executor
with executor(2) as processes:
    tasks = [Task(f"{{i}}", chores.sleep, (600.0, Path({marks!r}) / f"{{i}}")) for i in range(4)]
    list(processes.run(tasks))
"""


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent_amid_a_task(ending, tmp_path):
    code = PARENT.format(folder=str(Path(__file__).parent), marks=str(tmp_path))
    parent = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, start_new_session=True)
    try:
        wait_until(lambda: sum(path.read_text() != "" for path in tmp_path.iterdir()) == 2)
        workers = [int(path.read_text()) for path in tmp_path.iterdir()]
        assert all(alive(pid) for pid in workers)
        if ending == signal.SIGINT:  # as a terminal sends it: to all of the group
            os.killpg(parent.pid, ending)
        else:
            parent.send_signal(ending)
        errors = parent.communicate(timeout=10)[1]
        assert (b"KeyboardInterrupt" in errors) == (ending == signal.SIGINT)
        wait_until(lambda: not any(alive(pid) for pid in workers))
    finally:
        parent.kill()
        parent.communicate()


def wait_until(condition, seconds=30):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def alive(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    try:
        # A zombie, left to an init that does not collect it, is dead.
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
