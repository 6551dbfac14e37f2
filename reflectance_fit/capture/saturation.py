"""One clip point for a capture: what one overexposed frame shows of it holds for all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from reflectance_fit.capture.plane_means import PlaneMeans
from reflectance_fit.capture.raw import Plane
from reflectance_fit.capture.reduce import FrameMeans


def clipped_alike(means: Mapping[Path, FrameMeans]) -> dict[Path, FrameMeans]:
    """``means`` with every bin saturated whose mean reaches the lowest clip point found in its plane.

    A frame that is clipped evenly has no spike to tell by: all of it is at one
    level.  Bins that are clipped in part show it themselves.
    """
    lowest: dict[Plane, float] = {}
    for frame in means.values():
        for plane, clip in frame.clip.items():
            lowest[plane] = min(clip, lowest.get(plane, clip))
    return {path: _clipped(frame, lowest) for path, frame in means.items()}


def _clipped(frame: FrameMeans, lowest: Mapping[Plane, float]) -> FrameMeans:
    def seen(means: PlaneMeans, clip: float) -> PlaneMeans:
        return replace(means, saturated=np.where(means.mean >= clip, means.pixels, means.saturated))

    if not any(lowest[plane] < clip for plane, clip in frame.clip.items()):
        return frame
    planes = tuple(
        {plane: seen(means, lowest.get(plane, np.inf)) for plane, means in one.items()}
        for one in frame.planes
    )
    return replace(frame, planes=planes)
