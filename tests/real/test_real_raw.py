"""Raw files that others made: one sound photograph, and what LibRaw takes for one."""

from itertools import pairwise

import numpy as np
import pytest
import rawpy
from scipy import ndimage

from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.optical_black import measured_black
from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reading import Reading, read_frame
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


def even_squares(green: np.ndarray) -> list[tuple[float, float]]:
    """Centres (x, y) of squares of 25 to 50 pixels in which ``green`` varies no more than its noise, left to right."""
    mean = ndimage.uniform_filter(green, 9)
    spread = np.sqrt(np.maximum(ndimage.uniform_filter(green**2, 9) - mean**2, 0.0))
    even = ndimage.binary_opening(
        (spread < 1.6 * np.sqrt(400 + 0.35 * mean.clip(0))) & (mean > 20), iterations=2
    )
    labels, _ = ndimage.label(even)
    found = []
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        height, width = (side.stop - side.start for side in box)
        if 25 <= min(height, width) <= max(height, width) <= 50 and np.mean(labels[box] == number) > 0.85:
            found.append((box[1].start + (width - 1) / 2, box[0].start + (height - 1) / 2))
    return sorted(found)


def neutral_row(green: np.ndarray) -> list[tuple[float, float]]:
    """The six neutral patches: the four brightest are evenly spaced and each darker than the one before; two follow."""

    def level(at: tuple[float, float]) -> float:
        x, y = map(round, at)
        return float(green[y - 8 : y + 9, x - 8 : x + 9].mean())

    squares = even_squares(green)
    rows = []
    for i, one in enumerate(squares):
        for two in squares[i + 1 :]:
            step = np.subtract(two, one)
            if abs(step[1]) > 0.1 * step[0] or not 45 < step[0] < 65:
                continue
            ahead = [
                next((s for s in squares if np.hypot(*(np.add(one, k * step) - s)) < 4), None) for k in (2, 3)
            ]
            row = [one, two, *ahead]
            if None not in row and all(level(a) > 1.3 * level(b) for a, b in pairwise(row)):
                rows.append(row)
    (row,) = rows
    step = np.subtract(row[3], row[0]) / 3
    return [*row, *(tuple(np.add(row[3], k * step)) for k in (1, 2))]


def test_neutrals_of_the_canon_are_linear_in_reflectance(data):
    """To 2 % of white over a flare; the chart's greys are not alike in red and blue, so green alone is held closer."""
    frame = read_frame(data / "raw/canon_kissx4_colorchart.dng", Reading())
    above = frame.cfa - np.tile(frame.black, np.array(frame.cfa.shape) // 2)
    planes = {
        "R": above[0::2, 0::2],
        "G": (above[0::2, 1::2] + above[1::2, 0::2]) / 2,
        "B": above[1::2, 1::2],
    }
    row = neutral_row(planes["G"])
    np.testing.assert_allclose([2 * x for x, _ in row], NEUTRAL_X, atol=12)
    np.testing.assert_allclose([2 * y for _, y in row], NEUTRAL_Y, atol=12)
    for name, plane in planes.items():
        boxes = [plane[round(y) - 12 : round(y) + 12, round(x) - 12 : round(x) + 12] for x, y in row]
        level = np.array([box.mean() for box in boxes])
        slope, flare = np.polyfit(NEUTRAL, level, 1)
        if name == "G":
            np.testing.assert_allclose(level, [1161, 759, 477, 260, 127, 47], rtol=0.02)
            assert flare == pytest.approx(9, abs=3)
            np.testing.assert_allclose((level[:4] - flare) / NEUTRAL[:4], slope, rtol=0.02)
        np.testing.assert_allclose(level, flare + slope * NEUTRAL, atol=0.02 * slope)


def test_black_of_the_canon_beside_its_picture(data):
    """The file states 2056; the masked pixels average 2048.5, odd rows 4 DN above even ones."""
    with rawpy.imread(str(data / "raw/canon_kissx4_colorchart.dng")) as raw:
        origin = raw.sizes.top_margin, raw.sizes.left_margin
        found = measured_black(raw.raw_image, (), origin, 15000.0)
    np.testing.assert_allclose(found, [[2046.5, 2046.5], [2050.2, 2050.2]], atol=0.5)


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


def test_every_bad_file_is_refused_by_ingest(data, tmp_path):
    for path in [data / "raw/headerless_openisp_1920x1080.RAW", *(data / "raw/negative").iterdir()]:
        (tmp_path / path.name).write_bytes(path.read_bytes())
        manifest = tmp_path / "capture.yaml"
        manifest.write_text(
            "schema: reflectance_fit/capture/1\nsample: {name: x}\ngeometry: {kind: stated, s_axis_deg: 0}\n"
            "camera: {sensor: bayer, channels: {G: {wavelength_nm: 550}}}\n"
            f"frames:\n  - {{file: {path.name}, theta_deg: 45, analyzer_deg: 0, exposure_s: 1/60}}\n"
        )
        with pytest.raises(ReflectanceFitError) as caught:
            ingest(read_capture(manifest))
        assert all(f"{path.name} " in p.message and p.message.isprintable() for p in caught.value.problems)


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
