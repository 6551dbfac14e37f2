"""Write raw frames as machine-vision cameras do: 16-bit grey TIFF, nothing but pixels (TIFF 6.0, section 4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.files import write_whole

from .tiff_entries import directory, long, short


def write_tiff(path: Path, pixels: NDArray[np.uint16]) -> None:
    """Write one frame of shape (h, w), in one strip; the file appears complete or not at all."""
    height, width = pixels.shape
    data = np.ascontiguousarray(pixels, dtype="<u2")

    def header(pixels_at: int) -> bytes:
        entries = [
            long(256, width),
            long(257, height),
            short(258, 16),  # BitsPerSample
            short(259, 1),  # Compression: none
            short(262, 1),  # PhotometricInterpretation: 0 is black
            long(273, pixels_at),
            short(277, 1),  # SamplesPerPixel
            long(278, height),  # RowsPerStrip
            long(279, data.nbytes),
        ]
        return b"II*\0\x08\0\0\0" + directory(entries, 8)

    write_whole(path, lambda stage: stage.write_bytes(header(len(header(0))) + data.tobytes()))
