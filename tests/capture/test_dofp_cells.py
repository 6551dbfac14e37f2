"""Cells of four polarizers tested one by one: against a loop over cells, noise alone, and planted faults."""

import math

import numpy as np
import pytest

from reflectance_fit.capture.bins import Mask, Region, SphereBins
from reflectance_fit.capture.dofp_cells import uneven_cells
from reflectance_fit.capture.pixel_maps import PixelMaps
from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.physics.stokes import analyzer_signal

CELL = np.array([[90.0, 45.0], [135.0, 0.0]])
NOISE = (0.5, 4.0)  # 2 electrons a DN, read noise of 2 DN
BLACK = 64.0
WHOLE = Region(0, 0, 320, 240)


def frame_of(cfa, colour=False, maps=None):
    n = 4 if colour else 2
    channels = (
        np.array(list("RGGB")).reshape(2, 2).repeat(2, 0).repeat(2, 1) if colour else np.full((2, 2), "mono")
    )
    axes = np.tile(CELL, (n // 2, n // 2))
    levels = np.full((n, n), BLACK), np.full((n, n), 4095.0)
    return RawFrame(cfa, channels, axes, *levels, None, None, None, maps=maps)


def light(shape=(240, 320), seed=1, level=1500.0):
    """Partly polarized light that varies slowly, with the noise of NOISE."""
    y, x = np.indices(shape)
    dolp, aolp = 0.3 + 0.3 * x / shape[1], 0.01 * y
    stokes = np.stack(
        [np.ones(shape), dolp * np.cos(2 * aolp), dolp * np.sin(2 * aolp), np.zeros(shape)], axis=-1
    )
    axes = np.radians(np.tile(CELL, (shape[0] // 2, shape[1] // 2)))
    mean = level * analyzer_signal(stokes, axes)
    generator = np.random.default_rng(seed)
    sigma = np.sqrt(NOISE[0] * mean + NOISE[1])
    return np.rint(BLACK + mean + sigma * generator.standard_normal(shape)).astype(np.uint16)


def one_by_one(cfa, box, n, noise):
    """Cells of every group, of pixels whose top left corner is a multiple of 2."""
    found = {}
    rows, columns = box
    names = np.array(list("RGGB")).reshape(2, 2) if n == 4 else np.full((2, 2), "mono")
    for y in range(0, cfa.shape[0] - 1, 2):
        for x in range(0, cfa.shape[1] - 1, 2):
            inside = rows.start <= y and y + 2 <= rows.stop and columns.start <= x and x + 2 <= columns.stop
            if not inside:
                continue
            signal = cfa[y : y + 2, x : x + 2].astype(float) - BLACK
            if (cfa[y : y + 2, x : x + 2] >= BLACK + 0.98 * (4095 - BLACK)).any():
                continue
            variance = noise[0] * np.maximum(signal, 0) + noise[1] + (0.005 * signal) ** 2
            z = (signal[1, 1] + signal[0, 0] - signal[0, 1] - signal[1, 0]) / math.sqrt(variance.sum())
            entry = found.setdefault(str(names[y // 2 % 2, x // 2 % 2]), [0, 0])
            entry[0] += abs(z) > 4
            entry[1] += 1
    return {name: tuple(entry) for name, entry in found.items()}


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize(
    "box", [(0, 0, 240, 320), (3, 5, 101, 222), (10, 0, 12, 2), (7, 7, 8, 8), (0, 0, 999, 999)]
)
def test_counts_are_those_of_a_loop(colour, box):
    cfa = light()
    cfa[::7, ::5] += 400
    cfa[30:34, 50:70] = 4095
    where = slice(box[0], box[2]), slice(box[1], box[3])
    noise = dict.fromkeys(("mono", "R", "G", "B"), NOISE)
    found = uneven_cells(frame_of(cfa, colour), Region(box[1], box[0], box[3], box[2]), noise)
    expected = one_by_one(cfa, where, 4 if colour else 2, NOISE)
    assert {c: entry for c, entry in found.items() if entry[1]} == expected


def test_noise_alone_leaves_almost_none():
    (beyond, cells) = uneven_cells(frame_of(light()), WHOLE, {"mono": NOISE})["mono"]
    assert cells == 120 * 160
    assert beyond < 1e-3 * cells


def test_a_mask_takes_cells_out():
    cfa = light()
    cfa[100, 100] += 2000
    whole = WHOLE
    masked = np.zeros(cfa.shape, dtype=bool)
    masked[100, 100] = True
    beyond, cells = uneven_cells(frame_of(cfa), whole, {"mono": NOISE})["mono"]
    fewer = uneven_cells(frame_of(cfa), whole, {"mono": NOISE}, mask=Mask.of(masked))["mono"]
    assert fewer == (beyond - 1, cells - 1)


def test_a_gain_map_evens_cells_out():
    generator = np.random.default_rng(4)
    gain = generator.uniform(0.9, 1.1, (240, 320)).astype(np.float32)
    cfa = np.rint((light().astype(float) - BLACK) / gain + BLACK).astype(np.uint16)
    whole = WHOLE
    raw = uneven_cells(frame_of(cfa), whole, {"mono": NOISE})["mono"]
    mapped = uneven_cells(frame_of(cfa, maps=PixelMaps(None, gain)), whole, {"mono": NOISE})["mono"]
    assert raw[0] > 0.1 * raw[1]
    assert mapped[0] < 1e-3 * mapped[1]


def test_sensors_without_such_cells_have_none():
    plain = RawFrame(
        light(),
        np.full((2, 2), "mono"),
        np.full((2, 2), np.nan),
        *[np.full((2, 2), 64.0)] * 2,
        None,
        None,
        None,
    )
    assert uneven_cells(plain, WHOLE, {"mono": NOISE}) == {}
    assert uneven_cells(frame_of(light()), WHOLE, {}) == {}


def test_on_a_ball_only_its_rings_count():
    """What surrounds the ball, and its silhouette, are edges of the picture and no fault."""
    cfa = light()
    y, x = np.indices(cfa.shape)
    outside = np.hypot(x - 150, y - 120) > 95
    cfa[outside] = np.random.default_rng(2).integers(70, 3000, np.count_nonzero(outside))
    ball = SphereBins(150.0, 120.0, 100.0, None, tuple(np.radians([8.0, 40.0, 70.0])), 6)
    beyond, cells = uneven_cells(frame_of(cfa), ball, {"mono": NOISE})["mono"]
    low, high = 100 * np.sin(np.radians([8.0, 70.0]))
    assert cells == pytest.approx(math.pi * (high**2 - low**2) / 4, rel=0.01)
    assert beyond < 1e-3 * cells
