"""Captures as files, from photographs to a fit: what is checked, what is told, and what a bad frame costs."""

import hashlib
import importlib
import os
import re
import shutil
import sys
from dataclasses import fields, replace
from fractions import Fraction

import numpy as np
import pytest
import yaml

from reflectance_fit import workflow
from reflectance_fit.capture import decoding as module
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference import posterior
from reflectance_fit.observations_file import read_observations
from reflectance_fit.workflow_ingest import ingest_to_file

SPEC = CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=Sensor(width=96, height=64), seed=4)
SAMPLES = 8


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glass")
    write_capture(folder, SPEC)
    return folder


@pytest.fixture
def capture(original, tmp_path):
    """A copy to harm: its capture.yaml."""
    shutil.copytree(original, tmp_path / "glass")
    return tmp_path / "glass" / "capture.yaml"


def change(capture, *, hashes=False, **changes):
    """Rewrite top-level keys; without the hashes unless they stay."""
    data = yaml.safe_load(capture.read_text())
    for frame in data["frames"]:
        if not hashes:
            frame.pop("sha256", None)
    data |= changes
    capture.write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=1000))
    return data


def edit(capture, number, **changes):
    """Change keys of one frame, None to remove; without hashes."""
    data = yaml.safe_load(capture.read_text())
    for frame in data["frames"]:
        frame.pop("sha256", None)
    frame = data["frames"][number] | changes
    data["frames"][number] = {key: value for key, value in frame.items() if value is not None}
    change(capture, frames=data["frames"])


def read(capture):
    return ingest(read_capture(capture))


def problems(capture):
    """The error lines, file names without the folder; the program must have written nothing."""
    before = sorted(capture.parent.rglob("*"))
    with pytest.raises(ReflectanceFitError) as caught:
        read(capture)
    assert sorted(capture.parent.rglob("*")) == before
    return [line.replace(f"{capture.parent}{os.sep}", "") for line in caught.value.lines()]


def line_of(capture, file):
    return next(n for n, line in enumerate(capture.read_text().splitlines(), 1) if file in line)


def one_channel(measurement, name="G"):
    rows = measurement.observations
    return replace(measurement, observations=rows.select(rows.channel == name))


def quick(monkeypatch):
    monkeypatch.setattr(posterior, "MIN_ESS", 500.0)
    monkeypatch.setattr(posterior, "MAX_STEPS", 1500)


def test_a_whole_capture(capture):
    told = []
    ingested = ingest(read_capture(capture), progress=lambda *what: told.append(what))
    rows = ingested.measurement.observations
    assert len(rows) == 3 * SAMPLES
    assert (rows.flag == "used").all()
    assert set(rows.pixels) == {48 * 32 // 4, 48 * 32 // 2}
    assert ingested.rejected == {}
    assert ingested.measurement.warnings == ()
    assert [sample.frame.file for sample in ingested.samples] == [f"raw/{i:03d}.dng" for i in range(SAMPLES)]
    frames = len(list((capture.parent / "raw").iterdir()))
    darks = len(ingested.capture.role("dark"))
    assert told == [
        *(("looking for hot pixels", i, darks) for i in range(1, darks + 1)),
        *(("reading frames", i, frames) for i in range(1, frames + 1)),
    ]
    assert [file for file, _ in ingested.measurement.inputs[1:]] == [
        f"raw/{i:03d}.dng" for i in range(frames)
    ]
    for file, digest in ingested.measurement.inputs:
        assert digest == hashlib.sha256((capture.parent / file).read_bytes()).hexdigest()
    assert np.all(rows.sigma < 2e-3 * rows.value.max())


def test_a_changed_file_is_told_with_its_line(capture):
    for name in ("raw/002.dng", "raw/005.dng"):
        file = capture.parent / name
        file.write_bytes(file.read_bytes()[:-1] + b"\xff")
    found = problems(capture)
    assert len(found) == 2
    for line, name in zip(found, ("raw/002.dng", "raw/005.dng"), strict=True):
        assert line.startswith(
            f"Error: capture.yaml:{line_of(capture, name)}: {name} has changed: its sha256 is "
        )


def test_without_a_hash_the_user_is_told(capture):
    edit(capture, 0)
    (note,) = read(capture).measurement.warnings
    assert note.code == "NO_HASHES"
    assert "ingest --write-hashes" in note.message


def test_write_hashes_keeps_what_a_person_wrote(capture, tmp_path):
    edit(capture, 0)
    text = "# my rig\n" + capture.read_text().replace("frames:\n", "frames:   # all of them\n")
    text = re.sub(r"name: .*\}", "name: \"K9 'old'\"}", text, count=1)
    assert "sha256" not in text
    assert "# all of them" in text
    capture.write_text(text)
    said = []
    ingest_to_file(
        capture,
        tmp_path / "o.nc",
        write_hashes=True,
        pictures=False,
        progress=lambda *what: said.append(what),
    )
    new = capture.read_text()
    assert new.startswith("# my rig\n")
    assert "# all of them" in new
    assert "\"K9 'old'\"" in new
    frames = yaml.safe_load(new)["frames"]
    for frame in frames:
        assert (
            frame.pop("sha256") == hashlib.sha256((capture.parent / frame["file"]).read_bytes()).hexdigest()
        )
    assert frames == yaml.safe_load(text)["frames"]
    old, new_data = yaml.safe_load(text), yaml.safe_load(new)
    assert {k: v for k, v in old.items() if k != "frames"} == {
        k: v for k, v in new_data.items() if k != "frames"
    }
    assert read(capture).measurement.warnings == ()
    assert read_observations(tmp_path / "o.nc").warnings == ()
    again = capture.read_bytes()
    ingest_to_file(capture, tmp_path / "o.nc", write_hashes=True, pictures=False, progress=lambda *_: None)
    assert capture.read_bytes() == again


def test_mixed_iso(capture):
    edit(capture, 1, iso=200)
    (line,) = problems(capture)
    assert (
        line
        == "Error: capture.yaml: the frames were taken at ISO 100, 200: their gains and noise differ; use one"
    )


def test_an_exposure_that_nobody_states(capture):
    stated = yaml.safe_load(capture.read_text())["frames"][1]["exposure_s"]
    edit(capture, 1, exposure_s=None)
    file = capture.parent / "raw/001.dng"
    assert read(capture).settings[file].seconds == Fraction(stated)
    tag = (33434).to_bytes(2, "little") + (5).to_bytes(2, "little") + (1).to_bytes(4, "little")
    assert file.read_bytes().count(tag) == 1
    file.write_bytes(file.read_bytes().replace(tag, b"\xff\xff" + tag[2:]))
    (line,) = problems(capture)
    number = line_of(capture, "raw/001.dng")
    assert line == f"Error: capture.yaml:{number}: raw/001.dng has no exposure time; state exposure_s"


def test_a_missing_frame(capture):
    (capture.parent / "raw/003.dng").unlink()
    (line,) = problems(capture)
    assert line.startswith(f"Error: capture.yaml:{line_of(capture, 'raw/003.dng')}: frames.3: ")
    assert "there is no such file" in line


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda raw: b"\xff\xd8\xff\xe0\0\x10JFIF\0" + bytes(500), "is a JPEG, whose values are not linear"),
        (lambda raw: raw[: len(raw) // 2], "is cut off at "),
        (lambda raw: b"", "the file is empty"),
        (lambda raw: b"not a picture", "has no header of a raw format"),
        (
            lambda raw: (
                b"II*\0\x08\0\0\0\x02\0"
                + b"\0\1\4\0\1\0\0\0\x10\0\0\0"
                + b"\1\1\4\0\1\0\0\0\x10\0\0\0"
                + bytes(4)
            ),
            "is a plain TIFF without a raw image",
        ),
    ],
)
def test_what_is_no_raw_photograph(capture, content, message):
    edit(capture, 0)
    for name in ("raw/004.dng", "raw/006.dng"):
        file = capture.parent / name
        file.write_bytes(content(file.read_bytes()))
    first, second = problems(capture)
    assert first.startswith(f"Error: capture.yaml:{line_of(capture, 'raw/004.dng')}: raw/004.dng {message}")
    assert second.startswith(f"Error: capture.yaml:{line_of(capture, 'raw/006.dng')}: raw/006.dng {message}")


def test_a_colour_sensor_stated_mono(capture):
    camera = {"sensor": "mono", "channels": {"550": {"wavelength_nm": 550}}}
    change(capture, camera=camera)
    (line,) = problems(capture)
    assert line.startswith(
        f"Error: capture.yaml:{line_of(capture, 'raw/000.dng')}: raw/000.dng has the planes B, G, R"
    )
    assert "camera.sensor says mono" in line


def mono_dng(path, level):
    cfa = np.full((64, 96), level, dtype=np.uint16)
    cfa[0, 0] = 100
    metadata = DngMetadata("MONO", 14, (100,) * 4, 16000, Fraction(1, 100), 100, ((1e-4, 1e-6),))
    write_dng(path, cfa, metadata)


def test_a_mono_sensor_stated_bayer(capture):
    mono_dng(capture.parent / "raw/002.dng", 1000)
    edit(capture, 0)
    (line,) = problems(capture)
    assert line.startswith(
        f"Error: capture.yaml:{line_of(capture, 'raw/002.dng')}: raw/002.dng has the planes mono"
    )


def test_a_region_beside_the_picture(capture):
    edit(capture, 2, region=[500, 500, 600, 600])
    (line,) = problems(capture)
    number = line_of(capture, "raw/002.dng")
    assert line.startswith(f"Error: capture.yaml:{number}: raw/002.dng does not show the region")


def test_a_ball_beside_the_picture(capture):
    data = yaml.safe_load(capture.read_text())
    frames = [{k: v for k, v in f.items() if k not in ("sha256", "theta_deg")} for f in data["frames"]]
    geometry = {"kind": "sphere", "sphere": {"center_px": [900, 900], "radius_px": 50}}
    change(capture, frames=frames, geometry=geometry)
    found = problems(capture)
    assert len(found) == SAMPLES
    assert "raw/000.dng does not show the ball" in found[0]


def test_a_dark_of_another_size(capture):
    data = yaml.safe_load(capture.read_text())
    dark = next(f["file"] for f in data["frames"] if f["role"] == "dark")
    write_dng(
        capture.parent / dark,
        np.arange(30 * 40, dtype=np.uint16).reshape(30, 40),
        DngMetadata("RGGB", 14, (0,) * 4, 16000, Fraction(1, 2000), 100),
    )
    edit(capture, 0)
    found = problems(capture)
    assert f"capture.yaml:{line_of(capture, dark)}: {dark} is not of the size of raw/0" in found[0]


def test_a_sample_frame_of_another_size_is_named_and_not_the_darks_it_would_have(capture):
    sample = yaml.safe_load(capture.read_text())["frames"][0]["file"]
    write_dng(
        capture.parent / sample,
        np.arange(160 * 160, dtype=np.uint16).reshape(160, 160) % 5000,
        DngMetadata("RGGB", 14, (0,) * 4, 16000, Fraction(1, 2000), 100),
    )
    edit(capture, 0)
    found = problems(capture)
    assert found
    assert all(f"{sample} is not of the size of" in line for line in found)


DYING = """
import os
from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.reduce import reduce_file
def on_seven(path, *args):
    if decode(path).cfa[0, 0] == 7:
        os._exit(3)
    return reduce_file(path, *args)
def at_once(path, *args):
    os._exit(3)
"""


@pytest.fixture
def dying(tmp_path, monkeypatch):
    """In place of ``reduce_file``: functions that end their process, in a module that workers can import."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "dying_reducers.py").write_text(DYING)
    monkeypatch.syspath_prepend(tmp_path / "modules")
    yield importlib.import_module("dying_reducers")
    del sys.modules["dying_reducers"]


def mark(path):
    """Make the first pixel 7."""
    frame = decode(path)
    frame.cfa[0, 0] = 7
    black = tuple(int(b) for b in frame.black.flat)
    metadata = DngMetadata("RGGB", 14, black, int(frame.white[0, 0]), frame.exposure_s, 100, ((3e-5, 1e-8),))
    write_dng(path, frame.cfa, metadata)


@pytest.mark.parametrize("role", ["sample", "dark"])
def test_a_frame_that_kills_its_decoder_costs_that_frame(capture, monkeypatch, dying, role):
    edit(capture, 0)
    data = yaml.safe_load(capture.read_text())
    name = next(f["file"] for f in data["frames"] if f["role"] == role)
    mark(capture.parent / name)
    monkeypatch.setattr(module, "reduce_file", dying.on_seven)
    ingested = read(capture)
    assert ingested.rejected == {name: "ended the process that decoded it (exit code 3)"}
    (note,) = (n for n in ingested.measurement.warnings if n.code == "ROWS_IGNORED")
    assert note.message == f"{name} ended the process that decoded it (exit code 3)"
    rows = ingested.measurement.observations
    assert len(rows) == 3 * (SAMPLES - (role == "sample"))
    assert np.isfinite(rows.value).all()
    assert np.isfinite(rows.sigma).all()


def test_a_frame_whose_flat_is_lost_is_not_mixed_with_those_that_have_theirs(capture, monkeypatch, dying):
    data = yaml.safe_load(capture.read_text())
    frames = data["frames"]
    flat = next(f for f in frames if f["role"] == "flat")
    shutil.copy(capture.parent / flat["file"], capture.parent / "raw/own.dng")
    mark(capture.parent / "raw/own.dng")
    flat.pop("sha256")
    change(capture, frames=[*frames, flat | {"file": "raw/own.dng", "analyzer_deg": 45}])
    monkeypatch.setattr(module, "reduce_file", dying.on_seven)
    ingested = read(capture)
    lost = {f["file"] for f in frames if f["role"] == "sample" and f["analyzer_deg"] == 45}
    assert set(ingested.rejected) == {"raw/own.dng", *lost}
    assert {ingested.rejected[name] for name in lost} == {"has lost all of its flats"}
    rows = ingested.measurement.observations
    assert len(rows) == 3 * (SAMPLES - len(lost))
    assert np.ptp(rows.value[rows.channel == "G"]) < 2  # all over their flats


def test_all_frames_kill_their_decoders(capture, monkeypatch, dying):
    monkeypatch.setattr(module, "reduce_file", dying.at_once)
    found = problems(capture)
    assert len(found) >= SAMPLES
    assert found[0] == "Error: capture.yaml: raw/000.dng ended the process that decoded it (exit code 3)"


def overexposed(capture, colours):
    """Every sample frame written anew with these colours clipped."""
    generator = np.random.default_rng(0)
    for number in range(SAMPLES):
        cfa = generator.integers(4000, 5000, (64, 96)).astype(np.uint16)
        for i, colour in enumerate("RGGB"):
            if colour in colours:
                cfa[i // 2 :: 2, i % 2 :: 2] = 15871
        metadata = DngMetadata(
            "RGGB", 14, (512, 515, 509, 511), 15871, Fraction(1, 1000), 100, ((3e-5, 1e-8),)
        )
        write_dng(capture.parent / f"raw/{number:03d}.dng", cfa, metadata)
    edit(capture, 0)


def test_all_frames_saturated(capture):
    overexposed(capture, "RGB")
    with pytest.raises(ReflectanceFitError) as caught:
        workflow.fit(capture)
    assert len(caught.value.lines()) == 1
    assert "every row is saturated; expose less" in caught.value.lines()[0]


def test_one_channel_saturated_is_left_out(capture, monkeypatch):
    quick(monkeypatch)
    overexposed(capture, "RG")
    result = workflow.fit(capture, model="dielectric", timings=False)
    assert [channel.channel for channel in result.report.channels] == ["B"]
    told = [w.message for w in result.report.warnings if w.code == "SATURATED"]
    assert told == [f"{name} is left out: all of its 8 rows are saturated" for name in "RG"]


def test_one_azimuth_only_identifies_nothing(capture, monkeypatch):
    quick(monkeypatch)
    data = yaml.safe_load(capture.read_text())
    frames = [f for f in data["frames"] if f["role"] != "sample" or f["analyzer_deg"] == 0]
    change(capture, hashes=True, frames=frames)
    result = workflow.fit(one_channel(read(capture).measurement), model="dielectric", timings=False)
    eta = result.report.channels[0].eta
    assert eta.status == "not_identified"
    assert eta.median is None


def test_observations_of_a_capture_are_the_capture(capture, tmp_path, monkeypatch):
    quick(monkeypatch)
    edit(capture, 0)
    out = tmp_path / "deep" / "OBS.nc"
    ingested = ingest_to_file(capture, out, write_hashes=False, pictures=False, progress=lambda *_: None)
    stored = read_observations(out)
    for column in fields(stored.observations):
        np.testing.assert_array_equal(
            getattr(stored.observations, column.name),
            getattr(ingested.measurement.observations, column.name),
            column.name,
        )
    assert stored.nuisances == ingested.measurement.nuisances
    shutil.rmtree(capture.parent / "raw")
    one, other = (
        workflow.fit(one_channel(m), model="dielectric", timings=False, seed=3).report
        for m in (ingested.measurement, stored)
    )
    assert one.channels == other.channels
    assert one.fits == other.fits
    assert one.warnings == other.warnings
    assert [w.code for w in one.warnings].count("NO_HASHES") == 1
    assert sorted(p.name for p in out.parent.iterdir()) == ["OBS.nc"]


@pytest.mark.parametrize("write_hashes", [False, True])
def test_a_failed_ingest_writes_nothing(capture, tmp_path, write_hashes):
    edit(capture, 1, iso=200)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    with pytest.raises(ReflectanceFitError, match="ISO"):
        ingest_to_file(
            capture, tmp_path / "OBS.nc", write_hashes=write_hashes, pictures=False, progress=lambda *_: None
        )
    after = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    if write_hashes:  # which come first, and are right whatever the frames hold
        assert "sha256" in after.pop(capture).decode()
        before.pop(capture)
    assert after == before


def test_the_same_capture_gives_the_same_rows(capture):
    one, other = (read(capture).measurement.observations for _ in range(2))
    assert one.value.tolist() == other.value.tolist()
    assert one.sigma.tolist() == other.sigma.tolist()
