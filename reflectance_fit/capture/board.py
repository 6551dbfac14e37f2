"""The ChArUco board: its corners and its ink in millimetres, and whether it fits a sheet of paper.

Board coordinates are OpenCV's: x to the right, y down, from the outer corner of
the top left square, so that z points into the paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError, suggestion

FloatArray = NDArray[np.float64]

# Width and height, upright, mm.
PAPERS = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
_MARGIN_MM = 12.0  # printers leave as much white
_TEXT_MM = 34.0  # the bar and five lines, below the board
_LEAST_SQUARE_MM = 2.0  # finer, a marker's cells are dots of the printer


@dataclass(frozen=True, slots=True)
class Board:
    """A chessboard with a marker in each white square.

    ``squares`` are those across and down, ``dictionary`` is OpenCV's name of
    the markers.  The defaults are the example of docs/formats/capture.md.
    """

    squares: tuple[int, int] = (11, 8)
    square_mm: float = 10.0
    marker_mm: float = 7.5
    dictionary: str = "DICT_5X5_100"

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the pattern."""
        return self.squares[0] * self.square_mm, self.squares[1] * self.square_mm

    def opencv(self) -> Any:
        """OpenCV's board.

        Raises ReflectanceFitError for a dictionary that OpenCV does not know
        or that has fewer markers than the board has white squares.
        """
        return _opencv(self)

    def corners_mm(self) -> FloatArray:
        """Inner corners of the squares, shape (N, 3), in the order of their identifiers; z = 0."""
        return np.asarray(self.opencv().getChessboardCorners(), dtype=np.float64).reshape(-1, 3)

    def ink_mm(self) -> FloatArray:
        """Black rectangles (x, y, width, height), shape (N, 4), none overlapping: squares, then cells of markers."""
        board, side = self.opencv(), self.square_mm
        across, down = self.squares
        squares = [
            (column * side, row * side, side, side)
            for row in range(down)
            for column in range(across)
            if (row + column) % 2 == 0
        ]
        dictionary = board.getDictionary()
        cells = dictionary.markerSize + 2  # a black border of one cell around the code
        cell = self.marker_mm / cells
        markers = []
        places = np.asarray(board.getObjPoints(), dtype=np.float64).reshape(-1, 4, 3)
        for number, place in zip(np.asarray(board.getIds()).reshape(-1), places, strict=True):
            x, y = place[0, :2]
            for row, line in enumerate(dictionary.generateImageMarker(int(number), cells, borderBits=1)):
                # Runs of black cells: one rectangle, no seams within a row.
                edges = np.flatnonzero(np.diff(np.concatenate(([1], line != 0, [1]))))
                markers += [
                    (x + cell * first, y + cell * row, cell * (last - first), cell)
                    for first, last in edges.reshape(-1, 2)
                ]
        return np.array(squares + markers)


def sheet_mm(board: Board, paper: str) -> tuple[float, float]:
    """Width and height of the sheet, turned so that the board fits; ReflectanceFitError where it does not."""
    if board.square_mm < _LEAST_SQUARE_MM:
        raise ReflectanceFitError(
            f"squares of {board.square_mm:g} mm are too small to print sharply; use {_LEAST_SQUARE_MM:g} mm or more"
        )
    width, height = board.size_mm
    upright = PAPERS[paper]
    for sheet in sorted([upright, upright[::-1]], reverse=width > height):
        room = sheet[0] - 2 * _MARGIN_MM, sheet[1] - 2 * _MARGIN_MM - _TEXT_MM
        if width <= room[0] and height <= room[1]:
            return sheet
    raise ReflectanceFitError(
        f"a board of {width:g} mm x {height:g} mm does not fit on {paper}: take fewer or smaller squares"
    )


def manifest_text(board: Board) -> str:
    """What capture.yaml says of the board, as it says it."""
    across, down = board.squares
    return (
        "geometry:\n"
        "  kind: charuco\n"
        f"  charuco: {{squares: [{across}, {down}], square_mm: {board.square_mm:g}, "
        f"marker_mm: {board.marker_mm:g}, dictionary: {board.dictionary}}}"
    )


@lru_cache(8)
def _opencv(board: Board) -> Any:
    import cv2

    known = sorted(name for name in vars(cv2.aruco) if name.startswith("DICT_"))
    if board.dictionary not in known:
        near = suggestion(board.dictionary, known) or "; DICT_5X5_100 is the usual one"
        raise ReflectanceFitError(f"OpenCV knows no markers '{board.dictionary}'{near}")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    needed, there = board.squares[0] * board.squares[1] // 2, len(dictionary.bytesList)
    if needed > there:
        raise ReflectanceFitError(
            f"a board of {board.squares[0]} x {board.squares[1]} squares needs {needed} markers and "
            f"{board.dictionary} has {there}; take fewer squares or another dictionary"
        )
    return cv2.aruco.CharucoBoard(board.squares, board.square_mm, board.marker_mm, dictionary)
