"""Small pictures of frames: every pixel in its own cell and plane, once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.capture.bins import Mask, Region, Shift
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.thumbnails import MOST_CELLS, CellPicture, box_over, cell_means, grid_over

RGGB = np.array([["R", "G"], ["G", "B"]])


def frame(height, width, seed=0, channels=RGGB):
    n = len(channels)
    cfa = np.random.default_rng(seed).integers(500, 9000, (height, width), dtype=np.uint16)
    black = 500.0 + np.arange(n * n).reshape(n, n)
    return RawFrame(cfa, channels, np.full((n, n), np.nan), black, np.full((n, n), 9e4), None, None, None)


def literal(one, grid, plane, moved=(0, 0), masked=None):
    """A loop over cells: the pixels of the plane in each that are not masked, less their black."""
    n = len(one.channels)
    means = np.full((grid.rows, grid.columns), np.nan)
    for row in range(grid.rows):
        for column in range(grid.columns):
            values = []
            for y in range(
                grid.top + row * grid.pitch + moved[1], grid.top + (row + 1) * grid.pitch + moved[1]
            ):
                for x in range(
                    grid.left + column * grid.pitch + moved[0],
                    grid.left + (column + 1) * grid.pitch + moved[0],
                ):
                    inside = 0 <= y < one.cfa.shape[0] and 0 <= x < one.cfa.shape[1]
                    if not inside:
                        values.append(np.nan)
                    elif one.channels[y % n, x % n] == plane.channel and (masked is None or not masked[y, x]):
                        values.append(float(one.cfa[y, x]) - one.black[y % n, x % n])
            means[row, column] = np.mean(values) if values else np.nan
    return means


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    box=st.tuples(*[st.integers(0, 40)] * 2, *[st.integers(4, 60)] * 2),
    moved=st.tuples(*[st.integers(-4, 4)] * 2),
    quad=st.booleans(),
)
def test_cells_are_the_means_of_a_loop_over_pixels(box, moved, quad):
    channels = np.repeat(np.repeat(RGGB, 2, axis=0), 2, axis=1) if quad else RGGB
    n = len(channels)
    one = frame(48, 64, channels=channels)
    x0, y0, width, height = box
    shift = Shift(offset=(n * moved[0] + 0.4, n * moved[1] - 0.3))
    cells = cell_means(one, Region(x0, y0, x0 + width, y0 + height).box(), shift)
    assert cells.planes == (Plane("R"), Plane("G"), Plane("B"))
    for plane, mean in zip(cells.planes, cells.means, strict=True):
        wanted = literal(one, cells.grid, plane, (n * moved[0], n * moved[1]))
        np.testing.assert_allclose(mean, wanted, rtol=1e-5)


@pytest.mark.parametrize("share", [0.001, 0.05, 0.9])
def test_masked_pixels_do_not_count_and_clip_nothing(share):
    """Of 90 % some cells have no pixel left, and say so."""
    height, width = 4 * MOST_CELLS, 24  # cells of 4 x 4 pixels
    one = replace(frame(height, width), white=np.full((2, 2), 20000.0))
    masked = np.random.default_rng(1).random((height, width)) < share
    box = Region(0, 0, width, height).box()
    grid = cell_means(one, box).grid
    wanted = {c: literal(one, grid, Plane(c), masked=masked) for c in "RB"}
    one.cfa[masked] = 20000
    cells = cell_means(one, box, None, Mask.of(masked))
    for plane, means in zip(cells.planes, cells.means, strict=True):
        if plane.channel in wanted:  # in G each of the two positions counts alike
            np.testing.assert_allclose(means, wanted[plane.channel], rtol=1e-5)
    assert np.isnan(cells.means).any() == (share == 0.9)


@given(size=st.tuples(*[st.integers(2, 9000)] * 2), n=st.sampled_from([2, 4]))
def test_grids_are_small_and_lie_in_the_box(size, n):
    grid = grid_over((slice(3, 3 + size[0]), slice(5, 5 + size[1])), (7000, 8000), n)
    assert max(grid.rows, grid.columns) <= MOST_CELLS
    assert grid.left % n == grid.top % n == grid.pitch % n == 0
    assert grid.left >= 5
    assert grid.top >= 3
    assert grid.left + grid.pitch * grid.columns <= min(5 + size[1], 8000)
    assert grid.top + grid.pitch * grid.rows <= min(3 + size[0], 7000)


def test_a_clipped_pixel_makes_its_cell_infinite():
    one = frame(32, 32)
    one = replace(one, white=np.full((2, 2), 20000.0))
    one.cfa[8, 12] = 19990  # red
    cells = cell_means(one, Region(0, 0, 32, 32).box())
    assert {(cells.planes[p].channel, y, x) for p, y, x in np.argwhere(np.isinf(cells.means))} == {
        ("R", 4, 6)
    }


def test_what_is_saved_is_loaded(tmp_path):
    cells = cell_means(frame(32, 40), Region(3, 5, 30, 29).box())
    cells = replace(cells, planes=(Plane("R", 45.0), Plane("G"), Plane("B", 0.0)))
    cells.save(tmp_path / "one.npz")
    loaded = CellPicture.load(tmp_path / "one.npz")
    assert (loaded.planes, loaded.grid, loaded.shape) == (cells.planes, cells.grid, (32, 40))
    np.testing.assert_array_equal(loaded.means, cells.means)


def test_a_mask_of_cells_is_their_pixels():
    grid = grid_over((slice(4, 30), slice(7, 41)), (33, 45), 2)
    masked = np.random.default_rng(0).random((grid.rows, grid.columns)) < 0.3
    picture = np.zeros((33, 45), dtype=bool)
    for row, column in np.argwhere(masked):
        y, x = grid.top + row * grid.pitch, grid.left + column * grid.pitch
        picture[y : y + grid.pitch, x : x + grid.pitch] = True
    mask = grid.mask(masked, (33, 45))
    np.testing.assert_array_equal(mask.picture(), picture)
    np.testing.assert_array_equal(mask.bits, Mask.of(picture).bits)


@pytest.mark.parametrize(
    ("matrix", "offset"),
    [
        (((1.0, 0.0), (0.0, 1.0)), (7.3, -4.6)),
        (((0.9998, -0.02), (0.02, 0.9998)), (-3.0, 8.5)),
    ],
)
def test_a_mask_moves_with_the_picture(matrix, offset):
    """Each pixel is masked if the nearest pixel of where it is in the first frame is."""
    picture = np.zeros((60, 80), dtype=bool)
    picture[20:31, 35:50] = picture[3, 3] = True
    shift = Shift(matrix, offset)
    found = Mask.of(picture).moved(shift).picture()
    for y, x in np.ndindex(picture.shape):
        back_x, back_y = (round(float(one)) for one in shift.back(np.float64(x), np.float64(y)))
        inside = 0 <= back_x < 80 and 0 <= back_y < 60
        assert found[y, x] == (inside and picture[back_y, back_x])
    assert not Mask.of(np.zeros((6, 8), dtype=bool)).moved(shift).bits.any()


def test_the_box_over_bins_holds_them_all():
    assert box_over([Region(2, 3, 10, 12), Region(1, 5, 8, 20)]) == (slice(3, 20), slice(1, 10))


def test_centres_are_the_mean_positions_of_the_pixels():
    grid = grid_over((slice(10, 50), slice(6, 70)), (100, 100), 2)
    x, y = grid.centres()
    assert x.shape == y.shape == (grid.rows, grid.columns)
    assert x[0, 3] == pytest.approx(np.mean(np.arange(6 + 3 * grid.pitch, 6 + 4 * grid.pitch)))
    assert y[2, 0] == pytest.approx(np.mean(np.arange(10 + 2 * grid.pitch, 10 + 3 * grid.pitch)))
