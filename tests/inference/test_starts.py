"""Closed forms give the index back; the grid covers the range, the line has a point between critical angles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from reflectance_fit.inference import models, starts
from reflectance_fit.inference.rows import pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances

THETA = np.array([30.0, 45.0, 60.0, 75.0])
BK7 = 1.5168  # at 587.6 nm, Schott's data sheet
GOLD = (0.18, 3.43)  # near 633 nm, after Johnson and Christy, Phys. Rev. B 6 (1972) 4370


def closed(rows_of, priors, tables):
    rows = pack(concatenate([rows_of(THETA, quantity, value) for quantity, value in tables.items()]), 1.0)
    model = models.build("conductor", rows, priors, {}, [])
    points = starts.closed_forms(model, rows)
    return np.stack([np.exp(points[:, 0]), points[:, 1]], axis=1)


@pytest.mark.parametrize("kind", ["both powers", "ratio_ps", "dolp", "psi_deg", "reflectance_s"])
def test_single_rows_give_the_index_of_glass(rows_of, priors, kind):
    """Every angle offers BK7's index, whether it lies above or below Brewster's."""
    r = reflectances(np.cos(np.radians(THETA)), BK7, 0.0)
    tables = {
        "both powers": {"reflectance_s": r.s, "reflectance_p": r.p},
        "ratio_ps": {"ratio_ps": r.p / r.s},
        "dolp": {"dolp": (r.s - r.p) / (r.s + r.p)},
        "psi_deg": {"psi_deg": np.degrees(np.arctan(np.sqrt(r.p / r.s)))},
        "reflectance_s": {"reflectance_s": r.s},
    }[kind]
    found = closed(rows_of, priors, tables)
    near = np.abs(found[:, 0] / BK7 - 1) < 1e-9
    assert near.sum() >= len(THETA)
    assert not found[near, 1].any()


def test_psi_and_delta_give_eta_and_k_of_gold(rows_of, priors):
    psi, delta = np.degrees(psi_delta(np.cos(np.radians(THETA)), *GOLD))
    found = closed(rows_of, priors, {"psi_deg": psi, "delta_deg": delta})
    near = np.abs(found / GOLD - 1).max(axis=1) < 1e-9
    assert near.sum() == len(THETA)


def test_least_p_is_near_brewsters_angle(rows_of, priors):
    theta = np.arange(40.0, 70.0, 1.0)
    r = reflectances(np.cos(np.radians(theta)), BK7, 0.0)
    rows = pack(rows_of(theta, "signal_p", 50 * r.p, gain_group="p"), 1.0)
    model = models.build("conductor", rows, priors, {}, [])
    (point,) = starts.closed_forms(model, rows)
    assert np.exp(point[0]) == pytest.approx(BK7, rel=0.02)
    assert point[1] == 0.0


@pytest.mark.parametrize("logarithmic", [False, True])
def test_the_line_is_the_even_one_and_two_between_each_two_critical_angles(logarithmic):
    generator = np.random.default_rng(5)
    for count in (0, 1, 2, 7, 40):
        critical = np.sort(np.round(generator.uniform(0, 1, count), 1))  # some of them equal
        evenly = np.linspace(*((-3.0, 2.3) if logarithmic else (0.05, 10.0)), 30)
        apart = np.unique(critical)
        between = np.concatenate([apart[:-1] + share * np.diff(apart) for share in (0.15, 0.6)])
        between = np.log(between) if logarithmic else between
        between = between[(between >= evenly[0]) & (between <= evenly[-1])]
        found = starts._among_critical(critical, evenly, logarithmic)
        np.testing.assert_allclose(found, np.sort(np.concatenate([evenly, between])), rtol=1e-14)


@pytest.mark.parametrize("name", ["dielectric", "conductor"])
def test_grid_and_line_cover_the_range(rows_of, priors, name):
    rows = pack(rows_of(THETA, "reflectance_s", 0.1), 1.0)
    model = models.build(name, rows, priors, {"angle_offset_deg": 0.5}, [])
    found = starts.points(model, rows)
    assert np.prod(found.shape) == found.grid
    low, high = model.ranges.T
    assert np.all((found.values >= low) & (found.values <= high))
    grid = found.values[: found.grid]
    free = len(found.shape)
    assert np.array_equal(grid[:, :free].min(axis=0), low[:free])
    assert np.array_equal(grid[:, :free].max(axis=0), high[:free])
    assert not found.values[:, free:].any()  # an angle offset of 0
    line = np.exp(found.values[found.grid : found.grid + found.line, 0])
    assert np.all(np.diff(line) >= 0)
    critical = np.sin(np.radians(THETA))
    for below, above in pairwise(critical):
        assert np.any((line > below) & (line < above))
