"""The built-in tables against the refractiveindex.info files they were copied from."""

from __future__ import annotations

from importlib.resources import files

import pytest

SHIPPED = sorted((files("reflectance_fit.materials") / "constants").iterdir(), key=lambda path: path.name)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_file_is_unchanged(path, data):
    assert path.read_bytes() in {
        original.read_bytes() for original in (data / "refractiveindex_info").rglob("*.yml")
    }
