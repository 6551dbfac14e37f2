"""The slow definitions that the scorecards measure with, for tests of a few points."""

import importlib.util
from pathlib import Path

import pytest

ORACLES = Path(__file__).parents[1] / "scorecard" / "oracles"


@pytest.fixture(scope="session")
def oracle():
    """tests/scorecard/oracles/interface.py: one interface in 70 digits."""
    spec = importlib.util.spec_from_file_location("interface", ORACLES / "interface.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
