"""Scenes in closed form: what Stokes vector reaches the camera from each point of the picture.

Points are (x, y) in pixels, x to the right and y down, whole numbers at pixel
centres.  Stokes vectors are in the picture's frame: the first axis is the
picture's horizontal, angles run counter-clockwise as displayed (sensor row 0
on top), which is the receiver's view, so the signs of docs/conventions.md hold
with s replaced by the horizontal.  Light is 1 where a perfect mirror shows the
source.  The sample stands in air and fills its outline whatever its tilt: no
perspective, one angle of incidence for a flat sample.  `perspective` has
boards and balls before a camera nearby.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.mueller import polarizer, reflection, retarder, rotator
from reflectance_fit.physics.stokes import unpolarized

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FlatScene:
    """A flat sample in a rectangle of the picture, a dim surround around it.

    Parameters
    ----------
    outline : x0, y0, x1, y1 in pixels
        The sample covers the pixels x0 <= x < x1, y0 <= y < y1.
    theta_deg : float in [0, 90]
        Angle of incidence.
    light : float, shape (4,)
        Incident Stokes vector in the (s, p) frame.
    s_axis_deg : float
        From the picture's horizontal to the s axis, counter-clockwise.
    stray : float
        Unpolarized light from beside the sample.
    """

    outline: tuple[int, int, int, int]
    theta_deg: float
    light: Floats
    s_axis_deg: float = 0.0
    stray: float = 0.0

    def stokes(self, x: ArrayLike, y: ArrayLike, eta: ArrayLike, k: ArrayLike) -> Floats:
        """Stokes vectors at points x, y (broadcast to S) for eta + ik (shape C, vacuum): shape C + S + (4,)."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        x0, y0, x1, y1 = self.outline
        inside = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
        cos_theta, _ = cos_sin_deg(self.theta_deg)
        reflected = mirrored(cos_theta, np.radians(self.s_axis_deg), self.light, eta, k)
        reflected = np.expand_dims(reflected, tuple(range(np.ndim(eta), np.ndim(eta) + inside.ndim)))
        return np.where(inside[..., None], reflected, self.stray * unpolarized())

    @property
    def is_curved(self) -> bool:
        return False

    def part(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
        """Which part is seen: one for all, because the outline runs between pixels."""
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)), dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class SphereScene:
    """An opaque ball, seen from afar inside a surround that shines alike from everywhere.

    The normal at distance r from the centre is tilted by theta = arcsin(r / R),
    its plane of incidence holds the radius, so s lies along the tangent.
    Beside the ball the camera sees the surround itself, which the rim, all
    grazing reflection, meets without a step.

    Parameters
    ----------
    centre_px : x, y
    radius_px : float
    light : float, shape (4,)
        Stokes vector of the surround, in the (s, p) frame and so the same in
        every frame: unpolarized or circular.
    """

    centre_px: tuple[float, float]
    radius_px: float
    light: Floats

    def __post_init__(self) -> None:
        if self.light[1] != 0.0 or self.light[2] != 0.0:
            raise ValueError(
                "a uniform surround is unpolarized or circular: linear light has no frame of its own"
            )

    def stokes(self, x: ArrayLike, y: ArrayLike, eta: ArrayLike, k: ArrayLike) -> Floats:
        """Stokes vectors at points x, y (broadcast to S) for eta + ik (shape C, vacuum): shape C + S + (4,)."""
        right = np.asarray(x, dtype=np.float64) - self.centre_px[0]
        up = self.centre_px[1] - np.asarray(y, dtype=np.float64)
        r = np.hypot(right, up)
        stokes = np.empty((*np.shape(eta), *r.shape, 4))
        stokes[...] = self.light
        on = r < self.radius_px
        sine = r[on] / self.radius_px
        cosine = np.sqrt((1.0 - sine) * (1.0 + sine))
        s_axis = np.arctan2(up, right)[on] + np.pi / 2
        stokes[..., on, :] = mirrored(cosine, s_axis, self.light, eta, k)
        return stokes

    @property
    def is_curved(self) -> bool:
        return True

    def part(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
        """Which part is seen, as `rim` counts them."""
        right, down = np.asarray(x) - self.centre_px[0], np.asarray(y) - self.centre_px[1]
        return rim(np.hypot(right, down) - self.radius_px)


def rim(beyond_px: Floats) -> NDArray[np.intp]:
    """Parts of a ball at a distance beyond its silhouette: rings near it, where reflection changes within a pixel."""
    # Half a pixel wide, so that every pixel there sees two.
    return np.clip(np.floor(2.0 * beyond_px), -8, 0).astype(np.intp)


def mirrored(cos_theta: ArrayLike, s_axis: ArrayLike, light: Floats, eta: ArrayLike, k: ArrayLike) -> Floats:
    """What a surface in air makes of ``light``, in the picture's frame.

    Parameters
    ----------
    cos_theta, s_axis : float, both broadcast to shape S
        Cosine of the angle of incidence; direction of s in the picture, radians.
    light : float, shape (4,)
        Incident Stokes vector in the (s, p) frame.
    eta, k : float, shape C
        Relative to vacuum.

    Returns
    -------
    float, shape C + S + (4,)
    """
    cos_theta, s_axis = np.broadcast_arrays(cos_theta, s_axis)
    eta, k = (np.expand_dims(z, tuple(range(np.ndim(z), np.ndim(z) + cos_theta.ndim))) for z in (eta, k))
    mirror = reflection(*amplitudes(cos_theta, eta / AIR_INDEX, k / AIR_INDEX))
    # The picture's frame is turned by minus s_axis against the (s, p) frame.
    turned: Floats = (rotator(-s_axis) @ (mirror @ light)[..., None])[..., 0]
    return turned


def analyzer_weights(
    analyzer_deg: float,
    diattenuation: float = 1.0,
    *,
    retarder_deg: float | None = None,
    retardance_deg: float = 90.0,
) -> Floats:
    """The four weights w with which an analyzer turns light into a signal, ``stokes @ w``.

    Parameters
    ----------
    analyzer_deg : float
        Transmission axis in the picture.
    diattenuation : float in [0, 1]
        Below 1 the analyzer leaks; 1/2 of unpolarized light passes in any case.
    retarder_deg : float or None
        Fast axis in the picture of a plate before the analyzer; None for no plate.
    retardance_deg : float
        By how much the plate's slow axis lags.

    Returns
    -------
    float, shape (4,)
        Top row of the optics' Mueller matrix.
    """
    optics = polarizer(np.radians(analyzer_deg), diattenuation)
    if retarder_deg is not None:
        optics = optics @ retarder(np.radians(retarder_deg), np.radians(retardance_deg))
    weights: Floats = optics[0]
    return weights
