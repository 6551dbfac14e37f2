import importlib
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "scorecard"))


@pytest.fixture(scope="session")
def chores():
    """``chores.py`` beside this file, by a name that the workers can import too."""
    folder = str(Path(__file__).parent)
    sys.path.insert(0, folder)
    yield importlib.import_module("chores")
    sys.path.remove(folder)
    del sys.modules["chores"]
