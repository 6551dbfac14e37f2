"""From a frame's means to rows: every step against its formula, and sigma against repeated frames."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from reflectance_fit.capture.bins import Region, SphereBins
from reflectance_fit.capture.calibrate import calibrate
from reflectance_fit.capture.frames import Exposure
from reflectance_fit.capture.observe import angle_rows, flat_rows
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reduce import reduce_frame
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern

FLAT = """schema: reflectance_fit/capture/1
sample: {name: glass}
camera:
  sensor: bayer
  channels: {R: {wavelength_nm: 600}, G: {wavelength_nm: 550}, B: {wavelength_nm: 450}}
  noise: {gain_e_per_dn: {R: 2, G: 4, B: 5}, read_noise_e: {R: 3, G: 8, B: 0}}
polarizer: {diattenuation: {R: 0.9, G: 0.95, B: 1}}
retarder: {retardance_deg: {R: 80, G: 90, B: 100}}
geometry: {kind: stated, s_axis_deg: 30}
frames:
  - {file: a.dng, theta_deg: 45, analyzer_deg: 10, theta_deg_sigma: 0.25}
  - {file: b.dng, theta_deg: 45, analyzer_deg: 100, retarder_deg: 7}
  - {file: c.dng, theta_deg: 60, analyzer_deg: 10, s_axis_deg: -5, channel: G, set: x, light: {circular: right}}
"""
SPHERE = """schema: reflectance_fit/capture/1
sample: {name: ball}
camera: {sensor: mono, channels: {"550": {wavelength_nm: 550}}}
light: {shape: surround, uniform: true}
geometry: {kind: sphere, sphere: {center_px: [31.3, 24.2], radius_px: 20}}
frames:
  - {file: a.dng, analyzer_deg: 0}
  - {file: b.dng, analyzer_deg: 60}
  - {file: c.dng, analyzer_deg: 120}
"""


class OfPoints(SphereBins):
    """A ball seen by pixels without an area, as the pictures here are drawn."""

    __slots__ = ()

    @property
    def curvature(self):
        return 0.0


BALL = OfPoints(31.3, 24.2, 20.0, 0.0, tuple(np.radians([8.0, 30.0, 50.0, 76.0])), 6)
ALL = Region()
SENSOR = Sensor(width=64, height=48, prnu=0.0, dsnu_dn=0.0)


def capture_of(folder, text):
    for name in "abc":
        (folder / f"{name}.dng").touch()
    (folder / "capture.yaml").write_text(text)
    return read_capture(folder / "capture.yaml")


def means_of(cfa, bins=ALL, sensor=SENSOR, *, mono=False, profile=None, is_flat=False):
    names = np.full((2, 2), "mono") if mono else np.array(list(sensor.pattern)).reshape(2, 2)
    black, white = np.array(sensor.black, dtype=float), np.full((2, 2), float(sensor.white))
    if np.ndim(cfa) == 0:
        cfa = np.full((sensor.height, sensor.width), cfa)
    if profile == "sensor":
        profile = dict.fromkeys(set(names.flat), sensor.noise_profile)
    return reduce_frame(
        RawFrame(cfa, names, np.full((2, 2), np.nan), black, white, None, None, profile), (bins,), is_flat
    )


def above_black(dn):
    return np.tile(np.array(SENSOR.black) + dn, (24, 32)).astype(np.uint16)


def test_darks_exposure_and_sigma_by_their_formulas(tmp_path):
    capture = capture_of(tmp_path, FLAT)
    frame = capture.frames[0]
    darks = [means_of(above_black(dn)) for dn in (4, 10)]
    found = calibrate(
        capture, frame, Exposure(0.25, 100), Region(), means_of(above_black(1007)), darks, []
    ).signals
    for name, pixels, gain, read in (("R", 768, 2, 3), ("G", 1536, 4, 8), ("B", 768, 5, 0)):

        def variance(dn, gain=gain, read=read):
            return dn / gain + (read / gain) ** 2 + 1 / 12

        expected = (variance(1007) + (variance(4) + variance(10)) / 4) / pixels / 0.25**2
        signals = found[Plane(name)]
        assert signals.value == pytest.approx([4000.0])
        assert signals.variance == pytest.approx([expected])
        assert signals.pixels == [pixels]
        assert not signals.saturated


def test_without_darks_the_black_level_counts_and_a_signal_may_be_negative(tmp_path):
    capture = capture_of(tmp_path, FLAT)
    found = calibrate(
        capture, capture.frames[0], Exposure(1.0, 100), Region(), means_of(above_black(-3)), [], []
    )
    assert found.signals[Plane("R")].value == pytest.approx([-3.0])
    assert found.signals[Plane("R")].variance == pytest.approx([(9 / 4 + 1 / 12) / 768])


def test_flats_divide(tmp_path):
    capture = capture_of(tmp_path, FLAT)
    flats = [
        (means_of(above_black(2010)), 0.5, [means_of(above_black(10))]),
        (means_of(above_black(3000)), 0.5, []),
    ]
    arguments = (capture, capture.frames[0], Exposure(1.0, 100), Region(), means_of(above_black(1000)), [])
    divided, plain = (calibrate(*arguments, f).signals[Plane("R")] for f in (flats, []))
    assert divided.value == pytest.approx([1000 / 5000])
    assert np.sqrt(divided.variance) / divided.value == pytest.approx(np.sqrt(plain.variance) / plain.value)


def test_noise_of_the_file_of_the_flats_and_of_none(tmp_path):
    capture = replace(capture_of(tmp_path, FLAT), noise=None)
    frame, exposure = capture.frames[0], Exposure(1.0, 100)
    lit = above_black(1000)

    def variance(means, darks=(), flats=()):
        return (
            calibrate(capture, frame, exposure, Region(), means, darks, flats).signals[Plane("R")].variance[0]
        )

    slope, floor = SENSOR.noise_profile
    span = 15871 - 512
    of_file = variance(means_of(lit, profile=dict.fromkeys("RGB", (slope, floor))))
    assert of_file == pytest.approx((slope * span * 1000 + floor * span**2) / 768)
    assert math.isnan(variance(means_of(lit)))
    # From how pixels scatter in a flat and a dark.
    generator = np.random.default_rng(1)
    sensor = replace(SENSOR, vignetting=0.0)
    pixels = fixed_pattern(sensor, generator)
    white, black = (
        means_of(
            expose(np.full((1, 1), level, dtype=np.float32), Fraction(1, 2000), sensor, pixels, generator)
        )
        for level in (0.9, 0.0)
    )
    level = white.scatter[Plane("R")][0]
    expected = variance(means_of(lit, profile=dict.fromkeys("RGB", (slope, floor))), [black])
    assert variance(means_of(lit), [black], [(white, 1.0, [])]) * level**2 == pytest.approx(
        expected, rel=0.25
    )


def test_a_bin_is_saturated_from_one_pixel_in_a_thousand(tmp_path):
    capture = capture_of(tmp_path, FLAT)
    for clipped, flag in ((0, False), (1, True)):
        cfa = above_black(1000)
        cfa[0, 0] = SENSOR.white if clipped else 1000  # R
        found = calibrate(capture, capture.frames[0], Exposure(1.0, 100), Region(), means_of(cfa), [], [])
        assert [bool(found.signals[Plane(n)].saturated[0]) for n in "RGB"] == [flag, False, False]
        assert found.saturated_share == (0.25 if flag else 0.0)
        assert flat_rows(capture, [found]).flag.tolist() == (
            ["saturated", "used", "used"] if flag else ["used"] * 3
        )
    hot = Sensor(width=128, height=96)
    cfa = np.full((96, 128), 1000, dtype=np.uint16)
    cfa[0, 0] = hot.white
    means = means_of(cfa, sensor=hot)  # one R of 3072
    found = calibrate(capture, capture.frames[0], Exposure(1.0, 100), Region(), means, [], [])
    assert not found.signals[Plane("R")].saturated


def test_rows_of_a_flat_sample(tmp_path):
    capture = capture_of(tmp_path, FLAT)
    samples = [
        calibrate(capture, frame, Exposure(1.0, 100), Region(), means_of(above_black(100 * (i + 1))), [], [])
        for i, frame in enumerate(capture.frames)
    ]
    rows = flat_rows(capture, samples)
    assert rows.channel.tolist() == ["R", "R", "G", "G", "G", "B", "B"]
    assert rows.value.tolist() == pytest.approx([100, 200, 100, 200, 300, 100, 200])
    assert rows.analyzer_deg.tolist() == [-20, 70, -20, 70, 15, -20, 70]
    assert rows.retarder_deg.tolist() == pytest.approx(
        [math.nan, -23, math.nan, -23, math.nan, math.nan, -23], nan_ok=True
    )
    assert rows.retardance_deg.tolist() == pytest.approx(
        [math.nan, 80, math.nan, 90, math.nan, math.nan, 100], nan_ok=True
    )
    assert rows.diattenuation.tolist() == [0.9, 0.9, 0.95, 0.95, 0.95, 1, 1]
    assert rows.gain_group.tolist() == ["0:45", "0:45", "0:45", "0:45", "x:60", "0:45", "0:45"]
    assert rows.theta_deg_sigma.tolist() == [0.25, 0, 0.25, 0, 0, 0.25, 0]
    assert rows.light[4].tolist() == [1, 0, 0, 1]
    assert rows.light[0].tolist() == [1, 0, 0, 0]
    assert not rows.theta_deg_spread.any()
    assert rows.wavelength_nm.tolist() == [600, 600, 550, 550, 550, 450, 450]


def sphere_samples(capture, frames, **options):
    """One Calibrated a frame; mono, so every pixel counts."""
    out = []
    for frame, cfa in zip(capture.frames, frames, strict=True):
        bins = replace(BALL, analyzer=math.radians(frame.analyzer_deg))
        means = means_of(cfa, bins, mono=True, profile="sensor")
        out.append(calibrate(capture, frame, Exposure(1.0, 100), bins, means, [], []))
    return out


def linear_picture(analyzer_deg, a=2000.0, b=800.0, c=-500.0):
    """a + b cos 2 phi + c sin 2 phi above black, phi the analyzer's angle from the ball's tangent."""
    y, x = np.mgrid[:48, :64]
    phi = math.radians(analyzer_deg) - np.arctan2(24.2 - y, x - 31.3) - math.pi / 2
    return np.rint(a + b * np.cos(2 * phi) + c * np.sin(2 * phi) + np.tile(SENSOR.black, (24, 32)))


def test_a_sphere_s_rows_are_exact_for_what_is_linear_in_cos_and_sin(tmp_path):
    capture = capture_of(tmp_path, SPHERE)
    rows = angle_rows(capture, sphere_samples(capture, [linear_picture(a) for a in (0, 60, 120)]))
    assert len(rows) == 18
    assert (rows.diattenuation < 1).all()  # a sector of 30 degrees: sin(30) / radians(30)
    assert rows.diattenuation == pytest.approx(np.full(18, 0.955), abs=0.03)
    phi = np.radians(rows.analyzer_deg)
    expected = 2000 + rows.diattenuation * (800 * np.cos(2 * phi) - 500 * np.sin(2 * phi))
    assert rows.value == pytest.approx(expected, abs=0.2)
    assert np.unique(rows.gain_group).tolist() == ["0"]
    assert rows.pixels.sum() == sum(
        reduce_frame_pixels(capture, frame.analyzer_deg) for frame in capture.frames
    )
    # The three frames see a ring alike, so the middle of a ring is nearly that of its area.
    assert np.all(np.diff(rows.theta_deg.reshape(3, 6).mean(axis=1)) > 10)
    assert np.all(rows.theta_deg_spread > 2)


def test_a_flat_weighs_the_angles_of_a_bin(tmp_path):
    """Light that doubles across the picture: exact for what is linear in theta, in a bin of any width."""
    capture = capture_of(tmp_path, SPHERE)
    y, x = np.mgrid[:48, :64]
    theta = np.arcsin(np.minimum(np.hypot(x - 31.3, y - 24.2) / 20, 1))
    light = 4000 * (1 + x / 64)
    black = np.tile(SENSOR.black, (24, 32))
    flat = means_of(np.rint(light + black).astype(np.uint16), BALL, mono=True, is_flat=True)
    seen = means_of(np.rint(light * (0.5 + theta) + black).astype(np.uint16), BALL, mono=True)
    (found,) = calibrate(
        capture, capture.frames[0], Exposure(1.0, 100), BALL, seen, [], [(flat, 1.0, [])]
    ).signals.values()
    # Rounding of a pixel, 0.3 DN of 4000, averages out over the 30 and more of a bin.
    assert found.value == pytest.approx(0.5 + found.theta, rel=3e-5)


def reduce_frame_pixels(_capture, analyzer_deg):
    bins = replace(BALL, analyzer=math.radians(analyzer_deg))
    return int(means_of(1000, bins, mono=True).over(bins)[Plane("mono")].pixels.sum())


def test_a_clipped_frame_is_left_out_of_the_pool_and_a_bin_that_clips_everywhere_says_so(tmp_path):
    capture = capture_of(tmp_path, SPHERE)
    pictures = [linear_picture(a) for a in (0, 60, 120)]
    whole = angle_rows(capture, sphere_samples(capture, pictures))
    pictures[1] = np.full((48, 64), SENSOR.white)
    rows = angle_rows(capture, sphere_samples(capture, pictures))
    assert (rows.flag == "used").all()
    assert (rows.pixels < whole.pixels).all()
    phi = np.radians(rows.analyzer_deg)
    expected = 2000 + rows.diattenuation * (800 * np.cos(2 * phi) - 500 * np.sin(2 * phi))
    assert rows.value == pytest.approx(expected, abs=0.3)
    rows = angle_rows(capture, sphere_samples(capture, [np.full((48, 64), SENSOR.white)] * 3))
    assert len(rows) == 18
    assert (rows.flag == "saturated").all()
    assert rows.pixels.tolist() == whole.pixels.tolist()


def test_each_ring_has_a_gain_of_its_own_unless_the_surround_is_uniform(tmp_path):
    capture = capture_of(tmp_path, SPHERE.replace(", uniform: true", ""))
    rows = angle_rows(capture, sphere_samples(capture, [linear_picture(a) for a in (0, 60, 120)]))
    assert rows.gain_group.tolist() == [f"0:ring {i}" for i in range(3) for _ in range(6)]


def within_5_sigma_of_1(z):
    """``z`` of shape (repeats, rows): pooled variance about each row's mean against that of a normal."""
    degrees = (len(z) - 1) * z.shape[1]
    variance = np.sum((z - z.mean(axis=0)) ** 2) / degrees
    return abs(variance - 1) < 5 * math.sqrt(2 / degrees), variance


@pytest.mark.parametrize("stated", [False, True])
@pytest.mark.parametrize("radiance", [0.0, 0.01, 0.8])
def test_sigma_of_repeated_frames_of_a_flat_sample(tmp_path, radiance, stated):
    capture = capture_of(
        tmp_path, FLAT.replace("{R: 2, G: 4, B: 5}", "2.2").replace("{R: 3, G: 8, B: 0}", "3")
    )
    capture = capture if stated else replace(capture, noise=None)
    sensor = replace(SENSOR, prnu=0.01, dsnu_dn=2.0)
    generator = np.random.default_rng(11)
    pixels, exposure = fixed_pattern(sensor, generator), Fraction(1, 2000)

    def shot(level):
        picture = expose(np.full((1, 1), level, dtype=np.float32), exposure, sensor, pixels, generator)
        return means_of(picture, sensor=sensor, profile="sensor")

    rows = []
    for _ in range(300):
        darks = [shot(0.0), shot(0.0)]
        found = calibrate(
            capture, capture.frames[0], Exposure(float(exposure), 100), Region(), shot(radiance), darks, []
        )
        rows.append(flat_rows(capture, [found]))
    sigma = np.stack([r.sigma for r in rows])
    good, variance = within_5_sigma_of_1(np.stack([r.value for r in rows]) / sigma.mean(axis=0))
    assert good, variance


@pytest.mark.parametrize(("prnu", "flats"), [(0.005, 0), (0.0, 1), (0.005, 1), (0.02, 1), (0.005, 4)])
def test_sigma_of_a_sphere_seen_by_one_camera_after_another(tmp_path, prnu, flats):
    """A bin has its own pixels, so their differences count, and with flats the noise of those instead."""
    capture = capture_of(tmp_path, SPHERE)
    sensor = replace(SENSOR, prnu=prnu, pattern="RGGB", sensitivity_e_per_s=(4e7, 4e7, 4e7), vignetting=0.0)
    generator = np.random.default_rng(12)
    frame, exposure = capture.frames[0], Fraction(1, 2000)
    values, sigmas = [], []
    for _ in range(150):
        pixels = fixed_pattern(sensor, generator)

        def shot(level, pixels=pixels):
            picture = expose(np.full((1, 1), level, dtype=np.float32), exposure, sensor, pixels, generator)
            return means_of(picture, BALL, sensor, mono=True, profile="sensor")

        white = [(shot(1.0), float(exposure), []) for _ in range(flats)]
        rows = angle_rows(
            capture,
            [calibrate(capture, frame, Exposure(float(exposure), 100), BALL, shot(1.2), [], white)],
        )
        values.append(rows.value)
        sigmas.append(rows.sigma)
    good, variance = within_5_sigma_of_1(np.stack(values) / np.mean(sigmas, axis=0))
    assert good, variance


def test_a_mono_sensor_gives_its_one_channel_all_pixels(tmp_path):
    text = FLAT.replace("sensor: bayer", "sensor: mono")
    for old, new in (
        (
            "{R: {wavelength_nm: 600}, G: {wavelength_nm: 550}, B: {wavelength_nm: 450}}",
            "{G: {wavelength_nm: 550}}",
        ),
        ("{R: 2, G: 4, B: 5}", "4"),
        ("{R: 3, G: 8, B: 0}", "8"),
        ("{R: 0.9, G: 0.95, B: 1}", "0.95"),
        ("{R: 80, G: 90, B: 100}", "90"),
    ):
        assert old in text
        text = text.replace(old, new)
    capture = capture_of(tmp_path, text)
    means = means_of(above_black(1000), mono=True)
    rows = flat_rows(
        capture, [calibrate(capture, capture.frames[0], Exposure(0.5, 100), Region(), means, [], [])]
    )
    assert rows.channel.tolist() == ["G"]
    assert rows.pixels.tolist() == [64 * 48]
    assert rows.value.tolist() == pytest.approx([2000.0])
    assert rows.sigma.tolist() == pytest.approx([math.sqrt((1000 / 4 + 4 + 1 / 12) / 3072) / 0.5])
