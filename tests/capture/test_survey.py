"""Frames of one view looked at together: dots left out, walls and strangers rejected, shifts followed."""

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from reflectance_fit.capture.align import align
from reflectance_fit.capture.bins import Mask, Shift
from reflectance_fit.capture.decoding import decode as decode_all
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reading import Reading
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.picture import Optics
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import standard_spec

SENSOR = Sensor(width=480, height=360)
LARGER = Sensor(width=960, height=720)  # a printed marker's edges are blurred over a pixel, not half of one


def written(folder, shape="flat", **changes):
    angles = {} if shape == "sphere" else {"angles_deg": (50.0, 62.0)}
    spec = standard_spec("N-BK7", shape=shape, **angles)
    return write_capture(folder, replace(spec, sensor=SENSOR, **changes))


def changed(path, change):
    """Rewrite capture.yaml, hashes removed: its photographs are about to differ."""
    manifest = yaml.safe_load(path.read_text())
    for frame in manifest["frames"]:
        frame.pop("sha256", None)
    change(manifest)
    path.write_text(yaml.safe_dump(manifest, sort_keys=False))
    return path


def retouched(path, paint):
    """Every sample frame with ``paint`` (from DN above black to DN above black) over its pixels."""
    for entry in yaml.safe_load(path.read_text())["frames"]:
        if entry["role"] != "sample":
            continue
        frame = decode(path.parent / entry["file"])
        black = np.tile(frame.black, (frame.cfa.shape[0] // 2, frame.cfa.shape[1] // 2))
        dn = np.clip(np.rint(paint(frame.cfa - black) + black), 0, frame.white.min()).astype(np.uint16)
        metadata = DngMetadata(
            pattern="".join(frame.channels.flat),
            bits=14,
            black=tuple(int(b) for b in frame.black.flat),
            white=int(frame.white[0, 0]),
            exposure_s=frame.exposure_s,
            iso=100,
            noise_profile=tuple(frame.noise_profile[c] for c in "RGB"),
        )
        write_dng(path.parent / entry["file"], dn, metadata)
    return changed(path, lambda manifest: None)


def notes(ingested, code):
    return [note.message for note in ingested.measurement.warnings if note.code == code]


@pytest.mark.parametrize("shape", ["flat", "sphere"])
def test_of_a_clean_capture_nothing_is_masked_and_every_view_is_seen(tmp_path, shape):
    seen = []
    ingested = ingest(read_capture(written(tmp_path / "capture", shape)), seen=seen.append)
    assert not notes(ingested, "MASKED")
    assert [view.name for view in seen] == (["set 0, 50°", "set 0, 62°"] if shape == "flat" else ["set 0"])
    for view in seen:
        assert not any(masked.any() for masked in view.masked.values())
        assert view.channel == "G"
        # Four views 45 degrees apart that obey Malus contradict one another by noise alone.
        assert abs(np.nanmedian(view.stokes.redundancy[view.inside])) < 2e-3


def test_a_highlight_is_left_out_and_the_rows_are_as_without_it(tmp_path):
    path = written(tmp_path / "capture")
    clean = ingest(read_capture(path)).measurement.observations
    y, x = np.indices((SENSOR.height, SENSOR.width))
    spot = np.hypot(x - 260, y - 170) < 9

    def paint(above):
        return np.where(spot, np.maximum(2.5 * above, 40.0), above)

    ingested = ingest(read_capture(retouched(path, paint)))
    first, _ = notes(ingested, "MASKED")
    assert "highlights and dust" in first
    rows = ingested.measurement.observations
    assert np.all(rows.pixels < clean.pixels)
    assert np.all(rows.pixels > 0.97 * clean.pixels)
    # The rest of the region: what the missing pixels had by themselves is within their share of its noise and PRNU.
    np.testing.assert_allclose(rows.value, clean.value, rtol=5e-4, atol=0.3 * np.max(clean.sigma))
    touched = ingest(read_capture(path)).measurement.observations
    assert np.array_equal(rows.value, touched.value)


def test_what_is_masked_moves_with_a_frame_that_is_shifted(tmp_path):
    """A dot seen elsewhere in the second frame is left out there, as if it had never been on the picture."""
    path = written(tmp_path / "capture")
    y, x = np.indices((SENSOR.height, SENSOR.width))
    spot, moved = np.hypot(x - 260, y - 170) < 9, np.hypot(x - 267, y - 165) < 9
    capture = read_capture(changed(path, lambda manifest: None))
    frame = capture.role("sample")[1]
    jobs = {frame.path: (bins_of(capture, frame),)}

    def means():
        shifts = {frame.path: Shift(offset=(7.0, -5.0))}
        return decode_all(capture, jobs, None, shifts, masked=Mask.of(spot))[0][frame.path].planes[0]

    clean = means()
    retouched(path, lambda above: np.where(moved, 3.0 * above + 500.0, above))
    for plane, found in means().items():
        assert found.pixels == clean[plane].pixels
        assert found.mean == clean[plane].mean


def test_a_view_that_shows_more_of_something_else_is_rejected_by_name(tmp_path):
    """Dots over most of the first view's region; the second view is used as it is."""
    path = written(tmp_path / "capture")
    y, x = np.indices((SENSOR.height, SENSOR.width))
    dots = np.hypot((x % 20) - 10, (y % 20) - 10) < 6.8
    frames = iter(range(99))

    def paint(above):
        return np.where(dots & (next(frames) < 4), 3.0 * above + 60, above)

    ingested = ingest(read_capture(retouched(path, paint)))
    assert len(ingested.rejected) == 4
    assert all("too little of the sample alone" in reason for reason in ingested.rejected.values())
    assert {sample.frame.theta_deg for sample in ingested.samples} == {62.0}
    assert not notes(ingested, "MASKED")


def board(folder, wedge_px=2.6, registration="translation"):
    """A board seen through a wedge, its angles stated as if nobody had found the board."""
    spec = standard_spec("N-BK7", shape="board", angles_deg=(50.0,))
    optics = Optics(focal_px=3.2 * LARGER.width, blur_px=0.7, wedge_px=wedge_px)
    spec = replace(spec, sensor=LARGER, optics=optics, geometry_views=0)
    path = write_capture(folder, spec)

    def change(manifest):
        manifest["geometry"] = {"kind": "stated", "s_axis_deg": 0}
        manifest["registration"] = registration
        manifest["camera"].pop("focal_length_px", None)
        for frame in manifest["frames"]:
            if frame["role"] == "sample":
                frame["theta_deg"] = 50.0

    return changed(path, change), optics


def test_a_wedge_is_followed_to_a_fiftieth_of_a_pixel(tmp_path):
    path, optics = board(tmp_path / "capture")
    capture = read_capture(path)
    frames = capture.role("sample")
    samples = {frames[0].path: bins_of(capture, frames[0]).box()}
    shifts, errors = align([[frame.path for frame in frames]], Reading(), "translation", samples)
    assert not errors
    first = optics.shift_px(frames[0].analyzer_deg)
    for frame in frames:
        wanted = np.subtract(optics.shift_px(frame.analyzer_deg), first)
        np.testing.assert_allclose(shifts[frame.path].offset, wanted, atol=0.02)
    assert math.hypot(*shifts[frames[2].path].offset) > 3.0


def test_a_frame_of_something_else_does_not_register(tmp_path):
    path, _ = board(tmp_path / "capture")
    capture = read_capture(path)
    stranger = capture.role("sample")[2]
    frame = decode(stranger.path)
    metadata = DngMetadata(
        "RGGB", 14, tuple(int(b) for b in frame.black.flat), 15871, frame.exposure_s, 100, ((1e-4, 1e-6),) * 3
    )
    noise = np.random.default_rng(0).poisson(4000.0, frame.cfa.shape)
    write_dng(stranger.path, noise.astype(np.uint16), metadata)
    ingested = ingest(capture)
    assert set(ingested.rejected) == {stranger.file}
    assert "does not register with 000.dng: correlation" in ingested.rejected[stranger.file]
    assert len(ingested.samples) == 3
