"""Captures of boards, of nearby balls and of other sensors: files, manifest and truth say the same."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import rawpy
import tifffile
from click.testing import CliRunner

from reflectance_fit.capture.truth import read_truth
from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic import capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.picture import Optics
from reflectance_fit.data_synthetic.rig import MONO_CHANNELS, Setting
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import IMX250, SENSORS, CaptureSpec, standard_spec
from reflectance_fit.data_synthetic.target import Board
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials.library import get
from reflectance_fit.physics.fresnel import reflectances
from reflectance_fit.strict_yaml import load

AIR = 1.000277
QUIET = replace(SENSORS["none"], width=320, height=240, vignetting=0.0)
BOARD = CaptureSpec(
    "N-BK7",
    shape="board",
    angles_deg=(40.0, 60.0),
    sensor=QUIET,
    noise=False,
    optics=Optics(670.0),
    geometry_views=2,
    flats=0,
    darks=0,
)


def written(folder, spec):
    path = write_capture(folder, spec)
    return load(path).data, load(folder / "truth.yaml").data


def seconds(frame):
    return float(Fraction(frame["exposure_s"]))


def frames(manifest, role):
    return [frame for frame in manifest["frames"] if frame["role"] == role]


def counts(folder, frame):
    """DN above black, and a picture of each pixel's colour."""
    with rawpy.imread(str(folder / frame["file"])) as raw:
        cfa = raw.raw_image_visible.astype(float)
        if raw.num_colors == 1:
            black = np.tile(np.reshape([512, 515, 509, 511], (2, 2)), (cfa.shape[0] // 2, cfa.shape[1] // 2))
            return cfa - black, None
        colours = raw.raw_colors_visible
        return cfa - np.array(raw.black_level_per_channel)[colours], np.where(colours == 3, 1, colours)


def index(wavelength_nm):
    eta, k = get("N-BK7").absolute_index(wavelength_nm)
    return eta / AIR, k / AIR


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    folder = tmp_path_factory.mktemp("board") / "capture"
    return folder, *written(folder, BOARD)


def test_a_board_s_manifest_tells_what_a_photographer_knows(board):
    folder, manifest, _ = board
    assert manifest["geometry"] == {
        "kind": "charuco",
        "charuco": {
            "squares": [11, 8],
            "square_mm": 10,
            "marker_mm": 7.5,
            "dictionary": "DICT_5X5_100",
            "sample_offset_mm": 0,
        },
    }
    assert "region" not in manifest
    assert "focal_length_px" not in manifest["camera"]
    samples = frames(manifest, "sample")
    assert [f["gain_group"] for f in samples] == ["tilt 1"] * 4 + ["tilt 2"] * 4
    assert not any("theta_deg" in f for f in manifest["frames"])
    assert len({tuple(f["region"]) for f in samples}) == 2
    for frame in frames(manifest, "geometry"):
        assert set(frame) == {"file", "sha256", "role", "exposure_s"}
    assert len(frames(manifest, "geometry")) == 2
    assert read_truth(folder / "truth.yaml").views


def test_a_board_s_region_shows_the_sample_at_the_true_angle(board):
    """Malus' law over the region's mean: degree and direction of polarization are Fresnel's at that angle."""
    folder, manifest, truth = board
    samples = frames(manifest, "sample")
    for view, group in zip(truth["views"], ("tilt 1", "tilt 2"), strict=True):
        signal = {}
        for frame in (f for f in samples if f["gain_group"] == group):
            x0, y0, x1, y1 = frame["region"]
            dn, colours = counts(folder, frame)
            # Centre of the region: the angle is stated there.
            cy, cx = (y0 + y1) // 2, (x0 + x1) // 2
            part = dn[cy - 4 : cy + 4, cx - 8 : cx + 8], colours[cy - 4 : cy + 4, cx - 8 : cx + 8]
            signal[frame["analyzer_deg"]] = part[0][part[1] == 1].mean() / seconds(frame)
        s0 = signal[0] + signal[90]
        s1, s2 = signal[0] - signal[90], signal[45] - signal[135]
        powers = reflectances(np.cos(np.radians(view["theta_deg"])), *index(550.0))
        dolp = (powers.s - powers.p) / (powers.s + powers.p)
        assert np.hypot(s1, s2) / s0 / 0.999 == pytest.approx(dolp, abs=3e-3)
        azimuth = np.degrees(0.5 * np.arctan2(s2, s1))
        assert np.sin(2 * np.radians(azimuth - view["s_axis_deg"])) == pytest.approx(0.0, abs=2e-3)


def test_nothing_of_a_board_clips(board):
    folder, manifest, _ = board
    for frame in manifest["frames"]:
        assert counts(folder, frame)[0].max() < 0.85 * (15871 - 515)


def test_equal_seeds_are_equal_boards(board, tmp_path):
    again, other = written(tmp_path / "a", BOARD)[0], written(tmp_path / "b", replace(BOARD, seed=1))[0]
    assert [f["sha256"] for f in again["frames"]] == [f["sha256"] for f in board[1]["frames"]]
    assert not {f["sha256"] for f in other["frames"]} & {f["sha256"] for f in board[1]["frames"]}


def test_a_ball_nearby_has_to_be_found(tmp_path):
    spec = CaptureSpec("N-BK7", shape="sphere", sensor=QUIET, noise=False, optics=Optics(600.0), darks=0)
    manifest, _ = written(tmp_path, spec)
    assert manifest["geometry"] == {"kind": "sphere", "sphere": "detect"}
    assert manifest["camera"]["focal_length_px"] == 600.0
    x0, y0, x1, y1 = manifest["region"]
    dn, colours = counts(tmp_path, manifest["frames"][0])
    bright = np.median(dn[:8][colours[:8] == 1])
    inside = (dn < 0.9 * bright) & (colours == 1)
    rows, columns = inside.any(axis=1).nonzero()[0], inside.any(axis=0).nonzero()[0]
    # The rim itself is as bright as the surround, and only every second pixel is green.
    assert (columns[0], columns[-1]) == pytest.approx((x0, x1), abs=4)
    assert (rows[0], rows[-1]) == pytest.approx((y0, y1), abs=4)


def test_a_glossy_board_looks_different_behind_each_analyzer(tmp_path):
    """Sheen 0.4: pictures behind crossed analyzers differ by up to that share of their sum, here and there."""
    spec = replace(BOARD, board=Board(sheen=0.4), angles_deg=(40.0,), geometry_views=0)
    spec = replace(spec, sensor=replace(QUIET, pattern="MONO"), channels=MONO_CHANNELS)
    manifest, _ = written(tmp_path, spec)
    picture = {f["analyzer_deg"]: counts(tmp_path, f)[0] / seconds(f) for f in frames(manifest, "sample")}
    total = picture[0] + picture[90]
    x0, y0, x1, y1 = frames(manifest, "sample")[0]["region"]
    paper = (total > 0.8 * np.percentile(total[:60], 99)) & (total < 1.1 * np.percentile(total[:60], 99))
    paper[y0 - 10 : y1 + 10, x0 - 10 : x1 + 10] = False
    contrast = ((picture[0] - picture[90]) / total)[paper]
    assert np.percentile(contrast, [1, 99]) == pytest.approx([-0.4, 0.4], abs=0.02)


def test_the_stated_leakage_is_the_manifest_s(tmp_path):
    spec = replace(BOARD, geometry_views=0, angles_deg=(40.0,), settings=(Setting(0.0),))
    manifest, _ = written(tmp_path, replace(spec, stated_diattenuation=0.97))
    assert manifest["polarizer"] == {"diattenuation": 0.97}


@pytest.mark.parametrize("pattern", ["MONO", "RGGB"])
def test_pixels_with_polarizers_obey_malus(tmp_path, pattern):
    sensor = replace(QUIET, pattern=pattern, layout_deg=IMX250)
    spec = CaptureSpec(
        "N-BK7",
        angles_deg=(50.0,),
        settings=(Setting(None),),
        sensor=sensor,
        noise=False,
        s_axis_deg=20.0,
        channels=MONO_CHANNELS if pattern == "MONO" else CaptureSpec("N-BK7").channels,
        darks=0,
    )
    manifest, _ = written(tmp_path, spec)
    (frame,) = frames(manifest, "sample")
    assert "analyzer_deg" not in frame
    assert manifest["camera"]["sensor"] == ("dofp" if pattern == "MONO" else "dofp_bayer")
    assert manifest["camera"]["dofp_layout_deg"] == [[90, 45], [135, 0]]
    dn, colours = counts(tmp_path, frame)
    assert colours is None  # to a DNG it is a picture in grey
    x0, y0, x1, y1 = manifest["region"]
    dn = dn[y0 // 4 * 4 : y1 // 4 * 4, x0 // 4 * 4 : x1 // 4 * 4]
    rates = {"R": 2.4e7, "G": 4e7, "B": 2e7}
    for row in range(4):
        for column in range(4):
            colour = "G" if pattern == "MONO" else ["RG", "GB"][row // 2][column // 2]
            wavelength = {"R": 600.0, "G": 550.0, "B": 450.0}[colour]
            powers = reflectances(np.cos(np.radians(50.0)), *index(wavelength))
            axis = np.radians([[90, 45], [135, 0]][row % 2][column % 2] - 20.0)
            light = (powers.s + powers.p + 0.999 * (powers.s - powers.p) * np.cos(2 * axis)) / 4
            expected = light * rates[colour] * seconds(frame) / 2.2
            assert dn[row::4, column::4].mean() == pytest.approx(expected, abs=0.5)


def test_tiff_is_pixels_alone_and_the_manifest_says_the_rest(tmp_path):
    sensor = replace(QUIET, pattern="MONO", layout_deg=IMX250)
    spec = replace(
        standard_spec("N-BK7", sensor="dofp", angles_deg=(50.0,)), sensor=sensor, files="tiff", noise=False
    )
    manifest, _ = written(tmp_path / "tiff", spec)
    dng, _ = written(tmp_path / "dng", replace(spec, files="dng"))
    for one, other in zip(manifest["frames"], dng["frames"], strict=True):
        picture = tifffile.imread(tmp_path / "tiff" / one["file"])
        with rawpy.imread(str(tmp_path / "dng" / other["file"])) as raw:
            assert np.array_equal(picture, raw.raw_image_visible)
        with tifffile.TiffFile(tmp_path / "tiff" / one["file"]) as file:
            assert file.pages[0].bitspersample == 16
            assert file.pages[0].photometric.name == "MINISBLACK"
    camera = manifest["camera"]
    assert (camera["encoding"], camera["black_dn"], camera["white_dn"]) == ("linear", 511.75, 15871)
    assert camera["noise"] == {"gain_e_per_dn": 2.2, "read_noise_e": 3}


def test_brackets_and_flats_at_several_levels(tmp_path):
    spec = CaptureSpec(
        "N-BK7",
        angles_deg=(50.0,),
        settings=(Setting(0.0), Setting(90.0)),
        sensor=QUIET,
        bracket=(0, -2, 3),
        flats=2,
        flat_stops=(0, -1, -2),
        darks=2,
        noise_profile=False,
    )
    manifest, _ = written(tmp_path, spec)
    samples, flats = frames(manifest, "sample"), frames(manifest, "flat")
    assert len(samples) == 6
    for first in (0, 3):
        one, shorter, longer = samples[first : first + 3]
        assert {k: v for k, v in one.items() if k not in ("file", "sha256", "exposure_s")} == {
            k: v for k, v in longer.items() if k not in ("file", "sha256", "exposure_s")
        }
        assert seconds(shorter) < 0.3 * seconds(one)
        assert seconds(longer) > 6 * seconds(one)
    times = [seconds(f) for f in flats]
    assert times == sorted(times, reverse=True)
    assert [times.count(t) for t in sorted(set(times))] == [2, 2, 2]
    darks = [f["exposure_s"] for f in frames(manifest, "dark")]
    assert all(darks.count(f["exposure_s"]) == 2 for f in manifest["frames"])
    with tifffile.TiffFile(tmp_path / samples[0]["file"]) as file:
        assert 51041 not in file.pages[0].tags


def test_the_wedge_moves_each_analyzer_s_picture(tmp_path):
    """The window's edges in the mean over rows and columns: an edge's place is where the mean is half."""
    optics = Optics(670.0, blur_px=1.0, wedge_px=3.0)
    spec = replace(BOARD, angles_deg=(40.0,), optics=optics, geometry_views=0, channels=MONO_CHANNELS)
    spec = replace(spec, sensor=replace(QUIET, pattern="MONO"))
    manifest, _ = written(tmp_path, spec)
    place = {}
    for frame in frames(manifest, "sample"):
        dn = counts(tmp_path, frame)[0]
        paper = dn > 0.3 * np.percentile(dn, 95)
        rows, columns = paper.mean(axis=1), paper.mean(axis=0)
        place[frame["analyzer_deg"]] = (
            np.average(np.arange(320), weights=columns),
            np.average(np.arange(240), weights=rows),
        )
    across = place[0][0] - place[90][0], place[0][1] - place[90][1]
    assert across == pytest.approx((3.0, 3.0), abs=0.7)


def test_standard_captures_of_boards_and_sensors():
    spec = standard_spec("N-BK7", shape="board")
    assert max(spec.angles_deg) == 65.0
    assert spec.geometry_views > 8
    assert spec.board.print_scale != (1.0, 1.0)
    assert spec.board.print_scale == pytest.approx((1.0, 1.0), abs=0.003)
    assert set(spec.nuisances) == {"analyzer_offset_deg"}
    assert spec.faults.angle_offset_deg == 0.0
    assert standard_spec("N-BK7", shape="board", noise="none").board == Board()
    mono = standard_spec("Au", sensor="dofp")
    assert [(s.analyzer_deg, s.retarder_deg) for s in mono.settings] == [(None, None), (None, 0.0)]
    assert [channel.name for channel in mono.channels] == ["550"]
    assert standard_spec("Au", sensor="dofp_bayer").sensor.kind == "dofp_bayer"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": "board"}, "perspective"),
        ({"shape": "board", "optics": Optics(600.0), "angles_deg": (85.0,)}, "up to 80"),
        ({"files": "tiff"}, "DNG"),
        ({"settings": (Setting(None),)}, "analyzer angles"),
        ({"sensor": Sensor(pattern="MONO", layout_deg=IMX250)}, "analyzer angles"),
    ],
)
def test_impossible_photographs(changes, message):
    with pytest.raises(ReflectanceFitError, match=message):
        CaptureSpec("N-BK7", **changes)


def test_polarizers_under_other_colour_filters_are_not_made():
    with pytest.raises(ValueError, match="RGGB"):
        Sensor(pattern="GBRG", layout_deg=IMX250)


def test_an_analyzer_before_a_polarization_sensor_is_refused(tmp_path):
    words = ["synth", str(tmp_path / "a"), "--material", "N-BK7", "--sensor", "dofp", "--analyzer", "0,90"]
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 1
    assert "leave the analyzer away" in result.output


def test_the_command_photographs_a_board(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(capture, "write_capture", lambda folder, spec, **_: asked.append((folder, spec)))
    words = ["synth", str(tmp_path), "--material", "N-BK7", "--shape", "board", "--sensor", "dofp"]
    result = CliRunner().invoke(cli, [*words, "--angles", "50", "--seed", "3"])
    assert result.exit_code == 0, result.output
    expected = standard_spec("N-BK7", shape="board", sensor="dofp", angles_deg=(50.0,), seed=3)
    assert asked == [(tmp_path, expected)]
