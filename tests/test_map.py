"""Maps of photographs whose truth is known: honest to each pixel, and the same bytes however they were computed."""

import json
import math
import shutil
import sys
from pathlib import Path

import h5netcdf
import numpy as np
import OpenEXR
import pytest
import yaml

from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.rig import LIGHTS, MONO_CHANNELS, Faults, Setting
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.pixels.status import Status
from reflectance_fit.scale.executors import executor
from reflectance_fit.workflow import fit
from reflectance_fit.workflow_map import map_to_files

sys.path.append(str(Path(__file__).parent))
from map_tiles import dies, dies_at_the_second_tile

MONO = Sensor(width=160, height=120, pattern="MONO")


def quiet(*_what):
    pass


def mapped(capture, out, *, jobs=1, **options):
    with executor(jobs) as workers:
        return map_to_files(capture, out, workers, progress=quiet, **options)


def read(path):
    with h5netcdf.File(path, "r") as file:
        return {name: variable[...] for name, variable in file.variables.items()}, dict(file.attrs)


@pytest.fixture(scope="module")
def glass(tmp_path_factory):
    """A flat glass; the analyzer's mount and the goniometer are off, and the capture allows for it."""
    folder = tmp_path_factory.mktemp("glass")
    spec = CaptureSpec(
        "N-BK7",
        angles_deg=(45.0, 60.0),
        sensor=MONO,
        channels=MONO_CHANNELS,
        faults=Faults(angle_offset_deg=0.2, analyzer_offset_deg=-0.3),
        nuisances={"angle_offset_deg": 0.5, "analyzer_offset_deg": 1.0},
        seed=11,
    )
    write_capture(folder, spec)
    return folder / "capture.yaml", spec.index_of(MONO_CHANNELS[0])


@pytest.fixture(scope="module")
def metal(tmp_path_factory):
    folder = tmp_path_factory.mktemp("metal")
    spec = CaptureSpec(
        "Au",
        angles_deg=(65.0, 75.0),
        settings=tuple(
            Setting(angle, plate)
            for plate, angles in ((None, (0.0, 45.0, 90.0, 135.0)), (0.0, (45.0, 135.0)))
            for angle in angles
        ),
        light=LIGHTS["linear45"],
        sensor=MONO,
        channels=MONO_CHANNELS,
        seed=12,
    )
    write_capture(folder, spec)
    return folder / "capture.yaml", spec.index_of(MONO_CHANNELS[0])


def test_a_glass_pixel_by_pixel(glass, tmp_path):
    """Errors of the pixels are as large as their sigma, those of the rig are found by all pixels together."""
    capture, (eta, _) = glass
    result = mapped(capture, tmp_path / "map.nc", exr=tmp_path / "map.exr", tile=32)
    numbers, about = read(tmp_path / "map.nc")
    pulls = (numbers["eta"] - eta) / numbers["eta_sigma"]
    assert (numbers["status"] == Status.IDENTIFIED).all()
    pixels = pulls.size
    # Means and variances of so many normal numbers, at 5 of their standard deviations; the eta of all together
    # is off by its own sigma, which they share.
    shared = 4 * numbers["fit_eta_sigma"][0] / np.median(numbers["eta_sigma"])
    assert np.mean(pulls) == pytest.approx(0.0, abs=shared + 5 / math.sqrt(pixels))
    assert np.var(pulls) == pytest.approx(1.0, abs=5 * math.sqrt(2 / pixels))
    assert np.mean(numbers["chi2"] / numbers["dof"]) == pytest.approx(
        1.0, abs=5 * math.sqrt(2 / (pixels * numbers["dof"].flat[0]))
    )
    assert numbers["fit_eta"][0] == pytest.approx(eta, abs=5 * numbers["fit_eta_sigma"][0])
    assert "k" not in numbers
    assert about["Conventions"].startswith("CF-")
    assert json.loads(about["models"]) == {"550": "dielectric"}
    assert result.channels[0].counts == {Status.IDENTIFIED: pixels}
    exr = {
        name: channel.pixels for name, channel in OpenEXR.File(str(tmp_path / "map.exr")).channels().items()
    }
    assert np.array_equal(exr["eta.550"], numbers["eta"][0])
    assert np.array_equal(exr["status.550"], numbers["status"][0])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.exr", "map.nc", "map.png"]


def test_a_metal_pixel_by_pixel(metal, tmp_path):
    capture, (eta, k) = metal
    mapped(capture, tmp_path / "map.nc")
    numbers, _ = read(tmp_path / "map.nc")
    pixels = numbers["eta"].size
    for name, truth in (("eta", eta), ("k", k)):
        pulls = (numbers[name] - truth) / numbers[f"{name}_sigma"]
        shared = 4 * numbers[f"fit_{name}_sigma"][0] / np.median(numbers[f"{name}_sigma"])
        assert np.mean(pulls) == pytest.approx(0.0, abs=shared + 5 / math.sqrt(pixels))
        assert np.var(pulls) == pytest.approx(1.0, abs=5 * math.sqrt(2 / pixels))
    both = np.corrcoef(numbers["eta"].ravel(), numbers["k"].ravel())[0, 1]
    # Of n pairs a correlation is known to (1 - r^2) / sqrt(n).
    assert both == pytest.approx(
        np.median(numbers["eta_k_correlation"]), abs=5 * (1 - both**2) / math.sqrt(pixels)
    )


@pytest.mark.parametrize("which", ["glass", "metal"])
def test_a_pixel_is_the_single_fit_of_it(which, request, tmp_path):
    """A capture whose region is that pixel, fitted by itself; nothing else may be free in it."""
    capture, _ = request.getfixturevalue(which)
    model = {"glass": "dielectric", "metal": "conductor"}[which]
    folder = tmp_path / "c"
    shutil.copytree(capture.parent, folder)
    data = yaml.safe_load(capture.read_text()) | {"nuisances": {}}
    (folder / "capture.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    mapped(folder / "capture.yaml", tmp_path / "map.nc", model=model)
    numbers, _ = read(tmp_path / "map.nc")
    for row, column in ((0, 0), (17, 31), (40, 5)):
        x, y = int(numbers["x"][column]), int(numbers["y"][row])
        for frame in data["frames"]:
            if frame["role"] == "sample":
                frame["region"] = [x, y, x + 1, y + 1]
        (folder / "one.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
        one = fit(folder / "one.yaml", model=model, posterior="laplace").fits[0].optimum
        assert numbers["eta"][0, row, column] == pytest.approx(one.eta, abs=1e-6)
        if which == "metal":
            assert numbers["k"][0, row, column] == pytest.approx(one.k, abs=1e-6)
        assert numbers["chi2"][0, row, column] == pytest.approx(one.chi2, rel=1e-3)


def test_a_map_that_may_choose_says_what_it_chose(glass, tmp_path):
    """One angle of unpolarized light is one equation: eta if k is 0.  Priors are those of the whole, not of pixels."""
    folder = tmp_path / "c"
    shutil.copytree(glass[0].parent, folder)
    data = yaml.safe_load(glass[0].read_text()) | {
        "nuisances": {},
        "priors": {"eta": {"uniform": [1.3, 1.8]}},
    }
    data["frames"] = [f for f in data["frames"] if f.get("theta_deg", 60) == 60]
    (folder / "capture.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    result = mapped(folder / "capture.yaml", tmp_path / "map.nc")
    assert [note.code for note in result.notes if note.code != "NO_HASHES"] == [
        "K_TAKEN_AS_ZERO",
        "PRIORS_NOT_USED",
    ]
    assert result.channels[0].together.model == "dielectric"
    free = mapped(folder / "capture.yaml", tmp_path / "free.nc", model="conductor")
    assert Status.IDENTIFIED not in free.channels[0].counts


def test_the_bytes_do_not_depend_on_tiles_or_workers(glass, tmp_path):
    capture, _ = glass
    files = []
    for name, jobs, tile in (("a", 1, 512), ("b", 1, 17), ("c", 2, 40)):
        mapped(capture, tmp_path / f"{name}.nc", exr=tmp_path / f"{name}.exr", jobs=jobs, tile=tile)
        files.append([(tmp_path / f"{name}{ending}").read_bytes() for ending in (".nc", ".exr", ".png")])
    assert files[1:] == files[:1] * 2


def test_a_tile_that_kills_its_workers_is_masked(glass, tmp_path):
    capture, _ = glass
    result = mapped(capture, tmp_path / "map.nc", jobs=2, tile=32, compute=dies_at_the_second_tile)
    numbers, about = read(tmp_path / "map.nc")
    lost = numbers["status"][0] == Status.TILE_LOST
    assert lost[:32, 32:].all()
    assert lost.sum() == 32 * (lost.shape[1] - 32)
    assert np.isnan(numbers["eta"][0][lost]).all()
    assert np.isfinite(numbers["eta"][0][~lost]).all()
    assert [note.code for note in result.notes] == ["TILES_LOST"]
    assert "TILES_LOST" in about["warnings"]


def test_what_is_not_seen_has_a_reason(tmp_path):
    """A ball: beside it nothing, in its middle no plane of incidence; an overexposed frame costs its rim."""
    folder = tmp_path / "ball"
    write_capture(folder, CaptureSpec("N-BK7", shape="sphere", sensor=Sensor(width=240, height=180), seed=2))
    mapped(folder / "capture.yaml", tmp_path / "map.nc")
    numbers, _ = read(tmp_path / "map.nc")
    sphere = yaml.safe_load((folder / "capture.yaml").read_text())["geometry"]["sphere"]
    x, y = np.meshgrid(numbers["x"], numbers["y"])
    cx, cy = sphere["center_px"]
    share = np.hypot(x - cx, y - cy) / sphere["radius_px"]
    for status in numbers["status"]:
        assert (status[share > 1.01] == Status.OUTSIDE).all()
        assert (status[share < 0.12] == Status.OUTSIDE).all()
        seen = (share > 0.4) & (share < 0.75)
        assert np.isin(status[seen], [Status.IDENTIFIED, Status.AMBIGUOUS]).mean() > 0.9


def test_errors_leave_nothing_behind(glass, tmp_path):
    capture, _ = glass
    folder = tmp_path / "c"
    shutil.copytree(capture.parent, folder)
    data = yaml.safe_load(capture.read_text())
    for number, frame in enumerate(f for f in data["frames"] if f["role"] == "sample"):
        frame["region"] = [0, 0, 10, 10] if number else [50, 50, 60, 60]
    (folder / "apart.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(ReflectanceFitError, match="no pixel is in the region of every frame"):
        mapped(folder / "apart.yaml", tmp_path / "out" / "map.nc")
    assert not list(tmp_path.rglob("*.nc"))
    assert not list(tmp_path.rglob(".*"))


def test_the_work_folder_is_gone_after_a_kill_of_all_tiles(glass, tmp_path):
    capture, _ = glass
    with pytest.raises(ReflectanceFitError, match="worker"):
        mapped(capture, tmp_path / "map.nc", jobs=2, tile=4096, compute=dies)
    assert list(tmp_path.iterdir()) == []
