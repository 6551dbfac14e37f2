"""Where another photograph of the same view shows the same things: by how much it is shifted and turned.

A polarizer that is turned shifts the picture (its faces are never quite parallel) and
changes the shading by tens of percent.  Pictures are therefore compared without their
shading: as logarithms less their local mean, over their local spread.  What is found moves
the points at which a frame is sampled; its pixels are never resampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, rfft2
from scipy.ndimage import affine_transform

from reflectance_fit.capture.bins import Box, Shift
from reflectance_fit.capture.raw import RawFrame

Picture = NDArray[np.float32]
Motion = Literal["translation", "euclidean"]

LEAST_CORRELATION = 0.9
"""Below this correlation coefficient two pictures do not show the same, or show nothing."""

_LARGEST = 1_000_000  # pixels of a picture that is compared
# Pixels: what is finer is texture, what is coarser is shading, and over how far contrast is evened out.
_SHADING, _CONTRAST = 4.0, 18.0
_SMOOTH = 1.0
_MARGIN = 40  # beside which the local mean takes its pixels from one side only
_BESIDE = 12  # blocks: twice what a local mean reaches
_DARK = 0.02  # of the bright parts: logarithms below it would be those of noise
_FLAT = 0.02  # spread of the logarithm below which there is no texture
_ENOUGH = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-7)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A frame as it is compared: the texture of the means of blocks of ``pitch`` x ``pitch`` sensor pixels."""

    picture: Picture
    pitch: int


@dataclass(frozen=True, slots=True)
class Match:
    """Where a frame shows what another one shows, and the correlation coefficient of the two there."""

    shift: Shift
    correlation: float

    @property
    def found(self) -> bool:
        """Whether the two show the same."""
        return self.correlation > LEAST_CORRELATION


def view_of(frame: RawFrame) -> View:
    """``frame`` as it is compared."""
    blocks, pitch = blocks_of(frame)
    return View(_texture(blocks), pitch)


def blocks_of(frame: RawFrame) -> tuple[Picture, int]:
    """Whole colour cells of ``frame``, as many together as make at most a megapixel: means above black, and their pitch.

    All planes of a cell go into its mean alike, so nothing is interpolated
    between them; frames of one sensor share what their places differ by.
    """
    n = len(frame.channels)
    height, width = frame.cfa.shape
    cells = 1
    while (height // (n * cells)) * (width // (n * cells)) > _LARGEST:
        cells += 1
    pitch = n * cells
    rows, columns = height // pitch, width // pitch
    picture = np.zeros((rows, columns), dtype=np.float32)
    for y in range(pitch):
        for x in range(pitch):
            picture += frame.cfa[y : rows * pitch : pitch, x : columns * pitch : pitch]
    picture /= np.float32(pitch**2)
    picture -= np.float32(frame.black.mean())
    return picture, pitch


def match(first: View, other: View, motion: Motion, sample: Box | None = None) -> Match:
    """Where ``other`` shows what ``first`` shows, in sensor pixels.

    A smooth sample mirrors a lamp: against what is around it, it is brighter
    with one polarization and darker with the other, so its edges are compared
    only where nothing else is found.  ``sample`` are its rows and columns.

    Enhanced correlation (Evangelidis and Psarakis, IEEE TPAMI 30, 1858, 2008)
    of the pictures without shading, from where their cross-correlation is
    largest.  The correlation is 0 where nothing is found.

    Raises ValueError for pictures of different sizes.
    """
    if first.picture.shape != other.picture.shape or first.pitch != other.pitch:
        raise ValueError("the pictures differ in size; use frames of one camera setting")
    one, two = first.picture, other.picture
    margin = min(_MARGIN, *(side // 4 for side in one.shape))
    inside = np.zeros(one.shape, dtype=np.uint8)
    inside[margin:-margin, margin:-margin] = 1
    if sample is not None:
        beside = inside.copy()
        rows, columns = (_blocks(along, first.pitch) for along in sample)
        beside[rows, columns] = 0
        found = _climb(one, two, beside, motion, first.pitch)
        if found.found:
            return found
    return _climb(one, two, inside, motion, first.pitch)


def _blocks(along: slice, pitch: int) -> slice:
    """The blocks that see the sensor pixels ``along``, and what is blurred into them or shifted a little."""
    return slice(max(0, along.start // pitch - _BESIDE), -(-along.stop // pitch) + _BESIDE)


def _climb(one: Picture, two: Picture, inside: NDArray[np.uint8], motion: Motion, pitch: int) -> Match:
    """The largest correlation near where the pictures' cross-correlation is largest."""
    right, down = _seed(one * inside, two * inside)
    kind = cv2.MOTION_TRANSLATION if motion == "translation" else cv2.MOTION_EUCLIDEAN
    warp = np.array([[1.0, 0.0, right], [0.0, 1.0, down], [0.0, 0.0, 1.0]])
    try:
        # It interpolates linearly, which is another blur at each fraction of a pixel and pulls by up to 0.02 of
        # one.  So the picture is moved by a spline to where it was found, and what is left is found once more.
        orders: tuple[Literal[0, 3], ...] = (0, 3)
        for order in orders:  # by whole pixels first, which needs no spline
            start, moved = np.eye(2, 3, dtype=np.float32), _moved(two, warp, order)
            correlation, step = cv2.findTransformECC(one, moved, start, kind, _ENOUGH, inside, 1)
            warp = warp @ np.vstack([step, (0.0, 0.0, 1.0)])
    except cv2.error:  # it does not converge, or the pictures have nothing in common
        return Match(Shift(), 0.0)
    # The first pixel of a block is 0, the block's centre is not.
    centre = (pitch - 1.0) / 2.0
    (a, b, right), (c, d, down) = warp[:2].tolist()
    offset = (
        pitch * right + centre * (1.0 - a - b),
        pitch * down + centre * (1.0 - c - d),
    )
    return Match(Shift(((a, b), (c, d)), offset), max(float(correlation), 0.0))


def _moved(picture: Picture, warp: NDArray[np.float64], order: Literal[0, 3]) -> Picture:
    """What ``picture`` shows at ``warp`` of each place (x, y), by splines of ``order``; edges are repeated."""
    (a, b, right), (c, d, down) = warp[:2].tolist()
    # scipy counts rows first.
    return np.asarray(
        affine_transform(picture, [[d, c], [b, a]], (down, right), order=order, mode="nearest"),
        dtype=np.float32,
    )


def _texture(picture: Picture) -> Picture:
    """The picture without its shading and as contrasty everywhere."""
    bright = max(float(np.percentile(picture, 99)), 1.0)
    logarithm = np.log(np.maximum(picture, 0.0) + np.float32(_DARK * bright))
    texture = logarithm - cv2.GaussianBlur(logarithm, (0, 0), _SHADING)
    spread = np.sqrt(cv2.GaussianBlur(texture**2, (0, 0), _CONTRAST))
    return np.asarray(cv2.GaussianBlur(texture / (spread + np.float32(_FLAT)), (0, 0), _SMOOTH))


def _seed(one: Picture, two: Picture) -> tuple[int, int]:
    """By how many pixels, right and down, ``two`` is shifted, to a pixel.

    Phase correlation weighs all waves alike, most of which are noise, and
    misses by tens of pixels where this does not.
    """
    window = cv2.createHanningWindow(one.shape[::-1], cv2.CV_32F)
    product = rfft2(two * window) * np.conj(rfft2(one * window))
    down, right = np.unravel_index(int(np.argmax(irfft2(product, one.shape))), one.shape)
    height, width = one.shape
    return int((right + width // 2) % width) - width // 2, int((down + height // 2) % height) - height // 2
