"""Lights are drawn from by the density that is claimed for them, and that density is the geometry's."""

import numpy as np
import pytest
from render_chi2 import Sampler, examine, significance
from render_light_samplers import draw, lights, packed, samplers

LIGHTS = list(lights())
SAMPLERS = list(samplers())


@pytest.mark.parametrize(("light", "density"), LIGHTS, ids=lambda x: type(getattr(x, "shape", x)).__name__)
def test_the_density_that_goes_into_the_weights_is_the_geometrys(light, density):
    got = draw(packed(light), 0, 20_000, np.random.default_rng(0))
    assert np.linalg.norm(got[:, :3], axis=1) == pytest.approx(1.0, abs=1e-14)
    expected = density(got[:, :3])
    # A few directions fall beside an edge by rounding.
    assert np.mean(expected == 0.0) < 1e-3
    met = expected > 0.0
    assert got[met, 3] == pytest.approx(expected[met], rel=1e-9)


@pytest.mark.parametrize("sampler", SAMPLERS, ids=lambda s: s.name)
def test_samples_follow_their_density(sampler):
    found = examine(sampler, 100_000, seed=2, cells=8)
    assert found.p_value > significance(len(SAMPLERS))
    assert found.mass == pytest.approx(1.0, abs=2e-4)


def test_the_chi_square_sees_a_light_of_another_size():
    right, wrong = SAMPLERS[0], SAMPLERS[1]
    assert examine(Sampler("", right.sample, wrong.density, right.bounds), 100_000, 2, cells=8).p_value < 1e-6
