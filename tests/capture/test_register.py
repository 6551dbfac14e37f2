"""Registration on scenes whose shift is known: textures in closed form, taken where the moved pixels are."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.capture.register import blocks_of, match, view_of

HEIGHT, WIDTH = 720, 960
MOST_PX = 0.02
CENTRE = np.array([WIDTH / 2, HEIGHT / 2])


def waves(x, y):
    """A texture of forty waves, the finest four and a half pixels long; exp: reflectances span a factor of ten."""
    rng = np.random.default_rng(1)
    total = np.zeros(np.broadcast(x, y).shape)
    for k, a, p in zip(
        np.geomspace(0.02, 0.7, 40), rng.uniform(0, 7, 40), rng.uniform(0, 7, 40), strict=True
    ):
        total += np.cos(k * (np.cos(a) * x + np.sin(a) * y) + p)
    return np.exp(0.12 * total)


def board(x, y):
    """Squares of 31 to 47 pixels, edges blurred over two pixels: no two places alike."""

    def edges(t):
        return np.tanh(np.sin(np.pi * t / (39 + 8 * np.sin(t / 300))) * 6)

    return 0.5 + 0.42 * edges(np.cos(0.1) * x + np.sin(0.1) * y) * edges(np.cos(0.1) * y - np.sin(0.1) * x)


def shading(x, y, analyzer):
    """A ball's: the axis of polarization turns around the middle, the signal by +-40 % with the analyzer."""
    right, up = x - CENTRE[0], CENTRE[1] - y
    falloff = 1 / (1 + 0.3 * (right**2 + up**2) / CENTRE[0] ** 2)
    return falloff * (1 + 0.4 * np.cos(2 * (analyzer - np.arctan2(up, right))))


def photograph(texture, offset=(0.0, 0.0), turn=0.0, analyzer=0.0, seed=0):
    """A Bayer frame that shows at R x + offset what the scene has at x, R turning about the first pixel."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    right, down = x - offset[0], y - offset[1]
    cosine, sine = np.cos(turn), np.sin(turn)
    scene = texture(cosine * right + sine * down, cosine * down - sine * right)
    electrons = 8000 * scene / scene.max() * shading(x, y, analyzer)
    colours = np.array([["R", "G"], ["G", "B"]])
    electrons *= np.tile(np.where(colours == "G", 1.0, 0.55), (HEIGHT // 2, WIDTH // 2))
    dn = 512 + np.random.default_rng(seed).poisson(electrons) / 2.2
    flat = np.full((2, 2), 1.0)
    return RawFrame(
        np.rint(dn).astype(np.uint16), colours, np.nan * flat, 512 * flat, 16000 * flat, None, None, None
    )


def error_px(found, offset, turn=0.0):
    """The largest error in the middle and the corners, a sixth of the picture inwards."""
    places = np.array([(WIDTH / 2, HEIGHT / 2), (160, 120), (800, 120), (160, 600), (800, 600)])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    x, y = (places @ rotation.T + offset).T
    back = np.stack(found.shift.back(x, y), axis=1)
    return float(np.abs(back - places).max())


FIRST = {texture: view_of(photograph(texture)) for texture in (waves, board)}


@pytest.mark.parametrize("texture", FIRST)
@settings(max_examples=6, deadline=None, derandomize=True)
@given(
    x=st.floats(-9.0, 9.0), y=st.floats(-9.0, 9.0), analyzer=st.sampled_from([0.0, np.pi / 4, np.pi / 2, 2.4])
)
def test_a_shift_is_found_under_the_shading_of_a_polarizer(texture, x, y, analyzer):
    found = match(
        FIRST[texture], view_of(photograph(texture, (x, y), analyzer=analyzer, seed=1)), "translation"
    )
    assert found.found
    assert error_px(found, (x, y)) <= MOST_PX


@pytest.mark.parametrize("texture", FIRST)
@pytest.mark.parametrize(("offset", "turn"), [((1.3, -0.7), 0.002), ((-8.2, 3.5), -0.004)])
def test_a_turn_is_found_too(texture, offset, turn):
    found = match(FIRST[texture], view_of(photograph(texture, offset, turn, np.pi / 2, seed=1)), "euclidean")
    assert found.found
    assert error_px(found, offset, turn) <= 2 * MOST_PX


def test_a_large_shift_is_found():
    found = match(FIRST[waves], view_of(photograph(waves, (61.3, -40.6), seed=1)), "translation")
    assert found.found
    assert error_px(found, (61.3, -40.6)) <= MOST_PX


def test_another_scene_and_no_scene_are_not_found():
    def plain(x, y):
        return np.ones_like(x + y)

    for other in (board, plain):
        assert not match(FIRST[waves], view_of(photograph(other, seed=1)), "translation").found
    # In the middle of the ball the shading itself is a thing to hold on to, a quarter turn makes it another.
    blank = [view_of(photograph(plain, analyzer=a, seed=s)) for s, a in ((1, 0.0), (2, np.pi / 2))]
    assert not match(*blank, "translation").found


def test_views_are_means_of_whole_cells_and_small():
    frame = photograph(waves)
    blocks, pitch = blocks_of(frame)
    assert pitch == 2
    assert blocks.shape == view_of(frame).picture.shape == (HEIGHT // 2, WIDTH // 2)
    assert blocks[7, 9] == pytest.approx(frame.cfa[14:16, 18:20].mean() - 512)
    large = replace(frame, cfa=np.tile(frame.cfa, (3, 5))[:-1, :-3])
    blocks, pitch = blocks_of(large)
    assert pitch == 4
    assert blocks.size <= 1_000_000
    assert blocks[7, 9] == pytest.approx(large.cfa[28:32, 36:40].mean() - 512)


def test_pictures_of_two_sizes_are_refused():
    frame = photograph(waves)
    with pytest.raises(ValueError, match="differ in size"):
        match(view_of(frame), view_of(replace(frame, cfa=frame.cfa[:-2])), "translation")
