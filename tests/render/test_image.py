"""What is written is what comes back, under the names that viewers know."""

import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from reflectance_fit.render.film import Film
from reflectance_fit.render.image import (
    channels,
    luminance,
    polarization,
    row_polarization,
    stokes_luminance,
    write_exr,
)

sys.path.append(str(Path(__file__).parent))
from made_films import film

ABOUT = {"reflectance_fit.version": "0.1.0", "reflectance_fit.samples": 16, "reflectance_fit.error": 0.5}


def read(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return dict(file.header()), {name: channel.pixels.copy() for name, channel in file.channels().items()}


@pytest.mark.parametrize("mode", ["scalar", "rgb", "spectral", "polarized", "spectral_polarized"])
def test_round_trip_of_every_channel(mode, tmp_path):
    given = film(mode)
    write_exr(tmp_path / "a.exr", channels(given), ABOUT)
    header, found = read(tmp_path / "a.exr")
    assert {name: header[name] for name in ABOUT} == ABOUT
    names = "Y" if mode == "scalar" else "RGB"
    expected = {}
    for c, name in enumerate(names):
        expected[name] = given.mean[:, :, c, 0]
        expected[f"variance.{name}"] = given.error[:, :, c, 0] ** 2
        if "polarized" in mode:
            expected |= {f"S{s}.{name}": given.mean[:, :, c, s] for s in range(4)}
            expected |= {f"variance.S{s}.{name}": given.error[:, :, c, s] ** 2 for s in (1, 2, 3)}
    if "polarized" in mode:
        expected["DoLP"], expected["AoLP"] = polarization(given)
    assert set(found) == set(expected)
    for name, values in expected.items():
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], values.astype(np.float32))


def test_an_independent_reader_sees_the_same_picture(tmp_path):
    """Mitsuba's own reader, not this library's Python side: rows are not upside down, channels not swapped."""
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    given = film("polarized")
    path = tmp_path / "a.exr"
    write_exr(path, channels(given), ABOUT)
    bitmap = mitsuba.Bitmap(str(path))
    names = [field.name for field in bitmap.struct_()]
    pixels = np.array(bitmap)
    for c, channel in enumerate("RGB"):
        for s, prefix in ((0, ""), (2, "S2.")):
            expected = given.mean[:, :, c, s].astype(np.float32)
            np.testing.assert_array_equal(pixels[..., names.index(prefix + channel)], expected)


def test_polarization_is_that_of_the_luminance():
    given = film("polarized", seed=3)
    degree, angle = polarization(given)
    weights = np.array([0.2126, 0.7152, 0.0722])
    s0, s1, s2 = (given.mean[..., s] @ weights for s in range(3))
    np.testing.assert_allclose(degree, np.hypot(s1, s2) / s0, rtol=1e-12)
    # Malus: the analyzer at the angle passes most, and that says what the degree is.
    turn = np.radians(angle)
    passed = 0.5 * (s0 + s1 * np.cos(2 * turn) + s2 * np.sin(2 * turn))
    np.testing.assert_allclose(passed, 0.5 * s0 * (1 + degree), rtol=1e-12)
    assert np.all((angle >= 0) & (angle < 180))
    np.testing.assert_allclose(stokes_luminance(given)[..., 0], s0, rtol=1e-12)


def test_noise_that_cancels_in_a_row_is_no_polarization_of_it():
    """Neighbours polarized across one another: each pixel is polarized, their light together is not."""
    mean = np.zeros((2, 4, 3, 4))
    mean[..., 0] = 1.0
    mean[0, ::2, :, 1], mean[0, 1::2, :, 1] = 0.8, -0.8
    mean[1, :, :, 2] = 0.6
    given = Film("polarized", mean, np.zeros_like(mean), 1)
    np.testing.assert_allclose(polarization(given)[0].mean(axis=1), [0.8, 0.6], rtol=1e-12)
    np.testing.assert_allclose(row_polarization(given), [0.0, 0.6], atol=1e-12)


def test_a_black_picture_is_unpolarized():
    given = film("polarized", level=0.0)
    degree, angle = polarization(given)
    assert not degree.any()
    assert not row_polarization(given).any()
    assert not angle.any()


def test_luminance_of_gray_is_the_gray():
    assert luminance(np.full((2, 2, 3), 0.7)) == pytest.approx(0.7)
    assert luminance(np.full((2, 2, 1), 0.7)) == pytest.approx(0.7)


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.exr"
    path.write_bytes(b"before")
    broken = {"R": np.zeros((2, 2)), "G": np.zeros((3, 2))}
    with pytest.raises(Exception, match=r".+"):
        write_exr(path, broken, {})
    assert path.read_bytes() == b"before"
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]
