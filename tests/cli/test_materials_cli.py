"""``materials list`` and ``materials show`` as a user meets them."""

from __future__ import annotations

import subprocess
import sys

import pytest
from click.testing import CliRunner

from reflectance_fit.cli.materials import materials
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials import library


def run(*arguments: object) -> str:
    result = CliRunner().invoke(materials, [str(a) for a in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def row(output: str, first: str) -> list[str]:
    (line,) = [line for line in output.splitlines() if line.strip().startswith(first + " ")]
    return line.split()


def test_list_has_one_row_for_every_material():
    output = run("list")
    for name in library.names():
        assert row(output, f"{name} ")
    assert row(output, "N-BK7") == [
        "N-BK7",
        "dielectric",
        "300-2500",
        "550",
        "1.5185",
        "7.24e-09",
        "air",
        "Schott",
        "2017",
    ]
    # Not covered at 550 nm: the nearest wavelength, and it says which.
    assert row(output, "glycerol")[3:5] == ["589.3", "1.4722"]
    assert row(output, "CaF2")[5] == "-"


def test_show_gives_both_references_and_the_brewster_angle():
    """arctan(1.515089) = 56.574 degrees, seen from air."""
    output = run("show", "bk7", "--wavelength-nm", 632.8)
    assert output.startswith("N-BK7 (dielectric)\n")
    assert "Range: 300 to 2500 nm" in output
    assert "SCHOTT Zemax catalog 2017-01-20b" in output
    wavelength, eta_air, _, eta_vacuum, _, brewster = row(output, "632.8")
    assert (wavelength, eta_air, eta_vacuum, brewster) == ("632.8", "1.51509", "1.51551", "56.574")


def test_show_gold_has_a_pseudo_brewster_angle():
    """The minimum of R_p of 0.183 + 3.43i is near 72.6 degrees; arctan(eta) would be near 10."""
    _, eta, k, brewster = row(run("show", "gold", "-w", 633), "633")
    assert float(eta) == pytest.approx(0.183, abs=0.01)
    assert float(k) == pytest.approx(3.43, abs=0.02)
    assert float(brewster) == pytest.approx(72.6, abs=0.2)


def test_show_says_when_k_is_assumed_and_when_a_crystal_is_birefringent():
    output = run("show", "sapphire")
    assert "taken as 0" in output
    assert "Ordinary ray" in output
    for wavelength in ("450", "550", "650"):
        assert row(output, wavelength)


def test_show_falls_back_to_the_nearest_covered_wavelength():
    assert row(run("show", "tin"), "730")[1:3] == ["2.16", "6.35"]


def test_show_falls_back_to_the_upper_end_of_an_ultraviolet_source(own_file):
    own_file.write_text(own_file.read_text().replace("0.4 0.8", "0.2 0.3"))
    assert row(run("show", "--file", own_file), "300")


@pytest.fixture
def own_file(tmp_path):
    path = tmp_path / "own.yml"
    path.write_text(
        "REFERENCES: A. $x^2$ Author\nDATA:\n  - type: formula 5\n"
        "    wavelength_range: 0.4 0.8\n    coefficients: 1.5 0.004 -2\n"
    )
    return path


def test_show_reads_a_file_of_the_user(own_file):
    assert row(run("show", "--file", own_file, "-w", 500), "500")[1:3] == ["1.516", "0"]
    assert row(run("show", "--file", own_file, "--relative-to", "air", "-w", 500), "500")[3] == "1.51642"


@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG\r\n"), (".svg", b"<?xml")])
def test_show_draws_whole_files_that_repeat(own_file, tmp_path, suffix, start):
    picture = tmp_path / f"plot{suffix}"
    assert f"wrote {picture}" in run("show", "--file", own_file, "-o", picture)
    first = picture.read_bytes()
    assert first.startswith(start)
    run("show", "--file", own_file, "-o", picture)
    assert picture.read_bytes() == first
    assert sorted(path.name for path in tmp_path.iterdir()) == ["own.yml", picture.name]


@pytest.mark.parametrize("name", ["Al", "TiO2 film", "Sn", "water"])
def test_every_kind_of_source_can_be_drawn(name, tmp_path):
    run("show", name, "-o", tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("show", "unobtainium"), "no built-in material 'unobtainium'"),
        (
            ("show", "N-BK7", "-w", "5000"),
            "N-BK7: n is not known at 5000 nm; its source covers 300 to 2500 nm",
        ),
        (("show", "N-BK7", "-o", "plot.gif"), r"ends in \.png or \.svg"),
        (("show", "N-BK7", "-o", "no/such/folder/plot.png"), "cannot be written"),
        (("show", "--file", "no-such.yml"), "there is no such file"),
    ],
)
def test_mistakes_are_errors_a_user_can_mend(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ReflectanceFitError, match=message):
        run(*arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [("show",), ("show", "gold", "--file", "x.yml")])
def test_name_and_file_are_one_or_the_other(arguments):
    result = CliRunner().invoke(materials, list(arguments))
    assert result.exit_code == 2
    assert "one of the two" in result.output


@pytest.mark.parametrize("arguments", [(), ("list",), ("show",)])
def test_every_help_has_an_example(arguments):
    assert "Example:\n" in run(*arguments, "--help")


def test_help_imports_nothing_heavy():
    code = (
        "import sys, reflectance_fit.cli.materials\n"
        "print(sorted({'numpy', 'rich', 'ruamel', 'pydantic', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
