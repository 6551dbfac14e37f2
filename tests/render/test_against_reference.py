"""The renderer against a slow tracer that shares no transport with it, and against closed forms of polarization."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

sys.path.append(str(Path(__file__).parents[1] / "reference"))

from tracer_picture import picture
from tracer_scenes import CASES

from reflectance_fit.render.run import render
from reflectance_fit.render.settings import Settings

# Of the reference, a pixel and channel; the renderer gets as many, and less noise from them.
SAMPLES = {"scalar": 4000, "rgb": 2000, "polarized": 1500, "spectral": 6000, "spectral_polarized": 6000}
LEVEL = 1e-4
# The least number of independent groups of samples that a Film's errors come from.
GROUPS = 16
ROUNDING = 1e-5
JOBS = [pytest.param(case.scene, mode, id=f"{case.name}, {mode}") for case in CASES for mode in case.modes]


@pytest.mark.parametrize(("scene", "mode"), JOBS)
def test_the_picture_is_that_of_the_reference(scene, mode):
    """Every pixel, every quarter and the whole; each channel, each Stokes component."""
    ours, theirs = render(scene, Settings(mode, 4096)), picture(scene, mode, SAMPLES[mode], seed=1)
    assert np.all(np.isfinite(ours.mean))
    level = theirs.mean[..., 0].mean()
    difference, variance = ours.mean - theirs.mean, ours.error**2 + theirs.error**2
    half = np.array(difference.shape[:2]) // 2
    checks = [(difference, variance, GROUPS - 1)]
    for parts in (
        [difference, variance],
        *(
            [x[a : a + half[0], b : b + half[1]] for x in (difference, variance)]
            for a in (0, half[0])
            for b in (0, half[1])
        ),
    ):
        count = parts[0].shape[0] * parts[0].shape[1]
        checks.append((parts[0].mean(axis=(0, 1)), parts[1].mean(axis=(0, 1)) / count, np.inf))
    bound = LEVEL / sum(d.size for d, _, _ in checks)
    for d, v, freedom in checks:
        z = np.abs(d) / np.sqrt(v + (ROUNDING * level) ** 2)
        p = 2.0 * stats.t.sf(z, freedom)
        assert p.min() >= bound, (
            np.unravel_index(p.argmin(), p.shape),
            z.max(),
            d.ravel()[p.argmin()] / level,
        )
