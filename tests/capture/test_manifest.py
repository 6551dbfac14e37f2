"""capture.yaml by itself: every wrong key has its line and says what to do."""

import re
from fractions import Fraction
from pathlib import Path

import pytest

from reflectance_fit.capture.manifest import Manifest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reading import Reading
from reflectance_fit.capture.truth import Truth
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.strict_yaml import parse, validate

HEAD = """schema: reflectance_fit/capture/1
sample: {name: glass}
camera: {sensor: bayer, channels: {R: {wavelength_nm: 600, fwhm_nm: 90}, G: {wavelength_nm: 550}}}
geometry: {kind: stated, s_axis_deg: 0}
"""
FRAMES = "frames:\n  - {file: a.dng, theta_deg: 45, analyzer_deg: 0}\n"
BALL = HEAD.replace("kind: stated, s_axis_deg: 0", "kind: sphere, sphere: {center_px: [9, 9], radius_px: 5}")
MONO = HEAD.replace("bayer", "mono").replace("R: {wavelength_nm: 600, fwhm_nm: 90}, ", "")


def problems(folder: Path, text: str) -> list[str]:
    """Every problem of ``text`` as ``line: message``; a.dng to c.dng are there."""
    for name in "abc":
        (folder / f"{name}.dng").touch()
    path = folder / "capture.yaml"
    path.write_text(text)
    with pytest.raises(ReflectanceFitError) as caught:
        read_capture(path)
    assert {p.file for p in caught.value.problems} == {str(path)}
    return [f"{p.line}: {p.message}" for p in caught.value.problems]


def problem(folder: Path, text: str) -> str:
    (only,) = problems(folder, text)
    return only


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("light: {stokes: [1, 1, 1, 0]}", "5: light: more polarized than possible"),
        ("light: {linear_deg: 1, circular: left}", "5: light: give exactly one of"),
        ("light: {shape: big}", "5: light.shape: must be 'small' or 'surround' (found 'big')"),
        ("light: {uniform: 1}", "5: light.uniform: must be a valid boolean"),
        ("light: {uniform: true}", "5: light.uniform: belongs to light with shape: surround"),
        ("exterior_ior: 0", "5: exterior_ior: must be greater than 0 (found 0)"),
        (
            "polarizer: {diattenuation: 1.2}",
            "5: polarizer.diattenuation: must be less than or equal to 1 (found 1.2)",
        ),
        ("polarizer: {diattenuation: {R: 0, G: 1}}", "5: polarizer.diattenuation.R: must be greater than 0"),
        ("polarizer: {diattenuation: {R: 1}}", "5: polarizer.diattenuation: says nothing of G; add it"),
        (
            "polarizer: {diattenuation: {R: 1, G: 1, B: 1}}",
            "5: polarizer.diattenuation.B: 'B' is not among camera.channels; there are R, G",
        ),
        ("polarizer: {diattenuation: [1]}", "5: polarizer.diattenuation: must be a valid number"),
        ("polarizer: {diattenuation: }", "5: polarizer.diattenuation: has no value"),
        ("polarizer: {}", "5: polarizer: 'diattenuation' is missing; add it"),
        ("retarder: {retardance_deg: 0}", "5: retarder.retardance_deg: must be greater than 0"),
        ("retarder: {retardance_deg: {H: 90}}", "5: retarder.retardance_deg.H: 'H' is not among"),
        ("region: [1, 2, 3]", "5: region: must have at least 4 items, not 3"),
        ("region: [5, 0, 5, 9]", "5: region: must be [x0, y0, x1, y1] with x0 below x1"),
        ("region: [0, 9, 5, 5]", "5: region: must be [x0, y0, x1, y1] with x0 below x1"),
        ("region: [-1, 0, 5, 5]", "5: region.0: must be greater than or equal to 0 (found -1)"),
        ("region: [0.5, 0, 5, 5]", "5: region.0: must be a valid integer"),
        ("nuisances: {difuse: {}}", "5: nuisances.difuse: unknown nuisance, did you mean 'diffuse'?"),
        ("nuisances:", "5: nuisances: has no value"),
        ("priors: {eta: {uniform: [2, 1]}}", "5: priors.eta: the range must be"),
        ("polariser: {diattenuation: 1}", "5: unknown key 'polariser', did you mean 'polarizer'?"),
        ("tables: []", "5: unknown key 'tables'"),
    ],
)
def test_top_level_problems(tmp_path, text, expected):
    assert problem(tmp_path, f"{HEAD}{text}\n{FRAMES}").startswith(expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("bayer", "xtrans", "3: camera.sensor: must be 'bayer', 'mono', 'dofp' or 'dofp_bayer'"),
        ("R: {", "H: {", "3: camera.channels.H: a bayer sensor has the channels R, G and B"),
        ("wavelength_nm: 600", "wavelength_nm: 0.6", "3: camera.channels.R.wavelength_nm: must be greater"),
        ("wavelength_nm: 600", "wavelenght_nm: 600", "3: camera.channels.R: "),
        ("fwhm_nm: 90", "fwhm_nm: -1", "3: camera.channels.R.fwhm_nm: must be greater than or equal to 0"),
        ("sensor: bayer", "sensor: bayer, gain: 1", "3: camera: unknown key 'gain'"),
        (
            "sensor: bayer",
            "sensor: bayer, dofp_layout_deg: [[90, 45], [135, 0]]",
            "3: camera.dofp_layout_deg: belongs to dofp sensors; remove it",
        ),
        (
            "sensor: bayer",
            "sensor: bayer, noise: {gain_e_per_dn: {R: 2}, read_noise_e: 3}",
            "3: camera.noise.gain_e_per_dn: says nothing of G; add it",
        ),
        (
            "sensor: bayer",
            "sensor: bayer, noise: {gain_e_per_dn: 2}",
            "3: camera.noise: 'read_noise_e' is missing",
        ),
        (
            "sensor: bayer",
            "sensor: bayer, focal_length_px: 0",
            "3: camera.focal_length_px: must be greater than 0",
        ),
        (
            ", s_axis_deg: 0",
            "",
            "4: geometry: s_axis_deg is missing; add the angle from the picture's horizontal",
        ),
        ("kind: stated", "kind: flat", "4: geometry.kind: must be 'stated', 'charuco' or 'sphere'"),
        ("kind: stated, ", "", "4: geometry: 'kind' is missing; add it"),
        (
            "s_axis_deg: 0",
            "s_axis_deg: 0, sphere: {center_px: [1, 2], radius_px: 3}",
            "4: geometry.sphere: belongs to kind: sphere, and the kind is stated; remove it",
        ),
        (
            "kind: stated, s_axis_deg: 0",
            "kind: sphere",
            "4: geometry: sphere is missing; kind: sphere needs it",
        ),
        (
            "kind: stated, s_axis_deg: 0",
            "kind: sphere, sphere: {center_px: [1, 2], radius: 3}",
            "4: geometry.sphere: ",
        ),
        (
            "kind: stated, s_axis_deg: 0",
            "kind: sphere, sphere: found",
            "4: geometry.sphere: must be 'detect'",
        ),
    ],
)
def test_camera_and_geometry_problems(tmp_path, old, new, expected):
    assert old in HEAD
    found = problems(tmp_path, HEAD.replace(old, new) + FRAMES)
    assert any(line.startswith(expected) for line in found), found


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("theta_deg: 90", "theta_deg: must be less than 90"),
        ("theta_deg: -1", "theta_deg: must be greater than or equal to 0"),
        ("theta_deg: '45'", "theta_deg: must be a valid number"),
        ("theta_deg: .nan", "theta_deg: must be a finite number"),
        ("theta_deg_sigma: -1", "theta_deg_sigma: must be greater than or equal to 0"),
        ("exposure_s: 0", "exposure_s: must be above 0 and below a million seconds"),
        ("exposure_s: 1/0", "exposure_s: must be a number of seconds, such as 0.01 or 1/60"),
        ("exposure_s: .inf", "exposure_s: must be a number of seconds, such as 0.01 or 1/60"),
        ("exposure_s: true", "exposure_s: must be a number of seconds, such as 0.01 or 1/60"),
        ("exposure_s: [1, 60]", "exposure_s: must be a number of seconds, such as 0.01 or 1/60"),
        ("iso: 0", "iso: must be greater than 0"),
        ("role: smaple", "role: must be 'sample', 'dark', 'flat'"),
        ("sha256: 3f", "sha256: must be 64 hexadecimal digits, as sha256sum prints (found '3f')"),
        (f"sha256: {'g' * 64}", "sha256: must be 64 hexadecimal digits"),
        ("channel: B", "channel: 'B' is not among camera.channels; there are R, G"),
        ("region: [9, 9, 1, 1]", "region: must be [x0, y0, x1, y1]"),
        ("light: {}", "light: give exactly one of"),
        ("light: {shape: small}", "light: unknown key 'shape'"),
        ("set: [1]", "set: must be text"),
        ("retarder_deg: 45", "retarder_deg: needs the retarder's retardance_deg for R, G; add it"),
        ("thetadeg: 1", "unknown key 'thetadeg', did you mean 'theta_deg'?"),
    ],
)
def test_frame_problems(tmp_path, frame, expected):
    entry = f"  - {{file: b.dng, theta_deg: 30, analyzer_deg: 0, {frame}}}\n"
    if frame.startswith("theta_deg:"):
        entry = f"  - {{file: b.dng, analyzer_deg: 0, {frame}}}\n"
    found = problems(tmp_path, HEAD + FRAMES + entry)
    assert any(line.startswith(("7: frames.1." + expected, "7: frames.1: " + expected)) for line in found), (
        found
    )


def test_what_a_sample_frame_must_say(tmp_path):
    assert problems(tmp_path, HEAD + "frames:\n  - {file: a.dng}\n  - {file: b.dng, role: dark}\n") == [
        "6: frames.0: theta_deg is missing; add the angle of incidence in degrees",
    ]
    assert problem(tmp_path, HEAD + "frames:\n  - {file: a.dng, theta_deg: 3}\n").startswith(
        "6: frames.0: analyzer_deg is missing"
    )


def test_on_a_ball_frames_state_no_angle(tmp_path):
    assert problem(tmp_path, BALL + FRAMES) == (
        "6: frames.0.theta_deg: belongs to geometry kind: stated; here the ball says it; remove it"
    )
    frames = "frames:\n  - {file: a.dng, analyzer_deg: 0, s_axis_deg: 3}\n"
    assert problem(tmp_path, BALL + frames).startswith("6: frames.0.s_axis_deg: belongs to")


@pytest.mark.parametrize("where", ["top", "frame"])
def test_linear_light_on_a_ball(tmp_path, where):
    top, frame = ("light: {linear_deg: 45}\n", "") if where == "top" else ("", ", light: {linear_deg: 45}")
    text = f"{BALL}{top}frames:\n  - {{file: a.dng, analyzer_deg: 0{frame}}}\n"
    assert "alike from all sides: unpolarized or circular" in problem(tmp_path, text)


def test_there_must_be_a_sample(tmp_path):
    assert problem(tmp_path, HEAD + "frames:\n  - {file: a.dng, role: dark}\n").startswith(
        "5: frames: no frame shows the sample"
    )
    assert problem(tmp_path, HEAD + "frames: []\n") == "5: frames: must have at least 1 item, not 0"
    assert problem(tmp_path, HEAD) == "1: 'frames' is missing; add it"


def test_every_lit_frame_of_a_sensor_without_colour_filters_names_its_channel(tmp_path):
    text = HEAD.replace("bayer", "mono") + FRAMES
    assert problem(tmp_path, text) == "6: frames.0: channel is missing; say which one the frame belongs to"
    (tmp_path / "b.dng").touch()
    (tmp_path / "capture.yaml").write_text(
        text.replace("a.dng,", "a.dng, channel: G,") + "  - {file: b.dng, role: dark}\n"
    )
    capture = read_capture(tmp_path / "capture.yaml")
    assert [frame.channels for frame in capture.frames] == [("G",), tuple(capture.channels)]


@pytest.mark.parametrize(
    ("camera", "expected"),
    [
        ("sensor: bayer, encoding: linear", "3: camera: pattern is missing; add the colours"),
        ("sensor: bayer, pattern: RGGB", "3: camera.pattern: belongs to PNG and TIFF"),
        ("sensor: bayer, encoding: linear, pattern: RGBG", "3: camera.pattern: must be 'RGGB'"),
        ("sensor: bayer, encoding: gamma", "3: camera.encoding: must be 'linear' or 'srgb'"),
        (
            "sensor: bayer, black_dn: {R: 1, X: 1}",
            "3: camera.black_dn.X: a bayer sensor has the channels R, G",
        ),
        ("sensor: bayer, black_dn: -1", "3: camera.black_dn: must be greater than or equal to 0"),
        ("sensor: bayer, white_dn: 0", "3: camera.white_dn: must be greater than 0"),
        ("sensor: bayer, black_dn: 64, white_dn: 64", "3: camera.white_dn: must be above black_dn, 64"),
        ("sensor: bayer, black_dn: {B: 64}, white_dn: 63", "3: camera.white_dn: must be above black_dn, 64"),
        (
            "sensor: bayer, encoding: srgb, pattern: RGGB, black_dn: 3",
            "3: camera.black_dn: belongs to linear values",
        ),
    ],
)
def test_levels_and_encoding(tmp_path, camera, expected):
    assert problem(tmp_path, HEAD.replace("sensor: bayer", camera) + FRAMES).startswith(expected)


def test_levels_of_a_sensor_without_colour_filters(tmp_path):
    for camera, expected in (
        ("sensor: mono, pattern: RGGB", "3: camera.pattern: belongs to sensors with colour filters"),
        ("sensor: mono, white_dn: {G: 4095}", "3: camera.white_dn: a mono sensor has one level"),
    ):
        assert problem(tmp_path, MONO.replace("sensor: mono", camera) + FRAMES).startswith(expected)


def test_what_is_stated_goes_to_the_reading(tmp_path):
    (tmp_path / "a.dng").touch()
    path = tmp_path / "capture.yaml"
    path.write_text(HEAD.replace("bayer", "bayer, black_dn: 64, white_dn: {G: 4000}") + FRAMES)
    reading = read_capture(path).reading
    assert (reading.black_dn, reading.white_dn) == ({"R": 64, "G": 64, "B": 64}, {"G": 4000})
    assert reading.encoding is None
    path.write_text(MONO.replace("mono", "mono, encoding: srgb") + FRAMES)
    assert read_capture(path).reading == Reading("mono", encoding="srgb")
    path.write_text(MONO.replace("mono", "mono, black_dn: 3.5") + FRAMES)
    assert read_capture(path).reading == Reading("mono", black_dn={"mono": 3.5})


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("1/60", Fraction(1, 60)),
        ("0.01", Fraction(1, 100)),
        ("2", 2),
        ("1e-3", Fraction(1, 1000)),
        ("'1 / 8'", Fraction(1, 8)),
    ],
)
def test_exposures_are_exact(tmp_path, text, seconds):
    (tmp_path / "a.dng").touch()
    path = tmp_path / "capture.yaml"
    path.write_text(HEAD + FRAMES.replace("}", f", exposure_s: {text}}}"))
    (frame,) = read_capture(path).frames
    assert frame.exposure.seconds == seconds
    assert isinstance(frame.exposure.seconds, Fraction)


def test_a_retarder_has_no_angle_from_an_s_that_turns(tmp_path):
    text = (
        (HEAD + FRAMES)
        .replace("stated, s_axis_deg: 0", "sphere, sphere: {center_px: [50, 50], radius_px: 20}")
        .replace("theta_deg: 45, ", "")
        .replace("analyzer_deg: 0", "analyzer_deg: 0, retarder_deg: 20")
    )
    assert "retarder_deg: belongs to geometry kind: stated" in problem(tmp_path, text)


@pytest.mark.parametrize("again", ["a.dng", "./a.dng", "link.dng"])
def test_a_file_twice(tmp_path, again):
    (tmp_path / "link.dng").symlink_to("a.dng")
    text = f"{HEAD}{FRAMES}  - {{file: b.dng, role: dark}}\n  - {{file: {again}, role: dark}}\n"
    assert problem(tmp_path, text) == f"8: frames.2: {again} is also the frame of line 6; keep one"


@pytest.mark.parametrize("name", ["a.jpg", "a.JPEG", "a.png", "a.tif", "a.Tiff"])
def test_images_that_are_not_raw(tmp_path, name):
    (tmp_path / name).touch()
    assert problem(tmp_path, HEAD + FRAMES.replace("a.dng", name)) == (
        f"6: frames.0.file: '{name}' is not RAW; 8-bit and gamma-encoded images are refused unless"
        " camera.encoding says how to undo that; give the camera's RAW file"
    )


@pytest.mark.parametrize(
    ("schema", "expected"),
    [
        (
            "reflectance_fit/measurement/1",
            "1: is a measurement file (reflectance_fit/measurement/1); a capture file",
        ),
        ("reflectance_fit/capture/2", "1: schema reflectance_fit/capture/2 is not known"),
        ("something", "1: schema must be 'reflectance_fit/capture/1' (found 'something')"),
    ],
)
def test_another_schema_is_said_first_and_alone(tmp_path, schema, expected):
    assert problem(tmp_path, f"schema: {schema}\ntables: []\n").startswith(expected)


def test_all_problems_at_once_in_file_order(tmp_path):
    text = HEAD.replace("R: {", "Q: {") + "region: [3, 3, 1, 1]\nframes:\n"
    text += "  - {file: a.dng}\n  - {file: none.dng, role: dark}\n  - {file: ../x.dng, role: dark}\n"
    found = problems(tmp_path, text)
    assert [int(line.partition(":")[0]) for line in found] == [3, 5, 7, 8, 9]


def test_every_field_is_described_for_editors():
    schema = Manifest.model_json_schema()
    assert {"schema", "sample", "camera", "geometry", "frames"} == set(schema["required"])
    for name, model in {"top": schema, **schema["$defs"]}.items():
        assert model["additionalProperties"] is False
        for key, entry in model["properties"].items():
            assert entry.get("description") or name == "PriorRange", key
    assert "diffuse" in schema["properties"]["nuisances"]["propertyNames"]["enum"]
    gain = schema["$defs"]["Noise"]["properties"]["gain_e_per_dn"]["oneOf"]
    assert [choice["type"] for choice in gain] == ["number", "object"]


def test_the_page_shows_valid_files():
    pages = Path(__file__).parents[2] / "docs" / "formats"
    shown = {
        name: re.findall(
            r"^```yaml\n(.*?)^```$", (pages / f"{name}.md").read_text(), re.MULTILINE | re.DOTALL
        )
        for name in ("capture", "truth")
    }
    assert [len(texts) for texts in shown.values()] == [1, 1]
    validate(parse(shown["capture"][0], "capture.md"), Manifest)
    validate(parse(shown["truth"][0], "truth.md"), Truth)


def test_the_page_names_every_key():
    text = (Path(__file__).parents[2] / "docs" / "formats" / "capture.md").read_text()
    schema = Manifest.model_json_schema()
    parts = [
        schema,
        *(schema["$defs"][name] for name in ("Camera", "Geometry", "FrameEntry", "Illumination")),
    ]
    for part in parts:
        for key in part["properties"]:
            assert re.search(rf"`[^`]*\b{key}\b", text), key
