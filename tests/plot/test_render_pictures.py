"""Previews are what the numbers are: scaled, encoded, clipped where that is said, and the right way up."""

import numpy as np
import pytest
from PIL import Image

from reflectance_fit.plot.render import (
    automatic_stops,
    clipped_share,
    encoded,
    write_figure,
    write_preview,
)
from reflectance_fit.plot.render_panels import draw_analyzers, draw_compare, draw_polarization

RNG = np.random.default_rng(4)
PICTURE = RNG.lognormal(0.0, 1.0, (40, 60, 3))


def test_encoding_is_that_of_srgb():
    """Linear 0.2140 is code 0.5; the curve's two pieces meet; IEC 61966-2-1."""
    gray = encoded(np.array([[[0.21404114], [0.0031308], [1.0], [2.0], [-0.1]]]), 0.0)
    assert gray.shape == (1, 5, 3)
    np.testing.assert_allclose(gray[0, :, 1], [0.5, 0.0404500, 1.0, 1.0, 0.0], atol=1e-6)
    assert encoded(np.full((1, 1, 1), 0.21404114 / 8), 3.0)[0, 0, 0] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("level", [1e-6, 1.0, 3e4])
def test_the_automatic_exposure_does_not_know_the_unit(level):
    stops = automatic_stops(level * PICTURE)
    assert 0.005 < clipped_share(level * PICTURE, stops) <= 0.02
    np.testing.assert_allclose(2.0**stops * level, 2.0 ** automatic_stops(PICTURE), rtol=0.08)


def test_darkness_has_an_exposure_and_does_not_count():
    assert automatic_stops(np.zeros((4, 4, 3))) == 0.0
    half = np.concatenate([PICTURE, np.zeros_like(PICTURE)])
    assert automatic_stops(half) == pytest.approx(automatic_stops(PICTURE), abs=0.01)


def test_the_preview_is_the_picture_pixel_for_pixel(tmp_path):
    picture = np.zeros((3, 5, 3))
    picture[0, 4] = (1.0, 0.0, 0.0)
    picture[2, 0] = (0.0, 0.21586, 0.0)
    write_preview(tmp_path / "a.png", picture, 0.0)
    with Image.open(tmp_path / "a.png") as file:
        found = np.asarray(file)
    assert found.shape == (3, 5, 3)
    assert tuple(found[0, 4]) == (255, 0, 0)
    assert tuple(found[2, 0]) == (0, 128, 0)
    assert np.count_nonzero(found) == 2


def panel_texts(figure):
    return [ax.get_title(loc="left") for ax in figure.axes]


def test_the_comparison_shows_both_at_one_exposure_and_the_signed_difference(tmp_path):
    other = 1.2 * PICTURE
    signed = (other - PICTURE).mean(axis=-1)
    figure = draw_compare("ball", {"exact": PICTURE, "schlick": other}, signed, ["RMS 1"], -1.0)
    assert panel_texts(figure)[:3] == ["exact", "schlick", "schlick − exact, radiance"]
    first, second, third = (np.asarray(ax.images[0].get_array()) for ax in figure.axes[:3])
    np.testing.assert_array_equal(first, encoded(PICTURE, -1.0))
    np.testing.assert_array_equal(second, encoded(other, -1.0))
    np.testing.assert_array_equal(third, signed)
    low, high = figure.axes[2].images[0].get_clim()
    assert low == -high
    assert np.mean(np.abs(signed) > high) < 0.01
    write_figure(tmp_path / "c.png", figure)
    with Image.open(tmp_path / "c.png") as file:
        assert file.size[0] == 1440


def test_the_wheel_and_the_map_speak_the_same_colours():
    """A pixel polarized along 45 degrees has the colour that stands at 45 degrees on the wheel's rim."""
    angle = np.array([[0.0, 45.0, 90.0, 135.0]])
    figure = draw_polarization("x", np.ones((1, 4)), angle)
    shown = np.asarray(figure.axes[1].images[0].get_array())
    (wheel,) = [ax for ax in figure.axes[1].child_axes if ax.images]
    colours = np.asarray(wheel.images[0].get_array())
    centre = (len(colours) - 1) / 2
    for number, degrees in enumerate(angle[0]):
        towards = np.radians(degrees)
        row = round(centre - 0.97 * centre * np.sin(towards))
        column = round(centre + 0.97 * centre * np.cos(towards))
        np.testing.assert_allclose(colours[row, column, :3], shown[0, number], atol=0.06)
    assert np.ptp(shown[0], axis=0).max() > 0.5


def test_the_series_marks_the_row_of_largest_polarization(tmp_path):
    of_rows = np.exp(-0.5 * ((np.arange(40) - 13) / 5.0) ** 2)
    degree = np.tile(of_rows[:, None], (1, 60))
    pictures = dict.fromkeys((0.0, 45.0, 90.0, 135.0), PICTURE)
    figure = draw_analyzers("slab", pictures, degree, of_rows, 0.0)
    titles = panel_texts(figure)
    assert titles[:4] == [f"analyzer at {a}°" for a in (0, 45, 90, 135)]
    marked = [line.get_ydata()[0] for line in figure.axes[4].lines]
    assert marked == [13]
    write_figure(tmp_path / "a.png", figure)
