"""Photon transfer against a sensor of known gain, read noise and PRNU, and against the traps of simpler recipes."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from reflectance_fit.capture.photon_transfer import compare_pair, fit_transfer
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern

# 0.45 DN an electron, 3 electrons read noise; PRNU, DSNU and vignetting that only pairs see through.
SENSOR = Sensor(
    width=1200,
    height=900,
    gain_e_per_dn=1 / 0.45,
    read_noise_e=3.0,
    prnu=0.006,
    dsnu_dn=1.5,
    vignetting=0.4,
    background_e_per_s=0.0,
    black=((512, 512), (512, 512)),
)
CLIP = 0.98 * (SENSOR.white - 512) + 512
PIXELS = fixed_pattern(SENSOR, np.random.default_rng(99))
GENERATOR = np.random.default_rng(5)


def shot(share, sensor=SENSOR, pixels=PIXELS):
    """The green pixels of the first row of cells' frame, with ``share`` of the range in the centre."""
    radiance = np.float32(share * 15000 / 0.45 / sensor.sensitivity_e_per_s[1])
    image = np.full((sensor.height, sensor.width), radiance, dtype=np.float32)
    return expose(image, Fraction(1), sensor, pixels, GENERATOR)[0::2, 1::2]


def pair(share, drift=1.0, **options):
    return compare_pair(shot(share), shot(share * drift), 512.0, CLIP, dark=share == 0, **options)


def test_gain_and_read_noise_within_their_targets():
    found = fit_transfer([pair(s) for s in (0.03, 0.06, 0.12, 0.25, 0.5, 0.9)], [pair(0.0)])
    assert found.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.005)
    assert found.read_noise_e == pytest.approx(3.0, rel=0.02)
    assert abs(found.slope - 0.45) < 4 * found.slope_sigma < 4 * 0.002 * 0.45
    assert abs(found.floor - (1.35**2 + 1 / 12)) < 4 * found.floor_sigma
    assert found.prnu == pytest.approx(0.006, rel=0.03)
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.1)


def test_errors_are_as_large_as_stated():
    """Pulls of 40 calibrations with small frames."""
    small = replace(SENSOR, width=320, height=240)
    pixels = fixed_pattern(small, np.random.default_rng(3))
    pulls = []
    for _ in range(40):
        pairs = [
            compare_pair(shot(s, small, pixels), shot(s, small, pixels), 512.0, CLIP, dark=s == 0)
            for s in (0.1, 0.4, 0.8, 0.0)
        ]
        found = fit_transfer(pairs[:-1], pairs[-1:])
        pulls.append(
            [
                (found.slope - 0.45) / found.slope_sigma,
                (found.floor - 1.35**2 - 1 / 12) / found.floor_sigma,
            ]
        )
    # The spread of 40 values has a relative error of 11 %.
    assert np.std(pulls, axis=0) == pytest.approx([1.0, 1.0], abs=0.35)
    assert np.abs(np.mean(pulls, axis=0)) == pytest.approx([0.0, 0.0], abs=0.6)


def test_one_vignetted_level_and_a_dark_are_enough():
    found = fit_transfer([pair(0.9)], [pair(0.0)])
    assert found.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.01)
    assert found.read_noise_e == pytest.approx(3.0, rel=0.02)


def test_a_lamp_that_drifts_between_the_two_frames_costs_nothing():
    found = fit_transfer([pair(s, drift=0.9) for s in (0.1, 0.4, 0.8)], [pair(0.0)])
    assert found.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.01)


def test_hot_pixels_that_are_named_do_not_count():
    """One pixel in 500 with a dark current of 2000 DN, whose noise would pass for read noise."""
    generator = np.random.default_rng(11)
    hot = generator.random(shot(0.0).shape) < 0.002

    def with_hot(share):
        frame = shot(share).astype(np.float64)
        frame[hot] += generator.normal(2000.0, 30.0, np.count_nonzero(hot))
        return frame.clip(0, SENSOR.white).astype(np.uint16)

    def found(mask):
        pairs = [
            compare_pair(with_hot(s), with_hot(s), 512.0, CLIP, dark=s == 0, hot=mask)
            for s in (0.1, 0.4, 0.8, 0.0)
        ]
        return fit_transfer(pairs[:-1], pairs[-1:])

    clean, spoilt = found(hot), found(None)
    assert clean.read_noise_e == pytest.approx(3.0, rel=0.02)
    assert clean.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.01)
    assert clean.reduced_chi2 == pytest.approx(1.0, abs=0.1)
    assert spoilt.read_noise_e > 3.5


def test_clipped_blocks_are_left_out():
    # The centre is clipped, the corners are at 40 %.
    found = fit_transfer([pair(1.3), pair(0.3)], [pair(0.0)])
    assert found.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.01)
    assert len(compare_pair(np.full((64, 64), 16000, np.uint16), shot(0.5)[:64, :64], 512.0, CLIP).level) == 0


def test_darks_that_are_cut_off_at_zero_do_not_count():
    cut = [np.clip(shot(0.0).astype(int) - 512, 0, None).astype(np.uint16) for _ in range(2)]
    assert len(compare_pair(*cut, 0.0, CLIP, dark=True).level) == 0


def test_the_variance_within_one_frame_is_not_trusted_for_a_reason():
    """Neighbours of one frame differ by PRNU too: at 0.6 % that passes off as a gain far too low."""
    one = shot(0.9)[300:420, 200:320].astype(float) - 512
    single = np.mean(np.diff(one, axis=1) ** 2) / 2 / one.mean()
    assert single > 1.3 * 0.45


def test_read_noise_below_the_quantisation_is_none():
    quiet = replace(SENSOR, read_noise_e=0.1, dsnu_dn=0.0)
    pixels = fixed_pattern(quiet, np.random.default_rng(1))
    darks = compare_pair(shot(0.0, quiet, pixels), shot(0.0, quiet, pixels), 512.0, CLIP, dark=True)
    found = fit_transfer([pair(0.5), pair(0.1)], [darks])
    assert found.read_noise_e == 0.0
    assert found.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.01)


def test_without_darks_prnu_and_gain_still_come_out():
    found = fit_transfer([pair(s) for s in (0.05, 0.3, 0.9)], [])
    assert found.gain_e_per_dn == pytest.approx(1 / 0.45, rel=0.01)
    assert found.prnu == pytest.approx(0.006, rel=0.1)
    assert found.dark == found.floor


def test_pairs_of_one_level_are_refused():
    even = replace(SENSOR, vignetting=0.0)
    pixels = fixed_pattern(even, np.random.default_rng(1))
    one = compare_pair(shot(0.5, even, pixels), shot(0.5, even, pixels), 512.0, CLIP)
    with pytest.raises(ValueError, match="one level"):
        fit_transfer([one], [])
    with pytest.raises(ValueError, match="one level"):
        fit_transfer([], [])
    assert math.isnan(fit_transfer([one], [pair(0.0)]).prnu) is False
