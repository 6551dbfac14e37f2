"""A lens and poses that are good enough to start a fit from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.corners import MIN_CORNERS, Corners

FloatArray = NDArray[np.float64]

_GUESS = 1.5  # focal length over the picture's longer side, to start from


def first_camera(views: Sequence[Corners], places: FloatArray, focal_px: float | None) -> Camera:
    """The lens to start from: stated, else by OpenCV with all that is usual held fixed."""
    import cv2

    height, width = views[0].shape
    centre = (width - 1) / 2, (height - 1) / 2
    if focal_px:
        return Camera(focal_px, *centre)
    guess = _GUESS * max(width, height)
    matrix = np.array([[guess, 0.0, centre[0]], [0.0, guess, centre[1]], [0.0, 0.0, 1.0]])
    flags = (
        cv2.CALIB_USE_INTRINSIC_GUESS
        | cv2.CALIB_FIX_PRINCIPAL_POINT
        | cv2.CALIB_FIX_ASPECT_RATIO
        | cv2.CALIB_ZERO_TANGENT_DIST
        | cv2.CALIB_FIX_K1
        | cv2.CALIB_FIX_K2
        | cv2.CALIB_FIX_K3
    )
    _, found, *_ = cv2.calibrateCamera(
        [places[view.ids].astype(np.float32)[:, None] for view in views],
        [view.xy.astype(np.float32)[:, None] for view in views],
        (width, height),
        matrix,
        np.zeros(5),
        flags=flags,
    )
    focal = float(found[0, 0])
    sensible = 0.3 * max(width, height) < focal < 30 * max(width, height)
    return Camera(focal if sensible else guess, *centre)


def first_pose(
    view: Corners, places: FloatArray, camera: Camera
) -> tuple[FloatArray | None, NDArray[np.bool_] | None]:
    """A pose that most corners agree on, and which do; the lens is not known well yet."""
    import cv2

    matrix = np.array([[camera.focal_px, 0, camera.cx], [0, camera.focal_px, camera.cy], [0, 0, 1.0]])
    loose = 0.002 * max(view.shape)
    points, pixels = places[view.ids][:, None], view.xy[:, None]
    good, rotation, translation, found = cv2.solvePnPRansac(
        points, pixels, matrix, None, reprojectionError=loose, iterationsCount=300, flags=cv2.SOLVEPNP_IPPE
    )
    if not good or found is None or len(found) < MIN_CORNERS:
        return None, None
    inliers = np.zeros(len(view.ids), dtype=bool)
    inliers[np.asarray(found).reshape(-1)] = True
    rotation, translation = cv2.solvePnPRefineLM(
        points[inliers], pixels[inliers], matrix, None, rotation, translation
    )
    return np.concatenate([np.reshape(rotation, 3), np.reshape(translation, 3)]), inliers
