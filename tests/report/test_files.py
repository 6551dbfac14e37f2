"""Files appear whole or not at all, and nothing of the user's is lost."""

import os
from pathlib import Path

import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.files import check_writable, write_together, write_whole


def tree(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*") if p.is_file()}


def fill(stage: Path) -> None:
    (stage / "plots").mkdir()
    (stage / "plots" / "a.png").write_text("new")
    (stage / "report.yaml").write_text("new")
    (stage / "z.nc").write_text("new")


WRITTEN = {"plots/a.png": "new", "report.yaml": "new", "z.nc": "new"}


def test_a_new_folder_with_its_parents(tmp_path):
    write_together(tmp_path / "a" / "b", fill, last="report.yaml")
    assert tree(tmp_path / "a" / "b") == WRITTEN
    assert os.listdir(tmp_path) == ["a"]


def test_old_files_are_replaced_and_foreign_ones_stay(tmp_path):
    (tmp_path / "plots").mkdir()
    for name in ("report.yaml", "plots/a.png", "plots/b.png", "plots/mine.txt", "mine.txt"):
        (tmp_path / name).write_text("old")
    superseded = [tmp_path / "plots" / "a.png", tmp_path / "plots" / "b.png", tmp_path / "plots" / "gone.png"]
    write_together(tmp_path, fill, last="report.yaml", superseded=superseded)
    assert tree(tmp_path) == {**WRITTEN, "plots/mine.txt": "old", "mine.txt": "old"}


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt, SystemExit])
def test_a_failure_while_writing_changes_nothing(tmp_path, error):
    (tmp_path / "report.yaml").write_text("old")

    def fails(stage: Path) -> None:
        fill(stage)
        raise error

    for folder in (tmp_path, tmp_path / "new" / "below"):
        with pytest.raises(error):
            write_together(folder, fails, last="report.yaml", superseded=[tmp_path / "report.yaml"])
    assert tree(tmp_path) == {"report.yaml": "old"}
    assert os.listdir(tmp_path) == ["report.yaml"]


def test_one_file_whole_or_as_it_was(tmp_path):
    path = tmp_path / "a.txt"

    def fails(unfinished: Path) -> None:
        unfinished.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(path, fails)
    assert list(tmp_path.iterdir()) == []
    write_whole(path, lambda unfinished: unfinished.write_text("old"))
    with pytest.raises(KeyboardInterrupt):
        write_whole(path, fails)
    assert tree(tmp_path) == {"a.txt": "old"}


def test_the_last_file_comes_last(tmp_path, monkeypatch):
    order = []
    replace = Path.replace
    monkeypatch.setattr(Path, "replace", lambda path, to: order.append(path.name) or replace(path, to))
    write_together(tmp_path / "out", fill, last="report.yaml")
    assert sorted(order) == ["a.png", "report.yaml", "z.nc"]
    assert order[-1] == "report.yaml"


def test_everything_is_on_disk_before_anything_moves(tmp_path, monkeypatch):
    """After a power cut a name must not stand for an empty file."""
    events = []
    replace, fsync = Path.replace, os.fsync
    monkeypatch.setattr(Path, "replace", lambda path, to: events.append("move") or replace(path, to))
    monkeypatch.setattr(os, "fsync", lambda number: events.append("flush") or fsync(number))
    write_together(tmp_path, fill, last="report.yaml")
    assert events == ["flush"] * 3 + ["move"] * 3


def test_a_folder_where_a_file_should_go(tmp_path):
    (tmp_path / "z.nc").mkdir()
    with pytest.raises(ReflectanceFitError, match=r"z\.nc: a folder stands where the file should be"):
        write_together(tmp_path, fill, last="report.yaml")
    assert os.listdir(tmp_path) == ["z.nc"]


def test_check_writable_leaves_nothing_behind(tmp_path):
    check_writable(tmp_path)
    check_writable(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("below", ["file", "file/a", "file/a/b"])
def test_check_writable_where_a_file_stands(tmp_path, below):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(
        ReflectanceFitError, match="a file stands where the folder should be; choose another -o"
    ):
        check_writable(tmp_path / below)
    assert tree(tmp_path) == {"file": "mine"}


def test_check_writable_where_nobody_may_write(tmp_path):
    with pytest.raises(ReflectanceFitError, match=r"^/proc/x: cannot write here: "):
        check_writable(Path("/proc/x"))
    with pytest.raises(ReflectanceFitError, match="cannot write here: File name too long"):
        check_writable(tmp_path / ("x" * 999))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_check_writable_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ReflectanceFitError, match="Permission denied"):
        check_writable(tmp_path / "out")
