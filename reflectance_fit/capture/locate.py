"""Geometry that photographs have to tell: poses of a board, the outline of a ball, the size of the picture.

A pass over the photographs before they are reduced; each worker returns a few numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.camera import Camera, incidence
from reflectance_fit.capture.corners import corners_in_file
from reflectance_fit.capture.frames import (
    BoardSought,
    Capture,
    Frame,
    Geometry,
    OnBoard,
    Pose,
    Sphere,
    SphereSought,
    Stated,
)
from reflectance_fit.capture.outline import ball_of_outline, joined
from reflectance_fit.capture.poses import Poses, find_poses
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.silhouette import ball_in_file
from reflectance_fit.capture.workers import FrameError, RawWorkers
from reflectance_fit.errors import Problem, ReflectanceFitError

Progress = Callable[[str, int, int], None]
T = TypeVar("T")

# The model averages over a ring to the third moment of its angles.  A region is one ring as far as that goes.
_WIDEST_RING = math.radians(6.0)


def locate(capture: Capture, progress: Progress | None = None) -> tuple[Capture, dict[str, str]]:
    """The capture with its geometry known, and the files that do not show it, with the reason.

    Nothing is read where the manifest says all.  Raises ReflectanceFitError
    when no photograph shows what is sought, or they do not settle the angles.
    """
    geometry = capture.geometry
    if isinstance(geometry, BoardSought):
        return _on_board(capture, geometry.board, geometry.height_mm, progress)
    if isinstance(geometry, SphereSought):
        return _sphere(capture, progress)
    if capture.focal_length_px is not None and isinstance(geometry, Stated | Sphere):
        camera = _camera(capture, capture.focal_length_px)
        found: Geometry = (
            replace(geometry, camera=camera)
            if isinstance(geometry, Stated)
            else ball_of_outline(geometry, camera)
        )
        return replace(capture, geometry=found), {}
    return capture, {}


def _on_board(
    capture: Capture, board: Board, height_mm: float, progress: Progress | None
) -> tuple[Capture, dict[str, str]]:
    board.opencv()  # what is wrong with it is wrong for all photographs
    frames = {frame.path: frame for frame in capture.frames if frame.role in ("sample", "geometry")}
    found, rejected = _look(
        capture, frames.values(), corners_in_file, (board,), "looking for the board", progress
    )
    if not any(frames[path].role == "sample" for path in found):
        raise ReflectanceFitError(
            [
                Problem(str(capture.path), frames[p].line, f"{frames[p].file} {why}")
                for p, why in rejected.items()
            ]
        )
    sizes = {corners.shape for corners in found.values()}
    if len(sizes) > 1:
        raise ReflectanceFitError(
            Problem(str(capture.path), None, "the photographs of the board differ in size; use one camera")
        )
    boxes = {path: frames[path].box(next(iter(sizes))) for path in found if frames[path].role == "sample"}
    try:
        poses = find_poses(
            found,
            {path: frames[path].set for path in found},
            {path: ((x0 + x1 - 1) / 2, (y0 + y1 - 1) / 2) for path, (x0, y0, x1, y1) in boxes.items()},
            board,
            capture.focal_length_px,
        )
    except ReflectanceFitError as error:
        message = "; ".join(p.message for p in error.problems)
        raise ReflectanceFitError(Problem(str(capture.path), None, message)) from error
    rejected |= poses.rejected
    seen = {path: _pose(poses, path, box) for path, box in boxes.items() if path in poses.normals}
    # What all angles share is a nuisance of the fit; where the manifest forbids any, it widens each angle.
    shared = poses.common_sigma_deg if capture.nuisances == {} else 0.0
    updated = tuple(_with_angle(frame, poses, seen, boxes, shared) for frame in capture.frames)
    geometry = OnBoard(poses.camera, seen, poses.common_sigma_deg, height_mm)
    common = {"angle_offset_deg": dict.fromkeys(capture.channels, poses.common_sigma_deg)}
    return (
        replace(capture, geometry=geometry, frames=updated, common_sigmas=capture.common_sigmas | common),
        {frames[path].file: why for path, why in rejected.items()},
    )


def _pose(poses: Poses[Path], path: Path, box: tuple[int, int, int, int]) -> Pose:
    """Rings over what the region spans: its extremes are on its edge, or where it looks along the normal."""
    x0, y0, x1, y1 = box
    x, y = np.meshgrid(np.linspace(x0 - 1, x1, 65), np.linspace(y0 - 1, y1, 65))
    theta, _ = incidence(poses.camera.rays(x, y), np.array(poses.normals[path]))
    low, high = float(theta.min()), min(float(theta.max()), math.pi / 2)
    # Between the points of the mesh an angle may be a little less or more.
    margin = (high - low) / 64
    low, high = max(0.0, low - margin), high + margin
    rings = max(1, math.ceil((high - low) / _WIDEST_RING))
    edges = tuple(float(edge) for edge in np.linspace(low, high, rings + 1))
    return Pose(poses.view[path], poses.normals[path], poses.boards[path], edges)


def _with_angle(
    frame: Frame,
    poses: Poses[Path],
    seen: dict[Path, Pose],
    boxes: dict[Path, tuple[int, int, int, int]],
    shared: float,
) -> Frame:
    """A sample frame with the angle at the middle of its region, and how well it is known."""
    if frame.path not in seen:
        return frame
    x0, y0, x1, y1 = boxes[frame.path]
    ray = poses.camera.rays(np.array((x0 + x1 - 1) / 2), np.array((y0 + y1 - 1) / 2))
    theta, _ = incidence(ray, np.array(seen[frame.path].normal))
    return replace(
        frame,
        theta_deg=math.degrees(float(theta)),
        theta_deg_sigma=math.hypot(poses.sigma_deg[seen[frame.path].view], shared),
    )


def _sphere(capture: Capture, progress: Progress | None) -> tuple[Capture, dict[str, str]]:
    """The ball in the photographs made for it, else in those of the sample."""
    frames = capture.role("geometry") or capture.role("sample")
    found, rejected = _look(capture, frames, ball_in_file, (), "looking for the ball", progress)
    if not found:
        raise ReflectanceFitError(
            [Problem(str(capture.path), f.line, f"{f.file} {rejected[f.path]}") for f in frames]
        )
    outline = joined(list(found.values()))
    camera = None if capture.focal_length_px is None else _centred(capture.focal_length_px, outline.shape)
    # A frame in which the ball is not seen shows it where the others do.
    lost = {f.file: rejected[f.path] for f in frames if f.path in rejected and f.role == "geometry"}
    return replace(capture, geometry=outline.ball(camera)), lost


def _camera(capture: Capture, focal_px: float) -> Camera:
    """The principal point in the middle of the picture, whose size the first sample frame tells that can be read."""
    errors = {}
    for frame in capture.role("sample"):
        found, rejected = _look(capture, [frame], picture_size, (), "", None)
        if found:
            return _centred(focal_px, found[frame.path])
        errors[frame] = rejected[frame.path]
    raise ReflectanceFitError(
        [Problem(str(capture.path), frame.line, f"{frame.file} {why}") for frame, why in errors.items()]
    )


def _centred(focal_px: float, shape: tuple[int, int]) -> Camera:
    return Camera(focal_px, (shape[1] - 1) / 2, (shape[0] - 1) / 2)


def picture_size(path: Path, reading: Reading) -> tuple[int, int]:
    """Height and width of a file's picture, in raw pixels."""
    height, width = read_frame(path, reading).cfa.shape
    return height, width


def _look(
    capture: Capture,
    frames: Iterable[Frame],
    function: Callable[..., T],
    args: tuple[Any, ...],
    what: str,
    progress: Progress | None,
) -> tuple[dict[Path, T], dict[Path, str]]:
    """What ``function`` finds in each file, and why in the others it does not."""
    found: dict[Path, T] = {}
    rejected: dict[Path, str] = {}
    jobs = list(frames)
    with RawWorkers() as workers:
        answers = workers.map((f.path, function, (capture.reading, *args)) for f in jobs)
        for done, (frame, answer) in enumerate(zip(jobs, answers, strict=True), 1):
            if isinstance(answer, FrameError):
                rejected[frame.path] = answer.reason
            else:
                found[frame.path] = answer
            if progress:
                progress(what, done, len(jobs))
    return found, rejected
