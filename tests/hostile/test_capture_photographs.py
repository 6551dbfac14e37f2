"""Whatever bytes stand where photographs should be: rows that are finite, or lines a user can act on."""

import random
import re
import shutil

import numpy as np
import pytest
import yaml

from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec
from reflectance_fit.errors import ReflectanceFitError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Twelve files, no hashes."""
    folder = tmp_path_factory.mktemp("glass")
    path = write_capture(
        folder, CaptureSpec("N-BK7", angles_deg=(45.0, 60.0), sensor=Sensor(width=48, height=32))
    )
    data = yaml.safe_load(path.read_text())
    for frame in data["frames"]:
        del frame["sha256"]
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return folder


def harmed(raw, chance):
    """Cut, overwritten in the tags, or filled with noise: one of them."""
    raw = bytearray(raw)
    what = chance.randrange(5)
    header = min(700, len(raw))
    if what == 0:
        del raw[chance.randrange(len(raw)) :]
    elif what == 1:
        for _ in range(chance.randrange(1, 6)):
            raw[chance.randrange(header)] = chance.choice((0, 1, 127, 255, chance.randrange(256)))
    elif what == 2:
        at = chance.randrange(len(raw))
        raw[at : at + 40] = bytes(40)
    elif what == 3:
        at = chance.randrange(header)
        raw[at:at] = chance.randbytes(chance.randrange(1, 9))
    else:
        raw[8:header] = chance.randbytes(header - 8)
    return bytes(raw)


@pytest.mark.parametrize("seed", range(12))
def test_harmed_photographs(folder, tmp_path, seed):
    shutil.copytree(folder, tmp_path / "c")
    chance = random.Random(seed)
    names = sorted((tmp_path / "c" / "raw").iterdir())
    for path in chance.sample(names, chance.randrange(1, 4)):
        path.write_bytes(harmed(path.read_bytes(), chance))
    try:
        ingested = ingest(read_capture(tmp_path / "c" / "capture.yaml"))
    except ReflectanceFitError as error:
        for line in error.lines():
            assert re.match(r"Error: .*capture\.yaml(:\d+)?: ", line)
            assert line.isprintable()
        return
    rows = ingested.measurement.observations
    assert len(rows) == 3 * len(ingested.samples) > 0
    assert np.isfinite(rows.value).all()
    assert (np.isnan(rows.sigma) | (rows.sigma >= 0)).all()
    assert len(ingested.samples) + len(ingested.rejected) <= len(ingested.capture.frames)
    for reason in ingested.rejected.values():
        assert reason.isprintable()
        assert "\n" not in reason


def test_names_with_terminal_codes_stay_text(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "c")
    name = "raw/\x1b[2J.dng"
    (tmp_path / "c" / "raw" / "000.dng").rename(tmp_path / "c" / name)
    path = tmp_path / "c" / "capture.yaml"
    path.write_text(path.read_text().replace("raw/000.dng", '"raw/\\e[2J.dng"'))
    (tmp_path / "c" / name).write_bytes(b"")
    with pytest.raises(ReflectanceFitError) as caught:
        ingest(read_capture(path))
    (line,) = caught.value.lines()
    assert line.isprintable()


def test_a_file_that_is_replaced_by_a_pipe_or_folder_meanwhile(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "c")
    capture = read_capture(tmp_path / "c" / "capture.yaml")
    (tmp_path / "c" / "raw" / "000.dng").unlink()
    (tmp_path / "c" / "raw" / "000.dng").mkdir()
    with pytest.raises((ReflectanceFitError, IsADirectoryError)):
        ingest(capture)
