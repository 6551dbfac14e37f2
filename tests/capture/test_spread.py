"""Spreads of angles against sums over every pixel and against their first orders."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.capture.camera import Camera, incidence, tilted_normals
from reflectance_fit.capture.spread import over_cone, over_region

CAMERA = Camera(2000.0, 799.5, 599.5)


@given(theta=st.floats(0.2, 1.3), s=st.floats(0.0, 3.1), x=st.integers(0, 1300), y=st.integers(0, 900))
def test_a_regions_spread_is_that_of_its_pixels(theta, s, x, y):
    """Pixel by pixel, for both ways of leaning; the mean is between the two."""
    box = (x, y, x + 220, y + 160)
    found = over_region(box, CAMERA, theta, s)
    columns, rows = np.meshgrid(np.arange(x, x + 220.0), np.arange(y, y + 160.0))
    rays = CAMERA.rays(columns, rows)
    middle = CAMERA.rays(np.array(x + 109.5), np.array(y + 79.5))
    each = [incidence(rays, normal) for normal in tilted_normals(middle, theta, s)]
    angles = np.array([t for t, _ in each])
    turns = np.exp(2j * (np.array([d for _, d in each]) - s)).mean()
    # A grid of 64 midpoints is short of second orders by 1 / 64^2.
    assert found.theta - theta == pytest.approx(angles.mean() - theta, rel=1e-3, abs=1e-8)
    assert found.width == pytest.approx(angles.std(), rel=1e-3)
    assert 1 - found.modulation == pytest.approx(1 - abs(turns), rel=1e-3, abs=1e-8)
    assert 2 * found.turn == pytest.approx(np.angle(turns), rel=1e-3, abs=1e-8)


def test_a_narrow_region_spreads_as_its_height_over_the_focal_length():
    """s along the horizontal: theta runs up the picture, one pixel being 1 / f."""
    spread = over_region((700, 500, 900, 700), Camera(8000.0, 799.5, 599.5), math.radians(50), 0.0)
    assert spread.width == pytest.approx(200 / math.sqrt(12) / 8000, rel=2e-3)


@given(theta=st.floats(0.35, 1.2), half=st.floats(0.002, 0.06))
def test_a_cone_spreads_by_half_its_half_angle(theta, half):
    """A disc's variance along an axis is half_angle^2 / 4; second orders by the curvature of the sphere of directions."""
    found = over_cone(theta, half)
    assert found.width == pytest.approx(half / 2, rel=0.02)
    assert found.theta - theta == pytest.approx(half**2 / 8 / math.tan(theta), rel=0.1, abs=1e-9)
    # s turns by the sideways angle over tan(theta).
    assert 1 - found.modulation == pytest.approx(half**2 / 2 / math.tan(theta) ** 2, rel=0.1, abs=1e-9)


@given(theta=st.floats(0.0, 1.5))
def test_no_cone_changes_nothing(theta):
    found = over_cone(theta, 0.0)
    assert found.theta == pytest.approx(theta, abs=1e-12)
    assert found.width < 1e-12
