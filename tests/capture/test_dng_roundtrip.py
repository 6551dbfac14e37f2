"""What the writer puts in, LibRaw and tifffile get out: every bit, and every number beside."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import rawpy
import tifffile
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.structure import check_structure
from reflectance_fit.capture.tiff import read_tags
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng

CELLS = {
    "RGGB": [["R", "G"], ["G", "B"]],
    "BGGR": [["B", "G"], ["G", "R"]],
    "GRBG": [["G", "R"], ["B", "G"]],
    "GBRG": [["G", "B"], ["R", "G"]],
    "MONO": [["mono", "mono"], ["mono", "mono"]],
}
# Rows that fill whole bytes in 12 and 14 bits and rows that do not.
SHAPES = [(22, 22), (64, 96), (66, 98), (24, 102), (130, 26)]
METADATA = DngMetadata("RGGB", 14, (512, 513, 514, 515), 16000, Fraction(1, 125), 200)


def noise(shape, bits, seed=0):
    """Values over the whole range, both ends included."""
    cfa = np.random.default_rng(seed).integers(0, 2**bits, shape, dtype=np.uint16)
    cfa[0, 0], cfa[-1, -1] = 2**bits - 1, 0
    return cfa


@pytest.mark.parametrize("pattern", CELLS)
@pytest.mark.parametrize("bits", [12, 14, 16])
@pytest.mark.parametrize("shape", SHAPES)
def test_everything_comes_back(tmp_path, pattern, bits, shape):
    path = tmp_path / "a.dng"
    pairs = ((1e-4, 1e-6), (2e-4, 2e-6), (3e-4, 3e-6))[: 1 if pattern == "MONO" else 3]
    black = (60, 61, 62, 63)
    white = 2**bits - 5
    cfa = noise(shape, bits)
    write_dng(path, cfa, DngMetadata(pattern, bits, black, white, Fraction(1, 3), 640, pairs))
    frame = decode(path)
    assert frame.cfa.dtype == np.uint16
    np.testing.assert_array_equal(frame.cfa, cfa)
    assert frame.channels.tolist() == CELLS[pattern]
    assert frame.black.tolist() == [[60, 61], [62, 63]]
    assert (frame.white.tolist(), frame.exposure_s, frame.iso) == ([[white] * 2] * 2, Fraction(1, 3), 640)
    assert frame.noise_profile == dict(zip("RGB" if len(pairs) == 3 else ["mono"], pairs, strict=True))
    # tifffile reads the same by code of its own.
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        np.testing.assert_array_equal(page.asarray(), cfa)
        tags = {tag.code: tag.value for tag in page.tags}
    assert list(tags) == sorted(tags)  # as TIFF demands
    assert tags[274] == 1
    assert (tags[50714], tags[50717]) == (black, white)
    assert tags[51041] == tuple(x for pair in pairs for x in pair)
    assert tags[34665]["ExposureTime"] == (1, 3)
    assert tags[34665]["ISOSpeedRatings"] == 640
    if pattern != "MONO":
        assert tags[33422] == bytes("RGB".index(c) for c in pattern)


@pytest.mark.parametrize("pattern", [p for p in CELLS if p != "MONO"])
def test_libraw_sees_the_same_levels_and_pattern(tmp_path, pattern):
    """LibRaw gives black by plane, we by position: both must agree, as must its own map of the visible area."""
    path = tmp_path / "a.dng"
    write_dng(path, noise((64, 96), 14), replace(METADATA, pattern=pattern))
    frame = decode(path)
    with rawpy.imread(str(path)) as raw:
        cell = raw.raw_colors_visible[:2, :2]
        assert np.array(raw.black_level_per_channel)[cell].tolist() == frame.black.tolist()
        assert [["RGBG"[i] for i in row] for row in cell] == frame.channels.tolist()
        assert frame.white.tolist() == [[raw.white_level] * 2] * 2
        assert raw.sizes.flip == 0


@given(
    bits=st.sampled_from([12, 14, 16]),
    height=st.integers(11, 30),
    width=st.integers(11, 60),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_size_comes_back(tmp_path_factory, bits, height, width, seed):
    path = tmp_path_factory.mktemp("dng") / "a.dng"
    cfa = noise((2 * height, 2 * width), bits, seed)
    metadata = replace(METADATA, bits=bits, white=2**bits - 1)
    write_dng(path, cfa, metadata)
    np.testing.assert_array_equal(decode(path).cfa, cfa)
    check_structure(read_tags(path), "a.dng")


@given(above=st.integers(1, 2**32 - 1), below=st.integers(1, 2**32 - 1))
def test_exposure_is_exact(tmp_path_factory, above, below):
    path = tmp_path_factory.mktemp("dng") / "a.dng"
    exposure_s = Fraction(above, below)
    write_dng(path, noise((22, 22), 16), replace(METADATA, bits=16, exposure_s=exposure_s))
    assert read_tags(path).exposure_s == exposure_s


def test_one_noise_pair_serves_all_planes(tmp_path):
    write_dng(tmp_path / "a.dng", noise((64, 96), 14), replace(METADATA, noise_profile=((2e-4, 0.0),)))
    assert decode(tmp_path / "a.dng").noise_profile == dict.fromkeys("RGB", (2e-4, 0.0))


def test_no_noise_profile(tmp_path):
    write_dng(tmp_path / "a.dng", noise((64, 96), 14), METADATA)
    assert decode(tmp_path / "a.dng").noise_profile is None


def test_equal_frames_are_equal_files(tmp_path):
    for name in ("a.dng", "new/b.dng"):
        write_dng(tmp_path / name, noise((64, 96), 14), METADATA)
    assert (tmp_path / "a.dng").read_bytes() == (tmp_path / "new" / "b.dng").read_bytes()


def test_a_view_is_written_like_a_copy(tmp_path):
    big = noise((100, 200), 14)
    for bits in (12, 14, 16):
        view = big[10:60:1, 190:90:-1] % 4096
        write_dng(tmp_path / "a.dng", view, replace(METADATA, bits=bits, white=4095))
        np.testing.assert_array_equal(decode(tmp_path / "a.dng").cfa, view)


def test_a_frame_that_does_not_fit_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.dng"
    write_dng(path, noise((64, 96), 14), METADATA)
    before = path.read_bytes()
    for cfa, message in (
        (noise((64, 96), 15), "exceed 14 bits"),
        (noise((20, 96), 14), "at least 22"),
        (noise((64, 97), 14), "even"),
        (noise((63, 96), 14), "even"),
        (noise((64, 96), 14).astype(float), "uint16"),
        (noise((64, 96, 1), 14), "two dimensions"),
    ):
        with pytest.raises(ValueError, match=message):
            write_dng(path, cfa, METADATA)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.dng"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pattern": "RGBG"}, "pattern"),
        ({"bits": 10}, "bits"),
        ({"black": (1, 2, 3)}, "black"),
        ({"black": (1, 2, 3, -4)}, "black"),
        ({"black": (1, 2, 3, 16000)}, "black"),
        ({"white": 2**14}, "white"),
        ({"exposure_s": Fraction(0)}, "exposure"),
        ({"exposure_s": Fraction(1, 2**32)}, "exposure"),
        ({"iso": 0}, "iso"),
        ({"iso": 65536}, "iso"),
        ({"noise_profile": ((1e-4, 0.0),) * 2}, "noise pairs"),
        ({"noise_profile": ((0.0, 0.0),)}, "noise pairs"),
        ({"noise_profile": ((1e-4, float("nan")),)}, "noise pairs"),
        ({"pattern": "MONO", "noise_profile": ((1e-4, 0.0),) * 3}, "noise pairs"),
    ],
)
def test_metadata_that_no_dng_can_hold(change, message):
    with pytest.raises(ValueError, match=message):
        replace(METADATA, **change)
