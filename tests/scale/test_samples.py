"""Which files a batch takes for samples, and that no two share a folder."""

import os
import re
import string
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.samples import find_samples


def make(folder: Path, *files: str) -> None:
    for file in files:
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")


def names(folder: Path, *paths: Path) -> dict[str, str]:
    found = find_samples(paths or [folder], leave_out=folder / "results")
    return {sample.name: sample.source.relative_to(folder).as_posix() for sample in found}


def test_a_folder_is_searched_by_name(tmp_path):
    taken = ["a/measurement.yaml", "b/c/capture.yaml", "d/run7.measurement.yaml", "x.capture.yaml"]
    left = ["a/scan.csv", "truth.yaml", "b/measurement.yml", "mymeasurement.yaml", "a/report.yaml"]
    hidden = [".git/measurement.yaml", "a/.b/capture.yaml", "results/a/measurement.yaml"]
    make(tmp_path, *taken, *left, *hidden)
    (tmp_path / "link").symlink_to(tmp_path / "a")
    assert names(tmp_path) == {
        "a": "a/measurement.yaml",
        "b__c": "b/c/capture.yaml",
        "d__run7": "d/run7.measurement.yaml",
        "x": "x.capture.yaml",
    }


def test_files_are_taken_as_they_are_and_once(tmp_path):
    make(tmp_path, "a/measurement.yaml", "b/any.yaml", "b/obs.nc")
    paths = [tmp_path / f for f in ("a/measurement.yaml", "b/any.yaml", "b/obs.nc", "a", "b/../b/any.yaml")]
    assert names(tmp_path, *paths) == {"a": "a/measurement.yaml", "any": "b/any.yaml", "obs": "b/obs.nc"}


def test_the_folder_itself_may_be_the_sample(tmp_path, monkeypatch):
    make(tmp_path, "glass/measurement.yaml")
    assert names(tmp_path, tmp_path / "glass") == {"glass": "glass/measurement.yaml"}
    monkeypatch.chdir(tmp_path / "glass")
    (sample,) = find_samples([Path()], leave_out=Path("out"))
    assert (sample.name, sample.source) == ("glass", Path("measurement.yaml"))


def test_samples_of_one_name_get_longer_ones(tmp_path, monkeypatch):
    make(tmp_path, "lab1/s/measurement.yaml", "lab2/s/measurement.yaml", "lab2/t/measurement.yaml")
    monkeypatch.chdir(tmp_path)
    found = find_samples([Path("lab1"), Path("lab2")], leave_out=Path("out"))
    assert [sample.name for sample in found] == ["lab1__s__measurement", "lab2__s__measurement", "t"]


def test_names_that_differ_in_case_alone_are_one_folder_on_some_machines(tmp_path):
    make(tmp_path, "Gold/measurement.yaml", "gold/measurement.yaml", "GOLD.capture.yaml")
    found = names(tmp_path)
    assert len({name.casefold() for name in found}) == 3


def test_capture_and_measurement_side_by_side(tmp_path):
    make(tmp_path, "a/measurement.yaml", "a/capture.yaml")
    assert len(names(tmp_path)) == 2


def test_what_is_not_there(tmp_path):
    make(tmp_path, "empty/readme.txt")
    with pytest.raises(ReflectanceFitError) as caught:
        find_samples([tmp_path / "nothing", tmp_path / "empty"], leave_out=tmp_path / "out")
    messages = [problem.message for problem in caught.value.problems]
    assert messages == [
        "there is no such file or folder",
        "holds no capture.yaml or measurement.yaml; is it the right folder?",
    ]


letters = st.text(
    st.sampled_from(string.ascii_letters[:3] + "ABÄä._- :*?|\n\x1b\u202e\udc80é漢"), min_size=1, max_size=60
)


@given(st.lists(st.lists(letters, min_size=1, max_size=3), min_size=1, max_size=12))
def test_names_are_safe_and_differ(tmp_path_factory, folders):
    """On file systems that ignore case, too, and whatever the folders are called."""
    folder = tmp_path_factory.mktemp("named")
    kept = 0
    for steps in folders:
        if not any(step.startswith(".") for step in steps):
            place = folder.joinpath(*steps)
            place.mkdir(parents=True, exist_ok=True)
            (place / "measurement.yaml").touch()
            kept += 1
    if not kept:
        return
    found = find_samples([folder], leave_out=folder / "results")
    assert len(found) == sum("measurement.yaml" in files for _, _, files in os.walk(folder))
    assert len({sample.name.casefold() for sample in found}) == len(found)
    for sample in found:
        assert re.fullmatch(r"[\w][\w.-]*", sample.name)
        assert len(os.fsencode(sample.name)) <= 140
    assert [s.name for s in found] == sorted(s.name for s in found)
    assert find_samples([folder], leave_out=folder / "results") == found
