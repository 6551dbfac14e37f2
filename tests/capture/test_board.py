"""The printed board: its ink against OpenCV's own picture, its page against a rasteriser."""

import io

import cv2
import numpy as np
import pypdfium2
import pytest
from click.testing import CliRunner

from reflectance_fit.capture.board import PAPERS, Board, manifest_text, sheet_mm
from reflectance_fit.cli.main import cli
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.plot.board import board_pdf
from reflectance_fit.strict_yaml import load

DPI = 600


def raster(page: bytes, dpi: float = DPI) -> np.ndarray:
    document = pypdfium2.PdfDocument(io.BytesIO(page))
    assert len(document) == 1
    return np.asarray(document[0].render(scale=dpi / 72, grayscale=True).to_pil())


@pytest.mark.parametrize(
    "board",
    [Board(), Board((5, 7), 12.0, 9.0, "DICT_4X4_50"), Board((6, 6), 9.0, 5.0, "DICT_6X6_250")],
    ids=lambda b: b.dictionary,
)
def test_the_ink_is_that_of_opencvs_picture(board):
    """Every black cell once: sampled a fiftieth of a square apart, no point differs but those on an edge."""
    step = 50
    width, height = (n * step for n in board.squares)
    drawn = np.zeros((height, width), dtype=int)
    for left, top, w, h in board.ink_mm() * step / board.square_mm:
        columns, rows = (slice(round(a), round(a + b)) for a, b in ((left, w), (top, h)))
        drawn[rows, columns] += 1
    assert drawn.max() == 1
    theirs = board.opencv().generateImage((width, height), marginSize=0) < 128
    different = (drawn == 1) != theirs
    # OpenCV rounds a marker to whole pixels, so its cells' edges are a pixel off.
    assert cv2.erode(different.astype(np.uint8), np.ones((3, 3))).sum() == 0


def test_the_page_is_of_true_scale_and_its_markers_are_found(tmp_path):
    """The corners on the rasterised page are ``square_mm`` apart to a thousandth, along both axes."""
    file = tmp_path / "board.pdf"
    result = CliRunner().invoke(cli, ["board", "-o", str(file)])
    assert result.exit_code == 0, result.output
    picture = raster(file.read_bytes())
    assert picture.shape == tuple(round(mm / 25.4 * DPI) for mm in PAPERS["a4"])
    board = Board()
    corners, ids, _, markers = cv2.aruco.CharucoDetector(board.opencv()).detectBoard(picture)
    assert len(np.reshape(markers, -1)) == 44
    ids = np.reshape(ids, -1)
    assert len(ids) == 70
    found = np.array(corners, dtype=np.float32).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(picture, found, (20, 20), (-1, -1), (3, 50, 1e-4))
    found = np.reshape(found, (-1, 2)) * 25.4 / DPI
    ours = board.corners_mm()[ids][:, :2]
    design = np.column_stack([ours, np.ones(len(ours))])
    fit = np.linalg.lstsq(design, found)[0]
    assert fit[:2] == pytest.approx(np.eye(2), abs=1e-3)
    assert np.abs(design @ fit - found).max() < 0.02


def test_the_bar_is_100_mm(tmp_path):
    file = tmp_path / "board.pdf"
    assert CliRunner().invoke(cli, ["board", "-o", str(file), "--squares", "5x4"]).exit_code == 0
    dark = raster(file.read_bytes()) < 128
    # The bar is the only row with a run of ink that long.
    lengths = [np.diff(np.flatnonzero(np.diff(np.pad(row, 1)))).max(initial=0) for row in dark]
    assert max(lengths) * 25.4 / DPI == pytest.approx(100.0, abs=0.15)


def test_the_printed_lines_are_a_manifests(tmp_path):
    result = CliRunner().invoke(
        cli, ["board", "-o", str(tmp_path / "b.pdf"), "--squares", "7x5", "--square-mm", "12.5"]
    )
    file = tmp_path / "geometry.yaml"
    file.write_text(result.stdout)
    assert load(file).data["geometry"]["charuco"] == {
        "squares": [7, 5], "square_mm": 12.5, "marker_mm": 9.375, "dictionary": "DICT_5X5_100"
    }  # fmt: skip
    page = pypdfium2.PdfDocument(tmp_path / "b.pdf")[0].get_textpage().get_text_range()
    for line in result.stdout.splitlines():
        assert line.strip() in page


@pytest.mark.parametrize("paper", PAPERS)
@pytest.mark.parametrize("upright", [False, True])
def test_nothing_of_the_largest_board_leaves_the_page(paper, upright):
    """The largest square that is accepted leaves a white frame of 5 mm all around."""
    squares = (5, 8) if upright else (8, 5)

    def accepted(side: float) -> bool:
        try:
            sheet_mm(Board(squares, side, 0.75 * side), paper)
        except ReflectanceFitError:
            return False
        return True

    sides = [5 + 0.5 * step for step in range(110)]
    largest = max(side for side in sides if accepted(side))
    assert not accepted(largest + 0.5)
    board = Board(squares, largest, 0.75 * largest)
    page = board_pdf(board.ink_mm(), board.size_mm, sheet_mm(board, paper), ["x" * 92] * 5)
    dark = raster(page, 100) < 200
    edge = int(5 / 25.4 * 100)
    dark[edge:-edge, edge:-edge] = False
    assert not dark.any()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--square-mm", "30"], "does not fit on a4"),
        (["--square-mm", "1"], "too small to print"),
        (["--squares", "20x20", "--square-mm", "5"], "needs 200 markers"),
        (["--dictionary", "DICT_5X5_10"], "did you mean"),
    ],
)
def test_impossible_boards_are_refused(options, says, tmp_path):
    result = CliRunner().invoke(cli, ["board", "-o", str(tmp_path / "b.pdf"), *options])
    assert result.exit_code == 1
    assert says in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("squares", ["11", "2x8", "axb", "8x-3"])
def test_squares_are_two_counts(squares, tmp_path):
    result = CliRunner().invoke(cli, ["board", "-o", str(tmp_path / "b.pdf"), "--squares", squares])
    assert result.exit_code == 2


def test_the_default_is_the_documented_board():
    assert "squares: [11, 8], square_mm: 10, marker_mm: 7.5, dictionary: DICT_5X5_100" in manifest_text(
        Board()
    )


def test_the_same_board_gives_the_same_bytes(tmp_path):
    for name in ("a.pdf", "b.pdf"):
        assert CliRunner().invoke(cli, ["board", "-o", str(tmp_path / name)]).exit_code == 0
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_a_page_has_the_name_of_a_pdf(tmp_path):
    result = CliRunner().invoke(cli, ["board", "-o", str(tmp_path / "board.txt")])
    assert result.exit_code == 1
    assert result.stderr.endswith("the page is a PDF; give a name that ends in .pdf\n")
    assert not list(tmp_path.iterdir())
