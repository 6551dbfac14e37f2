"""Captures as files: what they say is what was put in, and an analysis that shares no code finds it again."""

import hashlib
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import rawpy
from click.testing import CliRunner
from scipy.optimize import least_squares

from reflectance_fit.capture.raw import decode as raw_frame
from reflectance_fit.capture.read import read_capture
from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.rig import Faults, Light, Setting
from reflectance_fit.data_synthetic.sensor import EXPOSURES_S, Sensor
from reflectance_fit.data_synthetic.spec import SENSORS, CaptureSpec, standard_spec
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials.library import get
from reflectance_fit.physics.brewster import brewster_angle
from reflectance_fit.strict_yaml import load

AIR = 1.000277
SMALL = Sensor(width=64, height=48)
QUIET = replace(SENSORS["none"], width=64, height=48)
COLOURS = {"R": 0, "G": 1, "B": 2}


def written(folder, spec):
    path = write_capture(folder, spec)
    return load(path).data, load(folder / "truth.yaml").data


def tree(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def seconds(frame):
    return float(Fraction(frame["exposure_s"]))


def decode(path):
    with rawpy.imread(str(path)) as raw:
        cfa, colours = raw.raw_image_visible.astype(float), raw.raw_colors_visible
        black = np.array(raw.black_level_per_channel)[colours]
    return cfa - black, np.where(colours == 3, 1, colours)


def rates(folder, manifest, colour):
    """Region mean over exposure of every sample frame in one colour, dark frame subtracted; DN a second."""
    x0, y0, x1, y1 = manifest["region"]
    darks = {
        f["exposure_s"]: decode(folder / f["file"])[0] for f in manifest["frames"] if f["role"] == "dark"
    }
    out = {}
    for frame in (f for f in manifest["frames"] if f["role"] == "sample"):
        counts, colours = decode(folder / frame["file"])
        counts = (counts - darks[frame["exposure_s"]])[y0:y1, x0:x1]
        key = frame.get("theta_deg"), frame["analyzer_deg"], frame.get("retarder_deg")
        out[key] = counts[colours[y0:y1, x0:x1] == COLOURS[colour]].mean() / seconds(frame)
    return out


@pytest.fixture(scope="module")
def glass(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glass")
    spec = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=SMALL, seed=7, darks=2)
    return folder, spec, *written(folder, spec)


def test_the_manifest_names_every_file_with_its_hash(glass):
    folder, spec, manifest, truth = glass
    frames = manifest["frames"]
    assert {f["file"] for f in frames} == {name for name in tree(folder) if name.startswith("raw/")}
    for frame in frames:
        assert frame["sha256"] == hashlib.sha256((folder / frame["file"]).read_bytes()).hexdigest()
    assert len(frames) == truth["frames"]
    roles = [f["role"] for f in frames]
    assert roles.count("sample") == len(spec.angles_deg) * len(spec.settings)
    assert roles.count("flat") == 1


def test_every_frame_has_its_darks(glass):
    _, _, manifest, _ = glass
    lit = {Fraction(f["exposure_s"]) for f in manifest["frames"] if f["role"] != "dark"}
    darks = [Fraction(f["exposure_s"]) for f in manifest["frames"] if f["role"] == "dark"]
    assert sorted(darks) == sorted([*lit, *lit])
    assert lit <= set(EXPOSURES_S)


def test_the_frames_say_what_the_manifest_says(glass):
    folder, spec, manifest, _ = glass
    for frame in manifest["frames"]:
        with rawpy.imread(str(folder / frame["file"])) as raw:
            assert raw.other.shutter_speed == pytest.approx(seconds(frame), rel=1e-6)
            assert raw.white_level == spec.sensor.white
            assert raw.raw_image.shape == (48, 64)


def test_no_measured_pixel_clips(glass):
    folder, spec, manifest, _ = glass
    x0, y0, x1, y1 = manifest["region"]
    brightest = []
    for frame in (f for f in manifest["frames"] if f["role"] == "sample"):
        with rawpy.imread(str(folder / frame["file"])) as raw:
            brightest.append(raw.raw_image[y0:y1, x0:x1].max() / spec.sensor.white)
    assert max(brightest) < 0.98
    assert min(brightest) > 0.35


def test_the_truth_is_the_library_s(glass):
    _, _, manifest, truth = glass
    assert truth["material"] == "N-BK7"
    for channel in truth["channels"]:
        wavelength_nm = channel["wavelength_nm"]
        assert manifest["camera"]["channels"][channel["channel"]]["wavelength_nm"] == wavelength_nm
        eta, k = get("N-BK7").absolute_index(wavelength_nm)
        assert (channel["eta"], channel["k"]) == pytest.approx((float(eta), float(k)), abs=1e-6)
        expected = np.degrees(brewster_angle(eta / AIR, k / AIR))
        assert channel["brewster_deg"] == pytest.approx(expected, abs=1e-4)


def test_seeds(glass, tmp_path):
    folder, spec, _, _ = glass
    write_capture(tmp_path / "again", spec)
    assert tree(tmp_path / "again") == tree(folder)
    write_capture(tmp_path / "other", replace(spec, seed=8))
    assert tree(tmp_path / "other")["raw/000.dng"] != tree(folder)["raw/000.dng"]


@pytest.mark.parametrize("s_axis_deg", [0.0, 90.0])
@pytest.mark.parametrize("pattern", ["RGGB", "GBRG"])
def test_a_literal_analysis_recovers_the_glass(tmp_path, s_axis_deg, pattern):
    """R_p / R_s at one angle gives eta in closed form; decoded by LibRaw."""
    sensor = replace(QUIET, pattern=pattern)
    spec = CaptureSpec(
        "SF11",
        angles_deg=(40.0, 50.0, 70.0),
        sensor=sensor,
        noise=False,
        s_axis_deg=s_axis_deg,
        faults=Faults(diattenuation=1.0),
    )
    manifest, truth = written(tmp_path, spec)
    for channel in truth["channels"]:
        signal = rates(tmp_path, manifest, channel["channel"])
        for theta_deg, below in ((40, 1), (50, 1), (70, -1)):
            along, across = (signal[theta_deg, (s_axis_deg + turn) % 180, None] for turn in (0, 90))
            rho = below * np.sqrt(across / along)
            sine, tangent = np.sin(np.radians(theta_deg)), np.tan(np.radians(theta_deg))
            theta_t = np.arctan((1 - rho) / (1 + rho) / tangent)
            assert AIR * sine / np.sin(theta_t) == pytest.approx(channel["eta"], abs=1e-3)


def jones(theta, index, light, analyzer, plate, retardance):
    """Signal by fields instead of Mueller matrices; angles in radians from s, plate None for none."""
    cos_t = np.sqrt(1 - (np.sin(theta) / index) ** 2 + 0j)
    cos_i = np.cos(theta)
    field = np.array(
        [
            (cos_i - index * cos_t) / (cos_i + index * cos_t) * light[0],
            (index * cos_i - cos_t) / (index * cos_i + cos_t) * light[1],
        ]
    )
    if plate is not None:
        fast, slow = np.array([np.cos(plate), np.sin(plate)]), np.array([-np.sin(plate), np.cos(plate)])
        field = fast * (fast @ field) + np.exp(1j * retardance) * slow * (slow @ field)
    return abs(np.array([np.cos(analyzer), np.sin(analyzer)]) @ field) ** 2


@pytest.mark.parametrize("light", ["linear", "right", "left"])
def test_a_fit_with_fields_recovers_gold_in_a_turned_rig(tmp_path, light):
    """eta and k from ratios only, with the sign of S3: the other hand or the other plate would not fit."""
    source, field = {
        "linear": (Light(linear_deg=45.0), [1, 1]),
        "right": (Light(circular="right"), [1, -1j]),
        "left": (Light(circular="left"), [1, 1j]),
    }[light]
    spec = replace(
        standard_spec("Au", light=source, noise="none"),
        angles_deg=(60.0, 70.0, 78.0),
        sensor=QUIET,
        s_axis_deg=20.0,
        faults=Faults(diattenuation=1.0, angle_offset_deg=0.3),
    )
    manifest, truth = written(tmp_path, spec)
    retardance_deg = manifest["retarder"]["retardance_deg"]
    for channel in truth["channels"]:
        signal = rates(tmp_path, manifest, channel["channel"])
        retardance = np.radians(retardance_deg[channel["channel"]])

        def residuals(x, signal=signal, retardance=retardance):
            out = []
            for theta_deg in spec.angles_deg:
                keys = [key for key in signal if key[0] == theta_deg]
                model = [
                    jones(
                        np.radians(theta_deg + 0.3),
                        complex(*x) / AIR,
                        np.array(field),
                        np.radians(analyzer - 20),
                        None if plate is None else np.radians(plate - 20),
                        retardance,
                    )
                    for _, analyzer, plate in keys
                ]
                measured = np.array([signal[key] for key in keys])
                out.append(np.array(model) / np.sum(model) - measured / np.sum(measured))
            return np.concatenate(out)

        fit = least_squares(residuals, [1.0, 3.0])
        assert fit.x == pytest.approx([channel["eta"], channel["k"]], abs=3e-3)
        assert np.max(np.abs(fit.fun)) < 1e-4


def test_faults_are_put_in_as_the_fit_takes_them_out(tmp_path):
    faults = Faults(
        analyzer_offset_deg=2.0, diffuse=0.05, source_dolp=0.1, source_azimuth_deg=30.0, diattenuation=0.98
    )
    spec = CaptureSpec(
        "ignored", index=(1.5, 0.2), angles_deg=(50.0,), sensor=QUIET, noise=False, faults=faults
    )
    manifest, truth = written(tmp_path, spec)
    assert truth["nuisances"] == faults.as_dict()
    assert manifest["polarizer"] == {"diattenuation": 0.999}
    theta, index = np.radians(50.0), (1.5 + 0.2j) / AIR

    def through(analyzer_deg):
        a = np.radians(analyzer_deg + 2.0)
        total = 0.0
        # 90 % unpolarized, as s and p at random phase, and 10 % along 30 degrees.
        azimuth = np.radians(30.0)
        for field, power in (([1, 0], 0.45), ([0, 1], 0.45), ([np.cos(azimuth), np.sin(azimuth)], 0.1)):
            for axis, share in ((a, 0.99), (a + np.pi / 2, 0.01)):
                total += power * share * jones(theta, index, np.array(field), axis, None, 0.0)
        return total

    model = np.array([through(setting.analyzer_deg) for setting in spec.settings])
    model += 0.05 / 0.95 * model.max()
    for channel in "RGB":
        measured = np.array(list(rates(tmp_path, manifest, channel).values()))
        assert measured / measured.sum() == pytest.approx(model / model.sum(), rel=3e-4)
        # The share is of the largest signal as measured.
        assert 0.05 * model.max() == pytest.approx(0.05 / 0.95 * (model - 0.05 * model.max()).max())


def test_a_ball(tmp_path):
    spec = replace(
        standard_spec("Au", shape="sphere", noise="none"),
        sensor=replace(QUIET, width=128, height=96),
        faults=Faults(diattenuation=1.0),
    )
    manifest, truth = written(tmp_path, spec)
    assert manifest["light"] == {"circular": "right", "shape": "surround", "uniform": True}
    assert manifest["geometry"]["kind"] == "sphere"
    assert all("theta_deg" not in f for f in manifest["frames"])
    (cx, cy), radius = (
        manifest["geometry"]["sphere"]["center_px"],
        manifest["geometry"]["sphere"]["radius_px"],
    )
    x0, y0, x1, y1 = manifest["region"]
    assert 0 <= x0 <= cx - radius < cx + radius < x1 <= 128
    assert 0 <= y0 <= cy - radius < cy + radius < y1 <= 96
    pictures = {
        frame.get("analyzer_deg"): decode(tmp_path / frame["file"])[0] / seconds(frame)
        for frame in manifest["frames"]
        if frame["role"] != "dark"
    }
    (index,) = [complex(c["eta"], c["k"]) / AIR for c in truth["channels"] if c["channel"] == "G"]
    # Green pixels left and right, above and below the middle; the flat field is half a perfect mirror.
    for y, x in ((25, 52), (25, 92), (63, 52), (63, 92), (44, 45), (30, 71)):
        across, up = x - cx, cy - y
        theta, s_axis = np.arcsin(np.hypot(across, up) / radius), np.arctan2(up, across) + np.pi / 2
        for setting in spec.settings:
            analyzer = np.radians(setting.analyzer_deg) - s_axis
            expected = 2 * jones(theta, index, np.array([1, -1j]) / np.sqrt(2), analyzer, None, 0.0)
            measured = pictures[setting.analyzer_deg][y, x] / pictures[None][y, x]
            assert measured == pytest.approx(expected, abs=5e-4)


def test_standard_captures_suit_the_material():
    assert standard_spec("bk7").light == Light()
    gold = standard_spec("gold")
    assert gold.light == Light(linear_deg=45.0)
    assert Setting(45.0, 0.0) in gold.settings
    assert standard_spec("gold", shape="sphere").light == Light(circular="right")
    pixels = gold.sensor.width * gold.sensor.height
    assert (pixels >= 2e6, len(gold.angles_deg) >= 5, gold.sensor.bits) == (True, True, 14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"settings": ()}, "analyzer angle"),
        ({"angles_deg": ()}, "angle of incidence"),
        ({"angles_deg": (91.0,)}, "0 to 90"),
        ({"shape": "sphere", "light": Light(linear_deg=0.0)}, "alike from all sides"),
        ({"shape": "sphere", "faults": Faults(angle_offset_deg=1.0)}, "flat sample"),
    ],
)
def test_impossible_captures(changes, message):
    with pytest.raises(ReflectanceFitError, match=message):
        CaptureSpec("Au", **changes)


def test_photographs_of_others_are_left_alone(tmp_path):
    spec = CaptureSpec("N-BK7", angles_deg=(45.0,), settings=(Setting(0.0),), sensor=SMALL)
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "mine.dng").write_bytes(b"mine")
    with pytest.raises(ReflectanceFitError, match="not synthetic"):
        write_capture(tmp_path, spec)
    assert tree(tmp_path) == {"raw/mine.dng": b"mine"}


def test_an_earlier_synthetic_capture_is_replaced(tmp_path):
    long = CaptureSpec("N-BK7", angles_deg=(45.0, 50.0), settings=(Setting(0.0),), sensor=SMALL)
    short = replace(long, angles_deg=(45.0,))
    write_capture(tmp_path, long)
    manifest, _ = written(tmp_path, short)
    assert {f["file"] for f in manifest["frames"]} == {n for n in tree(tmp_path) if n.startswith("raw/")}


def test_failure_leaves_nothing(tmp_path):
    bright = CaptureSpec("N-BK7", sensor=replace(SMALL, sensitivity_e_per_s=(1e12,) * 3))
    with pytest.raises(ReflectanceFitError, match="too long"):
        write_capture(tmp_path / "new", bright)
    assert list(tmp_path.iterdir()) == []


def test_progress_counts_to_the_end(tmp_path):
    said = []
    spec = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), settings=(Setting(0.0),), sensor=SMALL)
    write_capture(tmp_path, spec, progress=lambda *what: said.append(what))
    assert [s for s in said if s[0] == "taking frames"] == [("taking frames", n, 3) for n in (1, 2, 3)]
    assert said[-1][0] == "taking darks"
    assert said[-1][1] == said[-1][2]


def test_command(tmp_path):
    words = [
        "synth",
        str(tmp_path / "out"),
        "--material",
        "bk7",
        "--angles",
        "50",
        "--analyzer",
        "90",
        "--noise",
        "none",
    ]
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 0, result.output
    manifest = load(tmp_path / "out" / "capture.yaml").data
    (frame,) = [f for f in manifest["frames"] if f["role"] == "sample"]
    assert (frame["theta_deg"], frame["analyzer_deg"]) == (50, 90)
    assert Fraction(frame["exposure_s"]) > 0


def test_exposures_are_as_exact_in_the_manifest_as_in_the_files(tmp_path):
    """1/60 is no decimal number: both are the same fraction, and the one that the sensor was exposed for."""
    spec = CaptureSpec("N-BK7", angles_deg=(50.0, 70.0), sensor=SMALL)
    capture = read_capture(write_capture(tmp_path / "out", spec))
    assert len({frame.exposure.seconds for frame in capture.frames}) > 1
    for frame in capture.frames:
        assert frame.exposure.seconds in EXPOSURES_S
        assert frame.exposure.seconds == raw_frame(frame.path).exposure_s


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--material", "unobtainium"], 1, "no built-in material"),
        (["--material", "W"], 1, "not known at 600 nm"),
        (["--material", "Au", "--angles", "95"], 1, "0 to 90"),
        (["--material", "Au", "--shape", "sphere", "--angles", "45"], 1, "all angles"),
        (["--material", "Au", "--shape", "sphere", "--light", "linear45"], 1, "alike from all sides"),
        (["--material", "Au", "--angles", "a,b"], 2, "not a list of degrees"),
        (["--material", "Au", "--analyzer", "nan"], 2, "not a list of degrees"),
        ([], 2, "--material"),
    ],
)
def test_command_errors(tmp_path, words, code, message):
    result = CliRunner().invoke(cli, ["synth", str(tmp_path / "out"), *words])
    assert result.exit_code == code
    assert message in result.stderr
    assert not (tmp_path / "out").exists()
