"""Which photographs show one pose of the board, at what angle, and how well that is known."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.calibration import calibrate_views
from reflectance_fit.capture.camera import Camera
from reflectance_fit.capture.corners import MIN_CORNERS, Corners
from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float64]
Name = TypeVar("Name", bound=Hashable)

# A turn of the board by a tenth of a degree shifts corners against each other by more; a polarizer that is
# turned shifts them all alike.
_SAME_VIEW_PX = 1.0
# The prior of angle_offset_deg: views that know less know nothing.
_WORST_DEG = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Poses(Generic[Name]):
    """What the corners say.

    ``normals``, ``boards`` and ``view`` are by photograph: the board's normal towards the
    camera, its rotation vector and translation (mm), and a number alike for those of one pose.  ``rejected`` has the
    reason of every photograph left out.  ``sigma_deg`` is the standard deviation of
    the angle of incidence of each view by its number, apart from
    ``common_sigma_deg``, that of an error which all views share.
    """

    camera: Camera
    normals: dict[Name, tuple[float, float, float]]
    boards: dict[Name, tuple[float, ...]]
    view: dict[Name, int]
    sigma_deg: dict[int, float]
    common_sigma_deg: float
    rejected: dict[Name, str]


def find_poses(
    found: Mapping[Name, Corners],
    sets: Mapping[Name, str],
    middles: Mapping[Name, tuple[float, float]],
    board: Board,
    focal_px: float | None,
) -> Poses[Name]:
    """Poses of all photographs in ``found``.

    Parameters
    ----------
    found : corners by photograph
    sets : the manifest's ``set`` of each; those of different sets are of different views
    middles : x, y of the middle of the sample in the photographs of it, pixels
    board : Board
    focal_px : float or None
        As the manifest states it.

    Raises
    ------
    ReflectanceFitError
        When the views do not settle the angles to half a degree.
    """
    views = _views(found, sets)
    joined = [_joined([found[name] for name in view]) for view in views]
    fit = calibrate_views(joined, board, focal_px)
    rejected = {
        name: "shows a board whose corners do not fit together; is it flat, and in focus?"
        for view, normal in zip(views, fit.normals, strict=True)
        if np.isnan(normal).any()
        for name in view
    }
    height, width = joined[0].shape
    centre = ((width - 1) / 2, (height - 1) / 2)
    pixels = np.array(
        [next((middles[name] for name in view if name in middles), centre) for view in views], dtype=float
    )
    sampled = [
        i for i, view in enumerate(views) if any(name in middles and name not in rejected for name in view)
    ]
    covariance = fit.angle_covariance(pixels)[np.ix_(sampled, sampled)] * math.degrees(1) ** 2
    if len(sampled) and not math.sqrt(np.max(np.diag(covariance))) <= _WORST_DEG:
        raise ReflectanceFitError(
            "the photographs of the board leave the angles uncertain by "
            f"{math.sqrt(np.max(np.diag(covariance))):.1f} deg; add some from other directions "
            "(role: geometry), or state camera.focal_length_px"
        )
    common, own = _common_and_own(covariance)
    return Poses(
        camera=fit.camera,
        normals={
            name: (float(n[0]), float(n[1]), float(n[2]))
            for view, n in zip(views, fit.normals, strict=True)
            for name in view
            if name not in rejected
        },
        boards={
            name: tuple(map(float, board))
            for view, board in zip(views, fit.boards, strict=True)
            for name in view
            if name not in rejected
        },
        view={name: i for i, view in enumerate(views) for name in view},
        sigma_deg=dict(zip(sampled, map(float, own), strict=True)),
        common_sigma_deg=common,
        rejected=rejected,
    )


def _common_and_own(covariance: FloatArray) -> tuple[float, FloatArray]:
    """Standard deviations of one error that all share and of what each has beside it.

    The shared variance is the mean covariance of two views, as far as every view has
    as much; what is left of its own keeps each view's variance what it is.
    """
    variances = np.diag(covariance)
    if len(variances) < 2:
        return 0.0, np.sqrt(variances)
    pairs = covariance[~np.eye(len(variances), dtype=bool)]
    shared = min(max(float(pairs.mean()), 0.0), float(variances.min()))
    return math.sqrt(shared), np.sqrt(variances - shared)


def _views(found: Mapping[Name, Corners], sets: Mapping[Name, str]) -> list[list[Name]]:
    """Photographs by pose, in the order of their first."""
    views: list[list[Name]] = []
    for name, corners in found.items():
        for view in views:
            if sets[view[0]] == sets[name] and _same_view(found[view[0]], corners):
                view.append(name)
                break
        else:
            views.append([name])
    return views


def _same_view(one: Corners, other: Corners) -> bool:
    shift = _shift(one, other)
    if shift is None:
        return False
    _, first, second = np.intersect1d(one.ids, other.ids, assume_unique=True, return_indices=True)
    left = other.xy[second] - one.xy[first] - shift
    # The median: one corner that was found in a wrong place must not part two photographs.
    return bool(np.median(np.hypot(*left.T)) < _SAME_VIEW_PX)


def _shift(one: Corners, other: Corners) -> FloatArray | None:
    """By how much ``other`` is shifted as a whole; None where they have too few corners in common."""
    _, first, second = np.intersect1d(one.ids, other.ids, assume_unique=True, return_indices=True)
    if len(first) < MIN_CORNERS:
        return None
    return np.asarray(np.median(other.xy[second] - one.xy[first], axis=0))


def _joined(frames: Sequence[Corners]) -> Corners:
    """Corners of one pose as those of its first photograph: averaged, each photograph's shift undone."""
    totals: dict[int, list[FloatArray]] = {}
    for frame in frames:
        shift = _shift(frames[0], frame)
        for number, place in zip(frame.ids, frame.xy, strict=True):
            totals.setdefault(int(number), []).append(place - shift)
    ids = sorted(totals)
    return Corners(
        np.array(ids), np.array([np.mean(totals[number], axis=0) for number in ids]), frames[0].shape
    )
