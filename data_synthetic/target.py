"""A printed ChArUco board with a sample in its window: what is where."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.physics.jit import kernel

Floats = NDArray[np.float64]

BESIDE, BLACK, WHITE, SAMPLE = range(4)
"""What a point shows."""
_MARGIN_MM = 10.0  # of white paper around the squares


@dataclass(frozen=True, slots=True)
class Board:
    """A board as capture.yaml states it, with the window its sample lies in.

    Parameters
    ----------
    squares : int, int
        Across and down.
    square_mm, marker_mm : float
        Sides of squares and markers.
    dictionary : str
        OpenCV's name of the markers.
    window_mm : float, float
        Width and height of the sample, in the middle of the board.
    sample_offset_mm : float
        Height of the sample's surface above the board.
    print_scale : float, float
        True size over stated size, across and down.
    sheen : float in [0, 1]
        Degree of linear polarization of what the board scatters; its direction
        turns by 180 degrees from one side of the squares to the other.
    """

    squares: tuple[int, int] = (11, 8)
    square_mm: float = 10.0
    marker_mm: float = 7.5
    dictionary: str = "DICT_5X5_100"
    window_mm: tuple[float, float] = (48.0, 18.0)
    sample_offset_mm: float = 0.0
    print_scale: tuple[float, float] = (1.0, 1.0)
    sheen: float = 0.0

    def __post_init__(self) -> None:
        if not hasattr(cv2.aruco, self.dictionary):
            raise ReflectanceFitError(f"OpenCV knows no markers '{self.dictionary}'; use one as DICT_5X5_100")
        if not 0.0 < self.marker_mm < self.square_mm:
            raise ReflectanceFitError("markers must be smaller than squares")

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of all squares as printed."""
        across, down = (
            n * self.square_mm * scale for n, scale in zip(self.squares, self.print_scale, strict=True)
        )
        return across, down

    @property
    def window(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 of the sample, mm from the top left corner of the squares."""
        (width, height), (across, down) = self.window_mm, self.size_mm
        return (across - width) / 2, (down - height) / 2, (across + width) / 2, (down + height) / 2


class Print:
    """A board as printed, looked up at any point without resampling a picture of it."""

    def __init__(self, board: Board) -> None:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        layout = cv2.aruco.CharucoBoard(board.squares, board.square_mm, board.marker_mm, dictionary)
        across, down = board.squares
        # The marker of a square, -1 for a black one: markers stand on white.
        self._marker = np.full((down, across), -1, dtype=np.int64)
        modules = dictionary.markerSize + 2  # a border of one module
        pictures: list[NDArray[np.bool_]] = []
        for number, corners in zip(np.ravel(layout.getIds()), layout.getObjPoints(), strict=True):
            column, row = (np.reshape(corners, (-1, 3)).mean(axis=0)[:2] // board.square_mm).astype(int)
            self._marker[row, column] = len(pictures)
            pictures.append(cv2.aruco.generateImageMarker(dictionary, int(number), modules) == 0)
        self._ink = np.array(pictures)
        self._squares_mm = tuple(float(board.square_mm * scale) for scale in board.print_scale)
        self._share = board.marker_mm / board.square_mm
        self._window = board.window

    def part(self, x: ArrayLike, y: ArrayLike, paper: Floats, top: Floats) -> NDArray[np.intp]:
        """What points x, y of a picture show (broadcast to S): shape S.

        ``paper`` and ``top`` are homographies, shape (3, 3), that take (x, y, 1)
        to the planes of the paper and of the sample's surface: mm from the top
        left corner of the squares, across and down.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        squares = self._marker, self._ink, self._squares_mm, self._share
        return _parts(x.ravel(), y.ravel(), paper, top, squares, self._window).reshape(x.shape)


@kernel
def _parts(
    x: Floats,
    y: Floats,
    paper: Floats,
    top: Floats,
    squares: tuple[NDArray[np.int64], NDArray[np.bool_], tuple[float, ...], float],
    window: tuple[float, float, float, float],
) -> NDArray[np.intp]:
    """Compiled, because a picture asks for millions of points; ``squares`` are markers, modules, sides and share."""
    marker, ink, (wide, high), share = squares
    down, across = marker.shape
    modules = ink.shape[1]
    found = np.empty(len(x), dtype=np.intp)
    for i in range(len(x)):
        depth = top[2, 0] * x[i] + top[2, 1] * y[i] + top[2, 2]
        right = (top[0, 0] * x[i] + top[0, 1] * y[i] + top[0, 2]) / depth
        below = (top[1, 0] * x[i] + top[1, 1] * y[i] + top[1, 2]) / depth
        if window[0] <= right < window[2] and window[1] <= below < window[3]:
            found[i] = SAMPLE
            continue
        depth = paper[2, 0] * x[i] + paper[2, 1] * y[i] + paper[2, 2]
        right = (paper[0, 0] * x[i] + paper[0, 1] * y[i] + paper[0, 2]) / depth
        below = (paper[1, 0] * x[i] + paper[1, 1] * y[i] + paper[1, 2]) / depth
        if window[0] <= right < window[2] and window[1] <= below < window[3]:
            found[i] = BLACK
            continue
        on_paper = -_MARGIN_MM <= right < across * wide + _MARGIN_MM
        if not (on_paper and -_MARGIN_MM <= below < down * high + _MARGIN_MM):
            found[i] = BESIDE
            continue
        u, v = right / wide, below / high
        if not (0.0 <= u < across and 0.0 <= v < down):
            found[i] = WHITE
            continue
        column, row = int(u), int(v)
        number = marker[row, column]
        if number < 0:
            found[i] = BLACK
            continue
        # Modules from the marker's corner, which lies in the middle of its square.
        u = (u - column - (1.0 - share) / 2.0) / share * modules
        v = (v - row - (1.0 - share) / 2.0) / share * modules
        printed = 0.0 <= u < modules and 0.0 <= v < modules and ink[number, int(v), int(u)]
        found[i] = BLACK if printed else WHITE
    return found
