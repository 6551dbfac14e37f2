"""Files of columns: what is read, and what each unreadable row is told."""

from pathlib import Path

import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.measurement.manifest import Table
from reflectance_fit.measurement.tables import MAX_PROBLEMS, Columns, open_table, read_columns


def read(tmp_path: Path, text: str | bytes, **table) -> Columns:
    table.setdefault("columns", {"theta_deg": 0, "signal": 1})
    (tmp_path / "t.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_columns(open_table(tmp_path / "m.yaml", "t.csv"), Table(file="t.csv", **table))


def problems(tmp_path: Path, text: str, **table) -> list[tuple[int | None, str]]:
    with pytest.raises(ReflectanceFitError) as caught:
        read(tmp_path, text, **table)
    return [(p.line, p.message) for p in caught.value.problems]


@pytest.mark.parametrize(
    "text",
    [
        "83  934.2\n9 90.5\n",
        "  83\t934.2\n9\t90.5",
        "83,934.2\r\n9,90.5\r\n",
        "83;934.2\r9;90.5\r",
        "# comment\n\n83, 934.2\n\n#\n09, +9.05e1\n,\n",
        '"83","934.2"\n"9","90.5"\n',
        "\ufeff83 934.2\n9 90.5 words behind\n",
    ],
)
def test_delimiters_comments_and_line_ends(tmp_path, text):
    columns = read(tmp_path, text)
    assert columns.values["theta_deg"].tolist() == [83, 9]
    assert columns.values["signal"].tolist() == [934.2, 90.5]


@pytest.mark.parametrize(
    ("name", "text"),
    [("space", "1  2\n"), ("tab", "1\t2\n"), ("comma", "1,2\n"), ("semicolon", "1;2\n")],
)
def test_stated_delimiter(tmp_path, name, text):
    assert read(tmp_path, text, delimiter=name).values["signal"].tolist() == [2]


def test_a_stated_delimiter_is_not_overruled(tmp_path):
    assert "'1\t2' is not a number" in problems(tmp_path, "1\t2,3\n", delimiter="comma")[0][1]


def test_lines_are_those_of_the_file(tmp_path):
    columns = read(tmp_path, "skipped\n# c\n\n1 2\n#\x0c c\n3 4\n", skip_rows=1)
    assert columns.lines.tolist() == [4, 6]


@pytest.mark.parametrize(
    "text",
    [
        "angle,volts\n83,934.2\n",
        "# made on a Monday, by hand\nangle,volts\n83,934.2\n",
        "title line\nx y\n#angle\tother\tvolts\n#deg\t-\tV\n83\t1\t934.2\n",
        '"volts","angle"\n934.2,83\n',
    ],
)
def test_columns_by_header(tmp_path, text):
    columns = read(tmp_path, text, columns={"theta_deg": "angle", "signal": "volts"})
    assert columns.values["theta_deg"].tolist() == [83]
    assert columns.values["signal"].tolist() == [934.2]


def test_a_header_that_is_not_there(tmp_path):
    wanted = {"theta_deg": "angle", "signal": "vols"}
    assert problems(tmp_path, "angle,volts\n1,2\n", columns=wanted) == [
        (None, "no header 'vols', did you mean 'volts'?")
    ]
    assert "found are: a, b" in problems(tmp_path, "a,b\n1,2\n", columns=wanted)[0][1]


def test_a_header_that_is_there_twice(tmp_path):
    found = problems(tmp_path, "a b b\n1 2 3\n", columns={"theta_deg": "a", "signal": "b"})
    assert found == [(1, "'b' stands above several columns; name the column by its number")]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("4 x", "signal: 'x' is not a number; correct it, or remove the row"),
        ("4 nan", "signal: 'nan' is not a finite number; remove the row"),
        ("4 -Infinity", "signal: '-Infinity' is not a finite number; remove the row"),
        ("4 1e999", "signal: '1e999' is not a finite number; remove the row"),
        ("4 1_0", "signal: '1_0' is not a number; correct it, or remove the row"),
        ("4 \u0663", "signal: '\u0663' is not a number; correct it, or remove the row"),
        ("4", "has 1 columns; column 1 (signal, counted from 0) is missing"),
        ("4,5 2", "theta_deg: '4,5' has a decimal comma; write 4.5"),
    ],
)
def test_rows_that_cannot_be_read(tmp_path, row, message):
    assert problems(tmp_path, f"1 2\n{row}\n") == [(2, message)]


@pytest.mark.parametrize("text", ["83,5 0,31\n", "83,5\t0,31\n", "83,5;0,31\n", "83 0,31\n"])
def test_decimal_commas_are_named_whatever_separates(tmp_path, text):
    assert "has a decimal comma" in problems(tmp_path, text)[0][1]


def test_an_empty_field(tmp_path):
    assert problems(tmp_path, "1,2\n1,,3\n") == [(2, "signal: is empty; correct it, or remove the row")]


def test_a_header_read_as_data_says_what_to_do(tmp_path):
    assert "name columns by its texts or set skip_rows" in problems(tmp_path, "angle,volts\n1,2\n")[0][1]


def test_a_few_problems_are_enough(tmp_path):
    assert [line for line, _ in problems(tmp_path, "x y\n" * 50)] == [*range(1, MAX_PROBLEMS + 1)]


def test_no_rows(tmp_path):
    assert problems(tmp_path, "# only comments\n") == [(None, "holds no data rows; is it the right file?")]
    assert problems(tmp_path, "1 2\n", skip_rows=9) == [(None, "holds no data rows; is it the right file?")]


def test_a_quoted_field_beyond_the_csv_module(tmp_path):
    text = '"' + "1" * 200_000 + '",2\n'
    assert "is not a" in problems(tmp_path, text)[0][1]
    assert "no header" in problems(tmp_path, text, columns={"theta_deg": "a", "signal": 1})[0][1]
