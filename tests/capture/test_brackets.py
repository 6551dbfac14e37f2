"""Exposure brackets become one frame, weighted as they deserve; exposures that disagree are told."""

import math
import shutil
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.brackets import merged
from reflectance_fit.capture.calibrate import Calibrated, Signals
from reflectance_fit.capture.frames import Exposure, Frame
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.linearity import complaints, departures
from reflectance_fit.capture.raw import Plane, decode
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern
from reflectance_fit.data_synthetic.spec import CaptureSpec

MONO = Plane("mono")
FRAME = Frame(
    "a.dng", Path("a.dng"), 1, None, "sample", 45.0, 0.0, 0.0, math.nan, Exposure(None, None),
    (1.0, 0.0, 0.0, 0.0), None, 0.0, "0", "0:45", ("mono",),
)  # fmt: skip


def signals(value, variance, saturated=False, unlike=0.0, rejected=False):
    value = np.atleast_1d(np.asarray(value, dtype=float))
    full = np.full_like(value, 1.0)
    return Signals(
        value=value,
        variance=full * variance + full * unlike,
        unlike=full * unlike,
        per_dn=full,
        pixels=np.full(value.shape, 100),
        saturated=np.broadcast_to(saturated, value.shape).copy(),
        rejected=np.broadcast_to(rejected, value.shape).copy(),
        theta=full,
        theta_squared=full,
        cos_2phi=full,
        sin_2phi=full,
    )


def shot(seconds, *args, frame=FRAME, **kwargs):
    return Calibrated(frame, Exposure(Fraction(seconds), 100), Region(), {MONO: signals(*args, **kwargs)})


@given(
    rows=st.lists(
        st.tuples(st.integers(1, 1000), st.floats(1, 100), st.floats(1e-3, 10)),
        min_size=2,
        max_size=5,
        unique_by=lambda row: row[0],
    ),
    unlike=st.sampled_from([0.0, 0.5]),
)
def test_weights_are_those_of_least_variance(rows, unlike):
    """Slow and apart from the code: the solution of A x = b for one constant, with a common covariance added."""
    (one,) = merged([shot(s, v, var, unlike=unlike) for s, v, var in rows])
    inverse = np.linalg.inv(np.diag([var for *_, var in rows]))
    ones = np.ones(len(rows))
    expected = ones @ inverse @ [v for _, v, _ in rows] / (ones @ inverse @ ones)
    weights = inverse @ ones / (ones @ inverse @ ones)
    covariance = np.diag([var for *_, var in rows]) + unlike
    assert one.signals[MONO].value[0] == pytest.approx(expected)
    assert one.signals[MONO].variance[0] == pytest.approx(weights @ covariance @ weights)
    assert one.exposure.seconds == max(s for s, *_ in rows)


def test_clipped_bins_come_from_the_others():
    long = shot(4, [10, 20, 30], 1.0, saturated=[False, True, True])
    short = shot(1, [11, 22, 33], 4.0, saturated=[False, False, True])
    for view in ([long, short], [short, long]):
        (one,) = merged(view)
        found = one.signals[MONO]
        np.testing.assert_allclose(found.value, [(10 + 11 / 4) / (1 + 1 / 4), 22, 33])
        np.testing.assert_allclose(found.variance, [1 / (1 + 1 / 4), 4, 4])
        assert found.saturated.tolist() == [False, False, True]


def test_rejected_bins_come_from_the_others():
    (one,) = merged(
        [shot(4, [10, 20], 1.0, rejected=[True, True]), shot(1, [11, 22], 4.0, rejected=[False, True])]
    )
    assert one.signals[MONO].value.tolist() == [11, 22]
    assert one.signals[MONO].rejected.tolist() == [False, True]
    assert one.signals[MONO].saturated.tolist() == [False, False]


def test_without_known_noise_light_counts():
    (one,) = merged([shot(3, 10, math.nan), shot(1, 14, math.nan)])
    assert one.signals[MONO].value[0] == pytest.approx((3 * 10 + 14) / 4)
    assert math.isnan(one.signals[MONO].variance[0])


def test_what_stays_apart():
    alike = [shot(1, 10, 1.0), shot(1, 11, 1.0)]
    assert merged(alike) == alike
    # A file's 1/60 and a manifest's 0.0167 are one setting.
    same = [shot(Fraction(1, 60), 10, 1.0), shot(Fraction("0.0167"), 11, 1.0)]
    assert merged(same) == same
    for key, value in (("theta_deg", 46.0), ("analyzer_deg", 1.0), ("set", "1"), ("channels", ("x",))):
        other = replace(FRAME, **{key: value})
        assert len(merged([shot(1, 10, 1.0), shot(2, 10, 1.0, frame=other)])) == 2
    other = replace(FRAME, file="b.dng", path=Path("b.dng"), line=9, sha256="0" * 64)
    assert len(merged([shot(1, 10, 1.0), shot(2, 10, 1.0, frame=other)])) == 1


@given(
    level=st.floats(10, 1e4),
    seconds=st.lists(st.integers(1, 200), min_size=2, max_size=5, unique=True),
    seed=st.integers(0, 10**6),
)
def test_a_linear_sensor_is_not_complained_of(level, seconds, seed):
    generator = np.random.default_rng(seed)
    sd = 1e-3 * level
    views = [(Fraction(s), signals(level + generator.normal(0, sd, 6), sd**2)) for s in seconds]
    assert list(complaints(departures(views), "it")) == []
    # Noise of any size is no departure either.
    sd = 0.1 * level
    views = [(Fraction(s), signals(level + generator.normal(0, sd, 6), sd**2)) for s in seconds]
    assert list(complaints(departures(views), "it")) == []


def test_departures_have_the_sigma_they_scatter_with():
    generator = np.random.default_rng(0)
    variances = (4.0, 1.0, 0.25)
    pulls = []
    for _ in range(600):
        views = [
            (Fraction(i + 1), signals(1000 + generator.normal(0, v**0.5, 5), v))
            for i, v in enumerate(variances)
        ]
        pulls.append([d.share / d.sigma for d in departures(views)])
    # 600 draws know a standard deviation to 3 %.
    np.testing.assert_allclose(np.std(pulls, axis=0), 1.0, atol=0.1)


@pytest.mark.parametrize("bend", [0.02, -0.05])
def test_a_bent_sensor_is_told(bend):
    """Response x + bend x^2 over the range to 1."""
    views = [(Fraction(t, 10), signals((t / 10 + bend * (t / 10) ** 2) / (t / 10), 1e-8)) for t in (1, 3, 9)]
    (text,) = complaints(departures(views), "a.dng, G")
    assert "a.dng, G: the signal a second is" in text
    spread = abs(bend) * 0.8 / (1 + bend * (0.1 + 0.3 + 0.9) / 3)
    assert f"{100 * spread:.1f} % higher at" in text
    assert "powers of 2" not in text


def test_times_that_cameras_round():
    """1/60 stands for 1/64, 1/30 for 1/32, 1/125 for 1/128: a ramp of its own, with a remedy."""
    stated = (Fraction(1, 15), Fraction(1, 30), Fraction(1, 60), Fraction(1, 125))
    true = (Fraction(1, 16), Fraction(1, 32), Fraction(1, 64), Fraction(1, 128))
    views = [(s, signals(100 * float(t / s), 1e-6)) for s, t in zip(stated, true, strict=True)]
    (text,) = complaints(departures(views), "it")
    assert "state exposure_s" in text
    assert "1/125 s" in text


def test_what_tells_nothing():
    assert departures([(Fraction(1), signals(5, 1.0))]) == []
    assert departures([(Fraction(1), signals(5, 1.0)), (Fraction(2), signals(9, 1.0, saturated=True))]) == []
    assert departures([(Fraction(1), signals(-5, 1.0)), (Fraction(2), signals(-9, 1.0))]) == []
    # Dim bins are left to the black level.
    views = [(Fraction(1), signals([1000, 1], 1e-4)), (Fraction(2), signals([1000, 9], 1e-4))]
    assert list(complaints(departures(views), "it")) == []


SENSOR = Sensor(width=96, height=64)
SPEC = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=SENSOR, seed=4)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glass")
    write_capture(folder, SPEC)
    return folder


def frame_entries(capture):
    return yaml.safe_load(capture.read_text())["frames"]


def with_frames(capture, extra):
    data = yaml.safe_load(capture.read_text())
    data["frames"] += extra
    capture.write_text(yaml.safe_dump(data, sort_keys=False))


def again(capture, number, factor, name):
    """Frame ``number`` photographed once more at ``factor`` times its exposure: its light read back from the file."""
    entry = frame_entries(capture)[number]
    first = decode(capture.parent / entry["file"])
    black = np.tile(first.black, (SENSOR.height // 2, SENSOR.width // 2))
    rate = (first.cfa - black) * SENSOR.gain_e_per_dn / float(first.exposure_s)
    generator = np.random.default_rng(99)
    pixels = fixed_pattern(replace(SENSOR, prnu=0.0, dsnu_dn=0.0, vignetting=0.0), generator)
    light = (rate - pixels.background).clip(0) / pixels.response
    seconds = first.exposure_s * factor
    cfa = expose(light.astype(np.float32), seconds, SENSOR, pixels, generator)
    pair = SENSOR.noise_profile
    metadata = DngMetadata("RGGB", 14, tuple(np.ravel(SENSOR.black)), SENSOR.white, seconds, 100, (pair,) * 3)
    write_dng(capture.parent / name, cfa, metadata)
    kept = {k: v for k, v in entry.items() if k not in ("sha256", "exposure_s", "file")}
    return kept | {"file": name}


def test_a_capture_with_brackets(original, tmp_path):
    """A long frame that clips adds nothing, a short one adds a little; rows stay as many."""
    shutil.copytree(original, tmp_path / "c")
    capture = tmp_path / "c" / "capture.yaml"
    plain = ingest(read_capture(capture))
    with_frames(
        capture, [again(capture, 0, Fraction(1, 4), "raw/short.dng"), again(capture, 1, 64, "raw/long.dng")]
    )
    found = ingest(read_capture(capture))
    assert len(found.samples) == len(plain.samples) + 2
    assert not any(w.code == "NOT_LINEAR" for w in found.measurement.warnings)
    one, other = plain.measurement.observations, found.measurement.observations
    assert len(one) == len(other)
    assert (other.flag == "used").all()
    values, merged_values, sigma, merged_sigma = one.value, other.value, one.sigma, other.sigma
    changed = values != merged_values
    assert changed.sum() == 3  # the channels of frame 0
    assert (merged_sigma[changed] < sigma[changed]).all()
    np.testing.assert_allclose(merged_values, values, atol=5 * sigma.max())
    np.testing.assert_array_equal(merged_sigma[~changed], sigma[~changed])


def test_a_capture_whose_exposures_lie_is_told(original, tmp_path):
    shutil.copytree(original, tmp_path / "c")
    capture = tmp_path / "c" / "capture.yaml"
    entry = again(capture, 0, Fraction(1, 4), "raw/short.dng")
    seconds = float(Fraction(frame_entries(capture)[0]["exposure_s"]))
    with_frames(capture, [entry | {"exposure_s": seconds / 4 * 1.05}])
    notes = [w.message for w in ingest(read_capture(capture)).measurement.warnings if w.code == "NOT_LINEAR"]
    assert [note.split(":")[0] for note in notes] == [
        f"{frame_entries(capture)[0]['file']}, raw/short.dng, {c}" for c in "RGB"
    ]
    for note in notes:
        share = float(note.split("signal a second is ")[1].split(" %")[0])
        assert share == pytest.approx(5, abs=1.5)


def test_hot_pixels_of_a_dark_leave_every_frame(original, tmp_path):
    """A clipped pixel in the region shifts nothing, and is not counted."""
    shutil.copytree(original, tmp_path / "c")
    capture = tmp_path / "c" / "capture.yaml"
    data = yaml.safe_load(capture.read_text())
    plain = ingest(read_capture(capture)).measurement.observations
    x0, y0, _, _ = data["region"]
    pair = SENSOR.noise_profile
    for entry in data["frames"]:
        frame = decode(tmp_path / "c" / entry["file"])
        cfa = frame.cfa.copy()
        cfa[y0 + 4, x0 + 4] = SENSOR.white  # red, as the corner of the region is
        metadata = DngMetadata(
            "RGGB", 14, tuple(np.ravel(SENSOR.black)), SENSOR.white, frame.exposure_s, 100, (pair,) * 3
        )
        write_dng(tmp_path / "c" / entry["file"], cfa, metadata)
        del entry["sha256"]
    capture.write_text(yaml.safe_dump(data, sort_keys=False))
    found = ingest(read_capture(capture)).measurement.observations
    assert (found.flag == "used").all()
    red = found.channel == "R"
    np.testing.assert_array_equal(found.pixels[red], plain.pixels[red] - 1)
    np.testing.assert_array_equal(found.pixels[~red], plain.pixels[~red])
    np.testing.assert_array_equal(found.value[~red], plain.value[~red])
    # The pixel's own value is missing from the mean: less than a sixtieth of its noise.
    np.testing.assert_allclose(found.value[red], plain.value[red], atol=plain.sigma.max())
