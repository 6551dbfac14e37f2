"""The scorecards: what they print, how they end, and what they leave on their page.  Not what they measure."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
FAKE = """
from card import Figure, Table

def about(*, full):
    return f"Seeds 0 to {99 if full else 9}, N = 10."

def figures(*, full):
    yield Figure.judged("speed | of light", "3e8", "2e8", True)
    yield Figure.judged("patience", "0.1", "1", VERDICT)
    yield Table("Detail", ("a", "b"), (("1|2", "3"),))
    yield Figure.not_run("luck", "7", "no dice")
"""
RUN = """
import sys
from pathlib import Path
sys.path.append(sys.argv[1])
import card
sys.exit(card.main("scorecard", Path(__file__).parent, sys.argv[2:], Path(__file__).with_name("page.md")))
"""


@pytest.fixture
def fake(tmp_path):
    """A folder with two cards, of which one falls short, and what runs them."""
    (tmp_path / "run.py").write_text(RUN)
    (tmp_path / "good.py").write_text(FAKE.replace("VERDICT", "True"))
    (tmp_path / "bad.py").write_text(FAKE.replace("VERDICT", "False"))

    def run(*words):
        line = [sys.executable, tmp_path / "run.py", TESTS / "scorecard", *words]
        return subprocess.run(line, capture_output=True, text=True, check=False)

    return run


@pytest.mark.parametrize(
    ("kind", "known"),
    [("scorecard", {"capture", "fresnel", "inference"}), ("benchmarks", {"startup", "demo", "fresnel"})],
)
def test_an_unknown_name_lists_the_names(kind, known):
    line = [sys.executable, TESTS / kind / "run.py", "nothing"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    listed = done.stderr.strip().partition("choose one of: ")[2].split(", ")
    assert known <= set(listed)
    assert not {"card", "run"} & set(listed)
    assert not [name for name in listed if "_" in name]


def test_a_line_a_figure(fake):
    done = fake("bad")
    assert done.stdout.splitlines() == [
        "speed | of light: 3e8 (target 2e8) ok",
        "patience: 0.1 (target 1) short",
        "luck: - (target 7) not run: no dice",
        "1 ok, 1 short, 1 not run",
    ]
    assert done.returncode == 1
    done = fake("good")
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "2 ok, 0 short, 1 not run")


def test_nothing_is_written_unasked(fake, tmp_path):
    before = set(tmp_path.iterdir())
    fake("good")
    assert set(tmp_path.iterdir()) - before <= {tmp_path / "__pycache__"}


def test_write_keeps_the_other_sections(fake, tmp_path):
    page = tmp_path / "page.md"
    fake("good", "--write")
    good = page.read_text()
    assert "Seeds 0 to 9, N = 10." in good
    assert r"| speed \| of light | 3e8 | 2e8 | ok |" in good
    assert good.rstrip().endswith("### Detail\n\n| a | b |\n|---|---|\n| 1\\|2 | 3 |")
    assert "Python" in good
    assert "cores" in good
    fake("bad", "--write")
    fake("good", "--full", "--write")
    both = page.read_text()
    titles = [line for line in both.splitlines() if line.startswith("## ")]
    assert titles == ["## scorecard bad", "## scorecard good", "## scorecard good --full"]
    assert good.partition("## ")[2].strip() in both
    assert "Seeds 0 to 99, N = 10." in both
    # Written again, a section takes the place of its own.
    (tmp_path / "good.py").write_text(FAKE.replace("VERDICT", "False"))
    fake("good", "--write")
    again = page.read_text()
    assert [line for line in again.splitlines() if line.startswith("## ")] == titles
    assert again.count("| patience | 0.1 | 1 | ok |") == 1  # of the full run


def test_json(fake, tmp_path):
    fake("bad", "--json", tmp_path / "out.json")
    data = json.loads((tmp_path / "out.json").read_text())
    assert data["title"] == "scorecard bad"
    assert data["figures"][2] == {
        "name": "luck", "value": "-", "target": "7", "verdict": "not run", "why": "no dice"
    }  # fmt: skip
