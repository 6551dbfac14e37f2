"""What moves the corners of boards in several views, and how: the model that a calibration fits.

The parameters are a vector: what all views share (focal length, principal
point, k1, k2, the print's stretch, its bow across and down), then of each view
the board's rotation vector and translation, mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.corners import Corners

FloatArray = NDArray[np.float64]

SHARED, POSE = 8, 6
"""How many parameters all views share, and how many each has."""


def camera_of(parameters: FloatArray) -> Camera:
    """The lens."""
    return Camera(*map(float, parameters[:5]))


def pose_of(parameters: FloatArray, slot: int) -> FloatArray:
    """Rotation vector and translation of one of the views, shape (6,)."""
    first = SHARED + POSE * slot
    return parameters[first : first + POSE]


def rotation_of(pose: FloatArray) -> FloatArray:
    """Of the board into the camera's frame, shape (3, 3)."""
    import cv2

    return np.asarray(cv2.Rodrigues(np.ascontiguousarray(pose[:3]))[0], dtype=np.float64)


def normal_of(pose: FloatArray) -> FloatArray:
    """Of the board, towards the camera, shape (3,): its z axis points into the paper."""
    return -rotation_of(pose)[:, 2]


def carried(
    camera: Camera, board: FloatArray, other: FloatArray, height_mm: float, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where a point above the board that one pose shows at pixels x, y is seen in another; poses of shape (6,)."""
    rays = camera.rays(x, y)
    turn = rotation_of(board)
    # The ray times this length ends on the plane z = -height of the board's frame: z points into the paper.
    normal = turn[:, 2]
    length = (normal @ board[3:] - height_mm) / (rays @ normal)
    places = (rays * length[..., None] - board[3:]) @ turn
    seen = camera.pixels(places @ rotation_of(other).T + other[3:])
    return seen[..., 0], seen[..., 1]


class Bundle:
    """Residuals in standard deviations: corners of all views, then the priors."""

    def __init__(
        self,
        views: Sequence[Corners],
        kept: Sequence[Any],
        places: FloatArray,
        centre: FloatArray,
        prior: FloatArray,
        noise: float,
    ) -> None:
        self._views, self._kept = views, kept
        self._centre, self._prior, self._noise = centre, prior, noise
        middle, half = (places.max(0) + places.min(0)) / 2, np.ptp(places, axis=0)[:2] / 2
        from_middle = places - middle
        # Of each corner, what one unit of stretch and of the two bows moves it by.
        self._places, self._moves = places, np.zeros((len(places), 3, 3))
        self._moves[:, 0, 0] = from_middle[:, 0]
        self._moves[:, 2, 1:] = 1 - (from_middle[:, :2] / half) ** 2

    def residuals(self, parameters: FloatArray) -> FloatArray:
        parts = [
            (self._seen(parameters, slot)[0] - view.xy)[kept].ravel() / self._noise
            for slot, (view, kept) in enumerate(zip(self._views, self._kept, strict=True))
        ]
        return np.concatenate([*parts, (parameters[:SHARED] - self._centre) / self._prior])

    def distances(self, parameters: FloatArray, slot: int) -> FloatArray:
        """How far each corner of a view, outliers included, is from its place; pixels."""
        return np.asarray(
            np.linalg.norm(self._seen(parameters, slot)[0] - self._views[slot].xy, axis=1), dtype=np.float64
        )

    def jacobian(self, parameters: FloatArray) -> FloatArray:
        parts = []
        for slot, kept in enumerate(self._kept):
            _, shared, pose = self._seen(parameters, slot)
            part = np.zeros((2 * int(kept.sum()), len(parameters)))
            part[:, :SHARED] = shared[kept].reshape(-1, SHARED) / self._noise
            first = SHARED + POSE * slot
            part[:, first : first + POSE] = pose[kept].reshape(-1, POSE) / self._noise
            parts.append(part)
        priors = np.zeros((SHARED, len(parameters)))
        priors[:, :SHARED] = np.diag(1 / self._prior)
        return np.concatenate([*parts, priors])

    def _seen(self, parameters: FloatArray, slot: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pixels of a view's corners, shape (N, 2), and their derivatives by what is shared and by the pose."""
        import cv2

        focal, cx, cy, k1, k2 = parameters[:5]
        ids, pose = self._views[slot].ids, np.ascontiguousarray(pose_of(parameters, slot))
        moves = self._moves[ids]
        points = self._places[ids] + moves @ parameters[5:SHARED]
        matrix = np.array([[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]])
        seen, slopes = cv2.projectPoints(points, pose[:3], pose[3:], matrix, np.array([k1, k2, 0.0, 0.0]))
        # Columns of OpenCV: rotation, translation, fx, fy, cx, cy, k1, k2, ...
        slopes = np.asarray(slopes, dtype=np.float64).reshape(len(ids), 2, -1)
        by_points = slopes[:, :, 3:6] @ rotation_of(pose) @ moves
        lens = np.concatenate([slopes[:, :, 6:8].sum(2, keepdims=True), slopes[:, :, 8:12]], axis=2)
        by_shared = np.concatenate([lens, by_points], axis=2)
        return np.asarray(seen, dtype=np.float64).reshape(-1, 2), by_shared, slopes[:, :, :6]
