"""How the files of a capture are to be read, and the reading: what a worker does before it reduces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reflectance_fit.capture.raw import RawFrame, decode


@dataclass(frozen=True, slots=True)
class Reading:
    """What the manifest says of the camera.

    ``sensor`` is bayer, mono, dofp or dofp_bayer; ``layout_deg`` holds the
    transmission axes of a dofp sensor's 2 x 2 pixels, rows from the top.
    """

    sensor: str = "bayer"
    layout_deg: tuple[tuple[float, ...], ...] | None = None


def read_frame(path: Path, reading: Reading) -> RawFrame:
    """One frame, its pixels named as the manifest says; ReflectanceFitError for what cannot be read.

    A sensor with other colour filters than stated keeps those of its file.
    """
    return _as_stated(decode(path), reading)


def _as_stated(frame: RawFrame, reading: Reading) -> RawFrame:
    """The file of a sensor with polarizers on its pixels does not tell: to it the sensor is monochrome."""
    if reading.layout_deg is None or frame.channels[0, 0] != "mono":
        return frame
    axes = np.array(reading.layout_deg, dtype=np.float64)
    if reading.sensor == "dofp":
        return replace(frame, axes_deg=axes)
    # Each pixel of the Bayer cell is a 2 x 2 group with all four polarizers.
    colours = np.repeat(np.repeat(np.array([["R", "G"], ["G", "B"]]), 2, axis=0), 2, axis=1)
    return replace(
        frame,
        channels=colours,
        axes_deg=np.tile(axes, (2, 2)),
        black=np.tile(frame.black, (2, 2)),
        white=np.tile(frame.white, (2, 2)),
    )
