"""Camera and poses from corners of known places: errors within what is claimed, and what is claimed small enough."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.capture.calibration import calibrate_views
from reflectance_fit.capture.camera import incidence
from reflectance_fit.capture.corners import Corners, find_corners
from reflectance_fit.capture.poses import _common_and_own, find_poses
from reflectance_fit.errors import ReflectanceFitError

sys.path.append(str(Path(__file__).parent))
from photographed_boards import BOARD, CENTRE, FOCAL, SHAPE, corners, incidence_deg, photographed, pose

TILTS = (20.0, 35.0, 45.0, 55.0, 60.0, 65.0)
PIXEL = (1000.0, 760.0)


def found_angles(poses, names):
    ray = poses.camera.rays(*(np.array(value) for value in PIXEL))
    return {name: math.degrees(float(incidence(ray, np.array(poses.normals[name]))[0])) for name in names}


def scene(rng, tilts=TILTS, **print_):
    stands = {f"{tilt:g}": pose(tilt, rng.normal() * 5, rng.normal(size=3) * 4) for tilt in tilts}
    views = {name: corners(*stand, rng, **print_) for name, stand in stands.items()}
    return views, {name: incidence_deg(stand[0], PIXEL) for name, stand in stands.items()}


def solve(views, focal=None):
    return find_poses(views, dict.fromkeys(views, "0"), dict.fromkeys(views, PIXEL), BOARD, focal)


@pytest.mark.parametrize("focal", [None, 1.005 * FOCAL])
def test_errors_are_as_large_as_stated(focal):
    """Prints stretched and bowed as the priors say: pulls of 24 scenes have unit variance, none is absurd."""
    pulls, errors = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        views, true = scene(rng, stretch=1 + 0.001 * rng.normal(), bow_mm=0.1 * rng.normal(size=2))
        poses = solve(views, focal)
        assert not poses.rejected
        found = found_angles(poses, views)
        for name in views:
            sigma = math.hypot(poses.common_sigma_deg, poses.sigma_deg[poses.view[name]])
            pulls.append((found[name] - true[name]) / sigma)
            errors.append(found[name] - true[name])
    # 12 scenes of 6 views that share half of their error: at least 24 independent, so rms 1 +- 0.15.
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.45)
    assert np.max(np.abs(pulls)) < 4.5
    assert np.max(np.abs(errors)) < 0.05


def test_the_lens_is_found():
    rng = np.random.default_rng(3)
    views, _ = scene(rng)
    camera = solve(views).camera
    assert camera.focal_px == pytest.approx(FOCAL, rel=2e-3)
    assert (camera.cx, camera.cy) == pytest.approx(CENTRE, abs=4)
    assert camera.k1 == pytest.approx(-0.1, abs=0.03)


def test_wrong_corners_are_left_out():
    rng = np.random.default_rng(4)
    views, true = scene(rng)
    for corner_set in views.values():
        corner_set.xy[[3, 20, 41]] += np.array([[9.0, 0.0], [0.0, -1.2], [1.0, 1.0]])
    found = found_angles(solve(views), views)
    for name in views:
        assert found[name] == pytest.approx(true[name], abs=0.05)


def test_a_view_that_does_not_fit_is_rejected_by_name():
    rng = np.random.default_rng(5)
    views, _ = scene(rng)
    views["crumpled"] = Corners(
        views["45"].ids, views["45"].xy + 6 * rng.normal(size=views["45"].xy.shape), SHAPE
    )
    poses = solve(views)
    assert list(poses.rejected) == ["crumpled"]
    assert "do not fit together" in poses.rejected["crumpled"]


def test_frames_that_a_polarizer_shifts_are_one_view_and_a_turned_board_is_another():
    rng = np.random.default_rng(6)
    views, true = scene(rng)
    for shift in (1, 2, 3):
        views[f"45 again {shift}"] = Corners(views["45"].ids, views["45"].xy + 3 * shift, SHAPE)
    turned = pose(45.4)
    views["turned"] = corners(*turned, rng)
    poses = solve(views)
    assert len({poses.view["45"], *(poses.view[f"45 again {shift}"] for shift in (1, 2, 3))}) == 1
    assert len(set(poses.view.values())) == len(TILTS) + 1
    assert found_angles(poses, ["45 again 3"]) == pytest.approx({"45 again 3": true["45"]}, abs=0.05)


def test_a_corner_found_in_a_wrong_place_does_not_part_photographs():
    """A dark sample in the board's window gives false corners: 8 pixels off, and the mean of squares says turned."""
    rng = np.random.default_rng(8)
    stands = {f"{tilt:g}": pose(tilt, 0.0, np.zeros(3)) for tilt in TILTS}
    views = {name: corners(*stand, rng) for name, stand in stands.items()}
    second = corners(*stands["55"], rng)
    xy = second.xy.copy()
    xy[3] += (7.0, -4.0)
    views["dark"] = Corners(second.ids, xy, second.shape)
    poses = solve(views)
    assert poses.view["dark"] == poses.view["55"]
    assert len(set(poses.view.values())) == len(TILTS)


def test_frames_of_another_set_are_another_view():
    rng = np.random.default_rng(7)
    views, _ = scene(rng)
    views["copy"] = views["45"]
    sets = dict.fromkeys(views, "0") | {"copy": "1"}
    poses = find_poses(views, sets, dict.fromkeys(views, PIXEL), BOARD, None)
    assert poses.view["copy"] != poses.view["45"]


def test_views_that_settle_nothing_are_refused():
    """One photograph from straight above: its distance and the focal length cannot be told apart."""
    views = {"above": corners(*pose(2.0), np.random.default_rng(8), noise=0.3)}
    with pytest.raises(ReflectanceFitError, match="from other directions"):
        solve(views)


def test_the_covariance_is_split_without_changing_a_variance():
    rng = np.random.default_rng(9)
    for _ in range(20):
        spread = rng.normal(size=(5, 3))
        shared = 2 * rng.normal()
        covariance = spread @ spread.T + shared**2
        common, own = _common_and_own(covariance)
        assert common**2 + own**2 == pytest.approx(np.diag(covariance))
        assert common <= math.sqrt(np.diag(covariance).min())
    exact, own = _common_and_own(np.full((3, 3), 4.0) + np.diag([1.0, 2.0, 3.0]))
    assert exact == pytest.approx(2.0)
    assert own**2 == pytest.approx([1.0, 2.0, 3.0])


@pytest.fixture(scope="module")
def pictures():
    rng = np.random.default_rng(10)
    turns = {20.0: 3.0, 35.0: 95.0, 45.0: 5.0, 50.0: -60.0, 65.0: 30.0}
    stands = {tilt: pose(tilt, turn) for tilt, turn in turns.items()}
    return stands, {tilt: photographed(*stand, rng) for tilt, stand in stands.items()}


def test_tilts_of_pictures_are_right_to_a_twentieth_of_a_degree(pictures):
    """The whole way from blurred and noisy pixels, no stated lens, five views."""
    stands, seen = pictures
    views = {tilt: find_corners(picture, (0.0, 0.0), 1, BOARD) for tilt, picture in seen.items()}
    found = found_angles(solve(views), views)
    for tilt, (rotation, _) in stands.items():
        assert found[tilt] == pytest.approx(incidence_deg(rotation, PIXEL), abs=0.05)


def test_corners_are_found_where_they_are_and_in_sensor_pixels(pictures):
    stands, seen = pictures
    rotation, translation = stands[45.0]
    picture = seen[45.0]
    true = corners(rotation, translation, np.random.default_rng(0), noise=0.0)
    for scale in (1.0, 0.02, 3e4):
        found = find_corners(scale * picture, (0.0, 0.0), 1, BOARD)
        assert len(found.ids) > 60
        place = dict(zip(true.ids, true.xy, strict=True))
        off = np.array([xy - place[i] for i, xy in zip(found.ids, found.xy, strict=True)])
        assert np.sqrt(np.mean(off**2)) < 0.06
    halved = picture.reshape(667, 2, 1000, 2).mean(axis=(1, 3))
    found = find_corners(halved, (0.5, 0.5), 2, BOARD)
    off = np.array([xy - place[i] for i, xy in zip(found.ids, found.xy, strict=True)])
    assert np.sqrt(np.mean(off**2)) < 0.12
    assert np.abs(off.mean(axis=0)).max() < 0.04
    assert found.shape == SHAPE


@pytest.mark.parametrize("fill", [0.0, 0.5])
def test_no_board_is_said(fill):
    with pytest.raises(ReflectanceFitError, match=r"corners of the board|too dark"):
        find_corners(np.full((300, 400), fill), (0.0, 0.0), 1, BOARD)


def test_a_board_in_part_is_enough(pictures):
    picture = pictures[1][45.0].copy()
    picture[:, 1100:] = 0.2
    found = find_corners(picture, (0.0, 0.0), 1, BOARD)
    assert 8 <= len(found.ids) < 50


def test_the_start_needs_no_stated_focal_length_even_for_few_views():
    rng = np.random.default_rng(12)
    views, _ = scene(rng, tilts=(45.0, 60.0))
    fit = calibrate_views(list(views.values()), BOARD, None)
    assert fit.camera.focal_px == pytest.approx(FOCAL, rel=0.01)
    assert fit.noise_px == pytest.approx(0.03, rel=0.25)
