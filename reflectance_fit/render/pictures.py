"""Pictures that a scene names, surroundings and textures: EXR, Radiance HDR and PNG, as linear light."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import check_regular
from reflectance_fit.render.scene_spectra import Encoding

Floats = NDArray[np.float64]

MAX_PIXELS = 2**25
MAX_BYTES = 500_000_000
_PNG, _EXR, _HDR = b"\x89PNG\r\n\x1a\n", b"\x76\x2f\x31\x01", b"#?"
_DAMAGED = "is damaged or of a kind that is not read; save it again"


def read_picture(path: Path, shown: str, encoding: Encoding | None) -> Floats:
    """Linear values, shape (height, width, 1 or 3), finite and at 0 or above, row 0 on top.

    EXR and HDR are linear as they stand; of a PNG ``encoding`` says how its values,
    8 or 16 bits, follow light: 1 is the largest.  Known by their first bytes,
    whatever their names.

    Raises ReflectanceFitError, with ``shown`` for the file, for what is no such
    picture, is damaged, has transparency, or is larger than 2^25 pixels.
    """
    check_regular(path, shown)
    try:
        raw = path.read_bytes() if path.stat().st_size <= MAX_BYTES else b""
    except OSError as error:
        raise ReflectanceFitError(Problem(shown, None, f"cannot be read: {error.strerror}")) from error
    try:
        if raw.startswith(_EXR):
            pixels = _exr(path)
        elif raw.startswith((_PNG, _HDR)):
            pixels = _decoded(raw)
        else:
            raise ValueError("is no EXR, HDR or PNG of at most 500 MB; save it as one of these")
        if raw.startswith(_PNG) != (encoding is not None):
            raise ValueError(
                "is a PNG; say encoding: srgb (usual pictures) or encoding: linear"
                if encoding is None
                else "is linear as it stands; remove encoding"
            )
        if not np.all((pixels >= 0) & np.isfinite(pixels)):
            raise ValueError("holds values that are negative or not finite; save it without them")
    except ValueError as error:
        raise ReflectanceFitError(Problem(shown, None, str(error))) from error
    return from_srgb(pixels) if encoding == "srgb" else pixels


def from_srgb(encoded: Floats) -> Floats:
    """Light of encoded values in [0, 1].  Source: IEC 61966-2-1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _checked_size(height: int, width: int) -> None:
    if not (height > 0 and width > 0 and height * width <= MAX_PIXELS):
        raise ValueError(f"has {width} x {height} pixels; {MAX_PIXELS} in all are the most")


def _exr(path: Path) -> Floats:
    import OpenEXR

    try:
        # One file may hold several parts; the first is what viewers show.
        low, high = OpenEXR.File(str(path), header_only=True).header()["dataWindow"]
        _checked_size(int(high[1]) - int(low[1]) + 1, int(high[0]) - int(low[0]) + 1)
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
    except (RuntimeError, TypeError, KeyError) as error:
        raise ValueError(_DAMAGED) from error
    for names in ("RGB", "Y"):
        if all(name in channels for name in names):
            planes = [np.asarray(channels[name].pixels, dtype=float) for name in names]
            if len({plane.shape for plane in planes}) == 1:
                return np.stack(planes, axis=-1)
    raise ValueError("has neither channels R, G and B nor Y, alike in size; save it with them")


def _decoded(raw: bytes) -> Floats:
    import cv2

    if raw.startswith(_PNG):
        width, height = struct.unpack(">II", raw[16:24].ljust(8, b"\0"))
    else:
        found = re.search(rb"\n-Y (\d{1,9}) \+X (\d{1,9})\n", raw[:4096])
        height, width = (int(found[1]), int(found[2])) if found else (0, 0)
    _checked_size(height, width)
    try:
        picture = cv2.imdecode(np.frombuffer(raw, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ValueError(_DAMAGED) from error
    if picture is None or picture.shape[:2] != (height, width):
        raise ValueError(_DAMAGED)
    white = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}.get(picture.dtype, 1.0)
    pixels = np.atleast_3d(np.asarray(picture, dtype=float)) / white
    if pixels.shape[2] not in (1, 3):
        raise ValueError("has transparency; save it without")
    return np.ascontiguousarray(pixels[:, :, ::-1])  # OpenCV has blue first
