"""Help comes at once: nothing heavy is imported before it is needed.  Its examples run."""

import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from reflectance_fit.cli.main import cli
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import standard_spec
from reflectance_fit.data_synthetic.tables import write_example

HEAVY = {"numpy", "scipy", "numba", "emcee", "nlopt", "colour", "matplotlib", "PIL", "h5py", "h5netcdf"} | {
    "pydantic", "rich", "yaml", "ruamel", "arviz_stats", "OpenEXR"
}  # fmt: skip


def commands(command: click.Command, words: tuple[str, ...] = ()) -> dict[tuple[str, ...], click.Command]:
    """Every command by the words that lead to it, groups included."""
    found = {words: command}
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            child = command.get_command(context, name)
            assert child is not None
            found |= commands(child, (*words, name))
    return found


COMMANDS = commands(cli)


def help_text(words: tuple[str, ...]) -> str:
    result = CliRunner().invoke(cli, [*words, "--help"])
    assert result.exit_code == 0, result.output
    return result.stdout


def examples(words: tuple[str, ...]) -> list[list[str]]:
    """The command lines below ``Example:``, without the name of the program."""
    below = help_text(words).partition("Example:\n")[2].partition("\nOptions:")[0]
    lines = [shlex.split(line) for line in below.splitlines()]
    return [line[1:] for line in lines if line[:1] == ["reflectance-fit"]]


EXAMPLES = [(words, example) for words in COMMANDS for example in examples(words)]


def loaded_by(code: str) -> set[str]:
    code = f"import sys\n{code}\nprint(sorted({set(HEAVY)!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(eval(done.stdout.splitlines()[-1]))


def test_importing_the_package_costs_nothing():
    assert loaded_by("import reflectance_fit; reflectance_fit.__version__") == set()


def test_help_of_every_command_loads_nothing_heavy():
    lines = [[*words, "--help"] for words in COMMANDS]
    assert len(lines) >= 8
    code = (
        "from reflectance_fit.cli.main import cli\n"
        f"for words in {lines!r}:\n"
        "    try:\n"
        "        cli(words)\n"
        "    except SystemExit as end:\n"
        "        assert end.code == 0, words\n"
    )
    assert loaded_by(code) == set()


def test_a_wrong_word_loads_nothing_heavy():
    code = (
        "from reflectance_fit.cli.main import cli\n"
        "try:\n"
        "    cli(['fti'])\n"
        "except SystemExit as end:\n"
        "    assert end.code == 2\n"
        "print()"
    )
    assert loaded_by(code) == set()


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_has_help_and_an_example(words):
    text = help_text(words)
    assert "Example:\n" in text
    assert examples(words)
    # Options without a word of help are a riddle.
    for parameter in COMMANDS[words].params:
        if isinstance(parameter, click.Option):
            assert parameter.help, parameter.name


@pytest.mark.parametrize(("words", "example"), EXAMPLES, ids=lambda value: " ".join(value))
def test_every_example_parses(words, example):
    context = cli.make_context("reflectance-fit", list(example), resilient_parsing=False)
    command: click.Command = cli
    rest = list(example)
    while isinstance(command, click.Group) and rest:
        _, command, rest = command.resolve_command(context, rest)  # type: ignore[assignment]
    assert words == () or COMMANDS[words] is command or isinstance(COMMANDS[words], click.Group)
    with command.make_context(example[0], rest, parent=context):
        pass


RUN = [
    example
    for words, example in EXAMPLES
    if words not in ((), ("materials",)) and example[0] not in ("demo",)
]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """What the examples name: a table, a small capture and its observations, a scene."""
    folder = tmp_path_factory.mktemp("inputs")
    write_example(folder, "Au")
    spec = replace(standard_spec("Au"), sensor=Sensor(width=200, height=160), angles_deg=(60.0, 75.0))
    write_capture(folder, spec)
    (folder / "scene.yaml").write_text(
        "schema: reflectance_fit/scene/1\n"
        "camera: {position: [0, -5, 1], target: [0, 0, 1], size_px: [32, 24]}\n"
        "surfaces: [{sphere: {center: [0, 0, 1], radius: 1}, material: {type: lambertian, reflectance: 0.5}}]\n"
        "lights: [{type: environment, radiance: 1}]\n"
    )
    assert (
        CliRunner().invoke(cli, ["ingest", f"{folder}/capture.yaml", "-o", f"{folder}/obs.nc"]).exit_code == 0
    )
    return folder


@pytest.mark.parametrize("example", RUN, ids=" ".join)
def test_every_example_runs(example, inputs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if example[0] in ("fit", "ingest", "map", "render"):
        shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    if example[0] == "batch":
        for name in ("a", "b"):
            write_example(tmp_path / "samples" / name, "Au")
    if example[0] in ("fit", "batch"):
        example = [*example, "--no-plots"]
    result = CliRunner().invoke(cli, example)
    assert result.exit_code == 0, result.output
    assert result.stdout.strip()
    if "-o" in example:
        assert (tmp_path / example[example.index("-o") + 1]).exists()


def test_the_demo_of_the_help_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ((_, example),) = [item for item in EXAMPLES if item[0] == ("demo",)]
    result = CliRunner().invoke(cli, [*example, *([] if "--no-plots" in example else ["--no-plots"])])
    assert result.exit_code == 0, result.output
    assert "recovered against true" in result.stdout
    folder = Path(example[example.index("-o") + 1])
    (report,) = folder.rglob("report.yaml")
    assert report.parent.name == "result"


def test_the_installed_command_is_there():
    command = Path(sys.executable).with_name("reflectance-fit")
    path = str(command) if command.exists() else shutil.which("reflectance-fit")
    assert path
    done = subprocess.run([path, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("reflectance-fit, version ")
