"""Changes to a file that a person wrote: comments and layout stay."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ruamel.yaml import YAML


def write_hashes_into(manifest: Path, out: Path, hashes: Mapping[str, str]) -> None:
    """Write ``manifest`` to ``out`` with the sha256 of every frame, by its ``file``."""
    yaml = YAML()
    yaml.width = 10_000
    yaml.preserve_quotes = True
    data = yaml.load(manifest.read_text(encoding="utf-8-sig"))
    for frame in data["frames"]:
        frame["sha256"] = hashes[frame["file"]]
    with out.open("w", encoding="utf-8") as file:
        yaml.dump(data, file)
