"""Frames on the disk as plain pixels, so that any part of any frame can be read without decoding the rest."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import Mask
from reflectance_fit.capture.decoding import Progress
from reflectance_fit.capture.frames import Capture, Frame
from reflectance_fit.capture.hot import hot_pixels
from reflectance_fit.capture.pixel_maps import PixelMaps
from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.reduce import FrameMeans, reduce_frame
from reflectance_fit.capture.workers import FrameError, RawWorkers
from reflectance_fit.errors import Problem, ReflectanceFitError


@dataclass(frozen=True, slots=True, eq=False)
class Unpacked:
    """One frame: its pixels in files of numpy's, and the rest.

    ``frame`` has no pixels and no maps.  ``about`` is what the frame says of
    noise and clipping, over no bins.
    """

    frame: RawFrame
    about: FrameMeans
    pixels: Path
    offset: Path | None
    gain: Path | None

    def open(self) -> RawFrame:
        """The frame, its pixels read from the disk as they are asked for."""
        maps = None
        if self.offset or self.gain:
            offset, gain = (None if path is None else _mapped(path) for path in (self.offset, self.gain))
            maps = PixelMaps(offset, gain)
        return replace(self.frame, cfa=_mapped(self.pixels), maps=maps)


@dataclass(frozen=True, slots=True)
class SavedMask:
    """A mask on the disk, for pictures of many megapixels."""

    shape: tuple[int, int]
    bits: Path

    @classmethod
    def of(cls, mask: Mask, path: Path) -> SavedMask:
        """Write ``mask`` to ``path``."""
        np.save(path, mask.bits)
        return cls(mask.shape, path)

    def open(self) -> Mask:
        """The mask, read from the disk as it is asked for."""
        return Mask(self.shape, _mapped(self.bits))


def _mapped(path: Path) -> Any:
    return np.load(path, mmap_mode="r", allow_pickle=False)


def unpack(
    capture: Capture, frames: Iterable[Frame], folder: Path, progress: Progress | None = None
) -> tuple[dict[Path, Unpacked], SavedMask | None]:
    """Decode every file of ``frames`` into ``folder``, apart from this process; and the pixels that are hot in any dark.

    Raises ReflectanceFitError for a file that cannot be read.
    """
    files = {frame.path: frame for frame in frames}
    found: dict[Path, Unpacked] = {}
    hot: Mask | None = None
    with RawWorkers() as workers:
        jobs = (
            (path, unpack_file, (capture.reading, folder, f"{number:04d}", frame.role == "dark"))
            for number, (path, frame) in enumerate(files.items())
        )
        for done, (path, answer) in enumerate(zip(files, workers.map(jobs), strict=True), 1):
            if isinstance(answer, FrameError):
                message = f"{files[path].file} {answer.reason}"
                raise ReflectanceFitError(Problem(str(capture.path), files[path].line, message))
            found[path], own = answer
            hot = hot | own if hot and own else hot or own
            if progress:
                progress("unpacking frames", done, len(files))
    return found, None if hot is None else SavedMask.of(hot, folder / "hot.npy")


def unpack_file(
    path: Path, reading: Reading, folder: Path, name: str, is_dark: bool
) -> tuple[Unpacked, Mask | None]:
    """Decode one file into ``folder``, and find the hot pixels of a dark; what runs inside the decoding worker."""
    frame = read_frame(path, reading)
    pixels = folder / f"{name}.npy"
    np.save(pixels, frame.cfa)
    maps = frame.maps or PixelMaps(None, None)
    hot = hot_pixels(frame) if is_dark else None
    about = reduce_frame(frame, ())
    bare = replace(_smallest_cell(frame), cfa=np.zeros((0, 0), dtype=np.uint16), maps=None)
    # All frames have the same maps, but which is the first of them only the parent knows.
    offset, gain = (
        None if image is None else _saved(folder / f"{name}-{kind}.npy", image)
        for kind, image in (("offset", maps.offset), ("gain", maps.gain))
    )
    return Unpacked(bare, about, pixels, offset, gain), hot


def _saved(path: Path, image: NDArray[np.float32]) -> Path:
    np.save(path, image)
    return path


def _smallest_cell(frame: RawFrame) -> RawFrame:
    """A sensor whose pixels see all alike has a cell of one pixel, whatever the pattern of its levels."""
    if len(frame.planes()) > 1:
        return frame
    return replace(frame, channels=frame.channels[:1, :1], axes_deg=frame.axes_deg[:1, :1])
