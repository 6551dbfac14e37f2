"""A pinhole camera: rays of pixels, pixels of points, and directions as the picture shows them.

The camera is at the origin and looks along +z; x points to the right of the
picture, y down.  Lengths are in any one unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Camera:
    """Focal length and principal point, in pixels; whole numbers are pixel centres."""

    focal_px: float
    centre_px: tuple[float, float]

    def rays(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Unit vectors from the camera through the points x, y (broadcast to S), shape S + (3,)."""
        right = (np.asarray(x, dtype=np.float64) - self.centre_px[0]) / self.focal_px
        down = (np.asarray(y, dtype=np.float64) - self.centre_px[1]) / self.focal_px
        right, down = np.broadcast_arrays(right, down)
        length = np.sqrt(right**2 + down**2 + 1.0)
        return np.stack([right / length, down / length, 1.0 / length], axis=-1)

    def pixels(self, points: ArrayLike) -> Floats:
        """Where points in front of the camera are seen, shape (..., 3) to (..., 2)."""
        points = np.asarray(points, dtype=np.float64)
        return np.asarray(self.focal_px * points[..., :2] / points[..., 2:] + self.centre_px)


def picture_angle(rays: Floats, across: Floats) -> Floats:
    """Direction in the picture of vectors ``across`` at right angles to their rays; radians.

    Counter-clockwise from the picture's horizontal as displayed.  Each ray is
    turned into the optical axis the shortest way, as a lens does that keeps
    radial and tangential fields what they are: the double pole coordinates of
    Chipman, Lam and Young, Polarized Light and Optical Systems (2018).

    Notes
    -----
    The shortest turn from unit d to unit z takes v at right angles to d to
    v - (d + z) (z . v) / (1 + d . z).
    """
    share = across[..., 2] / (1.0 + rays[..., 2])
    right = across[..., 0] - rays[..., 0] * share
    down = across[..., 1] - rays[..., 1] * share
    return np.asarray(np.arctan2(-down, right))
