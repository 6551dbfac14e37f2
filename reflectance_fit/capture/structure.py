"""What a raw file may not be: refused by name before a decoder sees it.

LibRaw opens files whose pixels it then makes up: plain TIFFs, quad-Bayer
sensors, tiles larger than the picture, floats.  Others it decodes well, but
to values that no longer are the sensor's.
"""

from __future__ import annotations

from reflectance_fit.capture.tiff import CFA, JPEG, RawImage, RawTags
from reflectance_fit.errors import Problem, ReflectanceFitError

_UNCOMPRESSED = 1
_OTHER_COMPRESSIONS = {
    8: "Deflate, which LibRaw does not read",
    9: "VC-5, which may be lossy",
    34892: "lossy JPEG",
    52546: "JPEG XL, which may be lossy",
}
_BAYER_REPEAT = (2, 2)
_FILTERS: dict[tuple[int, ...], str] = {(6, 6): "an X-Trans sensor, ", (4, 4): "a quad-Bayer sensor, "}

_CONTAINERS = {
    "empty": "the file is empty; copy it from the camera again",
    "jpeg": "is a JPEG, whose values are not linear; use the camera's raw file",
    "png": "is a PNG and no raw file; use the camera's raw file, or state camera.encoding",
    "bigtiff": "is a BigTIFF, which LibRaw does not read; use the camera's raw file or a DNG below 4 GiB",
    "foveon": "is of a Foveon sensor, whose layers mix colours in every pixel; use a Bayer or monochrome camera",
    "unknown": "has no header of a raw format; use the camera's raw file or a DNG",
}


def check_structure(tags: RawTags, name: str) -> None:
    """Raise ReflectanceFitError, naming the file ``name``, for what LibRaw would misread or could not read."""
    reason = _refusal(tags)
    if reason:
        raise ReflectanceFitError(Problem(name, None, reason))


def _refusal(tags: RawTags) -> str | None:
    if tags.container in _CONTAINERS:
        return _CONTAINERS[tags.container]
    if tags.container == "tiff" and tags.image is None:
        return "is a plain TIFF without a raw image; use the camera's raw file, or state camera.encoding"
    if tags.image is None:
        return None
    image = tags.image
    return (
        _layout_refusal(image)
        or ((_coding_refusal(image) or _pieces_refusal(image)) if tags.dng else None)
        or _cut_refusal(tags, image)
    )


def _layout_refusal(image: RawImage) -> str | None:
    if image.sample_format != 1:
        return "holds floating-point or signed samples; use the integer raw file it was made from"
    if image.small_raw:
        return "is Canon's sRAW or mRAW, interpolated in the camera; photograph in full RAW"
    if image.photometric == CFA and image.cfa_repeat and image.cfa_repeat != _BAYER_REPEAT:
        size, sensor = " x ".join(map(str, image.cfa_repeat)), _FILTERS.get(image.cfa_repeat, "")
        return (
            f"is of {sensor or 'a sensor '}whose colour filters repeat over {size} pixels; "
            "only 2 x 2 (Bayer) sensors and monochrome are read"
        )
    if image.photometric == CFA and image.cfa_layout != 1:
        return "its colour filters are staggered; only rectangular (Bayer) sensors and monochrome are read"
    return None


def _coding_refusal(image: RawImage) -> str | None:
    if image.samples != 1:
        return (
            f"is a linear RGB DNG of {image.samples} samples a pixel, so it was demosaiced; "
            "use the camera's raw file"
        )
    if image.compression not in (_UNCOMPRESSED, JPEG):
        which = _OTHER_COMPRESSIONS.get(image.compression, "not known")
        return f"its compression {image.compression} is {which}; write an uncompressed or lossless DNG"
    if not (len(image.bits) == 1 and 8 <= image.bits[0] <= 16):
        return f"has {image.bits} bits a sample; 8 to 16 are read"
    if image.black is not None and not set(image.black_repeat) <= {1, 2}:
        size = " x ".join(map(str, image.black_repeat))
        return f"its black level repeats over {size} pixels; 1 and 2 are read"
    return None


def _pieces_refusal(image: RawImage) -> str | None:
    """Strips or tiles that cannot hold the picture."""
    if image.tile and (image.tile[0] > image.height or image.tile[1] > image.width):
        return "its tile is larger than the image, which decodes wrongly; write it in strips"
    rows, columns = image.tile or (image.rows_per_strip, image.width)
    needed = -(-image.height // rows) * -(-image.width // columns)
    if len(image.extents) != needed:
        return f"has {len(image.extents)} of {needed} pieces of the picture; copy it from the camera again"
    last_rows = image.height - (needed - 1) * rows if image.tile is None else rows
    heights = [rows] * (needed - 1) + [last_rows]
    if image.compression == _UNCOMPRESSED:
        row_bytes = -(-columns * image.bits[0] // 8)
        short = any(have < h * row_bytes for (_, have), h in zip(image.extents, heights, strict=True))
    else:
        if None in image.jpegs:
            return "a piece of its picture is no JPEG although it says so; copy it from the camera again"
        if not all(jpeg and jpeg.lossless for jpeg in image.jpegs):
            return "its JPEG compression is lossy; write an uncompressed or lossless DNG"
        short = any(jpeg.samples < h * columns for jpeg, h in zip(image.jpegs, heights, strict=False) if jpeg)
    return "its pieces are too short for the picture; copy it from the camera again" if short else None


def _cut_refusal(tags: RawTags, image: RawImage) -> str | None:
    if any(offset + size > tags.size for offset, size in image.extents):
        return f"is cut off at {tags.size} bytes; copy it from the camera again"
    return None
