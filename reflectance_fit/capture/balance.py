"""The redundancy of four analyzer axes as a check of the capture: both crossed pairs see all of the light."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from reflectance_fit.capture.calibrate import Calibrated, Signals
from reflectance_fit.capture.dofp_cells import BEYOND
from reflectance_fit.capture.frames import Capture, Frame
from reflectance_fit.capture.reduce import FrameMeans
from reflectance_fit.capture.stokes_pixels import redundancy
from reflectance_fit.measured import Note

# Flats of a good sensor leave less; a lamp that drifts, a layout or a tone curve not as stated leave more.
LARGEST_IMBALANCE = 0.01
_CLEAR = 5.0  # standard deviations
LARGEST_SHARE = 0.01  # of the cells of a frame


def check_balance(capture: Capture, samples: Sequence[Calibrated]) -> list[Note]:
    """A note for each channel whose pairs disagree by more than 1 % and 5 of their standard deviations."""
    notes = []
    for channel in capture.channels:
        found = [
            (files, float(r.imbalance[()]))
            for files, signals, axes in _fours(channel, samples)
            for r in [redundancy(*_means(signals), axes)]
            if abs(r.imbalance) > LARGEST_IMBALANCE and not abs(r.z) <= _CLEAR
        ]
        every = sum(1 for _ in _fours(channel, samples))
        if found:
            files, worst = max(found, key=lambda f: abs(f[1]))
            message = (
                f"I0 + I90 is not I45 + I135 in {len(found)} of {every} views of {channel}; worst {100 * worst:+.1f} % "
                f"in {files}: the lamp changed, pixels or angles respond unlike, or the counts are not linear"
            )
            notes.append(Note("IMBALANCE", message))
    return notes


def check_cells(capture: Capture, means: Mapping[Path, FrameMeans]) -> list[Note]:
    """A note for each channel of a sensor with polarizers of whose cells more than 1 % are uneven by themselves."""
    notes = []
    for channel in dict.fromkeys(c for m in means.values() for c in m.uneven):
        counts = {
            f.file: means[f.path].uneven[channel] for f in capture.frames if channel in _uneven(means, f)
        }
        shares = {file: beyond / cells for file, (beyond, cells) in counts.items() if cells}
        worst = max(shares, key=lambda file: shares[file], default="")
        if shares and shares[worst] > LARGEST_SHARE:
            message = (
                f"{100 * shares[worst]:.1f} % of the cells of {worst}, {channel}, have I0 + I90 unlike I45 + I135 by over"
                f" {BEYOND:g} sd: pixels that respond unlike, edges or dust; use camera.gain_map, or another region"
            )
            notes.append(Note("IMBALANCE", message))
    return notes


def _uneven(means: Mapping[Path, FrameMeans], frame: Frame) -> dict[str, tuple[int, int]]:
    return means[frame.path].uneven if frame.path in means else {}


def _fours(channel: str, samples: Sequence[Calibrated]) -> Iterator[tuple[str, list[Signals], list[float]]]:
    """Signals that differ in nothing but the axis, where these are two crossed pairs; and their files."""
    views: dict[tuple[object, ...], list[tuple[str, Signals, float]]] = {}
    for sample in samples:
        f = sample.frame
        for plane, signals in sample.of(channel):
            by_pixel = plane.axis_deg is not None
            one = f.file if by_pixel else ""
            axis_deg = plane.axis_deg if plane.axis_deg is not None else f.analyzer_deg
            key = (one, f.set, f.light, str(f.theta_deg), str(f.retarder_deg), f.region)
            views.setdefault(key, []).append((f.file, signals, math.radians(axis_deg)))
    for view in views.values():
        four, axes = [s for _, s, _ in view], [axis for _, _, axis in view]
        try:
            redundancy(np.ones(len(axes)), 1.0, axes)
        except ValueError:
            continue
        if not any(s.saturated.any() or s.rejected.any() for s in four):
            yield view[0][0], four, axes


def _means(signals: Sequence[Signals]) -> tuple[list[float], list[float]]:
    """Means over all pixels, and their variances."""
    pixels = [s.pixels / max(int(s.pixels.sum()), 1) for s in signals]
    variances = [
        float(np.sum(p**2 * np.nan_to_num(s.variance))) for p, s in zip(pixels, signals, strict=True)
    ]
    return [s.mean for s in signals], [max(v, np.finfo(float).tiny) for v in variances]
