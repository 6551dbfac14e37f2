"""The built-in tables against the refractiveindex.info files they were copied from."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path

import pytest

DATA = Path(os.environ.get("REFLECTANCE_FIT_DATA", Path(__file__).parents[2].parent / "shared" / "data"))
DATABASE = DATA / "refractiveindex_info"
SHIPPED = sorted((files("reflectance_fit.materials") / "constants").iterdir(), key=lambda path: path.name)


@pytest.mark.skipif(not DATABASE.is_dir(), reason=f"no {DATABASE}; set REFLECTANCE_FIT_DATA")
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_file_is_unchanged(path):
    assert path.read_bytes() in {original.read_bytes() for original in DATABASE.rglob("*.yml")}
