"""Scenes as a pinhole camera sees them: each pixel has its own angle and plane of incidence.

Frames, signs and units of light are those of `scenes`.  The incident Stokes
vector is the same in the (s, p) frame of every point.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .camera import Camera, picture_angle
from .scenes import mirrored, rim
from .target import BLACK, SAMPLE, Board, Print

Floats = NDArray[np.float64]

PAPER, INK = 0.05, 0.0025
"""Light that the board scatters, unpolarized, from lamps that its sample does not mirror."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardScene:
    """A board with a flat sample in its window.

    A point X of the board (mm from the top left corner of its squares, x along
    the rows, y down, z into the board) is at ``rotation @ X + shift_mm`` in the
    camera's frame, as OpenCV has it.  The sample's sides, where it stands
    above the board, are black.

    Parameters
    ----------
    camera : Camera
    board : Board
    rotation : float, shape (3, 3)
    shift_mm : float, shape (3,)
    light : float, shape (4,)
    stray : float
        Unpolarized light from beside the board.
    """

    camera: Camera
    board: Board
    rotation: Floats
    shift_mm: Floats
    light: Floats
    stray: float = 0.0
    _print: Print = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_print", Print(self.board))

    def stokes(self, x: ArrayLike, y: ArrayLike, eta: ArrayLike, k: ArrayLike) -> Floats:
        """Stokes vectors at points x, y (broadcast to S) for eta + ik (shape C, vacuum): shape C + S + (4,)."""
        part = self.part(x, y)
        stokes = np.zeros((*np.shape(eta), *part.shape, 4))
        # In the order of the parts that a board has.
        scattered = np.array([self.stray, INK, PAPER, 0.0])[part]
        stokes[..., 0] = scattered
        if self.board.sheen:
            turn = 2.0 * np.pi * self._across(x, y) / self.board.size_mm[0]
            stokes[..., 1] = self.board.sheen * scattered * np.cos(turn)
            stokes[..., 2] = self.board.sheen * scattered * np.sin(turn)
        on = part == SAMPLE
        if on.any():
            at_x, at_y = (np.broadcast_to(z, part.shape)[on] for z in (x, y))
            cosine, s_axis = self._incidence(self.camera.rays(at_x, at_y))
            stokes[..., on, :] = mirrored(cosine, s_axis, self.light, eta, k)
        return stokes

    def incidence(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Angle of incidence, and direction of s in the picture; radians, whatever the point shows."""
        cosine, s_axis = self._incidence(self.camera.rays(x, y))
        return np.arccos(cosine), s_axis

    def ink(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Whether points x, y of the board, mm from the squares' top left corner, are black or under the sample."""
        part = self._print.part(x, y, np.eye(3), np.eye(3))
        return np.asarray((part == BLACK) | (part == SAMPLE))

    @property
    def is_curved(self) -> bool:
        return False

    def part(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
        """Which part is seen at points x, y."""
        return self._print.part(x, y, self._to_plane(0.0), self._to_plane(self.board.sample_offset_mm))

    def _incidence(self, rays: Floats) -> tuple[Floats, Floats]:
        inwards = self.rotation[:, 2]
        return rays @ inwards, picture_angle(rays, np.cross(rays, inwards))

    def _to_plane(self, height: float) -> Floats:
        """The homography from the picture to the plane at this height above the board, mm; shape (3, 3)."""
        camera = -self.rotation.T @ self.shift_mm
        focal, (x, y) = self.camera.focal_px, self.camera.centre_px
        along = self.rotation.T @ np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, focal]])
        # A ray is in the plane at camera + along (-height - camera_z) / along_z.
        return np.asarray(
            (-height - camera[2]) * np.diag([1.0, 1.0, 0.0]) @ along + np.outer([*camera[:2], 1.0], along[2])
        )

    def _across(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """How far to the right on the board points x, y are, mm."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        right, _, depth = ((a * x + b * y + c) for a, b, c in self._to_plane(0.0))
        return np.asarray(right / depth)


@dataclass(frozen=True, slots=True, eq=False)
class BallScene:
    """An opaque ball inside a surround that shines alike from everywhere, from nearby.

    Parameters
    ----------
    camera : Camera
    centre : float, shape (3,)
        Of the ball, in its radii.
    light : float, shape (4,)
        Of the surround: unpolarized or circular.
    """

    camera: Camera
    centre: Floats
    light: Floats

    def stokes(self, x: ArrayLike, y: ArrayLike, eta: ArrayLike, k: ArrayLike) -> Floats:
        """Stokes vectors at points x, y (broadcast to S) for eta + ik (shape C, vacuum): shape C + S + (4,)."""
        rays = self.camera.rays(x, y)
        on = self._miss(rays) < 1.0
        stokes = np.empty((*np.shape(eta), *on.shape, 4))
        stokes[...] = self.light
        stokes[..., on, :] = mirrored(*self._incidence(rays[on]), self.light, eta, k)
        return stokes

    def incidence(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Angle of incidence, and direction of s in the picture; radians, NaN beside the ball."""
        rays = self.camera.rays(x, y)
        on = self._miss(rays) < 1.0
        theta, s_axis = np.full(on.shape, np.nan), np.full(on.shape, np.nan)
        cosine, s_axis[on] = self._incidence(rays[on])
        theta[on] = np.arccos(cosine)
        return theta, s_axis

    @property
    def is_curved(self) -> bool:
        return True

    def part(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
        """Which part is seen, as `rim` counts them."""
        pixel = float(np.linalg.norm(self.centre)) / self.camera.focal_px
        return rim((self._miss(self.camera.rays(x, y)) - 1.0) / pixel)

    def _miss(self, rays: Floats) -> Floats:
        """By how much rays pass beside the centre, in radii."""
        return np.asarray(np.linalg.norm(np.cross(rays, self.centre), axis=-1))

    def _incidence(self, rays: Floats) -> tuple[Floats, Floats]:
        miss = self._miss(rays)
        # The first of the two points at distance 1 from the centre; its normal points from there.
        cosine = np.sqrt((1.0 - miss) * (1.0 + miss))
        normal = rays * (rays @ self.centre - cosine)[..., None] - self.centre
        return cosine, picture_angle(rays, np.cross(rays, normal))
