"""The clip point of a synthetic sensor is found where it clips, and nowhere else."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.clipping import measured_white
from reflectance_fit.capture.raw import CLIP_SHARE, Plane, RawFrame
from reflectance_fit.capture.reduce import reduce_frame
from reflectance_fit.capture.saturation import clipped_alike
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern

SENSOR = Sensor(width=400, height=300)
BLACK = np.array(SENSOR.black, dtype=float)
y, x = np.mgrid[0:300, 0:400]
SPOT = (0.1 + 0.9 * np.exp(-((x - 200) ** 2 + (y - 150) ** 2) / 2 / 80**2)).astype(np.float32)


def photograph(exposure_s, light=SPOT, seed=0, **changes):
    sensor = replace(SENSOR, **changes)
    generator = np.random.default_rng(seed)
    return expose(light, exposure_s, sensor, fixed_pattern(sensor, generator), generator)


@pytest.mark.parametrize(
    ("changes", "clips_at"),
    [
        ({}, 15871.0),  # the converter
        ({"full_well_e": 25000.0}, 25000 / 2.2 + BLACK),  # the well, with read noise and offsets above it
        ({"bits": 16, "white": 4095, "gain_e_per_dn": 9.0}, 4095.0),  # 12 bits in 16
    ],
)
@pytest.mark.parametrize("denominator", [1000, 500, 250])
def test_the_spike_is_where_the_sensor_clips(changes, clips_at, denominator):
    frame = photograph(Fraction(1, denominator), **changes)
    found = measured_white(frame, BLACK, np.full((2, 2), 65535.0))
    # Green has nearly twice the light of the others, so it clips first.
    assert (found[[0, 1], [1, 0]] < 65535).all()
    # Within the 2 % that are kept from it, and never above it by more than its own noise.
    expected = np.broadcast_to(clips_at, (2, 2))
    clipped = found < 65535
    assert (found[clipped] < expected[clipped] + 8).all()
    assert (found[clipped] - BLACK[clipped] > 0.99 * (expected - BLACK)[clipped]).all()


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 1000),
    denominator=st.integers(1600, 50_000),
    even=st.booleans(),
    gain=st.sampled_from([0.3, 1.0, 2.2]),
)
def test_without_clipping_there_is_no_spike(seed, denominator, even, gain):
    light = np.full_like(SPOT, 0.9) if even else SPOT
    # Up to the same level at every gain.
    frame = photograph(
        Fraction(1, denominator) * Fraction(gain) / Fraction(2.2),
        light,
        seed,
        gain_e_per_dn=gain,
    )
    assert frame.max() < 15871
    assert measured_white(frame, BLACK, np.full((2, 2), 15871.0)).min() == 15871
    assert measured_white(frame, BLACK, np.full((2, 2), 65535.0)).min() == 65535


def test_many_pixels_at_the_largest_value_are_no_spike():
    """As in 8 bits: values are few, and the largest has its share."""
    frame = np.random.default_rng(0).integers(170, 190, (300, 400), dtype=np.uint16)
    assert np.count_nonzero(frame == frame.max()) > 5000
    assert measured_white(frame, np.zeros((2, 2)), np.full((2, 2), 255.0)).min() == 255


@pytest.mark.parametrize(
    "light", [SPOT, np.full_like(SPOT, 0.5), np.where(SPOT > 0.4, 0.5, 0.2).astype(np.float32)]
)
def test_a_frame_without_noise_tells_nothing(light):
    sensor = replace(SENSOR, prnu=0.0, dsnu_dn=0.0, vignetting=0.0)
    pixels = fixed_pattern(sensor, np.random.default_rng(0))
    frame = expose(light, Fraction(1, 2000), sensor, pixels, None)
    assert measured_white(frame, BLACK, np.full((2, 2), 16000.0)).min() == 16000


def test_nominal_is_never_raised():
    frame = photograph(Fraction(1, 500))
    for white in (15871.0, 12000.0):
        assert (measured_white(frame, BLACK, np.full((2, 2), white)) == white).all()


def as_frame(cfa, white):
    nominal = np.full((2, 2), white)
    names = np.array([["R", "G"], ["G", "B"]])
    axes = np.full((2, 2), np.nan)
    return RawFrame(cfa, names, axes, BLACK, nominal, None, None, None, measured_white(cfa, BLACK, nominal))


def test_an_evenly_clipped_frame_is_told_by_the_others():
    """A white wall far overexposed is one level: in itself a picture like any other."""
    well = {"full_well_e": 25000.0}
    wall = np.full_like(SPOT, 0.9)
    whole = Region()
    names = ("spot", "dim", "wall")
    cfas = (
        photograph(Fraction(1, 500), **well),
        photograph(Fraction(1, 4000), wall, **well),
        photograph(Fraction(1, 100), wall, **well),
    )
    means = {
        name: reduce_frame(as_frame(cfa, 15871.0), (whole,)) for name, cfa in zip(names, cfas, strict=True)
    }
    assert all(p.saturated[0] == 0 for p in means["wall"].over(whole).values())
    found = clipped_alike(means)
    assert all(p.saturated[0] == p.pixels[0] for p in found["wall"].over(whole).values())
    for plane in map(Plane, "RGB"):
        assert found["dim"].over(whole)[plane].saturated[0] == 0
        own = means["spot"].over(whole)[plane].saturated[0]
        assert 0 < own < means["spot"].over(whole)[plane].pixels[0]
        assert found["spot"].over(whole)[plane].saturated[0] == own


def test_pixels_near_the_measured_point_count_as_clipped():
    cfa = photograph(Fraction(1, 500), full_well_e=25000.0)
    frame = as_frame(cfa, 15871.0)
    level = BLACK + CLIP_SHARE * (frame.measured_white - BLACK)
    np.testing.assert_array_equal(frame.clip, level)
    means = reduce_frame(frame, (Region(),)).over(Region())
    expected = np.count_nonzero(cfa[0::2, 0::2] >= level[0, 0])
    assert means[Plane("R")].saturated[0] == expected > 100
