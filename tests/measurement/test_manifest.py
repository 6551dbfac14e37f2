"""measurement.yaml by itself: every wrong key has its line and says what to do."""

import math
from pathlib import Path

import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.measurement.manifest import Manifest, read_manifest

HEAD = "schema: reflectance_fit/measurement/1\nsample: {name: glass}\n"
TABLE = "tables:\n  - file: a.csv\n    columns: {theta_deg: 0, psi_deg: 1}\n"


def manifest(tmp_path: Path, text: str) -> Manifest:
    path = tmp_path / "measurement.yaml"
    path.write_text(text)
    return read_manifest(path)[0]


def problem(tmp_path: Path, text: str) -> str:
    """The only problem of ``text``, as ``line: message``."""
    with pytest.raises(ReflectanceFitError) as caught:
        manifest(tmp_path, text)
    (only,) = caught.value.problems
    assert only.file == str(tmp_path / "measurement.yaml")
    return f"{only.line}: {only.message}"


def test_defaults(tmp_path):
    m = manifest(tmp_path, HEAD + TABLE)
    assert m.exterior_ior == 1.000277
    assert m.nuisances is None
    assert m.tables[0].format == "columns"
    assert m.tables[0].delta_sense == 1


def test_empty_nuisances_differ_from_absent_ones(tmp_path):
    assert manifest(tmp_path, HEAD + TABLE + "nuisances: {}\n").nuisances == {}
    assert problem(tmp_path, HEAD + TABLE + "nuisances:\n") == (
        "6: nuisances: has no value; give one or remove the key"
    )


@pytest.mark.parametrize(
    ("light", "stokes"),
    [
        ("{stokes: [2, 0, 0, -2]}", (2, 0, 0, -2)),
        ("{linear_deg: 0}", (1, 1, 0, 0)),
        ("{linear_deg: 45}", (1, 0, 1, 0)),
        ("{linear_deg: 90}", (1, -1, 0, 0)),
        ("{circular: right}", (1, 0, 0, 1)),
        ("{circular: left}", (1, 0, 0, -1)),
    ],
)
def test_light(tmp_path, light, stokes):
    m = manifest(tmp_path, f"{HEAD}light: {light}\n{TABLE}")
    assert m.light is not None
    assert m.light.vector() == pytest.approx(stokes, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("light: {stokes: [1, 1, 1, 0]}", "3: light: more polarized than possible"),
        ("light: {stokes: [0, 0, 0, 0]}", "3: light: S0, the first of stokes, must be above 0"),
        ("light: {stokes: [1, 0, 0]}", "3: light.stokes: must have at least 4 items, not 3"),
        ("light: {linear_deg: 1, circular: left}", "3: light: give exactly one of"),
        ("light: {}", "3: light: give exactly one of"),
        ("exterior_ior: '1.0'", "3: exterior_ior: must be a valid number (found '1.0')"),
        ("exterior_ior: true", "3: exterior_ior: must be a valid number (found True)"),
        ("exterior_ior: .nan", "3: exterior_ior: must be a finite number"),
        ("exterior_ior: 0", "3: exterior_ior: must be greater than 0 (found 0)"),
        ("wavelength_nm: 0.65", "3: wavelength_nm: must be greater than or equal to 100 (found 0.65)"),
        ("wavelengths_nm: []", "3: wavelengths_nm: must have at least 1 item, not 0"),
        ("wavelengths_nm: 5", "3: wavelengths_nm: must be a list"),
        ("wavelenght_nm: 650", "3: unknown key 'wavelenght_nm', did you mean 'wavelength_nm'?"),
        ("nuisances: {angle_ofset_deg: {}}", "3: nuisances.angle_ofset_deg: unknown nuisance, did you mean"),
        ("nuisances: {diffuse: {sigma: 0}}", "3: nuisances.diffuse.sigma: must be greater than 0"),
        ("nuisances: {diffuse: 0.1}", "3: nuisances.diffuse: must be a block of keys"),
        ("nuisances: {diffuse: }", "3: nuisances.diffuse: must be a block of keys"),
        ("priors: {eta: {uniform: [2, 1]}}", "3: priors.eta: the range must be [low, high]"),
        ("priors: {eta: {uniform: [2, 2]}}", "3: priors.eta: the range must be [low, high]"),
        ("schemaa: x", "3: unknown key 'schemaa', did you mean 'schema'?"),
        ("priors: {eta: {uniform: [0, 1]}}", "3: priors: eta must be above 0"),
        ("priors: {k: {log_uniform: [0, 1]}}", "3: priors.k: the range must start above 0"),
        ("priors: {k: {uniform: [-1, 1]}}", "3: priors.k: the range must start at 0 or above"),
        ("priors: {k: {fixed: -1}}", "3: priors.k: fixed must be at 0 or above"),
        ("priors: {eta: {fixed: 0}}", "3: priors: eta must be above 0"),
        ("priors: {k: {uniform: [0, 1], log_uniform: [1, 2]}}", "3: priors.k: give exactly one of"),
    ],
)
def test_top_level_problems(tmp_path, text, expected):
    assert problem(tmp_path, f"{HEAD}{text}\n{TABLE}").startswith(expected)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("columns: {thet_deg: 0, psi_deg: 1}", "unknown column, did you mean 'theta_deg'?"),
        ("columns: {theta_deg: -1, psi_deg: 1}", "columns are counted from 0 (found -1)"),
        ("columns: {theta_deg: 1.5, psi_deg: 1}", "must be a column number"),
        ("columns: {theta_deg: true, psi_deg: 1}", "must be a column number"),
        ("columns: {psi_deg: 1}", "theta_deg is missing"),
        ("columns: {theta_deg: 0}", "columns names no quantity"),
        ("columns: {theta_deg: 0, psi_deg: 1}\n    delta_sense: true", "delta_sense: must be 1 or -1"),
        ("columns: {theta_deg: 0, psi_deg: 1}\n    delta_sense: 2", "delta_sense: must be 1 or -1"),
        ("columns: {theta_deg: 0, psi_deg: 1}\n    skip_rows: -1", "skip_rows: must be greater than or"),
        ("columns: {theta_deg: 0, psi_deg: 1, delta_deg_sigma: 2}", "delta_deg_sigma has no delta_deg"),
        (
            "columns: {theta_deg: 0, psi_deg: 1}\n    constants: {theta_deg: 3}",
            "both a column and a constant",
        ),
        ("columns: {theta_deg: 0, psi_deg: 1}\n    constants: {psi_deg: 3}", "unknown constant"),
        ("columns: {theta_deg: 0, psi_deg: 1, analyzer_deg: 2}", "analyzer_deg goes with"),
        ("columns: {theta_deg: 0, signal: 1, retardance_deg: 2}", "retardance_deg needs retarder_deg"),
        (
            "columns: {psi_deg: 1}\n    constants: {theta_deg: 1}\n    theta_from: {scale: 2}",
            "needs a column",
        ),
        ("columns: {theta_deg: 0, psi_deg: 1}\n    wavelengths_nm: [500]", "needs a wavelength column"),
        ("columns: {theta_deg: 0, psi_deg: 1, wavelength_nm: 2}\n    wavelength_nm: 500", "stated twice"),
        ("columns: {theta_deg: 0, psi_deg: 1}\n    quantities: [psi_deg]", "belongs to woollam_vase"),
        ("format: woollam_vase\n    wavelength_nm: 500", "stated twice"),
        ("format: woollam_vase\n    columns: {theta_deg: 0}", "woollam_vase files need no columns"),
        ("format: woollam_vase\n    quantities: [psi]", "quantities.0: must be 'psi_deg'"),
        ("format: woollam_vase\n    constants: {theta_deg: 3}", "state their own theta_deg"),
        ("format: woolam", "format: must be 'columns' or 'woollam_vase'"),
    ],
)
def test_table_problems(tmp_path, text, expected):
    found = problem(tmp_path, f"{HEAD}tables:\n  - file: a.csv\n    {text}\n")
    assert expected in found
    last = 4 + len(text.split("\n"))
    assert 5 <= int(found.split(":")[0]) <= last


@pytest.mark.parametrize(
    ("schema", "expected"),
    [
        ("reflectance_fit/capture/1", "1: is a capture file (reflectance_fit/capture/1); a measurement file"),
        ("reflectance_fit/measurement/2", "1: schema reflectance_fit/measurement/2 is not known"),
        ("something", "1: schema must be 'reflectance_fit/measurement/1' (found 'something')"),
        ("7", "1: schema must be"),
    ],
)
def test_another_schema_is_said_first_and_alone(tmp_path, schema, expected):
    assert problem(tmp_path, f"schema: {schema}\nframes: []\n").startswith(expected)


def test_missing_schema(tmp_path):
    assert "'schema: reflectance_fit/measurement/1' is missing" in problem(tmp_path, "sample: {name: x}\n")
    assert "is not a measurement file" in problem(tmp_path, "- 1\n- 2\n")


def test_all_problems_at_once_in_file_order(tmp_path):
    text = HEAD + "exterior_ior: -1\ntables:\n  - file: ''\n    saturation: x\n    skip_rows: 0.5\nfoo: 1\n"
    with pytest.raises(ReflectanceFitError) as caught:
        manifest(tmp_path, text)
    assert [p.line for p in caught.value.problems] == [3, 5, 6, 7, 8]


def test_missing_keys(tmp_path):
    with pytest.raises(ReflectanceFitError) as caught:
        manifest(tmp_path, "schema: reflectance_fit/measurement/1\ntables: []\n")
    assert [p.message for p in caught.value.problems] == [
        "'sample' is missing; add it",
        "tables: must have at least 1 item, not 0",
    ]


def test_every_field_is_described_for_editors():
    schema = Manifest.model_json_schema()
    assert "schema" in schema["required"]
    models = [schema, *(m for name, m in schema["$defs"].items() if name != "PriorRange")]
    for model in models:
        for name, entry in model["properties"].items():
            assert entry.get("description"), name
    table = schema["$defs"]["Table"]["properties"]
    assert "psi_deg_sigma" in table["columns"]["propertyNames"]["enum"]
    assert "psi_deg" not in table["constants"]["propertyNames"]["enum"]
    assert "diffuse" in schema["properties"]["nuisances"]["propertyNames"]["enum"]


def test_the_model_is_frozen(tmp_path):
    m = manifest(tmp_path, HEAD + TABLE)
    with pytest.raises(ValueError, match="frozen"):
        m.exterior_ior = math.pi
