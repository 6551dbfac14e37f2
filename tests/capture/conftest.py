"""Small synthetic frames."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng

METADATA = DngMetadata("RGGB", 14, (512, 513, 514, 515), 16000, Fraction(1, 125), 200)


@pytest.fixture
def frame(tmp_path: Path) -> Callable[..., Path]:
    def frame(name: str = "a.dng", seed: int = 0) -> Path:
        """A noisy 48 x 64 frame in the test's folder."""
        cfa = np.random.default_rng(seed).integers(0, 2**14, (48, 64), dtype=np.uint16)
        write_dng(tmp_path / name, cfa, METADATA)
        return tmp_path / name

    return frame
