"""``plan`` as a photographer meets it: the table, the files, and a manifest that the program itself accepts."""

import re

import pytest
import yaml
from click.testing import CliRunner, Result

from reflectance_fit.capture.manifest import Manifest
from reflectance_fit.cli.main import cli

FILES = {"plan.yaml", "plan.png", "plan.svg", "capture-template.yaml"}


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(cli, ["plan", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def aluminium(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan") / "deep" / "al"
    result = run("--material", "Al", "--noise", "0.001", "-o", folder)
    assert (result.exit_code, result.stderr) == (0, "")
    return folder, result.stdout


def test_the_table_names_equipment_angles_and_what_cannot_be_told(aluminium):
    folder, text = aluminium
    lines = text.splitlines()
    assert lines[0] == "Al, 550 nm: eta = 1.0152, k = 6.627 assumed, 12 photographs"
    assert [line for line in lines if line.startswith("with ")] == [
        "with an analyzer on the camera",
        "with a polarizer on the lamp too",
        "with a quarter-wave plate before the analyzer too",
    ]
    assert sum("(best" in line for line in lines) == 3
    assert sum("recommended)" in line for line in lines) == 1
    assert "  30 x2, 45 x2, 60 x2, s and p: eta and k apart: only a curve of pairs that fit alike" in lines
    assert sum("never told:" in line for line in lines) == 3
    assert "assumed: noise 0.1 % of each signal, an unknown gain at each angle," in lines
    assert "angle_offset_deg 0.5" in text
    assert lines[-1] == f"wrote {folder}"


def test_the_files_agree_with_the_table(aluminium):
    folder, text = aluminium
    assert {p.name for p in folder.iterdir()} == FILES
    plan = yaml.safe_load((folder / "plan.yaml").read_text())
    assert plan["schema"] == "reflectance_fit/plan/1"
    best = {option["needs"]: option for option in plan["best"]}
    assert set(best) == {"analyzer", "lamp polarizer", "quarter-wave plate"}
    for option in best.values():
        assert option["frames"] == len(option["angles_deg"]) * len(option["settings"]) <= 12
        sd = option["expected"]["eta"]["sd"]
        assert re.search(rf"1\.0\d+ \+- {sd:.2g}", text)
    # The usual angles in the words of the report.
    (usual,) = [option for option in plan["usual"] if option["name"] == "s and p"]
    assert usual["expected"]["k"] == {"status": "not_identified", "sd": None}
    assert usual["cannot_tell"]


def test_the_manifest_is_valid_and_is_the_recommended_design(aluminium):
    folder, _ = aluminium
    plan = yaml.safe_load((folder / "plan.yaml").read_text())
    (chosen,) = [o for o in plan["best"] if o["needs"] == plan["recommended"]]
    manifest = Manifest.model_validate(yaml.safe_load((folder / "capture-template.yaml").read_text()))
    assert len(manifest.frames) == chosen["frames"]
    assert sorted({frame.theta_deg for frame in manifest.frames}) == sorted(set(chosen["angles_deg"]))
    assert {(f.analyzer_deg, f.retarder_deg) for f in manifest.frames} == {
        (s["analyzer_deg"], s.get("retarder_deg")) for s in chosen["settings"]
    }
    assert manifest.light.linear_deg == chosen["light"]["linear_deg"]


def test_an_angle_that_stands_twice_has_two_gains(tmp_path):
    """Else its photographs would share a gain, and the manifest would not be what was planned."""
    run("--eta", 0.4, "--k", 2.4, "--frames", 16, "--noise", 0.05, "-o", tmp_path)
    plan = yaml.safe_load((tmp_path / "plan.yaml").read_text())
    (chosen,) = [o for o in plan["best"] if o["needs"] == plan["recommended"]]
    assert len(set(chosen["angles_deg"])) < len(chosen["angles_deg"])
    manifest = Manifest.model_validate(yaml.safe_load((tmp_path / "capture-template.yaml").read_text()))
    settings = [(f.theta_deg, f.gain_group) for f in manifest.frames]
    assert len(set(settings)) == len(chosen["angles_deg"])


def test_equal_questions_have_equal_answers(aluminium, tmp_path):
    folder, text = aluminium
    again = run("--material", "Al", "--noise", "0.001", "-o", tmp_path / "again")
    assert again.stdout.splitlines()[:-1] == text.splitlines()[:-1]
    for name in FILES:
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes(), name


def test_less_noise_and_more_photographs_tell_more(tmp_path):
    def eta_sd(*arguments):
        assert run("--eta", 1.5, *arguments, "-o", tmp_path).exit_code == 0
        return [
            o["expected"]["eta"]["sd"] for o in yaml.safe_load((tmp_path / "plan.yaml").read_text())["best"]
        ]

    usual = eta_sd("--noise", 0.01)
    for better in (eta_sd("--noise", 0.001), eta_sd("--noise", 0.01, "--frames", 24)):
        assert all(b < u for b, u in zip(better, usual, strict=True))


def test_a_transparent_material_gets_an_upper_limit_and_quiet_is_quiet(tmp_path):
    text = run("--material", "N-BK7", "--noise", "high", "--frames", 6).stdout
    assert re.search(r"< 0\.\d+ \(95 %\)", text)
    assert "Few lamps repeat to 0.1 %" in text
    result = run("--eta", 1.5, "-q", "-o", tmp_path / "out")
    assert (result.exit_code, result.output) == (0, "")
    assert {p.name for p in (tmp_path / "out").iterdir()} == FILES


def test_two_photographs_are_one_equation():
    text = run("--eta", 1.5, "--frames", 2).stdout
    assert "one equation for two unknowns: eta only if k = 0 is taken for granted" in text
    assert "with a polarizer" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give exactly one of --eta and --material"),
        (("--eta", "1.5", "--material", "Al"), "give exactly one of"),
        (("--eta", "1.5", "--noise", "none"), "neither low, typical, high nor a relative noise"),
        (("--eta", "1.5", "--noise", "nan"), "neither low, typical, high nor a relative noise"),
        (("--eta", "1.5", "--noise", "0"), "such as 0.01"),
        (("--eta", "1.5", "--frames", "1"), "--frames"),
    ],
)
def test_wrong_usage_is_2(arguments, message):
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--eta", "-1"), "Error: eta must be positive"),
        (("--eta", "nan"), "Error: eta must be positive"),
        (("--eta", "1.5", "--k", "-1"), "is yours n - ik?"),
        (("--eta", "30"), "a fit looks for eta from 0.05 to 10 and k up to 20"),
        (("--eta", "1.5", "--wavelength-nm", "nan"), "the wavelength must be from 100 to 20000 nm"),
        (("--eta", "1.5", "--k", "21"), "plan for an index in there"),
        (("--material", "N-BK"), "did you mean 'N-BK7'?"),
        (("--material", "Al", "--wavelength-nm", "5e5"), "its source covers"),
    ],
)
def test_what_the_user_can_mend_is_1(arguments, message, tmp_path):
    result = run(*arguments, "-o", tmp_path / "out")
    assert result.exit_code == 1
    (line,) = result.stderr.splitlines()
    assert message in line
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_said_before_any_work(tmp_path):
    (tmp_path / "file").write_text("mine")
    result = run("--eta", 1.5, "-o", tmp_path / "file")
    assert result.exit_code == 1
    assert "cannot write here" in result.stderr
    assert (tmp_path / "file").read_text() == "mine"
