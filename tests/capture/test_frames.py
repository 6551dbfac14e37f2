"""Frames with the manifest's defaults applied, and which of them go together."""

import hashlib
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from reflectance_fit.capture.frames import (
    Capture,
    Exposure,
    Frame,
    Noise,
    Sphere,
    Stated,
    darks_for,
    flats_for,
)
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.truth import TrueChannel, Truth, read_truth, write_truth
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior

HEAD = """schema: reflectance_fit/capture/1
sample: {name: BK7 flat}
camera:
  sensor: bayer
  channels: {R: {wavelength_nm: 600, fwhm_nm: 90}, G: {wavelength_nm: 550}}
"""
STATED = "geometry: {kind: stated, s_axis_deg: 10}\n"
BALL = "geometry: {kind: sphere, sphere: {center_px: [9.5, 8], radius_px: 5}}\n"


def capture(folder: Path, text: str) -> Capture:
    for name in "abcdef":
        (folder / f"{name}.dng").touch()
    (folder / "capture.yaml").write_text(text)
    return read_capture(folder / "capture.yaml")


def frames(folder: Path, *entries: str, head: str = HEAD + STATED) -> tuple[Frame, ...]:
    """Frames a.dng, b.dng ... with these keys; sample frames get what they need."""
    lines = [
        f"  - {{file: {name}.dng, {'' if 'role' in entry else 'analyzer_deg: 0, '}{entry}}}\n"
        for name, entry in zip("abcdef", entries, strict=False)
    ]
    return capture(folder, head + "frames:\n" + "".join(lines)).frames


def test_defaults(tmp_path):
    text = HEAD + STATED + "frames:\n  - {file: a.dng, theta_deg: 45, analyzer_deg: 30}\n"
    c = capture(tmp_path, text)
    assert (c.path, c.sample_name, c.exterior_ior, c.reading.sensor) == (
        tmp_path / "capture.yaml",
        "BK7 flat",
        1.000277,
        "bayer",
    )
    assert {name: (x.wavelength_nm, x.fwhm_nm) for name, x in c.channels.items()} == {
        "R": (600, 90),
        "G": (550, 0),
    }
    assert c.noise is None
    assert c.focal_length_px is None
    assert c.diattenuation == {"R": 1.0, "G": 1.0}
    assert set(c.retardance_deg) == {"R", "G"}
    assert all(map(math.isnan, c.retardance_deg.values()))
    assert c.geometry == Stated(10.0)
    assert (c.light_shape, c.light_uniform) == ("small", False)
    assert c.nuisances is None
    assert c.priors == {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)}
    assert c.inputs == (("capture.yaml", hashlib.sha256(text.encode()).hexdigest()),)
    (frame,) = c.frames
    assert math.isnan(frame.retarder_deg)
    assert replace(frame, retarder_deg=0.0) == Frame(
        file="a.dng",
        path=(tmp_path / "a.dng").resolve(),
        line=8,
        sha256=None,
        role="sample",
        theta_deg=45.0,
        theta_deg_sigma=0.0,
        analyzer_deg=30.0,
        retarder_deg=0.0,
        exposure=Exposure(None, None),
        light=(1.0, 0.0, 0.0, 0.0),
        region=None,
        s_axis_deg=10.0,
        set="0",
        gain_group="0:45",
        channels=("R", "G"),
    )


def test_everything_stated(tmp_path):
    c = capture(
        tmp_path,
        HEAD
        + """  noise: {gain_e_per_dn: {R: 2, G: 3}, read_noise_e: 4}
  focal_length_px: 4200
exterior_ior: 1.33
polarizer: {diattenuation: {R: 0.99, G: 0.98}}
retarder: {retardance_deg: {G: 90}}
light: {stokes: [2, 0, 0, 1], shape: surround, uniform: true}
geometry: {kind: stated, s_axis_deg: 10}
region: [1, 2, 30, 40]
nuisances: {angle_offset_deg: {sigma: 0.5}, dark_offset: {}}
priors: {k: {uniform: [0, 1]}}
frames:
  - {file: a.dng, theta_deg: 1, analyzer_deg: 2}
  - file: b.dng
    sha256: """
        + "AB" * 32
        + """
    theta_deg: 70.25
    theta_deg_sigma: 0.1
    analyzer_deg: 135
    retarder_deg: 5
    exposure_s: 0.01
    iso: 100
    light: {linear_deg: 45}
    region: [0, 0, 10, 10]
    s_axis_deg: -80
    gain_group: lamp
    set: 7
    channel: G
""",
    )
    assert c.noise == {"R": Noise(2.0, 4.0), "G": Noise(3.0, 4.0)}
    assert c.focal_length_px == 4200
    assert c.diattenuation == {"R": 0.99, "G": 0.98}
    assert c.retardance_deg["G"] == 90
    assert math.isnan(c.retardance_deg["R"])
    assert (c.light_shape, c.light_uniform) == ("surround", True)
    assert c.nuisances == {"angle_offset_deg": 0.5, "dark_offset": None}
    assert c.priors["k"] == Prior("uniform", 0.0, 1.0)
    first, second = c.frames
    assert (first.light, first.region, first.s_axis_deg) == ((2, 0, 0, 1), (1, 2, 30, 40), 10)
    assert second.light == pytest.approx((1, 0, 1, 0))
    assert (second.region, second.s_axis_deg, second.sha256) == ((0, 0, 10, 10), -80, "ab" * 32)
    assert (second.theta_deg_sigma, second.retarder_deg, second.exposure) == (
        0.1,
        5,
        Exposure(Fraction(1, 100), 100),
    )
    assert (second.set, second.gain_group, second.channels) == ("7", "lamp", ("G",))
    assert second.line == 18
    assert c.document.line(("frames", 1, "iso")) == 25


def test_frames_may_state_the_s_axis_one_by_one(tmp_path):
    head = HEAD + "geometry: {kind: stated}\n"
    one, _dark = frames(tmp_path, "theta_deg: 45, s_axis_deg: 90", "role: dark", head=head)
    assert one.s_axis_deg == 90


def test_zero_is_stated_too(tmp_path):
    (frame,) = frames(tmp_path, "theta_deg: 0, s_axis_deg: 0")
    assert (frame.s_axis_deg, frame.theta_deg, frame.gain_group) == (0.0, 0.0, "0:0")


def test_one_gain_for_each_angle_of_a_set(tmp_path):
    found = frames(
        tmp_path,
        "theta_deg: 45",
        "theta_deg: 45.0",
        "theta_deg: 45.125",
        "theta_deg: 45, set: b",
        "theta_deg: 60, gain_group: x",
    )
    assert [f.gain_group for f in found] == ["0:45", "0:45", "0:45.125", "b:45", "x"]


def test_gains_on_a_ball(tmp_path):
    (frame,) = frames(tmp_path, "set: x", head=HEAD + BALL)
    assert frame.gain_group is None
    assert math.isnan(frame.theta_deg)
    assert math.isnan(frame.s_axis_deg)
    (frame,) = frames(tmp_path, "set: x", head=HEAD + BALL + "light: {shape: surround}\n")
    assert frame.gain_group is None
    uniform = HEAD + BALL + "light: {shape: surround, uniform: true}\n"
    (frame,) = frames(tmp_path, "set: x", head=uniform)
    assert frame.gain_group == "x"
    assert capture(tmp_path, uniform + "frames:\n  - {file: a.dng, analyzer_deg: 0}\n").geometry == Sphere(
        (9.5, 8.0), 5.0
    )


def test_a_retarder_for_the_frames_channel_is_enough(tmp_path):
    head = HEAD + STATED + "retarder: {retardance_deg: {G: 90}}\n"
    (frame,) = frames(tmp_path, "theta_deg: 1, retarder_deg: 0, channel: G", head=head)
    assert frame.retarder_deg == 0
    with pytest.raises(ReflectanceFitError, match="needs the retarder's retardance_deg for R; add it"):
        frames(tmp_path, "theta_deg: 1, retarder_deg: 0", head=head)


def test_roles_in_order(tmp_path):
    c = capture(
        tmp_path,
        HEAD
        + STATED
        + "frames:\n  - {file: b.dng, role: dark}\n  - {file: a.dng, theta_deg: 1, analyzer_deg: 0}\n"
        "  - {file: c.dng, role: dark}\n",
    )
    assert [f.file for f in c.role("dark")] == ["b.dng", "c.dng"]


def names(found: tuple[Frame, ...]) -> str:
    return "".join(f.path.stem for f in found)


def test_darks_by_what_the_manifest_states(tmp_path):
    every = frames(
        tmp_path,
        "theta_deg: 1, exposure_s: 0.01, iso: 100",
        "role: dark, exposure_s: 0.01, iso: 100",
        "role: dark, exposure_s: 0.02, iso: 100",
        "role: dark, exposure_s: 0.01, iso: 200",
        "role: dark, exposure_s: 0.01",
        "role: flat, exposure_s: 0.01, iso: 100",
    )
    assert names(darks_for(every[0], every)) == "b"


def test_darks_by_what_the_files_say(tmp_path):
    every = frames(
        tmp_path, "theta_deg: 1", "role: dark", "role: dark, exposure_s: 0.0167, iso: 100", "role: dark"
    )
    sample, one, two, three = every
    float32 = Exposure(1 / 60 * (1 + 1e-7), 100.0)
    found = {sample.path: Exposure(1 / 60, 100.0), one.path: float32, three.path: Exposure(1 / 50, 100.0)}
    assert names(darks_for(sample, every, found)) == "bc"
    # What the manifest states goes before what the file says.
    found[two.path] = Exposure(1.0, 800.0)
    assert names(darks_for(sample, every, found)) == "bc"
    # Industrial cameras write no ISO: unknown of both is equal, of one is not.
    found[sample.path] = Exposure(1 / 60, None)
    found[one.path] = Exposure(1 / 60, None)
    assert names(darks_for(sample, every, found)) == "b"
    assert names(darks_for(sample, every)) == "bd"


def test_neighbouring_exposures_differ(tmp_path):
    sample, dark = frames(tmp_path, "theta_deg: 1", "role: dark")
    for ratio in (2 ** (1 / 6), 2 ** (-1 / 6)):
        found = {sample.path: Exposure(0.01, 100), dark.path: Exposure(0.01 * ratio, 100)}
        assert darks_for(sample, (dark,), found) == ()


def test_flats_by_set_and_analyzer(tmp_path):
    every = frames(
        tmp_path,
        "theta_deg: 1",
        "role: flat",
        "role: flat, analyzer_deg: 180",
        "role: flat, analyzer_deg: 90",
        "role: flat, set: x",
        "role: dark",
    )
    sample = every[0]
    assert names(flats_for(sample, every)) == "c"
    assert names(flats_for(replace(sample, analyzer_deg=-90.0), every)) == "d"
    assert names(flats_for(replace(sample, analyzer_deg=45.0), every)) == "b"
    assert names(flats_for(replace(sample, set="x"), every)) == "e"
    assert flats_for(replace(sample, set="y"), every) == ()


def test_truth_round_trip(tmp_path):
    truth = Truth(
        material="Glas é",
        channels=(TrueChannel(channel="G", wavelength_nm=550, eta=1.519, k=0.0, brewster_deg=56.64),),
        nuisances={"angle_offset_deg": 0.25, "diattenuation": 0.999},
        frames=24,
        seed=3,
    )
    write_truth(truth, tmp_path / "truth.yaml")
    assert read_truth(tmp_path / "truth.yaml") == truth
    assert (
        (tmp_path / "truth.yaml")
        .read_text()
        .startswith("schema: reflectance_fit/truth/1\nmaterial: Glas é\n")
    )


def test_truth_of_a_table_has_no_frames(tmp_path):
    write_example(tmp_path, "Au")
    assert read_truth(tmp_path / "truth.yaml").frames is None


def test_a_truth_that_is_none(tmp_path):
    (tmp_path / "t.yaml").write_text("schema: reflectance_fit/truth/1\nmaterial: x\nchannels: []\nseed: -1\n")
    with pytest.raises(ReflectanceFitError) as caught:
        read_truth(tmp_path / "t.yaml")
    assert [p.line for p in caught.value.problems] == [3, 4]
    (tmp_path / "t.yaml").write_text("schema: reflectance_fit/capture/1\n")
    with pytest.raises(ReflectanceFitError, match="is a capture file"):
        read_truth(tmp_path / "t.yaml")
