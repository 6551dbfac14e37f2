"""How sample, camera and lamp stand in each view of a capture, and what capture.yaml says of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .camera import Camera
from .perspective import BallScene, BoardScene
from .picture import Scene
from .rig import Light
from .room import RoomScene
from .scenes import FlatScene, SphereScene
from .spec import CaptureSpec

Floats = NDArray[np.float64]
Box = tuple[int, int, int, int]

_STRAY = 0.0005
# A flat sample reaches beyond the region that is measured; shares of the frame, on each side.
_SAMPLE, _REGION = 0.02, 0.25
_RADIUS = 0.42  # of the frame's height
_WIDTH = 0.72  # of the frame's, that a board takes
_INSET_PX = 4  # between a window's edge and the region: blur and wedge stay outside
# How well a hand sets up a board: one standard deviation.
_TILT_DEG, _TURN_DEG, _PLACE_MM, _DISTANCE = 0.4, 1.0, 2.0, 0.01
_GEOMETRY_DEG = (15.0, 40.0)  # tilts that show a lens's focal length
_HAND = 98  # the random stream


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One arrangement: its part of capture.yaml's entries, the scene, and the angle at the region's centre."""

    stated: dict[str, Any]
    scene: Scene | RoomScene
    truth: dict[str, float] | None = None


def views(spec: CaptureSpec) -> Iterator[View]:
    """The views of the sample, in the order of ``angles_deg``."""
    light = spec.faults.source(spec.light.stokes())
    if spec.shape == "board":
        yield from _board_views(spec, light)
    elif spec.shape == "flat":
        for stated in spec.angles_deg:
            theta = min(abs(stated + spec.faults.angle_offset_deg), 90.0)
            scene = FlatScene(_frame_less(spec, _SAMPLE), theta, light, spec.s_axis_deg, _STRAY)
            yield View({"theta_deg": stated}, scene)
    elif spec.optics.focal_px is None:
        yield View({}, SphereScene(*ball(spec), light))
    else:
        yield View({}, _around(spec, BallScene(_camera(spec), _ball_centre(spec), light)))


def geometry_scenes(spec: CaptureSpec) -> Iterator[BoardScene]:
    """The board alone, tilted in all directions: what a camera is calibrated from."""
    generator = np.random.default_rng([spec.seed, _HAND, 1])
    for i in range(spec.geometry_views):
        tilt_deg = generator.uniform(*_GEOMETRY_DEG)
        rotation, shift_mm = _placed(spec, tilt_deg, 360.0 * i / spec.geometry_views, generator)
        yield BoardScene(_camera(spec), spec.board, rotation, shift_mm, Light().stokes(), _STRAY)


def region(spec: CaptureSpec) -> Box | None:
    """x0, y0, x1, y1 of the pixels to measure in every frame; None where each frame has its own."""
    if spec.shape == "board":
        return None
    if spec.shape == "flat":
        return _frame_less(spec, _REGION)
    if spec.optics.focal_px is None:
        (x, y), radius = ball(spec)
        return int(x - radius), int(y - radius), int(x + radius) + 2, int(y + radius) + 2
    x0, y0, x1, y1 = silhouette(_camera(spec), _ball_centre(spec))
    return int(x0), int(y0), int(x1) + 2, int(y1) + 2


def ball(spec: CaptureSpec) -> tuple[tuple[float, float], float]:
    """Centre and radius in pixels, as seen from afar; not in the middle, and not on a pixel."""
    sensor = spec.sensor
    return (sensor.width / 2 + 7.3, sensor.height / 2 - 4.6), round(_RADIUS * sensor.height, 1)


def silhouette(camera: Camera, centre: Floats) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of the outline of a ball of radius 1, which is an ellipse."""
    low, high = [], []
    for axis in (0, 1):
        # Planes through the camera and the other axis that touch the ball.
        distance = np.hypot(centre[axis], centre[2])
        middle, half = np.arctan2(centre[axis], centre[2]), np.arcsin(1.0 / distance)
        low.append(camera.centre_px[axis] + camera.focal_px * float(np.tan(middle - half)))
        high.append(camera.centre_px[axis] + camera.focal_px * float(np.tan(middle + half)))
    return low[0], low[1], high[0], high[1]


def _camera(spec: CaptureSpec) -> Camera:
    assert spec.optics.focal_px is not None
    return Camera(spec.optics.focal_px, ((spec.sensor.width - 1) / 2, (spec.sensor.height - 1) / 2))


def _ball_centre(spec: CaptureSpec) -> Floats:
    """In radii, in the camera's frame: seen where a ball from afar would be, about as large."""
    camera, (centre_px, radius_px) = _camera(spec), ball(spec)
    distance = np.hypot(camera.focal_px, radius_px) / radius_px
    return np.asarray(camera.rays(*centre_px) * distance)


def _board_views(spec: CaptureSpec, light: Floats) -> Iterator[View]:
    generator = np.random.default_rng([spec.seed, _HAND])
    for i, tilt_deg in enumerate(spec.angles_deg, 1):
        tilt, turn = generator.normal((tilt_deg, spec.s_axis_deg), (_TILT_DEG, _TURN_DEG))
        rotation, shift_mm = _placed(spec, tilt, turn, generator)
        scene = BoardScene(_camera(spec), spec.board, rotation, shift_mm, light, _STRAY)
        box = _inside_window(scene)
        theta, s_axis = scene.incidence((box[0] + box[2] - 1) / 2, (box[1] + box[3] - 1) / 2)
        truth = {"theta_deg": float(np.degrees(theta)), "s_axis_deg": float(np.degrees(s_axis)) % 180.0}
        # Frames of one tilt have one lamp, and so one gain.
        yield View({"region": list(box), "gain_group": f"tilt {i}"}, _around(spec, scene), truth)


def _around(spec: CaptureSpec, scene: BallScene | BoardScene) -> Scene | RoomScene:
    return RoomScene(scene) if spec.surroundings == "room" else scene


def _placed(
    spec: CaptureSpec, tilt_deg: float, axis_deg: float, generator: np.random.Generator
) -> tuple[Floats, Floats]:
    """A board's rotation and shift: tilted about an axis in the picture, its middle near the optical axis."""
    across, down = spec.board.size_mm
    axis = np.radians(axis_deg)
    tilt = Rotation.from_rotvec(np.radians(tilt_deg) * np.array([np.cos(axis), -np.sin(axis), 0.0]))
    roll = Rotation.from_rotvec([0.0, 0.0, np.radians(generator.normal(0.0, _TURN_DEG))])
    rotation = (tilt * roll).as_matrix()
    distance = _camera(spec).focal_px * across / (_WIDTH * spec.sensor.width)
    place = np.array(
        [
            *generator.normal(0.0, _PLACE_MM, 2),
            distance * generator.normal(1.0, _DISTANCE),
        ]
    )
    return rotation, place - rotation @ np.array([across / 2, down / 2, 0.0])


def _inside_window(scene: BoardScene) -> Box:
    """The largest upright rectangle of the window's shape as seen, about its middle, a little less."""
    x0, y0, x1, y1 = scene.board.window
    height = -scene.board.sample_offset_mm
    corners = np.array([[x0, y0, height], [x1, y0, height], [x1, y1, height], [x0, y1, height]])
    seen = scene.camera.pixels(corners @ scene.rotation.T + scene.shift_mm)
    middle, half = seen.mean(axis=0), np.ptp(seen, axis=0) / 2
    # How far each side of the window is from the middle, against how far a corner of the rectangle reaches to it.
    normal = (np.roll(seen, -1, axis=0) - seen)[:, ::-1] * [1.0, -1.0]
    share = np.abs(np.sum(normal * (seen - middle), axis=1)) / (np.abs(normal) @ half)
    inner = half * min(1.0, float(share.min())) - _INSET_PX
    (left, top), (right, bottom) = np.ceil(middle - inner).astype(int), np.floor(middle + inner).astype(int)
    return int(left), int(top), int(right) + 1, int(bottom) + 1


def _frame_less(spec: CaptureSpec, share: float) -> Box:
    """The frame without a share on each side; whole colour cells only."""
    width, height = spec.sensor.width, spec.sensor.height
    dx, dy = 2 * round(share * width / 2), 2 * round(share * height / 2)
    return dx, dy, width - dx, height - dy
