"""Tasks on a Dask cluster that was started by its own commands; and every way in which there is none."""

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest
import scale_cluster

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.scale import cluster as module
from reflectance_fit.scale.executors import Outcome, Task, executor

IMPORTS = {"PYTHONPATH": str(Path(__file__).parent)}


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    with scale_cluster.cluster(tmp_path_factory.mktemp("cluster"), 2, env=IMPORTS) as (file, _):
        yield str(file)


@pytest.fixture(scope="module")
def cluster(scheduler):
    with executor(scheduler=scheduler) as cluster:
        yield cluster


def by_key(outcomes):
    outcomes = list(outcomes)
    found = {outcome.key: outcome for outcome in outcomes}
    assert len(found) == len(outcomes)
    return found


def refused(scheduler, match):
    with pytest.raises(ReflectanceFitError, match=match) as caught, executor(scheduler=scheduler):
        pass
    assert len(caught.value.lines()) == 1
    assert "\n" not in str(caught.value)


def test_every_task_gives_its_value(cluster, chores):
    found = by_key(cluster.run(Task(f"t{i}", chores.double, (i,)) for i in range(50)))
    assert found == {f"t{i}": Outcome(f"t{i}", 2 * i, None) for i in range(50)}
    assert list(cluster.run([])) == []


def test_tasks_run_in_the_workers_with_one_thread(cluster, chores):
    found = by_key(cluster.run(Task(f"{i}", chores.surroundings, ()) for i in range(8)))
    assert {outcome.value["threads"] for outcome in found.values()} == {("1", 1)}
    assert os.getpid() not in {outcome.value["pid"] for outcome in found.values()}


def test_an_exception_is_the_failure_of_its_task(cluster, chores, caplog):
    caplog.set_level("INFO", "reflectance_fit")
    tasks = [Task("wrong", chores.wrong, ("a.csv",)), Task("bug", chores.bug, ())]
    found = by_key(
        cluster.run([*tasks, Task("u", chores.unpicklable, ()), Task("good", chores.double, (4,))])
    )
    assert found["wrong"].failure == r"a.csv:3: no such column; and \x1b[31mmore"
    assert found["bug"].failure == r"KeyError: 'first\nsecond'"
    assert found["good"].value == 8
    assert "in bug" in caplog.text


def test_a_task_that_kills_its_workers_fails_and_the_others_do_not(cluster, chores, tmp_path):
    tasks = [Task(f"t{i}", chores.sleep, (0.05,)) for i in range(20)]
    tasks[2:2] = [Task("poison", chores.die, ()), Task("twice", chores.die_at_first, (tmp_path, "twice", 2))]
    found = by_key(cluster.run(tasks))
    assert found.pop("poison").failure == "its worker died 4 times"
    assert found.pop("twice").value == "twice"
    assert {(o.value, o.failure) for o in found.values()} == {(0.05, None)}
    assert len(found) == 20


def test_a_worker_killed_from_outside_costs_nothing(cluster, chores, tmp_path):
    marks = [tmp_path / f"{i}" for i in range(4)]

    def kill():
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            for mark in marks:
                if mark.exists() and mark.read_text():
                    os.kill(int(mark.read_text()), signal.SIGKILL)
                    return
            time.sleep(0.02)

    killer = threading.Thread(target=kill)
    killer.start()
    found = by_key(cluster.run(Task(mark.name, chores.sleep, (1.0, mark)) for mark in marks))
    killer.join()
    assert {outcome.value for outcome in found.values()} == {1.0}
    assert len(found) == 4


def test_tasks_are_read_a_few_ahead(cluster, chores):
    taken = []

    def tasks():
        for i in range(100):
            taken.append(i)
            yield Task(f"{i}", chores.double, (i,))

    outcomes = cluster.run(tasks())
    next(outcomes)
    assert len(taken) <= 8
    outcomes.close()


def listening(pids):
    """The addresses that processes listen on, as /proc/net has them: hexadecimal, IPv4 then IPv6."""
    sockets = set()
    for pid in pids:
        for descriptor in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(FileNotFoundError):
                sockets.add(os.readlink(descriptor).removeprefix("socket:[").removesuffix("]"))
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in sockets:  # listening
                found.add(words[1].partition(":")[0])
    return found


def test_a_cluster_of_ones_own_listens_to_this_machine_only(chores):
    before = listening([os.getpid()])
    assert before == set()
    with executor(1, "local") as local:
        found = by_key(local.run([Task("a", chores.surroundings, ()), Task("b", chores.bug, ())]))
        assert listening([os.getpid(), found["a"].value["pid"]]) == {"0100007F"}  # 127.0.0.1
    assert found["a"].value["threads"] == ("1", 1)
    assert found["a"].value["pid"] != os.getpid()
    assert found["b"].failure is not None


def test_nobody_there():
    refused("127.0.0.1:9", r"no scheduler answers at tcp://127.0.0.1:9: ConnectionRefusedError")


def test_dask_is_not_installed(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask", None)
    refused("127.0.0.1:9", r"pip install 'reflectance_fit\[cluster\]'")


def test_workers_of_another_version(scheduler, monkeypatch):
    monkeypatch.setattr(module, "version", other_version)
    refused(scheduler, r"has no reflectance_fit; install the version of this command there, 9\.9")


def other_version(name):
    return "9.9"


def test_no_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_WORKERS_S", 1.0)
    with scale_cluster.cluster(tmp_path, 0) as (file, _):
        refused(str(file), r"has no workers; start some with dask worker tcp://127.0.0.1:\d+ --nthreads 1")


def test_workers_with_threads_are_refused(tmp_path):
    with scale_cluster.cluster(tmp_path, 1, threads=2) as (file, _):
        refused(str(file), "start the workers with --nthreads 1")


def test_a_scheduler_that_dies_is_an_error(tmp_path, chores):
    with (
        scale_cluster.cluster(tmp_path, 1, env=IMPORTS) as (file, scheduler),
        executor(scheduler=str(file)) as cluster,
    ):
        outcomes = cluster.run([Task("short", chores.double, (1,)), Task("long", chores.sleep, (60.0,))])
        assert next(outcomes).value == 2
        scheduler.kill()
        with pytest.raises(ReflectanceFitError, match=r"connection to the scheduler is lost.*continues"):
            next(outcomes)


def test_certificates_let_in_and_keep_out(tmp_path, chores):
    settings = scale_cluster.certificates(tmp_path / "ours", "ours")
    others = scale_cluster.certificates(tmp_path / "theirs", "theirs")
    ca = "DASK_DISTRIBUTED__COMM__TLS__CA_FILE"
    with scale_cluster.cluster(tmp_path, 1, env=settings | IMPORTS, host="tls://127.0.0.1") as (file, _):
        refused(str(file), r"tls:// needs certificates: set DASK_DISTRIBUTED__COMM__TLS__CA_FILE")
        with configured(settings), executor(scheduler=str(file)) as cluster:
            assert by_key(cluster.run([Task("t", chores.double, (1,))]))["t"].value == 2
        with configured(others):
            refused(str(file), r"no scheduler answers at tls://.*certificate verify failed")
        # Nor does the scheduler talk to who has no certificate of its authority.
        with configured(others | {ca: settings[ca]}):
            refused(str(file), r"no scheduler answers at tls://")


def configured(settings):
    """As the environment would: Dask reads it when it is imported."""
    import dask

    keys = {key: key.removeprefix("DASK_").lower().replace("__", ".") for key in settings}
    return dask.config.set({keys[key]: value for key, value in settings.items()})
