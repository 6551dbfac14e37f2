"""The board's corners in one photograph: what runs inside the decoding worker."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.overview import overview
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float64]

MIN_CORNERS = 8  # a pose has six unknowns, and what is left must show an outlier
# Brighter than all but this share of the pixels is white: the lamp's reflection is not.
_WHITE_PERCENTILE = 98.0


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Identifiers, shape (N,), and places in raw sensor pixels, shape (N, 2); ``shape`` is the picture's (h, w)."""

    ids: NDArray[np.int64]
    xy: FloatArray
    shape: tuple[int, int]


def corners_in_file(path: Path, reading: Reading, board: Board) -> Corners:
    """Decode one file and find the board's corners; ReflectanceFitError where there are too few."""
    return find_corners(*overview(read_frame(path, reading)), board)


def find_corners(picture: FloatArray, origin: tuple[float, float], step: int, board: Board) -> Corners:
    """The corners that ``picture`` shows.

    Parameters
    ----------
    picture : float, shape (h, w)
        Linear values above black.
    origin : x, y
        Where the centre of its first pixel is on the sensor.
    step : int
        Raw pixels from one of its pixels to the next.
    board : Board

    Raises
    ------
    ReflectanceFitError
        When fewer than 8 corners are found, or all are on one line.
    """

    white = float(np.percentile(picture, _WHITE_PERCENTILE))
    if white <= 0:
        raise ReflectanceFitError("is too dark to show the board")
    # The root is nearer to what detectors are made for; a corner is alike in both, so it does not move it.
    grey = np.round(255 * np.sqrt(np.clip(picture / white, 0.0, 1.0))).astype(np.uint8)
    xy, numbers = _detected(board.opencv(), grey)
    xy = xy - _origin_of_corners()
    rows = numbers // (board.squares[0] - 1)
    columns = numbers % (board.squares[0] - 1)
    if len(numbers) < MIN_CORNERS or np.ptp(rows) == 0 or np.ptp(columns) == 0:
        raise ReflectanceFitError(
            f"shows {len(numbers)} corners of the board, which is too few; "
            "show more of it, in focus and evenly lit, or check charuco in the manifest"
        )
    height, width = picture.shape
    return Corners(numbers, xy * step + np.array(origin), (height * step, width * step))


def _detected(board: Any, grey: NDArray[Any]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Places of the corners as OpenCV counts pixels, shape (N, 2), and their identifiers."""
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.CharucoDetector(board, cv2.aruco.CharucoParameters(), parameters)
    # None without a board, whatever the annotations say; (N, 1, 2) before OpenCV 5, (N, 2) since.
    corners, ids, _, _ = detector.detectBoard(grey)
    if corners is None or ids is None:
        return np.zeros((0, 2)), np.zeros(0, np.int64)
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2), np.asarray(ids, dtype=np.int64).reshape(-1)


@cache
def _origin_of_corners() -> float:
    """What the installed OpenCV calls the centre of the first pixel: 0, or 0.5 as versions 4 do; asked of a drawn board."""
    import cv2

    side, margin = 40, 40
    board = cv2.aruco.CharucoBoard(
        (3, 3), 1.0, 0.75, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    )
    drawn = np.pad(board.generateImage((3 * side, 3 * side)), margin, constant_values=255)
    found, numbers = _detected(board, cv2.GaussianBlur(drawn, (0, 0), 1.0))
    # An edge between two pixels lies half a pixel before the centre of the second.
    true = np.stack([numbers % 2 + 1, numbers // 2 + 1], axis=1) * side + margin - 0.5
    return float(np.round(2.0 * np.mean(found - true)) / 2.0)
