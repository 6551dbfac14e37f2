"""refractiveindex.info files: what is read, what is refused, and where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials.loader import AIR_INDEX, load_optical_constants

HEAD = "# a comment\nREFERENCES: |\n    A. Author.\nDATA:\n"
NK = HEAD + "  - type: tabulated nk\n    data: |\n"  # rows follow from line 7
FORMULA = HEAD + "  - type: formula 5\n    wavelength_range: 0.4 0.8\n    coefficients: 1.5 0.004 -2\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.yml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_is_linear_between_its_rows(tmp_path):
    constants = load_optical_constants(write(tmp_path, NK + "        0.4 1.0 3.0\n        0.6 2.0 1.0\n"))
    assert constants.name == "mine"
    assert constants.range_nm == (400, 600)
    assert constants.k_known
    assert constants.index(450) == (pytest.approx(1.25), pytest.approx(2.5))
    eta, k = constants.index([[400.0], [600.0]])
    np.testing.assert_allclose(eta, [[1.0], [2.0]])
    np.testing.assert_allclose(k, [[3.0], [1.0]])
    assert all(isinstance(value, float) for value in constants.index(500))


def test_a_formula_without_k_is_transparent_and_says_so(tmp_path):
    constants = load_optical_constants(write(tmp_path, FORMULA))
    assert constants.index(500) == (pytest.approx(1.5 + 0.004 / 0.25), 0.0)
    assert not constants.k_known


def test_relative_to_air_scales_eta_and_k_to_vacuum(tmp_path):
    path = write(tmp_path, NK + "        0.4 1.5 0.5\n        0.6 1.5 0.5\n")
    in_air = load_optical_constants(path, relative_to="air")
    assert in_air.index(500) == (1.5, 0.5)
    assert in_air.absolute_index(500) == (1.5 * AIR_INDEX, 0.5 * AIR_INDEX)
    in_vacuum = load_optical_constants(path)
    assert in_vacuum.absolute_index(500) == in_vacuum.index(500) == (1.5, 0.5)


def test_an_unknown_k_is_an_error_only_when_k_is_asked(tmp_path):
    text = FORMULA + "  - type: tabulated k\n    data: |\n        0.5 1e-6\n        0.6 3e-6\n"
    constants = load_optical_constants(write(tmp_path, text))
    assert constants.range_nm == (500, 600)
    assert constants.index(550)[1] == pytest.approx(2e-6)
    assert constants.eta(450) == pytest.approx(1.5 + 0.004 / 0.45**2)
    with pytest.raises(
        ReflectanceFitError, match="mine: k is not known at 450 nm; its source covers 500 to 600 nm"
    ):
        constants.index(450)


@pytest.mark.parametrize("asked", [399.99, 800.01, -1.0, np.nan, np.inf, [500.0, 900.0]])
def test_nothing_is_extrapolated(tmp_path, asked):
    constants = load_optical_constants(write(tmp_path, FORMULA))
    with pytest.raises(
        ReflectanceFitError, match=r"mine: n is not known at .* nm; its source covers 400 to 800 nm"
    ):
        constants.index(asked)


def test_both_ends_of_a_range_are_inside_whatever_the_rounding(tmp_path):
    for low, high in ((0.4368, 1.052), (0.5893, 0.83), (0.41328, 0.7)):
        text = FORMULA.replace("0.4 0.8", f"{low} {high}")
        constants = load_optical_constants(write(tmp_path, text))
        eta, _ = constants.index([*constants.range_nm, float(f"{low * 1000:.10g}")])
        assert np.all(np.isfinite(eta))


def test_texts_lose_their_tags_but_not_their_brackets(tmp_path):
    text = HEAD.replace(
        "A. Author.", '<b>A.</b> Author,<br><a href="x">Al<sub>2</sub>O<sub>3</sub></a> &amp; Si'
    )
    text += "  - type: tabulated n\n    data: |\n        0.4 1.5\nCOMMENTS: Orientation <111>, 20 °C\nSPECS: {a: 1}\n"
    constants = load_optical_constants(write(tmp_path, text))
    assert constants.source == "A. Author, Al2O3 & Si"
    assert constants.comments == "Orientation <111>, 20 °C"


def test_tables_cannot_be_changed_by_their_user(tmp_path):
    constants = load_optical_constants(write(tmp_path, NK + "        0.4 1.0 3.0\n"))
    with pytest.raises(ValueError, match="read-only"):
        constants.n.values[0] = 2.0


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("DATA: 3\n", None, "no list DATA"),
        ("- 1\n", None, "no list DATA"),
        (HEAD + "  - 5\n", 5, "needs a 'type'"),
        (HEAD + "  - type: tabulated n2\n    data: 1\n", 5, "unknown data type 'tabulated n2'; known are"),
        (HEAD + "  - type: formula 10\n", 5, "unknown data type 'formula 10'"),
        (HEAD + "  - type: tabulated k\n    data: |\n        0.4 0.1\n", 4, "gives no n"),
        (HEAD + "  - type: tabulated nk\n", 5, "needs a text block 'data: |' of rows 'um n k'"),
        (
            HEAD + "  - type: tabulated n\n    data: 0.4 1.5 0.1\n",
            6,
            "row '0.4 1.5 0.1': write 2 numbers, 'um n'",
        ),
        (
            NK + "        0.4 1.0 3.0\n\n        0.5 one 3.0\n",
            9,
            "row '0.5 one 3.0': write 3 numbers, 'um n k'",
        ),
        (NK + "        0.4 1.0 3.0\n        0.5 1.0\n", 8, "write 3 numbers"),
        (NK + "        0.4 nan 3.0\n", 7, "must be finite"),
        (NK + "        0.4 1.0 inf\n", 7, "must be finite"),
        (
            NK + "        0.5 1.0 3.0\n        0.4 1.0 3.0\n",
            8,
            "row '0.4 1.0 3.0': wavelengths in micrometres must be",
        ),
        (NK + "        0.5 1.0 3.0\n        0.5 1.0 3.0\n", 8, "each given once"),
        (NK + "        0 1.0 3.0\n", 7, "positive, sorted"),
        (NK + "        0.5 0.0 3.0\n", 7, "n must be positive"),
        (NK + "        0.4 1.0 0\n        0.5 1.0 -3.0\n", 8, "row '0.5 1.0 -3.0': k must not be negative"),
        (HEAD + "  - type: formula 5\n    coefficients: 1.5\n", 5, "needs 'wavelength_range: LOW HIGH'"),
        (FORMULA.replace("0.4 0.8", "0.8 0.4"), 6, "needs 'wavelength_range: LOW HIGH'"),
        (FORMULA.replace("0.4 0.8", "0.4 inf"), 6, "needs 'wavelength_range: LOW HIGH'"),
        (FORMULA.replace(" 0.004 -2", " 0.004"), 7, "formula 5 takes 1, 3,"),
        (FORMULA.replace("1.5 0.004 -2", "1.5 x -2"), 7, "not 0"),
        (FORMULA.replace("1.5 0.004 -2", "1.5 -1.0 -2"), 7, "no positive real index at 0.4 um"),
        (
            FORMULA + "  - type: formula 5\n    wavelength_range: 1 2\n    coefficients: 1\n",
            8,
            "n is given twice",
        ),
        (FORMULA + "  - type: tabulated k\n    data: |\n        1.0 0.1\n", 4, "no wavelength in common"),
        ("DATA: [\n", 2, "not valid YAML"),
    ],
)
def test_a_malformed_file_is_named_with_its_line(tmp_path, text, line, message):
    path = write(tmp_path, text)
    with pytest.raises(ReflectanceFitError) as caught:
        load_optical_constants(path)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert problem.line == line or (line is None and problem.line in (None, 1))
    assert message in problem.message


def test_every_bad_row_is_reported_at_once(tmp_path):
    path = write(tmp_path, NK + "        0.4 1.0 -1\n        0.5 1.0 0.1\n        0.6 -1 0.1\n")
    with pytest.raises(ReflectanceFitError) as caught:
        load_optical_constants(path)
    assert [problem.line for problem in caught.value.problems] == [7, 9]
