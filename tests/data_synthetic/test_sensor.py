"""The sensor against its own noise model: each tolerance is a multiple of what the counts allow."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from reflectance_fit.data_synthetic.sensor import EXPOSURES_S, Sensor, auto_exposure, expose, fixed_pattern
from reflectance_fit.errors import ReflectanceFitError

PLAIN = Sensor(
    width=256,
    height=256,
    prnu=0.0,
    dsnu_dn=0.0,
    vignetting=0.0,
    background_e_per_s=0.0,
    sensitivity_e_per_s=(1e6,) * 3,
)
SECOND = Fraction(1)
EVERYTHING = (slice(None), slice(None))


def radiance(value):
    return np.full((1, 1), value, dtype=np.float32)


def camera(sensor, seed=0):
    return fixed_pattern(sensor, np.random.default_rng(seed))


def black(sensor):
    return np.tile(np.array(sensor.black), (sensor.height // 2, sensor.width // 2))


@pytest.mark.parametrize("electrons", [3, 30, 400, 5000, 30000])
def test_mean_and_variance_follow_the_model(electrons):
    frame = expose(radiance(electrons / 1e6), SECOND, PLAIN, camera(PLAIN), np.random.default_rng(1))
    signal = frame - black(PLAIN).astype(float)
    variance = (electrons + PLAIN.read_noise_e**2) / PLAIN.gain_e_per_dn**2 + 1 / 12
    assert signal.mean() == pytest.approx(
        electrons / PLAIN.gain_e_per_dn, abs=5 * np.sqrt(variance / signal.size)
    )
    # A Poisson variable's kurtosis adds 1/electrons to the 2 of a normal one.
    spread = np.sqrt((2 + 1 / electrons) / signal.size)
    assert signal.var() == pytest.approx(variance, rel=5 * spread)
    # What the DNG states is the same variance.
    slope, offset = PLAIN.noise_profile
    span = PLAIN.white - np.mean(PLAIN.black)
    stated = slope * (electrons / PLAIN.gain_e_per_dn / span) + offset
    assert stated * span**2 == pytest.approx(variance)


def test_photon_transfer_gives_the_gain():
    sensor = replace(PLAIN, prnu=0.01, dsnu_dn=2.0)
    pixels, generator = camera(sensor), np.random.default_rng(2)
    levels = np.array([0.002, 0.005, 0.01, 0.02])
    means, variances = [], []
    for level in levels:
        a, b = (expose(radiance(level), SECOND, sensor, pixels, generator).astype(float) for _ in range(2))
        means.append(((a + b) / 2 - black(sensor)).mean())
        variances.append((a - b).var() / 2)  # the fixed pattern drops out
    slope, _ = np.polyfit(means, variances, 1)
    spread = np.sqrt(2 / (sensor.width * sensor.height))
    leverage = (means - np.mean(means)) / np.sum((means - np.mean(means)) ** 2)
    tolerance = 5 * np.sqrt(np.sum((leverage * np.array(variances) * spread) ** 2))
    assert slope == pytest.approx(1 / sensor.gain_e_per_dn, abs=tolerance)
    assert tolerance < 0.04 / sensor.gain_e_per_dn


def test_without_a_generator_the_frame_is_the_expectation():
    frame = expose(radiance(0.0022), SECOND, PLAIN, camera(PLAIN), None)
    assert np.array_equal(frame, black(PLAIN) + 1000)


@pytest.mark.parametrize("full_well_e", [10000.0, 1e6])
def test_the_well_or_the_converter_clips(full_well_e):
    sensor = replace(PLAIN, full_well_e=full_well_e, read_noise_e=10.0)
    frame = expose(radiance(10.0), SECOND, sensor, camera(sensor), np.random.default_rng(3))
    if full_well_e > 1e5:
        assert np.all(frame == sensor.white)
    else:
        # A full well reads the same up to the read noise, which comes after it.
        signal = frame - black(sensor).astype(float)
        sd = 10.0 / sensor.gain_e_per_dn
        assert signal.mean() == pytest.approx(10000 / sensor.gain_e_per_dn, abs=5 * sd / 256)
        assert signal.std() == pytest.approx(sd, rel=0.05)


def test_values_below_black_are_kept():
    frame = expose(radiance(0.0), SECOND, PLAIN, camera(PLAIN), np.random.default_rng(4))
    below = frame < black(PLAIN)
    assert 0.3 < below.mean() < 0.5


def test_each_position_of_the_cell_has_its_own_black():
    sensor = replace(PLAIN, black=((100, 200), (300, 400)))
    dark = expose(radiance(0.0), SECOND, sensor, camera(sensor), None)
    assert [int(dark[i::2, j::2].mean()) for i in (0, 1) for j in (0, 1)] == [100, 200, 300, 400]


def test_the_pattern_is_the_camera_s_and_the_noise_the_frame_s():
    sensor = replace(PLAIN, prnu=0.05, dsnu_dn=20.0)
    generator = np.random.default_rng(5)

    def noise(a, b):
        return np.corrcoef((a - black(sensor)).ravel(), (b - black(sensor)).ravel())[0, 1]

    pixels = camera(sensor)
    a, b = (expose(radiance(0.02), SECOND, sensor, pixels, generator).astype(float) for _ in range(2))
    c = expose(radiance(0.02), SECOND, sensor, camera(sensor, seed=1), generator).astype(float)
    assert not np.array_equal(a, b)
    assert noise(a, b) > 0.9
    assert abs(noise(a, c)) < 5 / 256
    # Response and offset are independent, with the spreads stated.
    assert pixels.response.std() / pixels.response.mean() == pytest.approx(0.05, rel=5 / (256 * np.sqrt(2)))
    dark = expose(radiance(0.0), SECOND, sensor, pixels, None) - black(sensor).astype(float)
    assert dark.std() == pytest.approx(np.hypot(20.0, 1 / np.sqrt(12)), rel=5 / (256 * np.sqrt(2)))


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_every_pixel_has_its_colour(pattern):
    sensor = replace(
        PLAIN, pattern=pattern, black=((0, 0), (0, 0)), sensitivity_e_per_s=(2200.0, 4400.0, 6600.0)
    )
    frame = expose(radiance(1.0), SECOND, sensor, camera(sensor), None)
    expected = {"R": 1000, "G": 2000, "B": 3000}
    for colour, (i, j) in zip(pattern, ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True):
        assert np.all(frame[i::2, j::2] == expected[colour])


def test_corners_are_darker_and_dark_current_is_not():
    sensor = replace(PLAIN, vignetting=0.25)
    pixels = camera(sensor)
    assert pixels.response[0, 0] / pixels.response[128, 128] == pytest.approx(1 / 1.25**2, rel=1e-3)
    glow = replace(sensor, background_e_per_s=2200.0)
    dark = expose(radiance(0.0), SECOND, glow, camera(glow), None)
    assert np.array_equal(dark, black(glow) + 1000)


@pytest.mark.parametrize("level", [1e-4, 0.003, 0.05, 0.5, 4.0])
def test_auto_exposure_is_the_longest_that_does_not_clip(level):
    sensor = replace(PLAIN, prnu=0.01, vignetting=0.2)
    pixels = camera(sensor)
    exposure_s = auto_exposure(radiance(level), sensor, pixels, EVERYTHING)
    frame = expose(radiance(level), exposure_s, sensor, pixels, np.random.default_rng(6))
    assert frame.max() < 0.98 * sensor.white
    if exposure_s < EXPOSURES_S[-1]:
        assert frame.max() > 0.35 * sensor.white


def test_light_beyond_every_exposure_is_an_error():
    with pytest.raises(ReflectanceFitError, match="still too long"):
        auto_exposure(radiance(1e4), PLAIN, camera(PLAIN), EVERYTHING)


@pytest.mark.parametrize(
    "wrong", [{"width": 33}, {"white": 2**14}, {"black": ((0, 0), (0, 15871))}, {"bits": 12}]
)
def test_impossible_sensors(wrong):
    with pytest.raises(ValueError, match=r"must be multiples of 2|0 <= black"):
        Sensor(**wrong)
