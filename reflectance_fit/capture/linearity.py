"""Whether signals go with exposure time: one scene at several exposures must give one signal a second."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from reflectance_fit.capture.brackets import brackets
from reflectance_fit.capture.calibrate import Calibrated, FloatArray, Signals

TOLERANCE = 0.01
_SIGMAS = 4.0
_DIM = 0.02  # of the brightest bin: below it the black level counts, not linearity


class Departure(NamedTuple):
    """How far the signal a second of one exposure lies from the mean of all, relative; its standard deviation."""

    seconds: Fraction
    share: float
    sigma: float


def departures(exposures: Sequence[tuple[Fraction, Signals]]) -> list[Departure]:
    """Of each exposure of one scene, over the bins that none of them clips; none where there are none.

    The mean over exposures has equal weights, as what is asked is which of
    them stands apart; bins are weighted by inverse variance, equally where it is not known.
    """
    if len(exposures) < 2:
        return []
    values = np.stack([s.value for _, s in exposures])
    variances = np.stack([s.variance - s.unlike for _, s in exposures])
    usable = ~np.any([s.saturated | s.rejected for _, s in exposures], axis=0)
    usable &= np.isfinite(values).all(axis=0)
    level = values.mean(axis=0)
    usable &= level > _DIM * np.max(level, where=usable, initial=0.0)
    if not usable.any():
        return []
    return [
        Departure(seconds, *_departure(values[:, usable], variances[:, usable], number))
        for number, (seconds, _) in enumerate(exposures)
    ]


def _departure(values: FloatArray, variances: FloatArray, number: int) -> tuple[float, float]:
    count = len(values)
    level = values.mean(axis=0)
    own = np.eye(count)[number] - 1 / count  # what a departure takes of each exposure
    variance = np.sum((own[:, None] / level) ** 2 * variances, axis=0)
    known = bool(np.all(np.isfinite(variance)) and np.all(variance > 0))
    weight = 1 / variance if known else np.ones_like(level)
    weight = weight / weight.sum()
    share = float(np.sum(weight * (values[number] / level - 1)))
    return share, float(np.sqrt(np.sum(weight**2 * variance))) if known else 0.0


def complaints(found: Sequence[Departure], what: str) -> Iterator[str]:
    """A sentence where exposures of ``what`` differ by more than 1 % and 4 sigma."""
    if not found:
        return
    low, high = min(found, key=lambda d: d.share), max(found, key=lambda d: d.share)
    spread = high.share - low.share
    if spread > TOLERANCE and spread > _SIGMAS * math.hypot(low.sigma, high.sigma):
        text = (
            f"{what}: the signal a second is {100 * spread:.1f} % higher at {_seconds(high)} than at {_seconds(low)}; "
            "the lamp drifts, the sensor is not linear, or the exposures are not those stated"
        )
        if _powers_explain(found):
            text += (
                " (exposures that are powers of 2, as 1/64 s for 1/60 s, would explain it: state exposure_s)"
            )
        yield text


def nonlinear(frames: Iterable[Calibrated]) -> Iterator[str]:
    """What is to be said of the views among ``frames`` that were seen at several exposures."""
    for view in brackets(frames):
        alike = [s for s in view if s.bins == view[0].bins]
        for plane in view[0].signals:
            found = departures([(s.exposure.seconds or Fraction(1), s.signals[plane]) for s in alike])
            files = ", ".join(s.frame.file for s in alike)
            yield from complaints(found, f"{files}, {plane.channel}")


def _powers_explain(found: Sequence[Departure]) -> bool:
    """Cameras write 1/60 and expose 1/64: with such times the signals a second agree."""
    rates = [(1 + d.share) * float(d.seconds) / 2.0 ** _stops(d.seconds) for d in found]
    return bool(max(rates) / min(rates) - 1 < TOLERANCE)


def _stops(seconds: Fraction) -> float:
    """The nearest third of a stop."""
    return round(3 * math.log2(seconds)) / 3


def _seconds(departure: Departure) -> str:
    seconds = departure.seconds
    return f"{seconds} s" if seconds.denominator < 100_000 else f"{float(seconds):.4g} s"
