"""Scenes that have no closed form, through the path tracer: a ball on a table, a board under a softbox.

What the closed forms leave out is here: the table that a ball mirrors and that
mirrors the ball's light back, and a lamp of finite size that lights paper
more from one side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.render import scene as tracing
from reflectance_fit.render.settings import Settings

from .perspective import BallScene, BoardScene
from .picture import Optics
from .sensor import FloatArray, Sensor

Floats = NDArray[np.float64]

_TABLE, _TABLE_DOWN_DEG = 0.3, 30.0  # albedo of the table, and how far down on it the camera looks
_PAPER, _INK = 0.8, 0.04  # albedo of what boards are printed on and with
_LAMP_MM = 300.0  # from the sample to the softbox
_SPARE = 1.4  # the softbox against what the sample shows of it
_TEXELS = 200  # a square: whole numbers, so that its corners are where they should be
_SAMPLES = 128  # leave a noise of about 1 % where the table is mirrored, as photons do


@dataclass(frozen=True, slots=True, eq=False)
class RoomScene:
    """A scene in closed form, rendered with what is around it.

    The frame is the camera's of `perspective`: x to the right, y down, z
    along the view.
    """

    inner: BallScene | BoardScene

    def image(
        self,
        sensor: Sensor,
        indices: Mapping[str, tuple[float, float]],
        wavelengths_nm: Mapping[str, float],
        optics: Optics,
        seed: int,
    ) -> FloatArray:
        """Stokes vectors where the pixels are, each in its own colour; float32, shape (height, width, 4).

        Parameters
        ----------
        indices : colour to (eta, k)
            Of the sample, relative to vacuum.
        wavelengths_nm : colour to wavelength
        optics : Optics
            Without a wedge.

        Raises
        ------
        ValueError
            For optics with a wedge.
        """
        if optics.wedge_px:
            raise ValueError("a rendered scene is not shifted by a wedge")
        # By falling wavelength, as R, G and B are.
        colours = sorted(indices, key=lambda colour: -wavelengths_nm[colour])
        nm = np.array([wavelengths_nm[colour] for colour in colours])
        eta, k = (np.array([indices[colour][part] for colour in colours]) for part in (0, 1))
        from reflectance_fit.render.run import render  # here, because it loads the tracer

        described = self._scene(sensor, nm, eta, k)
        film = render(described, Settings("polarized", samples=_SAMPLES, seed=seed))
        picture = film.mean.astype(np.float32)
        if optics.blur_px:
            picture = gaussian_filter(picture, optics.blur_px, axes=(0, 1), mode="nearest")
        image = np.empty((*picture.shape[:2], 4), dtype=np.float32)
        for rows, columns, colour, _ in sensor.cell():
            image[rows, columns] = picture[rows, columns, colours.index(colour)]
        return image

    def _scene(self, sensor: Sensor, nm: Floats, eta: Floats, k: Floats) -> tracing.Scene:
        surfaces, light = (
            self._ball(nm, eta, k) if isinstance(self.inner, BallScene) else self._board(nm, eta, k)
        )
        pinhole = self.inner.camera
        middle = ((sensor.width - 1) / 2, (sensor.height - 1) / 2)
        if pinhole.centre_px != middle:
            raise ValueError("the optical axis of a rendered picture is in its middle")
        channels = tuple(float(value) for value in np.resize(nm, 3))
        camera = tracing.Camera(
            position=(0.0, 0.0, 0.0),
            target=(0.0, 0.0, 1.0),
            up=(0.0, -1.0, 0.0),
            size_px=(sensor.width, sensor.height),
            width=float(np.degrees(2.0 * np.arctan(sensor.width / 2 / pinhole.focal_px))),
            channels_nm=(channels[0], channels[1], channels[2]),
        )
        return tracing.Scene(camera, surfaces, (light,), exterior_ior=AIR_INDEX)

    def _ball(self, nm: Floats, eta: Floats, k: Floats) -> tuple[tuple[tracing.Surface, ...], tracing.Light]:
        assert isinstance(self.inner, BallScene)
        down = np.radians(_TABLE_DOWN_DEG)
        up = np.array([0.0, -np.cos(down), -np.sin(down)])
        table = tracing.Plane(_vector(self.inner.centre - up), _vector(up))
        ball = tracing.Sphere(_vector(self.inner.centre), 1.0)
        surfaces = (
            tracing.Surface(ball, _opaque(nm, eta, k)),
            tracing.Surface(table, tracing.Lambertian(tracing.constant(_TABLE))),
        )
        polarization = _polarization(self.inner.light, np.array([0.0, 0.0, 1.0]))
        return surfaces, tracing.ConstantEnvironment(
            tracing.constant(float(self.inner.light[0])), polarization
        )

    def _board(self, nm: Floats, eta: Floats, k: Floats) -> tuple[tuple[tracing.Surface, ...], tracing.Light]:
        assert isinstance(self.inner, BoardScene)
        scene, board = self.inner, self.inner.board
        right, lower, inwards = scene.rotation.T

        def rectangle(x0: float, y0: float, x1: float, y1: float, height: float) -> tracing.Rectangle:
            centre = scene.rotation @ np.array([(x0 + x1) / 2, (y0 + y1) / 2, -height]) + scene.shift_mm
            return tracing.Rectangle(
                _vector(centre), _vector(right * (x1 - x0) / 2), _vector(-lower * (y1 - y0) / 2)
            )

        across, down = board.size_mm
        side_x, side_y = across / board.squares[0], down / board.squares[1]
        paper = rectangle(-side_x, -side_y, across + side_x, down + side_y, 0.0)
        # A hair above the paper, where it is said to lie in the board's plane.
        sample = rectangle(*board.window, max(board.sample_offset_mm, 1e-3))
        surfaces = (
            tracing.Surface(paper, tracing.Lambertian(_print(scene))),
            tracing.Surface(sample, _opaque(nm, eta, k)),
        )
        middle = np.array(sample.center)
        seen = middle / np.linalg.norm(middle)
        mirrored = seen - 2.0 * (seen @ inwards) * inwards
        s_axis = np.cross(seen, inwards)
        lamp = middle + _LAMP_MM * mirrored
        # As large as the sample shows it to the camera's image behind the mirror.
        half = _SPARE * max(board.window_mm) / 2 * (1.0 + _LAMP_MM / float(np.linalg.norm(middle)))
        s_axis = s_axis / np.linalg.norm(s_axis)
        # Its normal, u x v, is towards the sample.
        other = np.cross(-mirrored, s_axis)
        softbox = tracing.Rectangle(_vector(lamp), _vector(half * s_axis), _vector(half * other))
        radiance = tracing.constant(float(scene.light[0]))
        return surfaces, tracing.AreaLight(softbox, radiance, _polarization(scene.light, s_axis))


def _opaque(nm: Floats, eta: Floats, k: Floats) -> tracing.Material:
    """The sample: what enters a dielectric does not come back, as from a blackened rear."""
    order = np.argsort(nm)
    wavelengths = None if len(nm) == 1 else nm[order]
    return tracing.Conductor(
        tracing.Spectrum(eta[order], wavelengths), tracing.Spectrum(k[order], wavelengths)
    )


def _print(scene: BoardScene) -> tracing.Texture:
    """The board's ink on its paper, with a margin as wide as a square."""
    x, y = (
        ((np.arange((count + 2) * _TEXELS) + 0.5) / _TEXELS - 1.0) * extent / count
        for count, extent in zip(scene.board.squares, scene.board.size_mm, strict=True)
    )
    ink = scene.ink(*np.broadcast_arrays(x, y[:, None]))
    return tracing.Texture(np.where(ink, _INK, _PAPER)[..., None])


def _polarization(stokes: Floats, axis: Floats) -> tracing.Polarization:
    s0, s1, s2, s3 = (float(value) for value in stokes)
    return tracing.Polarization((1.0, s1 / s0, s2 / s0, s3 / s0), _vector(axis))


def _vector(values: Floats) -> tracing.Vector:
    return float(values[0]), float(values[1]), float(values[2])
