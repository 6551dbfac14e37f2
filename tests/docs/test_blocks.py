"""Examples that do not run, rot; a runner that cannot fail is no better.

docs/conftest.py runs the pages.  Here: that it fails when it should, and that no block escapes it by its
language, its place or a skip that nobody agreed to.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from reflectance_fit.capture.manifest import Manifest as Capture
from reflectance_fit.measurement.manifest import Manifest
from reflectance_fit.render.scene_blocks import SceneBlock

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(
    r"(?P<above>[^\n]*)\n+^```(?P<language>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
RUN, COMPARED, SHOWN = {"bash", "python"}, {"text"}, {"yaml", "csv"}
# What sets up an environment cannot run inside of one; a table with timings differs in every run.
MAY_BE_SKIPPED = re.compile(r"pip install |ns/value")


def blocks():
    for page in PAGES:
        for match in BLOCK.finditer(page.read_text(encoding="utf-8")):
            yield page.relative_to(ROOT).as_posix(), match["above"].strip(), match["language"], match["text"]


def run_page(folder, text):
    """The outcome of a page of its own, run by a copy of docs/conftest.py."""
    (folder / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "conftest.py", folder / "docs")
    (folder / "docs" / "page.md").write_text(text, encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\nfilterwarnings = error\n", encoding="utf-8")
    return subprocess.run(
        [sys.executable, "-m", "pytest", "--import-mode=importlib", "-p", "no:cacheprovider", "docs"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


GOOD = """
```bash
mkdir made
echo 'eta = 1.5168 found'
```
```text
eta = 1.5170 found
```
<!-- file: made/words.yaml -->
```yaml
eta:
  median: 1.5
status: identified
```
<!-- from: made/words.yaml -->
```yaml
  median: 1.5
status: identified
```
<!-- skip: next -->
```bash
false
```
<!-- invisible-code-block: bash
test -f made/words.yaml
-->
```python
from pathlib import Path
text = Path("made/words.yaml").read_text()
```
```python
print(len(text.splitlines()))
```
```text
3
```
"""


def test_a_good_page_passes(tmp_path):
    done = run_page(tmp_path, GOOD)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("```bash\nfalse\n```\n", "exit code 1"),
        ("```bash\nfalse\ntrue\n```\n", "exit code 1"),
        ("```bash\nfalse | true\n```\n", "exit code 1"),
        ('```bash\necho "$never_set"\n```\n', "never_set"),
        ("<!-- invisible-code-block: bash\nfalse\n-->\n", "exit code 1"),
        ("```python\nassert 1 == 2\n```\n", "AssertionError"),
        ("```python\nimport warnings\nwarnings.warn('old')\n```\n", "UserWarning"),
        ("```bash\necho one\n```\n```text\ntwo\n```\n", "the command prints"),
        ("```bash\necho 1.5168\n```\n```text\n1.5174\n```\n", "the command prints"),
        ("```bash\necho 16 rows\n```\n```text\n17 rows\n```\n", "the command prints"),
        ("```bash\necho one; echo two\n```\n```text\none\n```\n", "the command prints"),
        ("```python\nprint(1)\n```\n```text\n2\n```\n", "the command prints"),
        ("```bash\necho 'k: 1' > f\n```\n<!-- from: f -->\n```yaml\neta: 1\n```\n", "not in f"),
        (
            "```bash\nprintf 'a: 1.5\\nb: 2.5\\n' > f\n```\n<!-- from: f -->\n```yaml\nb: 2.5\na: 1.5\n```\n",
            "order",
        ),
        ("```bash\necho 'eta: 1.5' > f\n```\n<!-- from: f -->\n```yaml\neta: 1.7\n```\n", "not in f"),
    ],
)
def test_a_bad_page_fails(tmp_path, text, message):
    done = run_page(tmp_path, text)
    assert done.returncode == 1, done.stdout
    assert message in done.stdout


def test_there_are_blocks_to_run():
    run = [page for page, above, language, _ in blocks() if language in RUN and "skip:" not in above]
    assert len(run) >= 8
    assert "docs/quickstart.md" in run


def test_no_block_escapes_by_its_language():
    """``sh``, ``console`` or no language at all would be shown and never run."""
    known = RUN | COMPARED | SHOWN
    assert [(page, language) for page, _, language, _ in blocks() if language not in known] == []


def test_every_fence_belongs_to_a_block():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert text.count("```") == 2 * len(BLOCK.findall(text)), page.name


def test_only_what_cannot_run_is_skipped():
    skipped = [(page, text) for page, above, _, text in blocks() if "skip:" in above]
    assert [page for page, text in skipped if not MAY_BE_SKIPPED.search(text)] == []
    assert len(skipped) == sum(
        page.read_text(encoding="utf-8").count("<!-- skip: next -->") for page in PAGES
    )
    for page in PAGES:
        assert set(re.findall(r"skip: (\S+)", page.read_text(encoding="utf-8"))) <= {"next"}, page.name


@pytest.mark.parametrize(
    ("schema", "model"), [("measurement/1", Manifest), ("capture/1", Capture), ("scene/1", SceneBlock)]
)
def test_every_manifest_shown_is_valid(schema, model):
    shown = [text for _, _, language, text in blocks() if language == "yaml" and f"fit/{schema}" in text]
    assert len(shown) >= 2
    for text in shown:
        model.model_validate(yaml.safe_load(text))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page):
    targets = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    local = [target.split("#")[0] for target in targets if not re.match(r"https?://", target)]
    assert [target for target in local if target and not (page.parent / target).exists()] == []
