"""A camera's own maps: the offset of every pixel, and the factor by which it counts less than others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError

Image = NDArray[np.float32]
AnyImage = NDArray[np.integer[Any]] | NDArray[np.floating[Any]]

# A factor this far from the typical pixel's is a dead pixel or another quantity, not a gain.
_FAR = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class PixelMaps:
    """``offset`` in DN takes the place of the black level, ``gain`` multiplies what is above it; shape (h, w) or None.

    ``gain`` is 1 for the median pixel, so DN stay DN whatever unit the map came in.
    """

    offset: Image | None
    gain: Image | None

    def above_black(
        self, dn: NDArray[np.uint16], where: tuple[slice, slice], black: float | NDArray[np.float64]
    ) -> Image:
        """Corrected DN of the pixels ``dn`` at ``where``."""
        level = np.asarray(black, dtype=np.float32) if self.offset is None else self.offset[where]
        counts = dn.astype(np.float32) - level
        return counts if self.gain is None else counts * self.gain[where]


def read_map(path: Path) -> AnyImage:
    """The picture of one map, of whole or floating-point numbers; ReflectanceFitError for what is none."""
    import cv2  # here, for it takes a quarter of a second that other sensors need not pay

    image: NDArray[Any] | None = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise _wrong(str(path), "cannot be read as a picture; give a TIFF file")
    if image.ndim != 2:
        raise _wrong(str(path), "has several samples a pixel; give a picture with one number a pixel")
    return image


def checked_maps(
    offset: AnyImage | None,
    gain: AnyImage | None,
    shape: tuple[int, ...],
    names: tuple[str, str],
) -> PixelMaps:
    """The maps for a picture of ``shape``; ``names`` are those of the two files, for messages.

    Raises ReflectanceFitError for a map that is not of the picture's size, not
    a number everywhere, or a gain that is not above 0 or 10 times the median.
    """
    for image, name in ((offset, names[0]), (gain, names[1])):
        if image is not None and image.shape != shape:
            have, need = (" x ".join(map(str, s[::-1])) for s in (image.shape, shape))
            raise _wrong(
                name, f"is of {have} pixels and the photographs are of {need}; use a map of this setting"
            )
        if image is not None and not np.isfinite(image).all():
            raise _wrong(name, "has pixels that are no numbers; repair them")
    relative = None
    if gain is not None:
        typical = float(np.median(gain))
        if not typical > 0 or gain.min() <= typical / _FAR or gain.max() >= typical * _FAR:
            raise _wrong(
                names[1], f"has factors from {gain.min():g} to {gain.max():g}; is it a map of gains?"
            )
        relative = (gain / typical).astype(np.float32)
    return PixelMaps(None if offset is None else offset.astype(np.float32), relative)


def _wrong(name: str, reason: str) -> ReflectanceFitError:
    return ReflectanceFitError(Problem(str(Path(name)), None, reason))
