"""Where in the picture which angle of incidence is seen."""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.capture.bins import Bins, Region, SphereBins
from reflectance_fit.capture.frames import Capture, Frame, Sphere

# The model averages over a ring to the third moment of its angles; what is left is the
# fourth derivative times (2 deg)^4 / 4000, below 1e-6.  Beyond 76 degrees a pixel spans
# too much; near the centre the plane of incidence has no direction.
RING_EDGES_DEG = tuple(np.arange(8.0, 77.0, 2.0))
SECTORS = 6


def bins_of(capture: Capture, frame: Frame) -> Bins:
    """The bins that a frame is averaged over; the lamp of a polarizer frame fills its region."""
    geometry = capture.geometry
    if not isinstance(geometry, Sphere) or frame.role == "polarizer":
        return Region() if frame.region is None else Region(*frame.region)
    return SphereBins(
        *geometry.center_px,
        radius=geometry.radius_px,
        analyzer=None if math.isnan(frame.analyzer_deg) else math.radians(frame.analyzer_deg),
        edges=tuple(float(np.radians(edge)) for edge in RING_EDGES_DEG),
        sectors=SECTORS,
    )
