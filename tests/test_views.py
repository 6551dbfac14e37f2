"""Stokes parameters from analyzer views: what went in comes out, and what cannot be is told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.data_synthetic.scenes import analyzer_weights
from reflectance_fit.physics.stokes import linear
from reflectance_fit.views import stokes_maps

AXES = st.lists(st.integers(0, 179), min_size=3, max_size=8, unique=True).filter(
    lambda a: np.linalg.cond([[1, np.cos(2 * t), np.sin(2 * t)] for t in np.radians(a)]) < 50
)


def views(stokes, axes_deg, diattenuation):
    return np.stack([stokes @ analyzer_weights(a, diattenuation) for a in axes_deg])


@given(
    axes=AXES,
    diattenuation=st.floats(0.5, 1.0),
    dolp=st.floats(0.0, 1.0),
    azimuth=st.floats(0.0, 3.14),
    level=st.floats(0.01, 1e4),
)
def test_what_went_in_comes_out(axes, diattenuation, dolp, azimuth, level):
    stokes = level * np.array([1.0, *(dolp * linear(azimuth)[1:3]), 0.0]) * np.ones((2, 3, 1))
    maps = stokes_maps(views(stokes, axes, diattenuation), np.radians(axes), diattenuation)
    np.testing.assert_allclose(maps.s0, level, rtol=1e-9)
    np.testing.assert_allclose(maps.dolp, dolp, atol=1e-9)
    if dolp > 1e-3:
        turn = np.angle(np.exp(2j * (maps.aolp - azimuth)))
        np.testing.assert_allclose(turn, 0.0, atol=1e-6)
    if len(axes) > 3:
        np.testing.assert_allclose(maps.redundancy, 0.0, atol=1e-9)
    else:
        assert maps.redundancy is None


def test_redundancy_is_what_no_stokes_vector_gives():
    one = views(np.array([1.0, 0.3, 0.1, 0.0]) * np.ones((2, 3, 1)), (0, 45, 90, 135), 1.0)
    one[1] -= 0.02  # the view at 45 degrees
    maps = stokes_maps(one, np.radians([0, 45, 90, 135]), 1.0)
    expected = (one[0] - one[1] + one[2] - one[3]) / 2 / maps.s0
    np.testing.assert_allclose(maps.redundancy, expected, rtol=1e-12)
    assert np.all(maps.redundancy > 0.009)
    five = np.concatenate([one, one[:1] + 0.01])
    assert np.all(stokes_maps(five, np.radians([0, 45, 90, 135, 180]), 1.0).redundancy > 0.009)


@pytest.mark.parametrize("axes_deg", [(0, 90), (0, 90, 180), (0, 90, 180, 270), (20, 20, 20)])
def test_axes_that_do_not_tell_stokes_parameters_apart_give_none(axes_deg):
    assert stokes_maps(np.ones((len(axes_deg), 2, 2)), np.radians(axes_deg), 1.0) is None


def test_a_cell_that_does_not_count_in_one_view_counts_in_none():
    one = views(np.array([1.0, 0.3, 0.1, 0.0]) * np.ones((2, 3, 1)), (0, 45, 90, 135), 1.0)
    one[2, 0, 1], one[3, 1, 2] = np.inf, np.nan
    finite = np.isfinite(stokes_maps(one, np.radians([0, 45, 90, 135]), 1.0).dolp)
    assert [tuple(c) for c in np.argwhere(~finite)] == [(0, 1), (1, 2)]
