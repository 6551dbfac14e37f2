"""Whatever a capture.yaml holds: frames, or lines a user can act on.  Never a traceback."""

import os
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reflectance_fit.capture.read import read_capture
from reflectance_fit.errors import ReflectanceFitError

YAML = """schema: reflectance_fit/capture/1
sample: {name: glass}
camera:
  sensor: bayer
  channels: {R: {wavelength_nm: 600, fwhm_nm: 90}, G: {wavelength_nm: 550}}
  noise: {gain_e_per_dn: {R: 2, G: 2.2}, read_noise_e: 3}
polarizer: {diattenuation: 0.999}
retarder: {retardance_deg: {R: 80, G: 90}}
light: {stokes: [1, 0, 0, 0], shape: small}
geometry: {kind: stated, s_axis_deg: 0}
region: [0, 0, 64, 64]
frames:
  - {file: raw/a.dng, role: sample, theta_deg: 45, analyzer_deg: 0, retarder_deg: 3, exposure_s: 0.01}
  - {file: raw/b.dng, role: dark, exposure_s: 0.01, set: 2}
nuisances: {diffuse: {sigma: 0.01}}
priors: {eta: {uniform: [1, 3]}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With both photographs, which reading the manifest does not open."""
    (tmp_path / "raw").mkdir()
    for name in "ab":
        (tmp_path / "raw" / f"{name}.dng").touch()
    return tmp_path


def lines(folder: Path, yaml: str | bytes) -> list[str]:
    """The error lines of a reading, without the folder's name."""
    (folder / "c.yaml").write_bytes(yaml if isinstance(yaml, bytes) else yaml.encode())
    with pytest.raises(ReflectanceFitError) as caught:
        read_capture(folder / "c.yaml")
    return [line.replace(f"{folder}{os.sep}", "") for line in caught.value.lines()]


def test_the_valid_file_is_valid(folder):
    (folder / "c.yaml").write_text(YAML)
    assert len(read_capture(folder / "c.yaml").frames) == 2


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("{name: glass}", "&a {name: glass}", "c.yaml:2: anchors (&a) are refused"),
        ("{name: glass}", "!!python/object:os.system {name: glass}", "c.yaml:2: tags ("),
        ("light: ", "<<: ", "c.yaml:9: merge keys (<<) are refused"),
        ("region: ", "light: ", "c.yaml:11: duplicate key 'light' (first in line 9); keep one"),
        ("0.999", ".nan", "c.yaml:7: polarizer.diattenuation: must be a finite number"),
        ("0.999", "1e999", "c.yaml:7: polarizer.diattenuation: must be a finite number"),
        ("R: 2,", "R: .inf,", "c.yaml:6: camera.noise.gain_e_per_dn.R: must be a finite number"),
        ("0.999", "{R: {G: 1}}", "c.yaml:7: polarizer.diattenuation.R: must be a valid number"),
        ("{kind: stated, s_axis_deg: 0}", "stated", "c.yaml:10: geometry: must be a block of keys"),
        ("[0, 0, 64, 64]", f"[0, 0, 64, {'9' * 500}]", "c.yaml:11: a number of 500 digits is refused"),
        ("[0, 0, 64, 64]", "all", "c.yaml:11: region: must be a list"),
        ("frames:\n", "frames: x\nframe:\n", "c.yaml:12: frames: must be a list"),
        ("set: 2", "set: true", "c.yaml:14: frames.1.set: must be text"),
        ("set: 2", 'set: "\\uD800"', "c.yaml:14: frames.1.set: must be text, without half characters"),
        ("R: {wave", '"": {wave', "c.yaml:5: "),
        ("file: raw/b.dng, ", "", "c.yaml:14: frames.1: 'file' is missing; add it"),
        ("file: raw/b.dng", "file: 3", "c.yaml:14: frames.1.file: must be text; put it in quotes (found 3)"),
    ],
)
def test_yaml(folder, old, new, expected):
    assert old in YAML
    found = lines(folder, YAML.replace(old, new, 1))
    assert found[0].startswith(f"Error: {expected}"), found


def test_a_manifest_that_is_no_file(tmp_path):
    for path in (
        tmp_path / "none.yaml",
        tmp_path,
        Path("/dev/zero"),
        tmp_path / "a\0b",
        tmp_path / ("x" * 999),
    ):
        with pytest.raises(ReflectanceFitError) as caught:
            read_capture(path)
        assert len(caught.value.lines()) == 1


@pytest.mark.parametrize(
    "name",
    [
        "../a.dng",
        "/etc/hostname",
        "raw/../raw/a.dng",
        "raw/../../a.dng",
        "link.dng",
        "linked/a.dng",
        "/dev/zero",
    ],
)
def test_paths_that_lead_outside(tmp_path, name):
    (tmp_path / "a.dng").touch()
    inside = tmp_path / "inside"
    (inside / "raw").mkdir(parents=True)
    for here in "ab":
        (inside / "raw" / f"{here}.dng").touch()
    (inside / "link.dng").symlink_to(tmp_path / "a.dng")
    (inside / "linked").symlink_to(tmp_path)
    (line,) = lines(inside, YAML.replace("raw/a.dng", name))
    assert line.startswith(
        f"Error: c.yaml:13: frames.0: '{name}' leads outside the folder of c.yaml; copy the"
    )


def test_paths_that_are_no_file(folder):
    (folder / "folder").mkdir()
    os.mkfifo(folder / "fifo")
    (folder / "loop").symlink_to("loop")
    (folder / "device").symlink_to("/dev/zero")
    for name, message in (
        ("none.dng", "none.dng: there is no such file"),
        ("folder", "folder: is a folder, not a file"),
        ("fifo", "fifo: is not a regular file"),
        ("device", "leads outside the folder"),
        ("raw/a.dng/x", ""),
        ('"a\\0b"', ""),
        ('"\\e[2J"', ""),
        ("loop", ""),
        ("x" * 999, ""),
        ('"\\uD800"', ""),
        (".", ""),
    ):
        (line,) = lines(folder, YAML.replace("raw/b.dng", name))
        assert line.startswith("Error: c.yaml:14: frames.1"), line
        assert message in line
        assert line.isprintable()


def test_many_frames_are_read_in_time(folder):
    entry = "  - {file: raw/a.dng, theta_deg: 4, analyzer_deg: 0}\n"
    text = YAML.replace("nuisances:", entry * 5000 + "nuisances:")
    found = lines(folder, text)
    assert len(found) == 20
    assert "is also the frame of line 13; keep one" in found[0]


NASTY = [
    *"[]{}:?-#,;|>&*!%@`'\"\t\r\x0c\u2028\ud7ffé",
    *[
        "null",
        "true",
        ".nan",
        "-1",
        "1e999",
        "0x10",
        "0o7",
        "<<",
        "9e9",
        "sphere",
        "detect",
        "charuco",
        "dofp",
    ],
]


@st.composite
def mutated(draw: st.DrawFn, text: str) -> bytes:
    """``text`` with up to four pieces cut, doubled, or overwritten by what tends to hurt."""
    raw = text.encode()
    nasty = st.sampled_from(NASTY).map(str.encode)
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(raw)))
        end = min(len(raw), start + draw(st.integers(0, 20)))
        piece = draw(st.one_of(st.just(b""), st.just(raw[start:end] * 2), nasty, st.binary(max_size=5)))
        raw = raw[:start] + piece + raw[end:]
    return raw


VALUES = [
    "1", "-1", "0", "1e9", ".inf", "x", "true", "[]", "{}", "[1, 2]", "{R: 1}", "{R: 1, G: 1}", "{kind: sphere}",
    "{circular: left}", "detect", "linear", "sphere", "mono", "dofp", "{center_px: [1, 2], radius_px: 3}", "",
]  # fmt: skip


@st.composite
def swapped(draw: st.DrawFn) -> bytes:
    """Valid YAML with wrong values: further in than cut text gets."""
    text = YAML
    for _ in range(draw(st.integers(1, 3))):
        spots = [m.span(1) for m in re.finditer(r": ([\w.]+|\{[^{}]*\}|\[[^\[\]]*\])(?=[,}\n])", text)]
        if spots:
            start, end = draw(st.sampled_from(spots))
            text = text[:start] + draw(st.sampled_from(VALUES)) + text[end:]
    return text.encode()


FUZZ = settings(
    max_examples=400,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@FUZZ
@given(
    st.one_of(
        mutated(YAML), swapped(), st.text(max_size=200).map(lambda t: t.encode("utf-8", "surrogatepass"))
    )
)
def test_fuzz(folder, yaml):
    (folder / "c.yaml").write_bytes(yaml)
    try:
        assert len(read_capture(folder / "c.yaml").frames) > 0
    except ReflectanceFitError as error:
        for line in error.lines():
            assert re.match(r"Error: (.*c\.yaml|and \d+ more)", line)
            assert line.isprintable()
