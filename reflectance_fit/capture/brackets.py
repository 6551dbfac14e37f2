"""Exposure brackets: frames of one view that differ in exposure alone, merged into one.

A long exposure has the less noise and clips the brighter bins; a short one
has them all.  Each bin takes from every exposure that does not clip it, by
inverse variance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.calibrate import Calibrated, FloatArray, Signals
from reflectance_fit.capture.frames import Exposure, Frame, same_setting


def brackets(samples: Iterable[Calibrated]) -> list[list[Calibrated]]:
    """``samples`` by view, in their order: those of a list are alike in all but file and exposure."""
    views: dict[object, list[Calibrated]] = {}
    for sample in samples:
        views.setdefault(_view(sample.frame), []).append(sample)
    return list(views.values())


def merged(samples: Iterable[Calibrated]) -> list[Calibrated]:
    """``samples`` with each bracket as one; repeats of one exposure stay apart, as they tell how it repeats."""
    out: list[Calibrated] = []
    for view in brackets(samples):
        first, *others = view
        alike = all(same_setting(s.exposure.seconds, first.exposure.seconds) for s in others)
        out += view if alike else [_merge(view)]
    return out


def _view(frame: Frame) -> object:
    fields = replace(
        frame, file="", path=frame.path.parent, line=0, sha256=None, exposure=Exposure(None, None)
    )
    # NaN, which stands for "none", is not equal to itself.
    return tuple(
        None if isinstance(value, float) and math.isnan(value) else value
        for value in (getattr(fields, name) for name in fields.__slots__)
    )


def _merge(view: Sequence[Calibrated]) -> Calibrated:
    longest = max(view, key=lambda s: s.exposure.seconds or 0)
    seconds = np.array([float(s.exposure.seconds or math.nan) for s in view])
    signals = {plane: _merge_signals([s.signals[plane] for s in view], seconds) for plane in longest.signals}
    return replace(longest, signals=signals)


def _merge_signals(signals: Sequence[Signals], seconds: FloatArray) -> Signals:
    """Weighted means over exposures of shape (bins,); a bin that none of them has is that of the shortest.

    A bin is not had where it is clipped or rejected.  What the same pixels repeat at every exposure (``unlike``) does not average out.
    """
    missing = np.stack([s.saturated | s.rejected for s in signals])
    own = np.stack([s.variance - s.unlike for s in signals])
    known = np.isfinite(own).all(axis=0) & (own > 0).all(axis=0)
    # Where no noise is known light counts, as for shot noise.
    weight = np.where(known, 1 / np.where(known, own, 1.0), seconds[:, None])
    shortest = np.arange(len(signals))[:, None] == np.argmin(seconds)
    nowhere = missing.all(axis=0)
    weight = np.where(nowhere, shortest, np.where(missing, 0.0, weight))
    weight = weight / weight.sum(axis=0)

    def mean(values: Sequence[NDArray[np.float64]]) -> FloatArray:
        return np.asarray(np.sum(weight * np.where(weight > 0, np.stack(values), 0.0), axis=0))

    unlike = mean([s.unlike for s in signals])
    return replace(
        signals[0],
        value=mean([s.value for s in signals]),
        variance=np.sum(weight**2 * np.where(weight > 0, own, 0.0), axis=0) + unlike,
        unlike=unlike,
        per_dn=mean([s.per_dn for s in signals]),
        saturated=nowhere & signals[int(np.argmin(seconds))].saturated,
        rejected=nowhere & signals[int(np.argmin(seconds))].rejected,
    )
