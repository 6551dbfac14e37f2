"""The command ``board``: a page to print, and what capture.yaml says of it."""

from __future__ import annotations

from pathlib import Path

from reflectance_fit.capture.board import Board, manifest_text, sheet_mm
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable, write_whole

_ADVICE = (
    "Print at 100 % (no fitting to the page) and glue it to something flat, such as glass.",
    "The bar is 100 mm. Where yours is not, multiply square_mm and marker_mm by its length / 100.",
)


def board_to_file(board: Board, paper: str, out: Path) -> str:
    """Write the page to ``out``, a PDF; returns the text for capture.yaml.

    Raises ReflectanceFitError for a name that does not end in .pdf, and a board
    that does not fit on the paper, or that OpenCV has not the markers for.
    """
    from reflectance_fit.plot.board import board_pdf

    if out.suffix.lower() != ".pdf":
        raise ReflectanceFitError(Problem(str(out), None, "the page is a PDF; give a name that ends in .pdf"))
    sheet = sheet_mm(board, paper)
    check_writable(out.parent)
    text = manifest_text(board)
    page = board_pdf(board.ink_mm(), board.size_mm, sheet, (*_ADVICE, *text.splitlines()))
    write_whole(out, lambda part: part.write_bytes(page))
    return text
