"""The renderer against a slow tracer that shares no transport with it."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

sys.path.append(str(Path(__file__).parents[1] / "reference"))

from tracer_kernels import furnished
from tracer_picture import picture
from tracer_scenes import BACKLIT, CASES

from reflectance_fit.render.run import render
from reflectance_fit.render.scene import AreaLight
from reflectance_fit.render.settings import Settings

# Paths a pixel of the reference; it has more noise than the renderer at as many.
SAMPLES = 3000
LEVEL = 1e-4
# The least number of independent groups of samples that a Film's errors come from.
GROUPS = 16
ROUNDING = 1e-5


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_picture_is_that_of_the_reference(case):
    """Every scene with all that a scene can hold, in the fullest of its modes that has three channels."""
    mode = "polarized" if any("polarized" in mode for mode in case.modes) else "rgb"
    compare(furnished(case.scene), mode, SAMPLES)


@pytest.mark.parametrize(
    "case", [c for c in CASES if "spectral_polarized" in c.modes], ids=lambda case: case.name
)
def test_the_spectral_picture_is_that_of_the_reference(case):
    compare(furnished(case.scene), "spectral_polarized", 4 * SAMPLES)


@pytest.mark.parametrize("fresnel", ["constant", "schlick", "schlick_f82", "lazanyi", "large_index"])
def test_approximations_are_met_at_the_half_vector(fresnel):
    """Rough metal and glass, where cos(theta) is h.v, and a coat that keeps light in by the same form."""
    compare(BACKLIT.scene, "scalar", 8000, fresnel)


def compare(scene, mode, samples, fresnel="exact"):
    """Every pixel, every quarter and the whole; each channel, each Stokes component."""
    ours = render(scene, Settings(mode, 4096, fresnel=fresnel))
    theirs = picture(scene, mode, samples, seed=1, fresnel=fresnel)
    assert np.all(np.isfinite(ours.mean))
    level = theirs.mean[..., 0].mean()
    difference, variance = ours.mean - theirs.mean, ours.error**2 + theirs.error**2
    height, width = (n // 2 for n in difference.shape[:2])
    parts = [(slice(None), slice(None))]
    parts += [(slice(a, a + height), slice(b, b + width)) for a in (0, height) for b in (0, width)]
    # The oracle draws no lights: of one so rarely met that none of a pixel's paths met it, that pixel's spread says
    # nothing.  One path more could have.
    brightest = max(
        (light.radiance.values.max() for light in scene.lights if isinstance(light, AreaLight)), default=0.0
    )
    checks = [(difference, variance + (brightest / samples) ** 2, GROUPS - 1)]
    for part in parts:
        pixels = difference[part][..., 0, 0].size
        checks.append((difference[part].mean(axis=(0, 1)), variance[part].mean(axis=(0, 1)) / pixels, np.inf))
    bound = LEVEL / sum(d.size for d, _, _ in checks)
    for d, v, freedom in checks:
        z = np.abs(d) / np.sqrt(v + (ROUNDING * level) ** 2)
        p = 2.0 * stats.t.sf(z, freedom)
        worst = np.unravel_index(p.argmin(), p.shape)
        assert p.min() >= bound, f"at {worst}: {z[worst]:.1f} sigma, {d[worst] / level:+.2%} of the mean"
