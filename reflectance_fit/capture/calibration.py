"""Where the camera stood: lens, board and poses from the corners of several photographs, with their covariance.

One least-squares fit of everything that moves corners: focal length, principal
point and radial distortion, the pose of the board in each view, and how the
print differs from the board that was meant, unequal scales and a bow.  What
the views do not settle is held by priors, so that the covariance says what is
known and no count of views has to be asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.corners import MIN_CORNERS, Corners

FloatArray = NDArray[np.float64]

# One standard deviation each, of what the views do not settle.
STATED_FOCAL = 0.01  # of camera.focal_length_px
CENTRE_SHARE = 0.01  # principal point off the picture's centre, of the picture's width
CORNER_DISTORTION = (0.05, 0.02)  # k1 and k2's part in the picture's corner
PRINT_SCALE = 0.001  # of the print across against down
BOW_MM = 0.1  # of the middle out of the plane of the edges, along each axis

_GUESS = 1.5  # focal length over the picture's longer side, to start from
_ROUNDS = 6
_LEAST_NOISE_PX = 0.02
_LEAST_CUT_PX = 0.5  # no corner nearer to its place than this is an outlier
_SHARED, _POSE = 8, 6  # f, cx, cy, k1, k2, stretch, bow across, bow down; rotation and translation


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The fit, over the views that it could use.

    Attributes
    ----------
    camera : Camera
    normals : float, shape (V, 3)
        Of the board, towards the camera, in camera coordinates; NaN for a view that was left out.
    noise_px : float
        Standard deviation of a corner's coordinate, raw pixels.
    """

    camera: Camera
    normals: FloatArray
    noise_px: float
    _parameters: FloatArray
    _covariance: FloatArray
    _slots: tuple[int | None, ...]

    def angle_covariance(self, pixels: FloatArray) -> FloatArray:
        """Covariance of the angles of incidence at a pixel of each view, radians^2, shape (V, V).

        ``pixels`` are x, y, shape (V, 2).  NaN for views that were left out.
        """
        used = [view for view, slot in enumerate(self._slots) if slot is not None]

        def angles(parameters: FloatArray) -> FloatArray:
            camera = _camera(parameters)
            found = []
            for view in used:
                slot = self._slots[view]
                assert slot is not None
                ray = camera.rays(*(np.asarray(value) for value in pixels[view]))
                found.append(math.acos(min(1.0, -float(ray @ _normal(_pose(parameters, slot))))))
            return np.array(found)

        step = 1e-3 * np.sqrt(np.diag(self._covariance))
        slopes = np.stack(
            [
                (angles(self._parameters + move) - angles(self._parameters - move)) / (2 * size)
                for size, move in zip(step, np.diag(step), strict=True)
            ],
            axis=-1,
        )
        covariance = np.full((len(self._slots),) * 2, np.nan)
        covariance[np.ix_(used, used)] = slopes @ self._covariance @ slopes.T
        return covariance


def calibrate_views(views: Sequence[Corners], board: Board, focal_px: float | None) -> Calibration:
    """Fit all ``views``, each photographs of one pose with their corners joined.

    Corners that are half a pixel and four standard deviations off are left
    out, and so are views of which fewer than 8 corners or half remain.
    """
    places = board.corners_mm()
    height, width = views[0].shape
    start = _start(views, places, focal_px)
    kept: list[NDArray[np.bool_] | None] = []
    poses: list[FloatArray | None] = []
    for view in views:
        pose, inliers = _first_pose(view, places, start)
        poses.append(pose)
        kept.append(inliers)
    shared = np.zeros(_SHARED)
    shared[:5] = start.focal_px, start.cx, start.cy, start.k1, start.k2
    prior = np.array(
        [
            STATED_FOCAL * focal_px if focal_px else math.inf,
            CENTRE_SHARE * width,
            CENTRE_SHARE * width,
            *(
                share / (math.hypot(width, height) / 2 / start.focal_px) ** power
                for share, power in zip(CORNER_DISTORTION, (2, 4), strict=True)
            ),
            PRINT_SCALE,
            BOW_MM,
            BOW_MM,
        ]
    )
    centre = np.array([focal_px or 0.0, (width - 1) / 2, (height - 1) / 2, *np.zeros(5)])
    noise = 1.0
    for _ in range(_ROUNDS):
        used = [i for i, inliers in enumerate(kept) if inliers is not None]
        fit = _Bundle([views[i] for i in used], [kept[i] for i in used], places, centre, prior, noise)
        first = np.concatenate([shared, *(poses[i] for i in used)])
        found = least_squares(fit.residuals, first, jac=fit.jacobian, x_scale="jac", method="lm")
        shared = found.x[:_SHARED]
        for slot, i in enumerate(used):
            poses[i] = _pose(found.x, slot)
        distances = [fit.distances(found.x, slot) for slot in range(len(used))]
        inside = np.concatenate([d[kept[i]] for d, i in zip(distances, used, strict=True)])
        # Of two normal coordinates, half are within 1.177 standard deviations: no outlier moves that.  What is kept
        # has tails all the same, which count for how well the angles are known.
        middle = max(float(np.median(inside)) / 1.177, _LEAST_NOISE_PX)
        cut = max(_LEAST_CUT_PX, 4 * middle)
        noise_now = max(middle, math.sqrt(float(np.mean(np.square(inside[inside <= cut]))) / 2))
        kept_now = list(kept)
        for d, i in zip(distances, used, strict=True):
            good = d <= cut
            enough = good.sum() >= MIN_CORNERS and 2 * good.sum() >= len(good)
            kept_now[i] = good if enough else None
        settled = math.isclose(noise, noise_now, rel_tol=0.01) and all(map(_alike, kept, kept_now))
        kept, noise = kept_now, noise_now
        if settled or not any(inliers is not None for inliers in kept):
            break
    jacobian = fit.jacobian(found.x)
    covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)
    slots: list[int | None] = [None] * len(views)
    normals = np.full((len(views), 3), np.nan)
    for slot, i in enumerate(used):
        if kept[i] is not None:
            slots[i] = slot
            normals[i] = _normal(_pose(found.x, slot))
    return Calibration(_camera(found.x), normals, noise, found.x, covariance, tuple(slots))


def _alike(one: NDArray[np.bool_] | None, other: NDArray[np.bool_] | None) -> bool:
    return one is other is None or (one is not None and other is not None and np.array_equal(one, other))


def _camera(parameters: FloatArray) -> Camera:
    return Camera(*map(float, parameters[:5]))


def _pose(parameters: FloatArray, slot: int) -> FloatArray:
    first = _SHARED + _POSE * slot
    return parameters[first : first + _POSE]


def _rotation(pose: FloatArray) -> FloatArray:
    import cv2

    return np.asarray(cv2.Rodrigues(np.ascontiguousarray(pose[:3]))[0], dtype=np.float64)


def _normal(pose: FloatArray) -> FloatArray:
    """The board's z axis points into the paper."""
    return -_rotation(pose)[:, 2]


def _start(views: Sequence[Corners], places: FloatArray, focal_px: float | None) -> Camera:
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


def _first_pose(
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


class _Bundle:
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
        return np.concatenate([*parts, (parameters[:_SHARED] - self._centre) / self._prior])

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
            part[:, :_SHARED] = shared[kept].reshape(-1, _SHARED) / self._noise
            first = _SHARED + _POSE * slot
            part[:, first : first + _POSE] = pose[kept].reshape(-1, _POSE) / self._noise
            parts.append(part)
        priors = np.zeros((_SHARED, len(parameters)))
        priors[:, :_SHARED] = np.diag(1 / self._prior)
        return np.concatenate([*parts, priors])

    def _seen(self, parameters: FloatArray, slot: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pixels of a view's corners, shape (N, 2), and their derivatives by what is shared and by the pose."""
        import cv2

        focal, cx, cy, k1, k2 = parameters[:5]
        ids, pose = self._views[slot].ids, np.ascontiguousarray(_pose(parameters, slot))
        moves = self._moves[ids]
        points = self._places[ids] + moves @ parameters[5:_SHARED]
        matrix = np.array([[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]])
        seen, slopes = cv2.projectPoints(points, pose[:3], pose[3:], matrix, np.array([k1, k2, 0.0, 0.0]))
        # Columns of OpenCV: rotation, translation, fx, fy, cx, cy, k1, k2, ...
        slopes = np.asarray(slopes, dtype=np.float64).reshape(len(ids), 2, -1)
        by_points = slopes[:, :, 3:6] @ _rotation(pose) @ moves
        lens = np.concatenate([slopes[:, :, 6:8].sum(2, keepdims=True), slopes[:, :, 8:12]], axis=2)
        by_shared = np.concatenate([lens, by_points], axis=2)
        return np.asarray(seen, dtype=np.float64).reshape(-1, 2), by_shared, slopes[:, :, :6]
