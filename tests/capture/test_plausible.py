"""Damage and wrong levels are seen; photographs of any scene, exposure, noise and sensor pass."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d

from reflectance_fit.capture.plausible import implausible
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern

SENSOR = Sensor(width=384, height=256)
BLACK = np.array(SENSOR.black, dtype=float)
WHITE = np.full((2, 2), float(SENSOR.white))


def scene(seed: int, detail: float) -> np.ndarray:
    """Light with edges in it, 0 to 1: as sharp as a lens, not as single pixels."""
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[0 : SENSOR.height, 0 : SENSOR.width] / SENSOR.width
    waves = sum(np.sin(detail * (a * x + b * y) + c) for a, b, c in generator.normal(0, 3, (6, 3)))
    return np.clip(0.3 + 0.1 * waves + 0.3 * (waves > 1), 0.0, 1.0).astype(np.float32)


def photograph(light=None, exposure_s=Fraction(1, 1500), sensor=SENSOR, seed=0):
    generator = np.random.default_rng(seed)
    light = scene(seed, 5.0) if light is None else light
    return expose(light, exposure_s, sensor, fixed_pattern(sensor, generator), generator)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    detail=st.sampled_from([0.5, 5.0, 15.0]),
    denominator=st.sampled_from([4, 100, 1500, 8000, 10**6]),
    gain=st.sampled_from([0.05, 0.5, 2.2, 20.0]),
    read=st.sampled_from([0.5, 3.0, 30.0]),
    bits=st.sampled_from([12, 14, 16]),
)
def test_photographs_pass(seed, detail, denominator, gain, read, bits):
    """From a dark to a clipped frame, 800 to 300 000 electrons full, noise of 0.03 to 600 DN."""
    white = 2**bits - 1 if bits < 16 else 15871
    well = gain * white
    # Read noise that alone would fill the range is no camera's.
    sensor = replace(
        SENSOR,
        bits=bits,
        white=white,
        gain_e_per_dn=gain,
        read_noise_e=min(read, 0.01 * well),
        full_well_e=2 * well,
        sensitivity_e_per_s=(700 * well,) * 3,
    )
    frame = photograph(scene(seed, detail), Fraction(1, denominator), sensor, seed)
    assert implausible(frame, BLACK, np.full((2, 2), float(white))) is None


@pytest.mark.parametrize("exposure_s", [Fraction(1, 10**6), Fraction(1, 1500), Fraction(1, 100)])
def test_of_a_sensor_with_black_taken_off_already(exposure_s):
    """Half of a dark frame is then 0."""
    frame = photograph(exposure_s=exposure_s).astype(int) - np.tile(SENSOR.black, (128, 192))
    assert implausible(frame.clip(0).astype(np.uint16), np.zeros((2, 2)), WHITE - BLACK) is None


def test_the_first_pixels_of_larger_cells():
    frame = photograph()
    assert implausible(frame, np.tile(BLACK, (2, 2)), np.tile(WHITE, (2, 2))) is None
    frame[200:] = 0
    assert "are 0" in implausible(frame, np.tile(BLACK, (2, 2)), np.tile(WHITE, (2, 2)))


@pytest.mark.parametrize("rows", [slice(-2, None), slice(100, 140), slice(0, 250)])
def test_zeros_where_rows_are_lost(rows):
    frame = photograph()
    frame[rows] = 0
    assert "many of its pixels are 0" in implausible(frame, BLACK, WHITE)


def test_dead_pixels_are_not_lost_rows():
    frame = photograph()
    frame.ravel()[np.random.default_rng(0).choice(frame.size, 5, replace=False)] = 0
    assert implausible(frame, BLACK, WHITE) is None


@pytest.mark.parametrize("value", [1, 700, 2000])
def test_an_end_of_one_value(value):
    frame = photograph()
    frame[-40:] = value
    assert implausible(frame, BLACK, WHITE) is not None
    if value == 2000:
        assert "its end is lost" in implausible(frame, BLACK, WHITE)


def test_a_clipped_end_is_none():
    light = scene(0, 5.0)
    light[-60:] = 30.0
    assert implausible(photograph(light), BLACK, WHITE) is None


@pytest.mark.parametrize(
    ("black", "white", "message"),
    [
        (BLACK + 9000, WHITE, "is above the picture"),
        (np.full((2, 2), 2048.0), np.full((2, 2), 15000.0), "far below its black level"),
        (BLACK, np.full((2, 2), 1500.0), "far above its white level 1500; state camera.white_dn"),
        (BLACK, BLACK, "is not below its white level"),
        (BLACK, np.full((2, 2), np.nan), "is not below its white level"),
    ],
)
def test_levels_that_cannot_be(black, white, message):
    light = scene(3, 5.0)
    light[:, :60] = 0.0  # some shadow
    assert message in implausible(photograph(light), black, white)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_bytes_of_something_else(bits):
    """Compressed or encrypted data read as pixels: even over the whole range."""
    noise = np.random.default_rng(0).integers(0, 2**bits, (256, 384), dtype=np.uint16)
    reason = implausible(noise, np.zeros((2, 2)), np.full((2, 2), 2.0**bits - 1))
    assert "its pixels are noise" in reason


def test_a_photograph_in_the_wrong_byte_order():
    frame = (photograph() - 500).clip(0, 4095).astype(np.uint16)
    assert implausible(frame, np.zeros((2, 2)), np.full((2, 2), 65535.0)) is None
    assert "its pixels are noise" in implausible(frame.byteswap(), np.zeros((2, 2)), np.full((2, 2), 65535.0))


def test_packed_12_bits_read_as_16():
    frame = (photograph() // 4).astype(np.uint16)
    high, low = frame[:, 0::2], frame[:, 1::2]
    packed = np.stack([high >> 4, (high & 15) << 4 | low >> 8, low & 255], axis=-1).astype(np.uint8)
    wrong = packed.reshape(256, -1).view("<u2")
    assert implausible(frame, BLACK // 4, WHITE // 4) is None
    assert "its pixels are noise" in implausible(wrong, np.zeros((2, 2)), np.full((2, 2), 65535.0))


LARGE = replace(SENSOR, width=1280, height=512)


def large_scene(seed: int, detail: float) -> np.ndarray:
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[0 : LARGE.height, 0 : LARGE.width] / LARGE.width
    waves = sum(np.sin(detail * (a * x + b * y) + c) for a, b, c in generator.normal(0, 3, (6, 3)))
    return np.clip(0.3 + 0.1 * waves + 0.3 * (waves > 1), 0.0, 1.0).astype(np.float32)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**16), first=st.integers(80, 450), offset=st.sampled_from([80.0, 300.0]))
def test_what_goes_on_downwards_is_damage(seed, first, offset):
    """As lossless JPEG leaves it: each column is off by something, more than its noise of 50, from a row on."""
    frame = photograph(large_scene(seed, 5.0), sensor=LARGE, seed=seed).astype(int)
    assert implausible(frame.astype(np.uint16), BLACK, WHITE) is None
    columns = np.random.default_rng(seed).normal(0, offset, LARGE.width)
    frame[first:] += np.rint(columns).astype(int)
    frame = frame.clip(0, SENSOR.white).astype(np.uint16)
    assert "repeat those above" in (implausible(frame, BLACK, WHITE) or "")


@pytest.mark.parametrize("pitch", [3, 5, 8, 17, 40])
@pytest.mark.parametrize("noise", [True, False])
def test_a_ruler_across_the_lower_half_is_no_damage(pitch, noise):
    """Upright lines from some row to the end."""
    x = np.arange(LARGE.width)
    lines = 0.25 + 0.5 / (1 + np.exp(-4 * np.cos(2 * np.pi * x / pitch)))
    assert implausible(lower_half(lines, noise), BLACK, WHITE) is None


@pytest.mark.parametrize("blur", [0.7, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_metal_brushed_upright_is_no_damage(blur, seed):
    """Lines of every width that a lens of some blur shows, pixels (1 sd)."""
    lines = gaussian_filter1d(np.random.default_rng(seed).normal(size=LARGE.width), blur)
    assert implausible(lower_half(0.4 + 0.06 * lines, True), BLACK, WHITE) is None


def lower_half(lines, noise):
    light = np.full((LARGE.height, LARGE.width), 0.4, dtype=np.float32)
    light[240:] = lines
    generator = np.random.default_rng(3)
    pixels = fixed_pattern(LARGE, generator)
    return expose(light, Fraction(1, 1500), LARGE, pixels, generator if noise else None)


def test_a_sector_of_zeros_is_seen_wherever_it_is():
    frame = photograph(scene(0, 5.0))
    for at in (7, 33_333, frame.size - 256):
        damaged = frame.copy().reshape(-1)
        damaged[at : at + 256] = 0
        assert "many of its pixels are 0" in implausible(damaged.reshape(frame.shape), BLACK, WHITE)
