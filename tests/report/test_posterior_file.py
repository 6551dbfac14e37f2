"""posterior.nc read back for the errors of approximations: the draws that were written, or a reason why not."""

import h5netcdf
import numpy as np
import pytest

from reflectance_fit import workflow
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference import posterior
from reflectance_fit.report.netcdf import read_index_draws, write_posterior

h5py = h5netcdf.core.h5py


@pytest.fixture(scope="module")
def fits(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glass")
    write_example(folder, "N-BK7")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior, "MIN_ESS", 300.0)
        patch.setattr(posterior, "BLOCK", 100)
        patch.setattr(posterior, "MAX_STEPS", 100)
        return workflow.fit(folder / "measurement.yaml", timings=False).fits


@pytest.fixture
def path(fits, tmp_path):
    write_posterior(fits, tmp_path / "posterior.nc")
    return tmp_path / "posterior.nc"


def test_what_was_written_comes_back(fits, path):
    names = [fit.channel for fit in fits]
    found = read_index_draws(path, names)
    assert list(found) == names
    for fit in fits:
        for draws, name in zip(found[fit.channel], ("eta", "k"), strict=True):
            assert np.array_equal(draws, fit.posterior.flat(name))


def refused(path, names):
    with pytest.raises(ReflectanceFitError) as caught:
        read_index_draws(path, names)
    (line,) = caught.value.lines()
    assert line.startswith(f"Error: {path}: ")
    assert len(line) < len(str(path)) + 150
    return line


@pytest.mark.parametrize("content", [b"", b"not a file of this kind", b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_broken_bytes(tmp_path, content):
    (tmp_path / "posterior.nc").write_bytes(content)
    assert "is no posterior.nc of a fit" in refused(tmp_path / "posterior.nc", ["G"])


def test_a_cut_file(fits, path):
    path.write_bytes(path.read_bytes()[:-2000])
    refused(path, [fit.channel for fit in fits])


def test_a_folder(tmp_path):
    (tmp_path / "posterior.nc").mkdir()
    assert "folder" in refused(tmp_path / "posterior.nc", ["G"])


def test_other_channels(path):
    assert "other channels" in refused(path, ["G"])


@pytest.mark.parametrize(
    ("name", "value"), [("eta", 0.0), ("eta", np.nan), ("eta", np.inf), ("k", -1.0), ("k", np.nan)]
)
def test_draws_that_are_no_index(fits, path, name, value):
    with h5py.File(path, "a") as file:
        file["posterior"][name][0, 0, 0] = value
    assert "no index" in refused(path, [fit.channel for fit in fits])


def other_shape(group):
    del group["k"]
    group["k"] = np.zeros((1, 2, 1))


def no_eta(group):
    del group["eta"]


def too_many(group):
    for name in ("eta", "k"):
        del group[name]
        group.create_dataset(name, (1000, 1_000_000, 1), float, chunks=(1000, 1000, 1))


def elsewhere(group):
    del group["eta"]
    group["eta"] = h5py.ExternalLink("/etc/hostname", "/eta")


def raw_bytes_of_another_file(group):
    shape = group["eta"].shape
    del group["eta"]
    group.create_dataset("eta", shape, float, external=[("/dev/zero", 0, h5py.h5f.UNLIMITED)])


@pytest.mark.parametrize("damage", [other_shape, no_eta, too_many, elsewhere, raw_bytes_of_another_file])
def test_files_that_claim_or_point_elsewhere(fits, path, damage):
    with h5py.File(path, "a") as file:
        damage(file["posterior"])
    assert "is no posterior.nc of a fit" in refused(path, [fit.channel for fit in fits])
