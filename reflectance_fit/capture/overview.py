"""A photograph as a grey picture to find things in: one channel, a pixel a cell of the sensor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.raw import RawFrame


def overview(frame: RawFrame) -> tuple[NDArray[np.float64], tuple[float, float], int]:
    """Green (or what the only channel is) above black, averaged over each cell, shape (h // n, w // n).

    Returns also where the centre of its first pixel is on the sensor, x and y,
    and how many raw pixels it is from one of its pixels to the next, n.
    Polarizers on the pixels average out, as each cell has all of them.
    """
    n = len(frame.channels)
    channel = "G" if "G" in frame.channels else str(frame.channels[0, 0])
    sites = np.argwhere(frame.channels == channel)
    height, width = (side // n * n for side in frame.cfa.shape)
    cells = [frame.cfa[y:height:n, x:width:n] - frame.black[y, x] for y, x in sites]
    y, x = sites.mean(axis=0)
    return np.mean(cells, axis=0), (float(x), float(y)), n
