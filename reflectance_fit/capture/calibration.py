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

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.bundle import POSE, SHARED, Bundle, camera_of, normal_of, pose_of
from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.corners import MIN_CORNERS, Corners
from reflectance_fit.capture.first_poses import first_camera, first_pose

FloatArray = NDArray[np.float64]

# One standard deviation each, of what the views do not settle.
STATED_FOCAL = 0.01  # of camera.focal_length_px
CENTRE_SHARE = 0.01  # principal point off the picture's centre, of the picture's width
CORNER_DISTORTION = (0.05, 0.02)  # k1 and k2's part in the picture's corner
PRINT_SCALE = 0.001  # of the print across against down
BOW_MM = 0.1  # of the middle out of the plane of the edges, along each axis

_ROUNDS = 6
_LEAST_NOISE_PX = 0.02
_LEAST_CUT_PX = 0.5  # no corner nearer to its place than this is an outlier


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The fit, over the views that it could use.

    Attributes
    ----------
    camera : Camera
    normals : float, shape (V, 3)
        Of the board, towards the camera, in camera coordinates; NaN for a view that was left out.
    boards : float, shape (V, 6)
        The board's rotation vector and translation (mm) into the camera's frame; NaN likewise.
    noise_px : float
        Standard deviation of a corner's coordinate, raw pixels.
    """

    camera: Camera
    normals: FloatArray
    boards: FloatArray
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
            camera = camera_of(parameters)
            found = []
            for view in used:
                slot = self._slots[view]
                assert slot is not None
                ray = camera.rays(*(np.asarray(value) for value in pixels[view]))
                found.append(math.acos(min(1.0, -float(ray @ normal_of(pose_of(parameters, slot))))))
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
    start = first_camera(views, places, focal_px)
    kept: list[NDArray[np.bool_] | None] = []
    poses: list[FloatArray | None] = []
    for view in views:
        pose, inliers = first_pose(view, places, start)
        poses.append(pose)
        kept.append(inliers)
    shared = np.zeros(SHARED)
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
        fit = Bundle([views[i] for i in used], [kept[i] for i in used], places, centre, prior, noise)
        first = np.concatenate([shared, *(poses[i] for i in used)])
        found = least_squares(fit.residuals, first, jac=fit.jacobian, x_scale="jac", method="lm")
        shared = found.x[:SHARED]
        for slot, i in enumerate(used):
            poses[i] = pose_of(found.x, slot)
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
    normals, boards = np.full((len(views), 3), np.nan), np.full((len(views), POSE), np.nan)
    for slot, i in enumerate(used):
        if kept[i] is not None:
            slots[i] = slot
            boards[i] = pose_of(found.x, slot)
            normals[i] = normal_of(boards[i])
    return Calibration(camera_of(found.x), normals, boards, noise, found.x, covariance, tuple(slots))


def _alike(one: NDArray[np.bool_] | None, other: NDArray[np.bool_] | None) -> bool:
    return one is other is None or (one is not None and other is not None and np.array_equal(one, other))
