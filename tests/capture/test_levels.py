"""Black from masked pixels, levels as stated, hot pixels, and PNG and TIFF through the whole reading."""

from fractions import Fraction

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.hot import find_hot, hot_pixels
from reflectance_fit.capture.optical_black import measured_black
from reflectance_fit.capture.raw import Plane, RawFrame, _rational, decode
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.reduce import reduce_frame
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.errors import ReflectanceFitError

SHORT, LONG, BYTE = 3, 4, 1
CELL_BLACK = np.array([[200.25, 210.5], [190.75, 205.0]])
METADATA = DngMetadata("RGGB", 14, (200, 210, 190, 205), 16000, Fraction(1, 60), 100, ((1e-4, 1e-6),) * 3)


def sensor(height=120, width=160, top=10, left=24, seed=0):
    """A dark sensor with light in its picture, which begins at (top, left); black by position in the picture's cell."""
    generator = np.random.default_rng(seed)
    cell = np.roll(CELL_BLACK, (top, left), axis=(0, 1))
    dn = np.tile(cell, (height // 2, width // 2)) + generator.normal(0, 3, (height, width))
    dn[top:, left:] += 900 + 5 * np.arange(width - left)
    return np.rint(dn).astype(np.uint16)


def dng(path, pixels, **tags):
    """A DNG by another writer; ``t50714=(type, values)`` sets a tag."""
    extra = {33421: (SHORT, (2, 2)), 33422: (BYTE, bytes([0, 1, 1, 2])), 50706: (BYTE, bytes([1, 4, 0, 0]))}
    extra |= {int(key[1:]): value for key, value in tags.items()} | {50717: (SHORT, (16000,))}
    tifffile.imwrite(
        path,
        pixels,
        photometric="cfa",
        subfiletype=0,
        extratags=[(tag, kind, len(values), values, True) for tag, (kind, values) in sorted(extra.items())],
    )
    return path


@pytest.mark.parametrize(("top", "left"), [(10, 24), (10, 0), (0, 24), (40, 40)])
def test_black_is_that_of_the_masked_pixels(tmp_path, top, left):
    """To a tenth of a DN: LibRaw's own would be a whole number."""
    pixels = sensor(top=top, left=left)
    area = (SHORT, (top, left, 120, 160))
    masked = (SHORT, (0, 0, top, 160) if top else (0, 0, 120, left))
    frame = decode(dng(tmp_path / "a.dng", pixels, t50829=area, t50830=masked))
    assert frame.cfa.shape == (120 - top, 160 - left)
    np.testing.assert_allclose(frame.black, CELL_BLACK, atol=6 * 3 / np.sqrt(pixels[:top].size / 4 or 720))


def test_without_a_list_the_margins_count_where_they_are_dark(tmp_path):
    pixels = sensor(top=20, left=24)
    area = (SHORT, (20, 24, 120, 160))
    frame = decode(dng(tmp_path / "a.dng", pixels, t50829=area))
    np.testing.assert_allclose(frame.black, CELL_BLACK, atol=0.5)
    # Light that leaks into the pixels beside the picture does not count, nor do a few defects.
    pixels[16:20] += 3000
    pixels[:, 20:24] += 3000
    pixels.ravel()[:8] = 16000
    np.testing.assert_allclose(
        decode(dng(tmp_path / "a.dng", pixels, t50829=area)).black, CELL_BLACK, atol=0.5
    )


def test_a_stated_black_is_not_replaced(tmp_path):
    area, masked = (SHORT, (10, 24, 120, 160)), (SHORT, (0, 0, 10, 160))
    path = dng(tmp_path / "a.dng", sensor(), t50829=area, t50830=masked, t50714=(SHORT, (123,)))
    assert decode(path).black.tolist() == [[123, 123], [123, 123]]


def test_a_picture_that_begins_in_an_odd_row():
    pixels = sensor(top=11, left=25)
    found = measured_black(pixels, ((0, 0, 11, 160), (0, 0, 120, 25)), (11, 25), 16000.0)
    np.testing.assert_allclose(found, CELL_BLACK, atol=0.5)


def test_margins_that_are_no_black(tmp_path):
    lit = sensor(top=0, left=0)  # light everywhere
    assert measured_black(lit, (), (20, 24), 16000.0) is None
    assert measured_black(sensor(), (), (4, 8), 16000.0) is None  # too few
    assert measured_black(sensor(), ((0, 0, 2, 2),), (10, 24), 16000.0) is None
    assert measured_black(sensor(), ((0, 0, 10**6, 10**6),), (10, 24), 16000.0) is None  # the whole sensor
    path = dng(tmp_path / "a.dng", lit, t50829=(SHORT, (20, 24, 120, 160)))
    assert decode(path).black.tolist() == [[0, 0], [0, 0]]


def test_levels_as_stated_leave_the_noise_in_dn(tmp_path):
    generator = np.random.default_rng(0)
    write_dng(tmp_path / "a.dng", generator.normal(1500, 30, (64, 96)).astype(np.uint16), METADATA)
    plain = read_frame(tmp_path / "a.dng", Reading())
    stated = read_frame(
        tmp_path / "a.dng", Reading(black_dn={"R": 100.0, "G": 150.5}, white_dn={"B": 9000.0})
    )
    assert stated.black.tolist() == [[100, 150.5], [150.5, 205]]
    assert stated.white.tolist() == [[16000, 16000], [16000, 9000]]
    np.testing.assert_array_equal(stated.cfa, plain.cfa)
    one, other = (reduce_frame(frame, (Region(),)).noise for frame in (plain, stated))
    for channel in "RGB":
        # Variance per DN stays; the profile's offset is that at black, wherever black is.
        np.testing.assert_allclose(other[channel], one[channel], rtol=1e-12)


def test_stated_levels_mend_a_file_that_is_refused(tmp_path):
    pixels = np.random.default_rng(0).normal(150, 5, (64, 96)).astype(np.uint16)
    write_dng(tmp_path / "a.dng", pixels, METADATA)
    with pytest.raises(ReflectanceFitError, match=r"state camera\.black_dn"):
        read_frame(tmp_path / "a.dng", Reading(black_dn={"R": 700.0, "G": 700.0, "B": 700.0}))
    assert (
        read_frame(tmp_path / "a.dng", Reading(black_dn={"R": 64.0, "G": 64.0, "B": 64.0})).black.max() == 64
    )


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_picture_of_a_machine_vision_camera(tmp_path, bits, suffix):
    pixels = np.random.default_rng(0).normal(100, 3, (48, 64)).clip(0, 255).astype(f"u{bits // 8}")
    path = tmp_path / f"a{suffix}"
    (tifffile.imwrite if suffix == ".tif" else lambda p, a: Image.fromarray(a).save(p))(path, pixels)
    frame = read_frame(path, Reading("mono", encoding="linear", white_dn={"mono": 200.0}))
    np.testing.assert_array_equal(frame.cfa, pixels)
    assert frame.planes() == (Plane("mono"),)
    assert (frame.black.max(), frame.white.min(), frame.exposure_s, frame.iso) == (0, 200, None, None)
    coloured = read_frame(path, Reading("bayer", encoding="linear", pattern="GBRG"))
    assert coloured.channels.tolist() == [["G", "B"], ["R", "G"]]
    assert coloured.white.min() == 2**bits - 1
    axes = ((90.0, 45.0), (135.0, 0.0))
    polarized = read_frame(path, Reading("dofp", axes, "linear"))
    assert polarized.planes() == tuple(Plane("mono", a) for row in axes for a in row)
    both = read_frame(path, Reading("dofp_bayer", axes, "linear", pattern="GRBG"))
    assert both.channels[::2, ::2].tolist() == [["G", "R"], ["B", "G"]]
    assert both.axes_deg[2:, :2].tolist() == [list(row) for row in axes]


def a_dark(hot=(), shape=(200, 300), seed=0):
    dn = np.random.default_rng(seed).normal(512, 4, shape)
    for row, column, extra in hot:
        dn[row, column] += extra
    cell = np.full((2, 2), "mono")
    levels = np.full((2, 2), 512.0), np.full((2, 2), 16000.0)
    return RawFrame(dn.clip(0).astype(np.uint16), cell, np.full((2, 2), np.nan), *levels, None, None, None)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10**6),
    hot=st.sets(st.tuples(st.integers(0, 199), st.integers(0, 299)), max_size=100),
)
def test_hot_pixels_are_found_and_noise_is_not(seed, hot):
    mask = hot_pixels(a_dark([(r, c, 200.0) for r, c in hot], seed=seed))
    assert {(int(r), int(c)) for r, c in np.argwhere(mask.picture())} == hot


def test_positions_of_a_cell_have_each_their_own_level():
    dark = a_dark([(10, 10, 100.0)])
    dark.cfa[1::2, 1::2] += 80  # twenty spreads: another black, not hot
    assert np.argwhere(hot_pixels(dark).picture()).tolist() == [[10, 10]]


def test_a_dark_without_noise():
    dark = a_dark()
    dark.cfa[:] = 512
    dark.cfa[7, 8], dark.cfa[9, 9] = 600, 514
    assert np.argwhere(hot_pixels(dark).picture()).tolist() == [[7, 8]]


def test_a_dark_that_saw_light(tmp_path):
    dark = a_dark()
    dark.cfa[:30, :60] += 300  # 3 % of it
    assert hot_pixels(dark) is None
    metadata = DngMetadata("MONO", 14, (512,) * 4, 16000, Fraction(1), 100)
    write_dng(tmp_path / "a.dng", dark.cfa, metadata)
    with pytest.raises(ReflectanceFitError, match="is no dark: more than 2% of its pixels stand out"):
        find_hot(tmp_path / "a.dng", Reading("mono"))


@given(below=st.integers(1, 32_000), above=st.integers(1, 60))
def test_an_exposure_that_libraw_rounds_to_32_bits_comes_back(below, above):
    """Every time that cameras have: 1/n, whole seconds, and simple fractions."""
    for exact in (Fraction(1, below), Fraction(above), Fraction(above, 10), Fraction(10, below)):
        if exact.denominator < 3000 or exact.numerator == 1:
            assert _rational(float(np.float32(float(exact)))) == exact


def test_no_exposure():
    assert [_rational(x) for x in (0.0, -1.0, float("nan"), float("inf"))] == [None] * 4
