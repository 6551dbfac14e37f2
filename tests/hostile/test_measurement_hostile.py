"""Whatever a measurement.yaml or its tables hold: data, or lines a user can act on.  Never a traceback."""

import os
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.measurement.read import read_measurement

YAML = """schema: reflectance_fit/measurement/1
sample: {name: glass}
wavelength_nm: 650
light: {linear_deg: 45}
tables:
  - file: t.csv
    columns: {theta_deg: 0, signal_p: 1, signal_p_sigma: 2}
    saturation: 4.2
    theta_from: {scale: 1, zero_deg: 0}
nuisances:
  angle_offset_deg: {sigma: 1.0}
priors: {eta: {uniform: [1, 3]}}
"""
ROWS = "# angle signal sigma\n10, 0.30, 0.01\n20, 0.31, 0.01\n30, 0.25, 0.01\n"
WOOLLAM = (
    "title\nVASEmethod[x=1]\nnm\n500.0\t65\t25\t110\t0.1\t0.1\npR\t500\t65\t0.2\t0.01\nuR\t500\t0\t1\t1\n"
)


def lines(folder: Path, yaml: str | bytes = YAML, rows: str | bytes | None = ROWS) -> list[str]:
    """The error lines of a reading, without the folder's name."""
    (folder / "m.yaml").write_bytes(yaml if isinstance(yaml, bytes) else yaml.encode())
    if rows is not None:
        (folder / "t.csv").write_bytes(rows if isinstance(rows, bytes) else rows.encode())
    with pytest.raises(ReflectanceFitError) as caught:
        read_measurement(folder / "m.yaml")
    return [line.replace(f"{folder}{os.sep}", "") for line in caught.value.lines()]


def with_file(name: str) -> str:
    return YAML.replace("file: t.csv", f"file: {name}")


def test_the_valid_file_is_valid(tmp_path):
    (tmp_path / "m.yaml").write_text(YAML)
    (tmp_path / "t.csv").write_text(ROWS)
    assert len(read_measurement(tmp_path / "m.yaml").observations) == 3


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "wavelength_nm",
            "wavelenght_nm",
            "m.yaml:3: unknown key 'wavelenght_nm', did you mean 'wavelength_nm'?",
        ),
        (
            "    saturation",
            "    saturated",
            "m.yaml:8: tables.0: unknown key 'saturated', did you mean 'saturation'?",
        ),
        (
            "wavelength_nm: 650",
            "sample: {name: x}",
            "m.yaml:3: duplicate key 'sample' (first in line 2); keep one",
        ),
        ("{name: glass}", "&a {name: glass}", "m.yaml:2: anchors (&a) are refused"),
        ("{name: glass}", "{name: *a}", "m.yaml:2: aliases (*a) are refused"),
        ("{name: glass}", "!!python/object:os.system {name: glass}", "m.yaml:2: tags ("),
        ("light: ", "<<: ", "m.yaml:4: merge keys (<<) are refused"),
        ("650", ".nan", "m.yaml:3: wavelength_nm: must be a finite number"),
        ("650", "1e999", "m.yaml:3: wavelength_nm: must be a finite number"),
        ("650", "[[[", "m.yaml:"),
        ("glass", "\x07", "m.yaml:"),
    ],
)
def test_yaml(tmp_path, old, new, expected):
    found = lines(tmp_path, YAML.replace(old, new, 1))
    assert found[0].startswith(f"Error: {expected}")


def test_merge_bomb_is_refused_at_once(tmp_path):
    bomb = "a0: &a0 {x: 1}\n"
    for i in range(1, 30):
        bomb += f"a{i}: &a{i} {{<<: [{f'*a{i - 1}, ' * 9}]}}\n"
    found = lines(tmp_path, YAML + bomb)
    assert len(found) == 20
    assert found[0].startswith("Error: m.yaml:13: anchors")


def test_a_million_bytes_are_enough_for_a_manifest(tmp_path):
    found = lines(tmp_path, YAML + "#" * 1_000_000)
    assert found == ["Error: m.yaml: is larger than 1 MB; is it the right file?"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"\x89PNG\r\n\x1a\n\x00\xff", "is not text (UTF-8)"),
        (b"schema\x00: x", "is not text (UTF-8)"),
    ],
)
def test_content_that_is_no_text(tmp_path, content, message):
    assert lines(tmp_path, content)[0].startswith(f"Error: m.yaml: {message}")
    assert lines(tmp_path, YAML, content)[0].startswith(f"Error: m.yaml:6: t.csv: {message}")


def test_a_manifest_that_is_no_file(tmp_path):
    for path in (
        tmp_path / "none.yaml",
        tmp_path,
        Path("/dev/zero"),
        tmp_path / "a\0b",
        tmp_path / ("x" * 999),
    ):
        with pytest.raises(ReflectanceFitError) as caught:
            read_measurement(path)
        assert len(caught.value.lines()) == 1


@pytest.mark.parametrize(
    "name",
    ["../t.csv", "/etc/hostname", "a/../t.csv", "a/../../t.csv", "link.csv", "linked/t.csv", "/dev/zero"],
)
def test_paths_that_lead_outside(tmp_path, name):
    (tmp_path / "t.csv").write_text(ROWS)
    folder = tmp_path / "inside"
    folder.mkdir()
    (folder / "link.csv").symlink_to(tmp_path / "t.csv")
    (folder / "linked").symlink_to(tmp_path)
    (line,) = lines(folder, with_file(name))
    assert line.startswith(f"Error: m.yaml:6: '{name}' leads outside the folder of m.yaml; copy the file")


def test_a_link_inside_the_folder_is_fine(tmp_path):
    (tmp_path / "m.yaml").write_text(with_file("link.csv"))
    (tmp_path / "t.csv").write_text(ROWS)
    (tmp_path / "link.csv").symlink_to("t.csv")
    assert len(read_measurement(tmp_path / "m.yaml").observations) == 3


def test_paths_that_are_no_file(tmp_path):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "loop").symlink_to("loop")
    for name, message in (
        ("none.csv", "there is no such file"),
        ("folder", "is a folder"),
        ("fifo", "is not a regular file"),
        ('"a\\0b"', ""),
        ("loop", ""),
        ("x" * 999, ""),
        ('"\\uD800"', ""),
    ):
        (line,) = lines(tmp_path, with_file(name))
        assert line.startswith("Error: m.yaml:")
        assert message in line
        assert line.isprintable()


def test_a_table_above_50_megabytes(tmp_path):
    with (tmp_path / "t.csv").open("wb") as stream:
        stream.truncate(50_000_001)
    assert lines(tmp_path, rows=None) == [
        "Error: m.yaml:6: t.csv: is larger than 50 MB; is it the right file?"
    ]


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("nan, 0.3, 0.01", "theta_deg: 'nan' is not a finite number"),
        ("95, 0.3, 0.01", "theta_deg must be below 90"),
        ("40, 0.3", "has 2 columns"),
        ("40, 0.3, 0", "signal_p_sigma must be above 0"),
        ("40, \x1b[2Jx, 0.1", "signal_p: '\\x1b[2Jx' is not a number"),
    ],
)
def test_rows(tmp_path, row, expected):
    assert lines(tmp_path, rows=f"{ROWS}{row}\n")[0].startswith(f"Error: t.csv:5: {expected}")


def test_percent(tmp_path):
    yaml = YAML.replace("signal_p", "reflectance_p")
    assert "is it a percentage" in lines(tmp_path, yaml, ROWS.replace("0.3", "3"))[0]


def outcome(folder: Path, yaml: bytes, rows: bytes) -> None:
    """Data or a ReflectanceFitError whose every line names a file; anything else fails the test."""
    (folder / "m.yaml").write_bytes(yaml)
    (folder / "t.csv").write_bytes(rows)
    try:
        assert len(read_measurement(folder / "m.yaml").observations) > 0
    except ReflectanceFitError as error:
        for line in error.lines():
            assert re.match(r"Error: (.*(m\.yaml|t\.csv)|and \d+ more)", line)
            assert line.isprintable()


NASTY = [
    *"[]{}:?-#,;|>&*!%@`'\"\t\r\x0c\u2028\ud7ffé",
    *["null", "true", ".nan", "-1", "1e999", "0x10", "0o7", "<<", "9e9"],
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


FUZZ = settings(
    max_examples=400,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@FUZZ
@given(mutated(YAML), st.just(ROWS.encode()))
def test_fuzz_manifest(tmp_path, yaml, rows):
    outcome(tmp_path, yaml, rows)


@FUZZ
@given(st.just(YAML.encode()), mutated(ROWS))
def test_fuzz_columns(tmp_path, yaml, rows):
    outcome(tmp_path, yaml, rows)


@FUZZ
@given(mutated("10;0,3;1\nangle;volts\n10;0.3\n"))
def test_fuzz_header(tmp_path, rows):
    columns = "columns: {theta_deg: angle, signal_p: volts}"
    outcome(tmp_path, re.sub("columns: .*", columns, YAML).encode(), rows)


@FUZZ
@given(mutated(WOOLLAM))
def test_fuzz_woollam(tmp_path, rows):
    yaml = "schema: reflectance_fit/measurement/1\nsample: {name: a}\n"
    yaml += "tables:\n  - {file: t.csv, format: woollam_vase, wavelengths_nm: [500]}\n"
    outcome(tmp_path, yaml.encode(), rows)


@FUZZ
@given(st.text(max_size=200), st.binary(max_size=50))
def test_fuzz_any_text(tmp_path, yaml, rows):
    outcome(tmp_path, yaml.encode("utf-8", "surrogatepass"), rows)
