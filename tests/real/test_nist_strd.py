"""NIST's certified regressions through the least squares that polishes a fit."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[1] / "scorecard"))

import inference_nist as nist
from inference_optimizer import DATA

SETS = sorted(path.stem for path in (DATA / "nist_strd").glob("*.dat"))


@pytest.mark.parametrize("name", SETS)
def test_certified_values_from_both_starts(data, name):
    problem = nist.read(data / "nist_strd" / f"{name}.dat")
    assert problem.starts.shape == (2, len(problem.certified))
    # The models are ours, the sum of squares is NIST's.
    residuals = problem.y - nist.MODELS[name](problem.x, problem.certified)
    assert np.sum(residuals**2) == pytest.approx(problem.sum_of_squares, rel=1e-7)
    assert min(nist.recovered(name, problem)) >= 6.0


def test_the_digits_are_those_of_the_worst_parameter():
    assert nist.digits(np.array([1.0, 2.0]), np.array([1.0, 2.0])) == nist.CERTIFIED_DIGITS
    assert nist.digits(np.array([1.0, 2.002]), np.array([1.0, 2.0])) == pytest.approx(3.0, abs=1e-6)
