"""Pictures of machine-vision cameras: PNG and TIFF that hold the sensor's own samples, decoded by OpenCV.

The manifest says how the values are encoded, since the files do not: linear
in light, or by the curve of sRGB.  Exposure and ISO are the manifest's too.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.image_headers import read_image_header
from reflectance_fit.errors import Problem, ReflectanceFitError


def decode_samples(path: Path, encoding: str) -> tuple[NDArray[np.uint16], float]:
    """Samples of a PNG or TIFF, and their nominal white.

    Parameters
    ----------
    path : Path
        One unsigned sample a pixel, of 8 or 16 bits.
    encoding : {"linear", "srgb"}
        ``linear``: as recorded.  ``srgb``: the curve undone, 65535 at white.

    Returns
    -------
    samples : uint16, shape (h, w)
        The picture's first row on top, whatever its orientation tag.
    white : float
        The largest sample there can be; black is nominally 0.

    Raises
    ------
    ReflectanceFitError
        Naming the file, for what is no such picture, or is damaged.
    """
    header = read_image_header(path)
    import cv2

    reason = ""
    try:
        samples = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        samples, reason = None, f" ({error.err})"
    dtype = np.uint8 if header.bits == 8 else np.uint16
    if samples is None or samples.shape != header[:2] or samples.dtype != dtype:
        message = f"OpenCV cannot decode it{reason}; copy it from the camera again"
        raise ReflectanceFitError(Problem(str(path), None, message))
    if encoding == "srgb":
        return np.take(_srgb_table(header.bits), np.asarray(samples, dtype=np.intp)), 65535.0
    return np.asarray(samples, dtype=np.uint16), float(2**header.bits - 1)


def _srgb_table(bits: int) -> NDArray[np.uint16]:
    """Light, 65535 at white, of every sample.  Source: IEC 61966-2-1."""
    encoded = np.arange(2**bits) / (2**bits - 1)
    light = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.rint(65535 * light), dtype=np.uint16)
