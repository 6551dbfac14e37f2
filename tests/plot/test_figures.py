"""What the pictures of a posterior claim: shares inside contours, ranks, numbers that can be read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path
from scipy.stats import rankdata

from reflectance_fit.plot.chains import RANK_BARS, draw_rank, rank_densities
from reflectance_fit.plot.corner import draw_corner
from reflectance_fit.plot.residuals import draw_residuals
from reflectance_fit.plot.style import inner_ticks
from reflectance_fit.result import Interval, Shared


@pytest.fixture
def slanted(gold):
    """Strongly correlated draws, k at the wall of zero: contours must bend and end there."""
    rng = np.random.default_rng(5)
    eta = rng.normal(size=(32, 1000))
    k = np.abs(0.8 * eta + 0.6 * rng.normal(size=eta.shape))
    return replace(gold, posterior=replace(gold.posterior, samples={"eta": 1.5 + 0.01 * eta, "k": k}))


def test_contours_hold_the_shares_they_claim(slanted):
    ax = draw_corner(slanted).axes[1]
    draws = np.stack([slanted.posterior.flat("eta"), slanted.posterior.flat("k")], axis=1)
    outer, inner = ax.collections[0].get_paths()
    for path, share in ((outer, 0.95), (inner, 0.68)):
        # The view holds 99.8 % of each parameter, and smoothing widens a region a little.
        assert np.mean(path.contains_points(draws)) == pytest.approx(share, abs=0.025)
    (dots,) = [line for line in ax.lines if line.get_marker() == "o"]
    assert np.mean(outer.contains_points(dots.get_xydata())) < 0.25
    assert not np.any(inner.contains_points(dots.get_xydata()))


def test_the_diagonal_is_the_histogram_of_all_draws(slanted):
    first = draw_corner(slanted).axes[0]
    (stairs,) = [p for p in first.patches if hasattr(p, "get_data")]
    values, edges, _ = stairs.get_data()
    draws = slanted.posterior.flat("eta")
    assert (
        values.sum()
        == np.sum((draws >= edges[0]) & (draws <= edges[-1]))
        == pytest.approx(0.998 * draws.size, abs=2)
    )


@pytest.mark.parametrize(
    ("verdict", "title"),
    [
        (Interval(None, None, None, (1.4, 1.6), "not_identified"), "not identified"),
        (Interval(None, None, None, (0.0, 1.52), "upper_limit"), "< 1.5 (95 %)"),
        (Interval(1.5, 0.4, (0.7, 1.5), (0.7, 1.5), "multimodal", (0.66, 1.51)), "0.66 or 1.51"),
    ],
)
def test_the_corner_says_no_more_than_the_report(slanted, verdict, title):
    """A median and an error only of what is identified; a line for each mode."""
    drawn = draw_corner(replace(slanted, intervals={**slanted.intervals, "eta": verdict})).axes[0]
    assert drawn.get_title(loc="center") == title
    assert [line.get_xdata()[0] for line in drawn.lines] == list(verdict.modes)


def test_one_chi2_of_many_channels_says_so(gold):
    def title(fit):
        return draw_residuals(fit).texts[0].get_text()

    curve = Shared(("450 nm", "550 nm", "650 nm"), {}, np.ones((2, 2)), np.ones((2, 2)))
    assert "of all" not in title(gold)
    assert "χ²/dof of all 3 channels = " in title(replace(gold, shared=curve))


@given(st.integers(2, 5), st.integers(2, 6), st.integers(7, 60), st.integers(0, 10**6))
def test_rank_densities_are_the_histogram_of_ranks(ensembles, walkers, draws, seed):
    from reflectance_fit.result import Posterior

    values = np.random.default_rng(seed).normal(size=(ensembles * walkers, draws))
    ensemble = np.repeat(np.arange(ensembles), walkers)
    posterior = Posterior(
        "dielectric", "emcee", ("eta",), {"eta": values}, values, ensemble, {}, True
    )  # fmt: skip
    ranks = ((rankdata(values) - 1) / values.size).reshape(values.shape)
    bars = np.floor(ranks * RANK_BARS + 1e-9).astype(int)
    expected = [np.bincount(bars[ensemble == e].ravel(), minlength=RANK_BARS) for e in range(ensembles)]
    np.testing.assert_allclose(
        rank_densities(posterior, "eta"), np.array(expected) * RANK_BARS / (walkers * draws), atol=1e-12
    )


def test_an_ensemble_that_disagrees_leaves_the_grey_band(gold):
    """Ensemble 2 sits one standard deviation high; the others agree."""
    posterior = gold.posterior
    moved = {n: v + (posterior.ensemble == 1)[:, None] * v.std() for n, v in posterior.samples.items()}
    for samples, apart in ((posterior.samples, False), (moved, True)):
        ax = draw_rank(replace(gold, posterior=replace(posterior, samples=samples))).axes[0]
        (row, *_) = (p.get_y() + p.get_height() for p in ax.patches)
        steps = {line.get_label(): line.get_ydata()[:RANK_BARS] for line in ax.lines}
        # Rows run downwards and the first is 0: up is negative, and the top bar is the highest rank.
        assert bool(steps["ensemble 2"][-1] < -row) is apart
        assert np.all(np.abs([np.mean(s) for s in steps.values()]) < 1e-9)


@given(st.floats(-1e4, 1e4), st.floats(1e-6, 1e4), st.integers(2, 3))
def test_ticks_keep_clear_of_the_ends(low, width, most):
    high = low + width
    ticks = inner_ticks(low, high, most)
    assert 1 <= len(ticks) <= most
    assert np.all((ticks > low + 0.1 * width) & (ticks < high - 0.1 * width))


def test_paths_of_a_contour_are_closed(slanted):
    for path in draw_corner(slanted).axes[1].collections[0].get_paths():
        starts = np.flatnonzero(path.codes == Path.MOVETO)
        ends = np.append(starts[1:], len(path.codes)) - 1
        assert np.all(
            (path.codes[ends] == Path.CLOSEPOLY) | np.all(path.vertices[ends] == path.vertices[starts])
        )
