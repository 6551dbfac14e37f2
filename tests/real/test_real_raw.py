"""Raw files that others made: one sound photograph, and what LibRaw takes for one."""

import numpy as np
import pytest
import rawpy

from reflectance_fit.capture.raw import decode
from reflectance_fit.errors import ReflectanceFitError

# Centres of the chart's neutral patches in the visible area, and their reflectances (MANIFEST.csv of the data).
NEUTRAL_X = (704, 811, 922, 1030, 1141, 1255)
NEUTRAL_Y = 926
NEUTRAL = np.array([0.90, 0.591, 0.362, 0.198, 0.090, 0.031])


def test_a_canon_decodes(data):
    path = data / "raw/canon_kissx4_colorchart.dng"
    frame = decode(path)
    assert frame.cfa.shape == (1156, 1734)
    assert frame.channels.tolist() == [["R", "G"], ["G", "B"]]
    assert frame.black.tolist() == [[2056, 2056], [2056, 2056]]
    assert frame.white.tolist() == [[15000] * 2] * 2
    # The file says 0/1000000 s, which LibRaw gives as 1 s.
    assert (frame.exposure_s, frame.iso, frame.noise_profile) == (None, None, None)
    with rawpy.imread(str(path)) as raw:
        assert raw.raw_colors_visible[:2, :2].tolist() == [[0, 1], [3, 2]]


def test_green_of_the_canon_is_linear_in_reflectance(data):
    frame = decode(data / "raw/canon_kissx4_colorchart.dng")
    boxes = [frame.cfa[NEUTRAL_Y - 24 : NEUTRAL_Y + 24, x - x % 2 - 24 : x - x % 2 + 24] for x in NEUTRAL_X]
    green = np.array([np.mean([b[0::2, 1::2], b[1::2, 0::2]]) for b in boxes]) - frame.black[0, 1]
    np.testing.assert_allclose(green, [1161, 759, 477, 260, 127, 47], rtol=0.02)
    slope, flare = np.polyfit(NEUTRAL, green, 1)
    np.testing.assert_allclose(green, flare + slope * NEUTRAL, atol=0.02 * slope)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        # A dump without a header, which LibRaw takes for a camera by its length, with pattern and white made up.
        ("headerless_openisp_1920x1080.RAW", "has no header of a raw format"),
        # Only the first of 140 tiles is there; LibRaw gives 8 megapixels of zeros.
        ("negative/exiftool_DNG.dng", "has 1 of 140 pieces"),
        # Directories without pictures, for tests of another reader.
        ("negative/exiftool_CanonRaw.cr2", "LibRaw cannot decode it (Unsupported file format"),
        ("negative/exiftool_CanonRaw.crw", "LibRaw cannot decode it (Input/output error)"),
    ],
)
def test_what_is_no_photograph_is_refused_by_name(data, name, reason):
    with pytest.raises(ReflectanceFitError) as caught:
        decode(data / "raw" / name)
    (problem,) = caught.value.problems
    assert problem.file == str(data / "raw" / name)
    assert reason in problem.message
    assert problem.message.isprintable()


def test_every_bad_file_is_listed_above(data):
    assert {p.name for p in (data / "raw/negative").iterdir()} == {
        "exiftool_DNG.dng",
        "exiftool_CanonRaw.cr2",
        "exiftool_CanonRaw.crw",
    }


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.999])
def test_a_cut_canon_is_refused(data, tmp_path, keep):
    whole = (data / "raw/canon_kissx4_colorchart.dng").read_bytes()
    (tmp_path / "cut.dng").write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(ReflectanceFitError, match="cut off"):
        decode(tmp_path / "cut.dng")
