"""Third-party data: the folder REFLECTANCE_FIT_DATA names, by default ../shared/data beside the project.

Without the folder these tests are skipped; where the variable is set, it was
meant to be there, and a skip is a failure.
"""

import os
from pathlib import Path

import pytest

VARIABLE = "REFLECTANCE_FIT_DATA"
DATA = Path(os.environ.get(VARIABLE) or Path(__file__).parents[2] / ".." / "shared" / "data").resolve()


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of third-party data."""
    if not DATA.is_dir():
        pytest.skip(f"the third-party data are not here; {VARIABLE} names their folder")
    return DATA


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.skipped and os.environ.get(VARIABLE) and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped although {VARIABLE} is set: {report.longrepr}"
    return report
