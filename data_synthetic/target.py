"""A printed ChArUco board: which points of it are ink."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError

Floats = NDArray[np.float64]


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
    """The ink of a board, looked up at any point without resampling a picture of it."""

    def __init__(self, board: Board) -> None:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        layout = cv2.aruco.CharucoBoard(board.squares, board.square_mm, board.marker_mm, dictionary)
        across, down = board.squares
        # The marker of a square, -1 for a black one: markers stand on white.
        self._marker = np.full((down, across), -1, dtype=np.intp)
        modules = dictionary.markerSize + 2  # a border of one module
        pictures: list[NDArray[np.bool_]] = []
        for number, corners in zip(np.ravel(layout.getIds()), layout.getObjPoints(), strict=True):
            column, row = (np.reshape(corners, (-1, 3)).mean(axis=0)[:2] // board.square_mm).astype(int)
            self._marker[row, column] = len(pictures)
            pictures.append(cv2.aruco.generateImageMarker(dictionary, int(number), modules) == 0)
        self._ink = np.array(pictures)
        self._board, self._modules = board, modules

    def ink(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Whether points x, y are black; mm from the top left corner of the squares, as printed."""
        board, modules = self._board, self._modules
        x, y = x / (board.print_scale[0] * board.square_mm), y / (board.print_scale[1] * board.square_mm)
        across, down = board.squares
        column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        on = (column >= 0) & (column < across) & (row >= 0) & (row < down)
        number = self._marker[np.where(on, row, 0), np.where(on, column, 0)]
        # Modules from the marker's corner, which lies in the middle of its square.
        margin, module = (1.0 - board.marker_mm / board.square_mm) / 2, board.marker_mm / board.square_mm
        u, v = ((z - np.floor(z) - margin) / module * modules for z in (x, y))
        i, j = np.floor(v).astype(np.intp), np.floor(u).astype(np.intp)
        marked = (i >= 0) & (i < modules) & (j >= 0) & (j < modules) & (number >= 0)
        printed = self._ink[np.where(marked, number, 0), np.where(marked, i, 0), np.where(marked, j, 0)]
        return np.asarray(on & np.where(marked, printed, number < 0))
