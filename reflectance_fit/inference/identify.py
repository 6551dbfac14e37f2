"""From draws to an interval and a verdict: what can be said, and what cannot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.priors import Prior
from reflectance_fit.result import Interval

FloatArray = NDArray[np.float64]

# A 95 % interval wider than this share of the prior's has learned next to nothing:
# for eta's default prior, ends that differ by more than a factor 3.8.
UNINFORMED_SHARE = 0.25
# A parameter that cannot be told from its bound has a 2.5 % quantile near it.
AT_BOUND = 0.1
# Two clusters of draws are two modes where the gap between them exceeds this many
# times the wider cluster's standard deviation and each holds a hundredth of the draws.
MODE_GAP, MODE_SHARE = 3.0, 0.01
MOST_MODES = 6


def interval(draws: FloatArray, prior: Prior | None = None, *, bounded: bool = False) -> Interval:
    """Median, sd, 68 and 95 % intervals of ``draws`` (any shape), with a status.

    ``prior`` decides on not_identified; without it (derived quantities) the
    caller does.  ``bounded``: the parameter has a physical lower bound 0 that
    the truth may lie on; draws that pile up there give an upper limit, the
    one-sided 95 % quantile.  NaN draws (an angle that does not exist) give
    not_identified.
    """
    x = np.sort(draws.ravel())
    if not np.all(np.isfinite(x)):
        return Interval(None, None, None, None, "not_identified")
    low95, low68, median, high68, high95 = (float(q) for q in np.quantile(x, [0.025, 0.16, 0.5, 0.84, 0.975]))
    if bounded and low95 < AT_BOUND * median:
        limit = float(np.quantile(x, 0.95))
        if prior is not None and limit > UNINFORMED_SHARE * prior.high:
            return Interval(None, None, None, None, "not_identified")
        return Interval(None, None, None, (0.0, limit), "upper_limit")
    modes = _modes(x)
    if not modes and prior is not None and _share(prior, low95, high95) > UNINFORMED_SHARE:
        return Interval(None, None, None, (low95, high95), "not_identified")
    status = "multimodal" if modes else "identified"
    return Interval(median, float(x.std()), (low68, high68), (low95, high95), status, modes)


def _share(prior: Prior, low: float, high: float) -> float:
    """Width of an interval over the prior's range, both in the prior's coordinate."""
    bottom, top = prior.coordinate_range
    return float(np.ptp(prior.to_coordinate(np.array([low, high])))) / (top - bottom)


def _modes(x: FloatArray) -> tuple[float, ...]:
    """Medians of the clusters of sorted draws that gaps part; none where there is one cluster."""
    least = max(int(MODE_SHARE * len(x)), 2)
    gaps = np.diff(x)
    # The widest gaps that leave enough draws on both sides: a few strays are no cluster.
    cuts: list[int] = []
    for cut in np.argsort(-gaps, kind="stable")[: 2 * least + MOST_MODES] + 1:
        edges = [0, *sorted([*cuts, int(cut)]), len(x)]
        if len(cuts) < MOST_MODES - 1 and min(np.diff(edges)) >= least:
            cuts.append(int(cut))
    while cuts:
        places = sorted(cuts)
        clusters = np.split(x, places)
        widths = np.array([cluster.std() for cluster in clusters])
        needed = MODE_GAP * np.maximum(widths[:-1], widths[1:])
        if np.all(gaps[np.array(places) - 1] > needed):
            return tuple(float(np.median(cluster)) for cluster in clusters)
        cuts.pop()  # the narrowest
    return ()
