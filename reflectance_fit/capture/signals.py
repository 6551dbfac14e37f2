"""Signals of a frame with the darks, flats and references that serve it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from reflectance_fit.capture.bins import Bins, Cells
from reflectance_fit.capture.calibrate import Calibrated, calibrate
from reflectance_fit.capture.frames import Capture, Exposure, Frame, darks_for, flats_for
from reflectance_fit.capture.reduce import FrameMeans
from reflectance_fit.capture.reference import references_for, relative_to


def compared(
    capture: Capture,
    frame: Frame,
    settings: Mapping[Path, Exposure],
    means: Mapping[Path, FrameMeans],
    bins: Bins | Cells,
) -> Calibrated:
    """A sample frame's signals over ``bins``, over those of its references where there are any."""
    sample = calibrated(capture, frame, settings, means, bins)
    references = [
        calibrated(capture, reference, settings, means, bins)
        for reference in references_for(frame, capture.frames)
        if reference.path in means
    ]
    return relative_to(capture, sample, references) if references else sample


def calibrated(
    capture: Capture,
    frame: Frame,
    settings: Mapping[Path, Exposure],
    means: Mapping[Path, FrameMeans],
    bins: Bins | Cells,
) -> Calibrated:
    def darks(one: Frame) -> list[FrameMeans]:
        return [means[d.path] for d in darks_for(one, capture.frames, settings) if d.path in means]

    flats = [
        (means[flat.path], float(settings[flat.path].seconds or math.nan), darks(flat))
        for flat in flats_for(frame, capture.frames)
        if flat.path in means
    ]
    return calibrate(capture, frame, settings[frame.path], bins, means[frame.path], darks(frame), flats)


def flat_alone(
    capture: Capture, flat: Frame, settings: Mapping[Path, Exposure], means: Mapping[Path, FrameMeans]
) -> Calibrated:
    """A flat's own signal, over the bins of the first frame it serves."""
    darks = [means[d.path] for d in darks_for(flat, capture.frames, settings) if d.path in means]
    own = means[flat.path]
    return calibrate(capture, flat, settings[flat.path], own.bins[0], own, darks, [])


def knows_noise(capture: Capture, means: FrameMeans, channel: str) -> bool:
    told = set(means.noise or ()) | set(capture.transfer)
    return capture.noise is not None or channel in told or "mono" in told
