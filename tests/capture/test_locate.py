"""Captures whose photographs tell the geometry, from files on."""

import copy
import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml

from reflectance_fit.capture.frames import OnBoard, Sphere
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.locate import locate
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.spread import over_cone, over_region
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec, Setting, standard_spec
from reflectance_fit.errors import ReflectanceFitError


def edited(path, change):
    data = yaml.safe_load(path.read_text())
    for frame in data["frames"]:
        frame.pop("sha256", None)
    change(data)
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """A board at two tilts, six more views, a frame that shows none."""
    folder = tmp_path_factory.mktemp("board")
    spec = replace(standard_spec("N-BK7", shape="board"), angles_deg=(45.0, 60.0))
    path = write_capture(folder, spec)

    def blank(data):
        dark = next(f for f in data["frames"] if f["role"] == "dark")
        shutil.copy(folder / dark["file"], folder / "raw" / "blank.dng")
        first = copy.deepcopy(data["frames"][0])
        data["frames"].append({**first, "file": "raw/blank.dng", "analyzer_deg": 20})

    edited(path, blank)
    return path, yaml.safe_load((folder / "truth.yaml").read_text())


def test_a_board_tells_the_angles_and_a_frame_without_one_is_rejected_by_name(board):
    path, truth = board
    capture, rejected = locate(read_capture(path))
    assert list(rejected) == ["raw/blank.dng"]
    assert "of the board" in rejected["raw/blank.dng"] or "dark" in rejected["raw/blank.dng"]
    assert isinstance(capture.geometry, OnBoard)
    seen = [f for f in capture.role("sample") if f.file not in rejected]
    true = [view["theta_deg"] for view in truth["views"] for _ in range(4)]
    assert [f.theta_deg for f in seen] == pytest.approx(true, abs=0.05)
    assert {capture.geometry.poses[f.path].view for f in seen[:4]} != {
        capture.geometry.poses[f.path].view for f in seen[4:]
    }
    assert all(0 < f.theta_deg_sigma < 0.05 for f in seen)


def test_what_all_angles_share_is_told_once_and_widens_each_only_where_nuisances_are_forbidden(board):
    path, _ = board
    capture = read_capture(path)
    apart, _ = locate(capture)
    together, _ = locate(replace(capture, nuisances={}))
    common = apart.geometry.common_sigma_deg
    assert apart.common_sigmas == {"angle_offset_deg": dict.fromkeys("RGB", common)}
    for narrow, wide in zip(apart.role("sample")[:8], together.role("sample")[:8], strict=True):
        assert wide.theta_deg_sigma == pytest.approx(math.hypot(narrow.theta_deg_sigma, common))
        assert wide.theta_deg_sigma > narrow.theta_deg_sigma > 0


def small(tmp_path, **keys):
    spec = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=Sensor(width=96, height=64), seed=4, **keys)
    return write_capture(tmp_path, spec)


def test_a_stated_focal_length_and_a_cone_widen_the_angle(tmp_path):
    path = small(tmp_path)

    def lens(data):
        data["camera"]["focal_length_px"] = 900.0
        data["light"]["half_angle_deg"] = 1.5

    plain = ingest(read_capture(path)).measurement.observations
    wide = ingest(read_capture(edited(path, lens))).measurement.observations
    x0, y0, x1, y1 = yaml.safe_load(path.read_text()).get("region") or (0, 0, 96, 64)
    from reflectance_fit.capture.camera import Camera

    for row in range(len(plain)):
        region = over_region(
            (x0, y0, x1, y1), Camera(900.0, 47.5, 31.5), math.radians(plain.theta_deg[row]), 0.0
        )
        cone = over_cone(region.theta, math.radians(1.5))
        assert wide.theta_deg[row] == pytest.approx(math.degrees(cone.theta), abs=1e-9)
        assert wide.theta_deg_spread[row] == pytest.approx(math.degrees(math.hypot(region.width, cone.width)))
        weaker = region.modulation * cone.modulation
        assert wide.diattenuation[row] == pytest.approx(plain.diattenuation[row] * weaker)
    assert wide.value == pytest.approx(plain.value)
    assert np.all(plain.theta_deg_spread == 0)


def test_a_ball_is_found_and_its_rings_have_a_sigma(tmp_path):
    spec = replace(
        standard_spec("N-BK7", shape="sphere"),
        sensor=Sensor(width=400, height=300),
        settings=(Setting(0.0), Setting(90.0)),
    )
    path = write_capture(tmp_path, spec)
    stated = yaml.safe_load(path.read_text())["geometry"]["sphere"]

    def detect(data):
        data["geometry"]["sphere"] = "detect"

    capture = read_capture(edited(path, detect))
    found, rejected = locate(capture)
    assert not rejected
    assert isinstance(found.geometry, Sphere)
    assert found.geometry.center_px == pytest.approx(stated["center_px"], abs=0.3)
    assert found.geometry.radius_px == pytest.approx(stated["radius_px"], abs=0.3)
    rows = ingest(capture).measurement.observations
    wanted = np.tan(np.radians(rows.theta_deg)) * found.geometry.radius_sigma_px / found.geometry.radius_px
    assert rows.theta_deg_sigma == pytest.approx(np.degrees(wanted), rel=1e-6)


def test_no_photograph_of_the_board_is_an_error_that_names_each(tmp_path):
    path = small(tmp_path)

    def on_board(data):
        data["geometry"] = {
            "kind": "charuco",
            "charuco": {"squares": [11, 8], "square_mm": 10, "marker_mm": 7.5, "dictionary": "DICT_5X5_100"},
        }
        data["region"] = [10, 10, 80, 50]
        for frame in data["frames"]:
            frame.pop("theta_deg", None)

    with pytest.raises(ReflectanceFitError) as error:
        locate(read_capture(edited(path, on_board)))
    samples = [f for f in yaml.safe_load(path.read_text())["frames"] if f.get("role", "sample") == "sample"]
    assert len(error.value.problems) == len(samples)
    assert "raw/000.dng" in str(error.value.problems[0])
