"""OBS.nc gives back what went in, and a file from elsewhere is one line, not a traceback."""

import math
import os
from dataclasses import fields, replace
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.observations import Flag, Observations, Quantity
from reflectance_fit.observations_columns import ATTRIBUTES, COLUMNS, observations_schema
from reflectance_fit.observations_file import read_observations, write_observations
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, Prior

h5py = h5netcdf.core.h5py

ABOUT = {
    "sample_name": "Glas № 1, 玻璃",
    "exterior_ior": 1.000277,
    "sample_note": "gewaschen",
    "nuisances": {"angle_offset_deg": 0.5, "source_azimuth_deg": math.inf},
    "priors": {"eta": Prior("log_uniform", *ETA_PRIOR), "k": Prior("uniform", *K_PRIOR)},
    "warnings": (Note("NO_HASHES", "première"), Note("SATURATED", "zweite: 5 %")),
    "common_sigmas": {"angle_offset_deg": {"R": 0.012, "grün 波長": 0.3}},
    "inputs": (("capture.yaml", "0" * 64), ("raw/é.dng", "f" * 64)),
}


def observations(n: int = 4) -> Observations:
    """Rows of every flag and of unequal text lengths; the numbers need all their digits."""
    x = np.random.default_rng(0).random(n)
    nan_last = np.where(np.arange(n) == n - 1, np.nan, 0.1 + x)
    return Observations(
        channel=np.resize(["R", "G", "632.8 nm", "grün 波長"], n),
        wavelength_nm=400 + 300 * x,
        set=np.resize(["0", "", "a\nb"], n),
        gain_group=np.resize(["0:45", "", "lamp"], n),
        theta_deg=90 * x,
        theta_deg_sigma=x,
        analyzer_deg=360 * nan_last - 180,
        retarder_deg=nan_last,
        retardance_deg=nan_last,
        theta_deg_spread=0.1 * x,
        diattenuation=1 - 0.1 * x,
        light=np.column_stack([1 + x, x / 2, -x / 2, x / 4]),
        quantity=np.resize([str(q) for q in Quantity], n),
        value=x - 0.5,
        sigma=nan_last,
        pixels=np.arange(n, dtype=np.int64) + 2**40,
        flag=np.resize([str(f) for f in Flag], n),
        fwhm_nm=90 * x,
        signal_per_dn=nan_last,
    )


def write(rows: Observations, path: Path, **about: object) -> None:
    write_observations(Measurement(path=path, observations=rows, **{**ABOUT, **about}), path)


def assert_equal(one: Observations, other: Observations) -> None:
    for column in fields(Observations):
        a, b = getattr(one, column.name), getattr(other, column.name)
        assert a.dtype.kind == b.dtype.kind, column.name
        np.testing.assert_array_equal(a, b, column.name)


def problem(path: Path) -> str:
    with pytest.raises(ReflectanceFitError) as caught:
        read_observations(path)
    lines = caught.value.lines()
    assert all(line.startswith(f"Error: {path}: ") and line.isprintable() for line in lines)
    return "\n".join(line.removeprefix(f"Error: {path}: ") for line in lines)


@pytest.fixture
def path(tmp_path):
    write(observations(), tmp_path / "obs.nc")
    return tmp_path / "obs.nc"


@pytest.mark.parametrize("n", [0, 1, 2, 5, 37])
def test_round_trip(tmp_path, n):
    given_rows = observations(n)
    write(given_rows, tmp_path / "obs.nc")
    found = read_observations(tmp_path / "obs.nc")
    assert_equal(given_rows, found.observations)
    for name, value in ABOUT.items():
        assert getattr(found, name) == value, name


@settings(max_examples=50)
@given(
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=20),
    st.floats(allow_nan=False, allow_infinity=False),
)
def test_round_trip_of_any_name_and_number(tmp_path_factory, name, number):
    path = tmp_path_factory.mktemp("any") / "obs.nc"
    rows = replace(observations(2), channel=np.array([name, "G"]), value=np.full(2, number))
    write(rows, path, sample_name=name, warnings=(Note(name, name),))
    found = read_observations(path)
    assert_equal(rows, found.observations)
    assert (found.sample_name, found.warnings) == (name, (Note(name, name),))


@pytest.mark.parametrize("nuisances", [None, {}, {"diffuse": 0.25}])
def test_forbidden_nuisances_differ_from_a_free_choice(tmp_path, nuisances):
    write(observations(), tmp_path / "obs.nc", nuisances=nuisances)
    assert read_observations(tmp_path / "obs.nc").nuisances == nuisances


def test_the_same_rows_give_the_same_bytes(tmp_path, path):
    write(observations(), tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == path.read_bytes()


def test_a_failed_write_leaves_the_earlier_file(tmp_path, path):
    before = path.read_bytes()
    with pytest.raises((TypeError, ValueError)):
        write(observations(), path, exterior_ior=object())
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["obs.nc"]


def test_a_column_added_later_does_not_matter(path):
    with h5netcdf.File(path, "a") as file:
        file.create_variable("humidity", ("row",), float)[...] = 1.0
        file.attrs["room"] = "cellar"
    assert_equal(read_observations(path).observations, observations())


def test_schema_and_file_agree(path):
    schema = observations_schema()
    with h5netcdf.File(path, "r") as file:
        assert set(file.variables) == set(schema["columns"]) == set(COLUMNS)
        assert set(file.attrs) == set(schema["attributes"]) == set(ATTRIBUTES)
        for name, column in schema["columns"].items():
            assert column["description"]
            assert file[name].attrs.get("units") == column["unit"]
    plain = {f.name for f in fields(Observations)} - {"light"}
    assert plain | {f"light_s{i}" for i in range(4)} == set(COLUMNS)


@pytest.mark.parametrize(
    "content", [b"", b"schema: x\n", b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n" + b"\xff" * 5000]
)
def test_not_a_netcdf_file(tmp_path, content):
    (tmp_path / "x.nc").write_bytes(content)
    assert problem(tmp_path / "x.nc").startswith("cannot be read as observations (NetCDF4): ")


def test_not_a_file(tmp_path):
    assert problem(tmp_path) == "is a folder, not a file"
    assert problem(tmp_path / "none.nc") == "there is no such file"
    assert problem(Path("/dev/zero")) == "is not a regular file"


def test_a_netcdf_file_of_another_kind(tmp_path):
    with h5netcdf.File(tmp_path / "x.nc", "w") as file:
        file.dimensions = {"chain": 2}
        file.attrs["title"] = "posterior draws"
    assert problem(tmp_path / "x.nc").startswith("'schema: reflectance_fit/observations/1' is missing")


def edit(path: Path, name: str, data: object, dtype: object = None) -> None:
    with h5py.File(path, "a") as file:
        dimensions = dict(file[name].attrs)
        del file[name]
        file.create_dataset(name, data=data, dtype=dtype)
        for key, value in dimensions.items():
            if key not in ("DIMENSION_LIST", "REFERENCE_LIST"):
                file[name].attrs[key] = value
        file[name].dims[0].attach_scale(file["row"])


BAD_COLUMNS = [
    ("value", [1.0, np.nan, 1, 1], "value must be finite"),
    ("sigma", [0.0, 1, 1, 1], "sigma must be above 0"),
    ("theta_deg", [90.0, 1, 1, 1], "theta_deg must be 0 to below 90"),
    ("theta_deg_sigma", [-1.0, 1, 1, 1], "theta_deg_sigma must be 0 or above"),
    ("theta_deg_spread", [np.nan, 1, 1, 1], "theta_deg_spread must be 0 to 90"),
    ("fwhm_nm", [-1.0, 1, 1, 1], "fwhm_nm must be 0 or above"),
    ("signal_per_dn", [0.0, 1, 1, 1], "signal_per_dn must be above 0"),
    ("wavelength_nm", [0.5, 500, 500, 500], "wavelength_nm must be 100 to 20000"),
    ("analyzer_deg", [np.inf, 1, 1, 1], "analyzer and retarder angles must be finite"),
    ("diattenuation", [0.0, 1, 1, 1], "diattenuation must be above 0"),
    ("light_s0", [0.1, 1, 1, 1], "light is more polarized than possible"),
    ("light_s1", [np.nan, 0, 0, 0], "light is more polarized than possible"),
    (
        "quantity",
        np.array(["x", "dolp", "dolp", "dolp"], dtype=object),
        "quantity has a name that is not known",
    ),
    ("channel", [1.0, 2, 3, 4], "the column channel must hold text values"),
    ("pixels", [1.0, 2, 3, 4], "the column pixels must hold integer values"),
    ("value", [1, 2, 3, 4], "the column value must hold float values"),
]


@pytest.mark.parametrize(("name", "data", "expected"), BAD_COLUMNS)
def test_bad_values(path, name, data, expected):
    write(replace(observations(), flag=np.full(4, "used")), path)
    edit(path, name, data, h5py.string_dtype() if getattr(data, "dtype", None) == object else None)
    assert problem(path).startswith(expected)


def test_files_of_the_first_version_have_no_widths_and_no_counts(path):
    rows = replace(observations(), flag=np.full(4, "used"))
    write(rows, path)
    with h5py.File(path, "a") as file:
        del file["fwhm_nm"], file["signal_per_dn"]
    read = read_observations(path).observations
    assert_equal(read, replace(rows, fwhm_nm=np.zeros(4), signal_per_dn=np.full(4, np.nan)))


def test_rows_that_are_not_used_may_be_anything(path):
    rows = replace(
        observations(),
        flag=np.array(["used", "saturated", "masked", "rejected"]),
        value=np.array([1.0, *[np.nan] * 3]),
    )
    write(rows, path)
    assert_equal(read_observations(path).observations, rows)


def test_a_flag_that_is_not_known(path):
    write(replace(observations(), flag=np.full(4, "usedd")), path)
    assert problem(path).startswith("flag has a name that is not known")


def test_missing_columns_are_all_named(path):
    with h5py.File(path, "a") as file:
        del file["value"], file["diattenuation"]
    assert problem(path).splitlines() == [
        f"the column {name} is missing; write the file anew with ingest"
        for name in ("diattenuation", "value")
    ]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("schema", "reflectance_fit/observations/2", "schema reflectance_fit/observations/2 is not known"),
        ("schema", "reflectance_fit/map/1", "is a map file"),
        ("schema", 7, "schema must be"),
        ("exterior_ior", -1.0, "exterior_ior: must be greater than 0"),
        ("exterior_ior", "one", "exterior_ior: must be a valid number"),
        ("sample", 5, "sample: must be text"),
        ("priors", "{", "cannot be read as observations"),
        ("priors", "[" * 100_000, "cannot be read as observations"),
        ("priors", '{"eta": {"uniform": [2, 1]}}', "priors.eta: the range must be"),
        ("nuisances", '{"difuse": 1}', "nuisances.difuse: unknown nuisance, did you mean 'diffuse'?"),
        ("nuisances", '{"diffuse": -1}', "nuisances.diffuse: must be greater than 0"),
        ("inputs", "[]", "inputs: must have at least 1 item"),
    ],
)
def test_bad_attributes(path, name, value, expected):
    with h5py.File(path, "a") as file:
        file.attrs[name] = value
    assert problem(path).startswith(expected)


def test_a_missing_attribute(path):
    with h5py.File(path, "a") as file:
        del file.attrs["sample"]
    assert problem(path) == "'sample' is missing; add it"


def test_more_rows_than_a_file_can_hold(path):
    with h5py.File(path, "a") as file:
        del file["row"]
        file.create_dataset("row", shape=(10**12,), dtype="f4", chunks=(1000,)).make_scale("row")
        for name in COLUMNS:
            del file[name]
            file.create_dataset(name, shape=(10**12,), dtype="f8", chunks=(1000,)).dims[0].attach_scale(
                file["row"]
            )
    assert problem(path) == "has 1000000000000 rows; at most 5000000 are read"


@pytest.mark.parametrize("trick", ["external link", "external storage", "virtual", "soft link", "group"])
def test_columns_from_elsewhere(tmp_path, path, trick):
    (tmp_path / "secret").write_bytes(bytes(1000))
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["value"] = np.ones(4)
    with h5py.File(path, "a") as file:
        del file["value"]
        if trick == "external link":
            file["value"] = h5py.ExternalLink("other.h5", "value")
        elif trick == "soft link":
            file["value"] = h5py.SoftLink("/sigma")
        elif trick == "group":
            file.create_group("value")
        elif trick == "virtual":
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource("other.h5", "value", (4,))
            file.create_virtual_dataset("value", layout)
        else:
            file.create_dataset("value", (4,), "f8", external=[(str(tmp_path / "secret"), 0, 32)])
    assert problem(path).endswith("value is no column of this file")


@settings(max_examples=300)
@given(
    st.lists(st.tuples(st.integers(0, 1 << 20), st.binary(min_size=1, max_size=8)), min_size=1, max_size=4),
    st.booleans(),
)
def test_broken_bytes(tmp_path_factory, edits, cut):
    """Rows or lines, whatever is overwritten or cut off."""
    folder = tmp_path_factory.mktemp("broken")
    write(observations(2), folder / "obs.nc")
    raw = bytearray((folder / "obs.nc").read_bytes())
    for place, piece in edits:
        place %= len(raw)
        raw[place : place + len(piece)] = piece
    (folder / "obs.nc").write_bytes(raw[: edits[0][0] % len(raw)] if cut else raw)
    found = outcome(folder / "obs.nc")
    assert len(found) > 0


def outcome(path: Path) -> list[str] | Observations:
    try:
        return read_observations(path).observations
    except ReflectanceFitError as error:
        return [line for line in error.lines() if line.startswith("Error: ") and line.isprintable()]
