"""Signals of single cells: those of ingest over a region of one cell, whatever part of the picture is asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from reflectance_fit.capture.bins import Cells, Mask, Shift
from reflectance_fit.capture.bundle import carried, rotation_of
from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.frames import OnBoard
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.pixel_means import pixel_means
from reflectance_fit.capture.pixel_source import pixel_source
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.picture import Optics
from reflectance_fit.data_synthetic.rig import MONO_CHANNELS
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import IMX250, CaptureSpec

SMALL = Sensor(width=96, height=64)


def source_of(folder, tmp_path, **changes):
    path = folder / "capture.yaml"
    if changes:
        path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text()) | changes, sort_keys=False))
    ingested = ingest(read_capture(path))
    work = tmp_path / "work"
    work.mkdir(exist_ok=True)
    return ingested, pixel_source(ingested, work)


def frame_of(cfa, channels, axes_deg=None, black=0.0):
    n = len(channels)
    return RawFrame(
        cfa=np.asarray(cfa, dtype=np.uint16),
        channels=np.array(channels),
        axes_deg=np.full((n, n), np.nan) if axes_deg is None else np.array(axes_deg),
        black=np.full((n, n), black),
        white=np.full((n, n), 65000.0),
        exposure_s=None,
        iso=None,
        noise_profile=None,
    )


@pytest.mark.parametrize("kind", ["bayer", "mono"])
def test_a_cell_is_a_region_of_one_cell(tmp_path, kind):
    """Value and sigma to the last digits: darks, flats of each analyzer angle, exposures, levels, all of it."""
    spec = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=SMALL, seed=3, bracket=(0, -2))
    if kind == "mono":
        spec = replace(spec, sensor=replace(SMALL, pattern="MONO"), channels=MONO_CHANNELS)
    write_capture(tmp_path / "c", spec)
    _, source = source_of(tmp_path / "c", tmp_path)
    extent = source.extent()
    row, column = 5, 7
    pitch = extent.pitch
    x, y = extent.left + pitch * column, extent.top + pitch * row
    data = yaml.safe_load((tmp_path / "c" / "capture.yaml").read_text())
    for frame in data["frames"]:
        if frame.get("role", "sample") == "sample":
            frame["region"] = [x, y, x + pitch, y + pitch]
    (tmp_path / "c" / "one.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    rows = ingest(read_capture(tmp_path / "c" / "one.yaml")).measurement.observations
    for channel in source.capture.channels:
        found = source.signals(channel, extent)
        alone = rows.select(rows.channel == channel)
        at = row * extent.columns + column
        assert found.value[:, at] == pytest.approx(alone.value, rel=1e-6)
        assert np.sqrt(found.variance[:, at]) == pytest.approx(alone.sigma, rel=1e-6)
        assert [r.gain_group for r in found.rows] == alone.gain_group.tolist()


def test_a_part_is_a_part_of_the_whole(tmp_path):
    """Bit by bit, at odd places and sizes, with frames that are shifted and a mask."""
    write_capture(
        tmp_path / "c", CaptureSpec("N-BK7", shape="sphere", sensor=Sensor(width=240, height=180), seed=2)
    )
    _, source = source_of(tmp_path / "c", tmp_path)
    moved = Shift(((1.0, 2e-4), (-2e-4, 1.0)), (0.37, -1.21))
    source = replace(source, shifts={source.frames[1].path: moved})
    whole = source.extent()
    all_of_it = source.signals("G", whole)
    shape = (whole.rows, whole.columns)
    for top, left, rows, columns in (
        (0, 0, 7, 11),
        (13, 5, 21, 17),
        (whole.rows - 3, 1, 3, whole.columns - 1),
    ):
        part = replace(
            whole,
            left=whole.left + whole.pitch * left,
            top=whole.top + whole.pitch * top,
            rows=rows,
            columns=columns,
        )
        found = source.signals("G", part)
        cut = np.s_[top : top + rows, left : left + columns]
        for name in ("value", "variance"):
            expected = getattr(all_of_it, name).reshape(-1, *shape)[:, *cut].reshape(len(found.rows), -1)
            assert np.array_equal(getattr(found, name), expected, equal_nan=True)
        for name in ("theta", "s_direction"):
            expected = getattr(all_of_it.views[0], name).reshape(shape)[cut].ravel()
            assert np.array_equal(getattr(found.views[0], name), expected, equal_nan=True)
        assert np.array_equal(found.inside, all_of_it.inside.reshape(shape)[cut].ravel())


def test_between_pixels_a_slope_is_a_slope():
    """Linear interpolation is exact on a plane: of a shifted frame, and of polarizers on the pixels."""
    y, x = np.mgrid[0:40, 0:60]
    plane = 1000 + 7 * x + 11 * y
    shift = Shift(((1.0, 0.01), (-0.01, 1.0)), (2.3, -1.6))
    cells = Cells(8, 6, 2, 10, 12)
    bayer = frame_of(plane, [["R", "G"], ["G", "B"]], black=100.0)
    for colour, (dx, dy) in {"R": (0.0, 0.0), "G": (0.5, 0.5), "B": (1.0, 1.0)}.items():
        found = pixel_means(bayer, Plane(colour), cells, shift.forward, None, math.inf)
        at_x, at_y = shift.forward(*cells.places(dx, dy))
        assert found.mean == pytest.approx((900 + 7 * at_x + 11 * at_y).ravel(), abs=1e-9)
    dofp = frame_of(plane, [["mono"] * 2] * 2, IMX250)
    for axis in (0.0, 45.0, 90.0, 135.0):
        found = pixel_means(dofp, Plane("mono", axis), cells, None, None, math.inf)
        at_x, at_y = cells.places(0.5, 0.5)
        assert found.mean == pytest.approx((1000 + 7 * at_x + 11 * at_y).ravel(), abs=1e-9)
        # Weights 9, 3, 3 and 1 in 16.
        assert found.pixels == pytest.approx(256 / 100)


def test_the_variance_is_that_of_the_interpolated():
    rng = np.random.default_rng(1)
    noise = frame_of(1000 + rng.normal(0, 40, (200, 200)), [["mono"]])
    cells = Cells(10, 10, 1, 180, 180)
    found = pixel_means(noise, Plane("mono"), cells, Shift(offset=(0.3, 0.8)).forward, None, math.inf)
    # 32,400 values, neighbours correlated: their variance to 3 % at 3 sigma.
    assert np.var(found.mean) * found.pixels[0] == pytest.approx(40**2, rel=0.05)


def test_what_is_clipped_hot_or_beyond_the_picture_is_told():
    cfa = np.full((20, 20), 1000)
    cfa[4, 6] = 64900
    frame = frame_of(cfa, [["mono"]])
    masked = np.zeros((20, 20), dtype=bool)
    masked[9, 9] = True
    cells = Cells(2, 2, 1, 17, 17)
    still = pixel_means(frame, Plane("mono"), cells, None, Mask.of(masked), math.inf)
    assert np.argwhere(still.saturated.reshape(17, 17)).tolist() == [[2, 4]]
    assert np.argwhere(np.isnan(still.mean.reshape(17, 17))).tolist() == [[7, 7]]
    # Half a pixel on, two pixels make each value; the clip of another frame counts here too.
    moved = pixel_means(frame, Plane("mono"), cells, Shift(offset=(0.5, 0.0)).forward, Mask.of(masked), 900.0)
    assert moved.saturated.all(where=np.isfinite(moved.mean))
    assert np.argwhere(np.isnan(moved.mean.reshape(17, 17))).tolist() == [[7, 6], [7, 7]]
    beyond = pixel_means(frame, Plane("mono"), cells, Shift(offset=(3.0, 0.0)).forward, None, math.inf)
    assert np.isnan(beyond.mean.reshape(17, 17)[:, -2:]).all()
    assert np.isfinite(beyond.mean.reshape(17, 17)[:, :-2]).all()


def test_a_point_of_a_board_is_carried_from_pose_to_pose():
    """Against points of the plane seen in both poses; the sample may lie above the board."""
    rng = np.random.default_rng(5)
    camera = Camera(2000.0, 800.0, 600.0, -0.05, 0.01)
    one, other = (np.array([tilt, 0.02, -0.01, -40.0, -30.0, 290.0]) for tilt in (0.5, 0.9))
    for height in (0.0, 4.0):
        points = np.column_stack([rng.uniform(10, 90, (50, 2)), np.full(50, -height)])
        seen, expected = (camera.pixels(points @ rotation_of(p).T + p[3:]) for p in (one, other))
        x, y = carried(camera, one, other, height, seen[:, 0], seen[:, 1])
        assert np.stack([x, y], axis=1) == pytest.approx(expected, abs=1e-6)


def test_a_board_has_angles_of_its_own_in_every_view(tmp_path):
    write_capture(
        tmp_path / "b",
        CaptureSpec(
            "N-BK7",
            shape="board",
            angles_deg=(40.0, 55.0),
            sensor=Sensor(width=832, height=624),
            seed=1,
            optics=Optics(2.1 * 832, 0.7),
            geometry_views=8,
        ),
    )
    ingested, source = source_of(tmp_path / "b", tmp_path)
    assert isinstance(ingested.capture.geometry, OnBoard)
    extent = source.extent()
    signals = source.signals("G", extent)
    middle = extent.rows // 2 * extent.columns + extent.columns // 2
    stated = sorted({round(f.theta_deg, 2) for f in source.frames})
    assert len(signals.views) == len(stated) == 2
    for view, theta_deg in zip(signals.views, stated, strict=True):
        assert math.degrees(np.nanmedian(view.theta)) == pytest.approx(theta_deg, abs=0.2)
        assert np.isfinite(view.theta[middle])
