"""The outline of a ball in a photograph, to a few hundredths of a pixel: what runs inside the decoding worker.

The ball is looked for in smaller pictures first, as a circle and then by its
rim, sector by sector; at last among the sensor's own pixels, each where it is.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.outline import Outline
from reflectance_fit.capture.overview import overview
from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.rim_fit import NOT_SEEN, Lattice, Round, circle_of, refined
from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float64]

_COARSE_PX = 400  # longer side of the picture in which the ball is first looked for
_LEAST_RADIUS = 0.04  # of that side


def ball_in_file(path: Path, reading: Reading) -> Outline:
    """Decode one file and find the ball in it; ReflectanceFitError where its outline is not seen."""
    return outline_of(read_frame(path, reading))


def outline_of(frame: RawFrame) -> Outline:
    """The outline of the largest ball in ``frame``; ReflectanceFitError when less than half of it is seen."""
    picture, (x, y), step = overview(frame)
    shrunk = max(1, math.ceil(max(picture.shape) / _COARSE_PX))
    outline = _circle(_shrunk(picture, shrunk))
    while True:
        for _ in range(2):
            outline = refined([[Lattice(_shrunk(picture, shrunk))]], outline)[2]
        if shrunk == 1:
            break
        finer = max(1, shrunk // 3)
        outline, shrunk = outline.scaled(shrunk / finer), finer
    outline = Round(outline.x * step + x, outline.y * step + y, outline.series * step)
    planes = _planes(frame)
    points, noise, _ = refined(planes, refined(planes, outline)[2], melting=True)
    height, width = frame.cfa.shape
    return Outline(points, noise, (height, width))


def _planes(frame: RawFrame) -> list[list[Lattice]]:
    """Of each plane of the overview's channel, the pixels of its places in the cell."""
    n = len(frame.channels)
    channel = "G" if "G" in frame.channels else str(frame.channels[0, 0])
    return [
        [
            Lattice(frame.cfa[y::n, x::n] - frame.black[y, x], float(x), float(y), n)
            for y, x in frame.sites(plane)
        ]
        for plane in frame.planes()
        if plane.channel == channel
    ]


def _shrunk(picture: FloatArray, factor: int) -> FloatArray:
    height, width = (side // factor for side in picture.shape)
    blocks = picture[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _circle(picture: FloatArray) -> Round:
    """The circle that most edges are on."""
    import cv2

    dark, bright = np.percentile(picture, (0.5, 99.5))
    if not dark < bright:
        raise ReflectanceFitError(NOT_SEEN)
    grey = np.sqrt(np.clip((picture - dark) / (bright - dark), 0.0, 1.0))
    longest = max(picture.shape)
    found = cv2.HoughCircles(
        cv2.GaussianBlur(np.round(255 * grey).astype(np.uint8), (0, 0), 1.0),
        cv2.HOUGH_GRADIENT_ALT,
        1.5,
        longest / 4,
        param1=150,
        param2=0.6,
        minRadius=round(_LEAST_RADIUS * longest),
        maxRadius=round(0.6 * longest),
    )
    # None, (1, N, 3) or (N, 3), by OpenCV's version.
    circles = np.zeros((0, 3)) if found is None else np.asarray(found, dtype=np.float64).reshape(-1, 3)
    if not len(circles):
        raise ReflectanceFitError(NOT_SEEN)
    x, y, radius = circles[np.argmax(circles[:, 2])]
    return circle_of(float(x), float(y), float(radius))
