"""report.yaml and posterior.nc of a real fit: what the contract promises, and that both say the same."""

import hashlib
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from ruamel.yaml import YAML

import reflectance_fit
from reflectance_fit import workflow
from reflectance_fit.data_synthetic.tables import write_example
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference import posterior
from reflectance_fit.measured import Note
from reflectance_fit.physics.fresnel import r0
from reflectance_fit.report.build import build_report
from reflectance_fit.report.read import material_of, read_report
from reflectance_fit.report.schema import Report
from reflectance_fit.report.write import report_yaml
from reflectance_fit.result import Interval

MANIFEST = """schema: reflectance_fit/measurement/1
sample: {name: K9 prism}
tables:
  - file: gold.csv
    wavelength_nm: 632.8
    columns: {theta_deg: theta_deg, psi_deg: psi_deg, psi_deg_sigma: psi_deg_sigma, delta_deg: delta_deg,
      delta_deg_sigma: delta_deg_sigma}
  - file: glass.csv
    wavelength_nm: 550
    columns: {theta_deg: theta_deg, signal_s: signal_s, signal_p: signal_p}
nuisances: {angle_offset_deg: {sigma: 0.2}}
"""


def flat(draws):
    return np.asarray(draws).ravel()


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Two channels in one file: a metal's psi and delta, a glass's signals without any sigma."""
    folder = tmp_path_factory.mktemp("two")
    for material, name in (("Au", "gold"), ("N-BK7", "glass")):
        write_example(folder / name, material)
        (folder / name / "scan.csv").rename(folder / f"{name}.csv")
    (folder / "measurement.yaml").write_text(MANIFEST)
    return folder / "measurement.yaml"


@pytest.fixture(scope="module", autouse=True)
def short_runs():
    """Fewer draws than a user gets: nothing here depends on how many there are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(posterior, "MIN_ESS", 400.0)
        patch.setattr(posterior, "BLOCK", 150)
        patch.setattr(posterior, "MAX_STEPS", 150)
        yield


@pytest.fixture(scope="module")
def result(source, short_runs):
    return reflectance_fit.fit(source, timings=False)


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    result.write(folder, plots=False)
    return folder


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "report.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def data(text):
    return yaml.safe_load(text)


@pytest.fixture(scope="module")
def draws(folder):
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(folder / "posterior.nc", group="posterior", engine="h5netcdf") as dataset:
        return dataset.load()


# --- the text


def same(a, b) -> bool:
    """Equal in value and in kind: 1 and 1.0 differ."""
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def test_both_yaml_versions_read_it_alike(text, data):
    assert same(data, YAML(typ="safe", pure=True).load(text))


@pytest.mark.parametrize(
    "name", ["1e5", "0o17", "0x1F", "1_000", "yes", "~", "12:30", "2020-01-01", ".5", "nan", "="]
)
def test_both_yaml_versions_read_names_alike(result, name):
    report = result.report.model_copy(
        update={"sample": result.report.sample.model_copy(update={"name": name})}
    )
    text = report_yaml(report)
    assert yaml.safe_load(text)["sample"]["name"] == name
    assert YAML(typ="safe", pure=True).load(text)["sample"]["name"] == name


def test_small_and_large_numbers_are_numbers_to_both(result):
    gains = {"a": 1e-7, "b": 1e17, "c": 1234567.0, "d": 0.0}
    fit = result.report.fits[0]
    report = result.report.model_copy(
        update={"fits": [fit.model_copy(update={"fit": fit.fit.model_copy(update={"gains": gains})})]}
    )
    for read in (yaml.safe_load, YAML(typ="safe", pure=True).load):
        assert same(read(report_yaml(report))["fits"][0]["fit"]["gains"], gains)


def test_no_number_is_infinite_or_missing(text):
    assert not re.search(r"(?i)[-+]?\.(nan|inf)", text)
    assert not re.search(r"(?i)\b(nan|infinity)\b", text)


def test_numbers_are_short(data):
    def numbers(value):
        if isinstance(value, dict):
            value = list(value.values())
        if isinstance(value, list):
            for item in value:
                yield from numbers(item)
        elif isinstance(value, float):
            yield value

    found = list(numbers(data))
    assert len(found) > 80
    assert [x for x in found if float(f"{x:.9g}") != x] == []


def test_the_text_is_what_the_schema_says(data, result):
    assert Report.model_validate(data) == result.report
    allowed = Report.model_json_schema(by_alias=True)
    assert set(data) <= set(allowed["properties"])
    assert set(allowed["required"]) <= set(data)


def test_read_report_gives_it_back(folder, result):
    assert read_report(folder / "report.yaml") == result.report


def test_the_material_of_a_report(folder, result):
    material = material_of(read_report(folder / "report.yaml"), folder / "report.yaml")
    assert material.name == "K9 prism"
    assert material.channels == ("632.8 nm", "550 nm")
    assert material.eta.tolist() == [channel.eta.median for channel in result.report.channels]
    # Glass: k is an upper limit, so the material has none.
    assert material.k.tolist() == [result.report.channels[0].k.median, 0.0]


# --- the fields


def test_the_fields_of_the_contract(data):
    assert data["schema"] == "reflectance_fit/material-report/1"
    assert data["sample"] == {"name": "K9 prism"}
    for channel in data["channels"]:
        assert {
            *("channel", "fit", "wavelength_nm", "eta", "k", "brewster_deg", "r0", "schlick"),
        } <= set(channel)
        for name in ("eta", "k", "brewster_deg", "r0"):
            assert {"median", "sd", "ci68", "ci95", "status"} <= set(channel[name])
        assert {"max_abs_error", "at_deg", "max_rel_error", "rms_error", "albedo_error"} < set(
            channel["schlick"]
        )
        for row in channel["schlick"]["approximations"]:
            assert {"name", "max_abs_error", "rms_error"} <= set(row)
        assert data["fits"][channel["fit"]]["channels"] == [channel["channel"]]
    for fit in data["fits"]:
        assert set(fit) == {"channels", "model", "fit", "posterior"}
        assert {"name", "chosen_because", "candidates"} <= set(fit["model"])
        for candidate in fit["model"]["candidates"]:
            assert {"name", "nuisances", "parameters", "chi2", "dof", "bic"} <= set(candidate)
        assert {"optimizer", "chi2", "dof", "reduced_chi2", "p_value", "nuisances"} <= set(fit["fit"])
        assert set(fit["fit"]["nuisances"]["angle_offset_deg"]) == {"median", "sd"}
        assert {"method", "ensembles", "draws", "ess_min", "rhat_nested_max", "acceptance"} <= set(
            fit["posterior"]
        )
    assert {"fresnel", "model", "posterior"} <= set(data["effort"])
    assert set(data["provenance"]) == {"version", "seed", "inputs", "packages"}
    for warning in data["warnings"]:
        assert set(warning) == {"code", "channel", "message"}


def test_a_metal_and_a_glass(data):
    gold, glass = data["channels"]
    assert (gold["channel"], glass["channel"]) == ("632.8 nm", "550 nm")
    assert [fit["model"]["name"] for fit in data["fits"]] == ["conductor", "dielectric"]
    assert (gold["eta"]["status"], gold["k"]["status"]) == ("identified", "identified")
    assert gold["brewster_deg"]["kind"] == "pseudo_brewster"
    assert {"second_brewster_deg", "principal_angle_deg"} <= set(gold)
    assert glass["brewster_deg"]["kind"] == "brewster"
    assert "principal_angle_deg" not in glass
    limit = glass["k"]
    assert limit["status"] == "upper_limit"
    assert limit["median"] is limit["sd"] is limit["ci68"] is None
    assert limit["ci95"][0] == 0 < limit["ci95"][1]


def test_warnings(data):
    found = {(w["code"], w["channel"]) for w in data["warnings"]}
    # No sigma was stated for the glass; gold is no K9.
    assert {("SIGMA_ESTIMATED", "550 nm"), ("LITERATURE_DISAGREES", "632.8 nm")} <= found
    assert not {("SIGMA_ESTIMATED", "632.8 nm"), ("LITERATURE_DISAGREES", "550 nm")} & found
    assert set(data["fits"][1]["fit"]["estimated_sigma"]) == {"signal_s", "signal_p"}
    assert data["fits"][1]["fit"]["p_value"] is None
    assert 0 < data["fits"][0]["fit"]["p_value"] <= 1


def test_literature(data):
    for channel in data["channels"]:
        literature = channel["literature"]
        assert literature["nearest"] == "N-BK7"
        z = (channel["eta"]["median"] - literature["eta"]) / channel["eta"]["sd"]
        assert literature["z"] == pytest.approx(z, rel=1e-3)


def test_provenance(data, source):
    inputs = data["provenance"]["inputs"]
    assert [item["file"] for item in inputs] == ["measurement.yaml", "gold.csv", "glass.csv"]
    for item in inputs:
        assert item["sha256"] == hashlib.sha256((source.parent / item["file"]).read_bytes()).hexdigest()
    assert data["provenance"]["seed"] == 0
    assert data["provenance"]["version"] == reflectance_fit.__version__
    assert {"python", "numpy", "scipy", "numba", "nlopt", "emcee"} <= set(data["provenance"]["packages"])


def test_priors(data):
    priors = data["priors"]
    assert priors["eta"] == {"log_uniform": [0.05, 10.0]}
    assert priors["k"] == {"uniform": [0.0, 20.0]}
    assert priors["angle_offset_deg"] == {"normal": {"mean": 0.0, "sigma": 0.2}}


# --- the numbers


def test_intervals_are_those_of_the_draws(data, draws):
    checked = 0
    for index, channel in enumerate(data["channels"]):
        for name in ("eta", "k", "brewster_deg", "second_brewster_deg", "principal_angle_deg", "r0"):
            estimate = channel.get(name)
            if estimate is None or estimate["status"] != "identified":
                continue
            values = flat(draws[name].isel(channel=index))
            quantiles = np.quantile(values, [0.025, 0.16, 0.5, 0.84, 0.975])
            assert estimate["median"] == pytest.approx(quantiles[2], rel=1e-6)
            assert estimate["sd"] == pytest.approx(values.std(), rel=1e-3)
            # 68 % may be the normal's 0.6827: a third of a per cent of the draws.
            assert estimate["ci68"] == pytest.approx(quantiles[[1, 3]], abs=0.03 * estimate["sd"])
            assert estimate["ci95"] == pytest.approx(quantiles[[0, 4]], abs=0.03 * estimate["sd"])
            checked += 1
    assert checked >= 8


def test_nuisances_are_those_of_the_draws(data, draws):
    for index, fit in enumerate(data["fits"]):
        for name, nuisance in fit["fit"]["nuisances"].items():
            values = flat(draws[name].isel(channel=index))
            assert nuisance["median"] == pytest.approx(np.median(values), rel=1e-6)
            assert nuisance["sd"] == pytest.approx(values.std(), rel=1e-6)


def test_derived_draws_follow_from_eta_and_k(draws):
    eta, k = draws["eta"].values / 1.000277, draws["k"].values / 1.000277
    np.testing.assert_allclose(draws["r0"], r0(eta, k), rtol=1e-12)
    glass = draws.isel(channel=1)
    np.testing.assert_allclose(glass["brewster_deg"], np.degrees(np.arctan(eta[..., 1])), rtol=1e-12)
    assert np.all(glass["k"] == 0)
    # A glass has no principal angle: NaN there, not a number that nobody measured.
    assert np.all(np.isnan(glass["principal_angle_deg"]))
    assert np.all(np.isfinite(draws.isel(channel=0)["principal_angle_deg"]))


def test_candidates_and_the_reason(data):
    for fit in data["fits"]:
        bic = {candidate["name"]: candidate["bic"] for candidate in fit["model"]["candidates"]}
        assert set(bic) == {"dielectric", "conductor"}
        assert fit["model"]["name"] == min(bic, key=lambda name: bic[name])
        difference = abs(bic["conductor"] - bic["dielectric"])
        stated = float(fit["model"]["chosen_because"].rpartition("delta BIC = ")[2])
        assert stated == pytest.approx(difference, rel=1e-3, abs=0.05)


# --- posterior.nc


def test_arviz_opens_it(folder, data):
    arviz = pytest.importorskip("arviz")
    posterior_data = arviz.from_netcdf(folder / "posterior.nc")
    posterior_group = posterior_data.posterior
    assert set(posterior_group.sizes) == {"chain", "draw", "channel"}
    assert {"eta", "k", "brewster_deg", "angle_offset_deg"} <= set(posterior_group.data_vars)
    for name in ("eta", "k", "brewster_deg"):
        assert posterior_group[name].dims == ("chain", "draw", "channel")
    assert posterior_group["channel"].values.tolist() == ["632.8 nm", "550 nm"]
    assert {"lp", "ensemble"} <= set(posterior_data.sample_stats.data_vars)
    assert posterior_data.sample_stats["lp"].shape == posterior_group["eta"].shape
    assert (
        len(set(posterior_data.sample_stats["ensemble"].values.tolist()))
        == data["fits"][0]["posterior"]["ensembles"]
    )

    summary = arviz.summary(posterior_data, var_names=["eta"], round_to="none")
    for row, channel in zip(summary["mean"], data["channels"], strict=True):
        assert row == pytest.approx(channel["eta"]["median"], abs=channel["eta"]["sd"])


def test_units_are_stated(draws):
    assert draws["eta"].attrs["units"] == "1"
    assert draws["brewster_deg"].attrs["units"] == draws["angle_offset_deg"].attrs["units"] == "degree"


# --- seeds and clocks


def test_same_seed_same_bytes_other_seed_other_draws(tmp_path):
    source = write_example(tmp_path, "Au")
    runs = [workflow.fit(source, timings=False, seed=seed) for seed in (3, 3, 4)]
    paths = [run.write(tmp_path / str(i), plots=False) for i, run in enumerate(runs)]
    first, again, other = (run.fits[0] for run in runs)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    for name, values in first.posterior.samples.items():
        np.testing.assert_array_equal(values, again.posterior.samples[name])
    assert not np.any(first.posterior.samples["eta"] == other.posterior.samples["eta"])
    # Another stream, the same answer: within the Monte Carlo error of a few hundred draws.
    eta = first.intervals["eta"]
    assert abs(eta.median - other.intervals["eta"].median) < 0.5 * eta.sd


def rebuilt(result, fits=None, **options):
    settings = {
        "sample_name": "sample",
        "exterior_ior": 1.000277,
        "notes": (),
        "seed": 0,
        "inputs": (),
        "seconds": None,
    } | options
    return build_report(result.fits if fits is None else fits, **settings)


def test_timings_are_there_only_when_asked_for(result, text):
    assert "seconds" not in text
    assert "ns_per_eval" not in text
    timed = yaml.safe_load(report_yaml(rebuilt(result, seconds={"read": 0.0123456, "fit": 3.0})))
    assert timed["effort"]["seconds"] == {"read": 0.0123, "fit": 3.0}
    assert all(row["ns_per_eval"] > 0 for row in timed["channels"][0]["schlick"]["approximations"])


# --- cases that a fit of good data does not show


def codes(report) -> list[str]:
    return [warning.code for warning in report.warnings]


def test_notes_of_the_reader_become_warnings(result):
    report = rebuilt(result, notes=[Note("ROWS_IGNORED", "3 rows of t.dat were left out")])
    assert report.warnings[0].model_dump() == {
        "code": "ROWS_IGNORED",
        "channel": None,
        "message": "3 rows of t.dat were left out",
    }


def test_warnings_of_bad_fits(result):
    gold = replace(result.fits[0], posterior=replace(result.fits[0].posterior, converged=True))
    assert codes(rebuilt(result, [gold])) == []
    bad = replace(gold, optimum=replace(gold.optimum, chi2=100.0))
    assert "WRONG_MODEL" in codes(rebuilt(result, [bad]))
    assert "SATURATED" in codes(rebuilt(result, [replace(gold, saturated=2)]))
    stuck = replace(gold, posterior=replace(gold.posterior, converged=False))
    assert "NOT_CONVERGED" in codes(rebuilt(result, [stuck]))
    low = gold.observations.select(gold.observations.theta_deg < 66)
    assert "ANGLE_RANGE" in codes(rebuilt(result, [replace(gold, observations=low)]))


def test_an_index_that_is_not_identified(result, tmp_path):
    nothing = Interval(None, None, None, None, "not_identified")
    unknown = replace(result.fits[0], intervals=dict.fromkeys(result.fits[0].intervals, nothing))
    report = rebuilt(result, [unknown], sample_name="gold")
    data = yaml.safe_load(report_yaml(report))
    (channel,) = data["channels"]
    assert channel["eta"] == dict.fromkeys(("median", "sd", "ci68", "ci95")) | {"status": "not_identified"}
    assert channel["schlick"] is None
    assert channel["literature"]["z"] is None
    path = tmp_path / "report.yaml"
    path.write_text(report_yaml(report))
    with pytest.raises(ReflectanceFitError, match="eta is identified in no channel"):
        material_of(read_report(path), path)


def test_modes_are_listed_where_there_are_several(result):
    two = replace(result.fits[0].intervals["eta"], status="multimodal", modes=(0.2, 1.5))
    fit = replace(result.fits[0], intervals={**result.fits[0].intervals, "eta": two})
    data = yaml.safe_load(report_yaml(rebuilt(result, [fit])))
    assert data["channels"][0]["eta"]["modes"] == [0.2, 1.5]
    assert "modes" not in data["channels"][0]["k"]


def test_an_unknown_model_is_refused(source):
    with pytest.raises(
        ReflectanceFitError,
        match="unknown model 'metal'; choose auto, dielectric, fixed_k, fixed_eta, conductor",
    ):
        workflow.fit(source, model="metal")


def test_a_known_value_and_the_model_that_takes_it(source, tmp_path):
    def refusal(priors, model):
        path = source.with_name("fixed.yaml")
        path.write_text(source.read_text() + f"priors: {priors}\n")
        with pytest.raises(ReflectanceFitError) as caught:
            workflow.fit(path, model=model)
        return caught.value.lines()[0]

    assert "--model fixed_k needs the value, as in priors: {k: {fixed: 1.5}}" in refusal("{}", "fixed_k")
    assert "priors fix eta at 1.5, which --model conductor does not take" in refusal(
        "{eta: {fixed: 1.5}}", "conductor"
    )
    assert "priors fix k at 0.5, which --model dielectric does not take" in refusal(
        "{k: {fixed: 0.5}}", "dielectric"
    )
    both = refusal("{eta: {fixed: 1.5}, k: {fixed: 0}}", "auto")
    assert "eta and k are both fixed: nothing is left to fit" in both


def test_a_channel_without_a_usable_row(source, tmp_path):
    for name in ("gold.csv", "glass.csv"):
        (tmp_path / name).write_bytes((source.parent / name).read_bytes())
    path = tmp_path / "measurement.yaml"
    path.write_text(
        MANIFEST.replace("    wavelength_nm: 550\n", "    wavelength_nm: 550\n    saturation: 0.001\n")
    )
    report = workflow.fit(path).report
    assert "550 nm" not in [channel.channel for channel in report.channels]
    (note,) = [w.message for w in report.warnings if w.code == "SATURATED"]
    assert note.startswith("550 nm is left out")


def test_channels_of_unequal_length_share_one_file(result, tmp_path):
    """posterior.nc has one dimension for all channels: the longer ones are thinned, and no ensemble is lost."""
    long, short = result.fits
    half = short.posterior.log_density.shape[0] // 2
    keep = np.arange(half) * 2
    thin = replace(
        short,
        posterior=replace(
            short.posterior,
            samples={name: values[keep, 5:] for name, values in short.posterior.samples.items()},
            log_density=short.posterior.log_density[keep, 5:],
            ensemble=short.posterior.ensemble[keep],
        ),
        derived={name: values[keep, 5:] for name, values in short.derived.items()},
    )
    workflow.FitResult(result.report, (long, thin)).write(tmp_path, plots=False)
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(tmp_path / "posterior.nc", group="posterior", engine="h5netcdf") as dataset:
        assert dataset.sizes["chain"] == half
        np.testing.assert_array_equal(dataset["eta"].values[..., 1], thin.posterior.samples["eta"])
    with xarray.open_dataset(tmp_path / "posterior.nc", group="sample_stats", engine="h5netcdf") as stats:
        counts = np.bincount(stats["ensemble"].values)
    assert counts.tolist() == [half // 4] * 4
