"""What a scene is made of, as plain data: shapes, materials, lights and a camera.

World coordinates are right-handed, lengths in any one unit.  Light travels
against the rays that the renderer follows.  Signs and frames of polarized
light are those of docs/conventions.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """A quantity over wavelength.

    Parameters
    ----------
    values : float, shape (1,), (3,) or (N,)
        One number for every wavelength, of a light: white, D65; three without
        ``wavelength_nm``: linear sRGB, of an index: at the camera's channels; else
        the value at each of ``wavelength_nm``, linear in between, held beyond the ends.
    wavelength_nm : float, shape (N,), or None
        Increasing, vacuum.
    """

    values: Floats
    wavelength_nm: Floats | None = None


def constant(value: float) -> Spectrum:
    """The same at every wavelength."""
    return Spectrum(np.array([value]))


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """A picture as a reflectance, laid over a rectangle: linear, shape (height, width, 1 or 3), row 0 at +v, column 0 at -u."""

    pixels: Floats


@dataclass(frozen=True, slots=True)
class Polarization:
    """State of emitted light: a Stokes vector with S0 = 1, and what its S1 refers to.

    S1 = +1 is a field along ``axis``, seen at right angles to the ray; angles
    count counter-clockwise for the receiver.  Along ``axis`` itself no such
    direction exists, and the light there counts as unpolarized.
    """

    stokes: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)

    @property
    def is_polarized(self) -> bool:
        return any(self.stokes[1:])


# ---------------------------------------------------------------- materials


@dataclass(frozen=True, slots=True, eq=False)
class Lambertian:
    """Reflects alike in all directions and depolarizes; two-sided."""

    reflectance: Spectrum | Texture


@dataclass(frozen=True, slots=True, eq=False)
class Dielectric:
    """A transparent interface; ``eta`` relative to vacuum, behind the normal; GGX ``roughness`` alpha, 0: smooth."""

    eta: Spectrum
    roughness: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Conductor:
    """An opaque interface, eta + ik relative to vacuum; GGX ``roughness`` alpha, 0: smooth; two-sided."""

    eta: Spectrum
    k: Spectrum
    roughness: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Plastic:
    """A dielectric coat, smooth or GGX, over a Lambertian base that depolarizes; two-sided."""

    eta: Spectrum
    reflectance: Spectrum
    roughness: float = 0.0


@dataclass(frozen=True, slots=True)
class PolarizerSheet:
    """A thin linear polarizer, on a rectangle or disk; passes straight on.

    ``axis_deg`` is the transmission axis, from the shape's u axis towards its v axis.
    """

    axis_deg: float
    diattenuation: float = 1.0


@dataclass(frozen=True, slots=True)
class RetarderSheet:
    """A thin linear retarder, on a rectangle or disk; ``fast_axis_deg`` from the shape's u axis towards its v axis."""

    fast_axis_deg: float
    retardance_deg: float


Material = Lambertian | Dielectric | Conductor | Plastic | PolarizerSheet | RetarderSheet


# ------------------------------------------------------------------- shapes


@dataclass(frozen=True, slots=True)
class Sphere:
    center: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class Rectangle:
    """``u`` and ``v`` are its half edges, at right angles; its normal is along u x v."""

    center: Vector
    u: Vector
    v: Vector


@dataclass(frozen=True, slots=True)
class Disk:
    """``u`` is a radius; its normal is ``normal``, its v axis normal x u."""

    center: Vector
    normal: Vector
    u: Vector


@dataclass(frozen=True, slots=True)
class Plane:
    """Without end."""

    point: Vector
    normal: Vector


Shape = Sphere | Rectangle | Disk | Plane


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A shape of a material.  Dielectrics lie behind the normal: inside a sphere."""

    shape: Shape
    material: Material
    name: str = ""


# ------------------------------------------------------------------- lights


@dataclass(frozen=True, slots=True, eq=False)
class PointLight:
    """``intensity`` is power per solid angle."""

    position: Vector
    intensity: Spectrum
    polarization: Polarization = Polarization()


@dataclass(frozen=True, slots=True, eq=False)
class DirectionalLight:
    """Light that travels along ``direction``; ``irradiance`` on a plane at right angles to it."""

    direction: Vector
    irradiance: Spectrum
    polarization: Polarization = Polarization()


@dataclass(frozen=True, slots=True, eq=False)
class AreaLight:
    """Equal radiance from the front of a sphere, rectangle or disk, which itself reflects nothing."""

    shape: Sphere | Rectangle | Disk
    radiance: Spectrum
    polarization: Polarization = Polarization()


@dataclass(frozen=True, slots=True, eq=False)
class ConstantEnvironment:
    """Equal radiance from all directions that meet nothing."""

    radiance: Spectrum
    polarization: Polarization = Polarization()


@dataclass(frozen=True, slots=True, eq=False)
class ImageEnvironment:
    """A latitude-longitude picture of the surroundings.

    ``pixels`` are linear sRGB radiance, shape (height, width, 3), row 0 at the
    zenith +z; columns run from azimuth 180 to -180 degrees, azimuth 0 along +x
    and 90 along +y, so that the picture shows what one sees from inside.
    """

    pixels: Floats
    scale: float = 1.0
    polarization: Polarization = Polarization()


Light = PointLight | DirectionalLight | AreaLight | ConstantEnvironment | ImageEnvironment


# ------------------------------------------------------------------- camera


@dataclass(frozen=True, slots=True)
class Camera:
    """Where the picture is taken from, and through what.

    Parameters
    ----------
    position, target : (3,)
        The optical axis goes from one to the other.
    up : (3,)
        Direction that is up in the picture.
    size_px : int, int
        Width and height.
    projection : {"perspective", "orthographic"}
    width : float
        Of what is seen: the horizontal field of view in degrees, or the width
        in scene units of an orthographic picture.
    analyzer_deg : float or None
        Transmission axis of an ideal analyzer before the lens, counter-clockwise
        from the picture's horizontal.
    channels_nm : float, float, float
        Wavelengths that stand for R, G and B where a picture is not spectral;
        ``scalar`` uses the middle one.
    """

    position: Vector
    target: Vector
    up: Vector
    size_px: tuple[int, int]
    projection: Literal["perspective", "orthographic"] = "perspective"
    width: float = 40.0
    analyzer_deg: float | None = None
    channels_nm: tuple[float, float, float] = (600.0, 550.0, 450.0)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that a picture depends on.

    ``exterior_ior`` is the index of what lies between the shapes; ``max_depth``
    the longest path, in rays: 1 shows lights alone, 2 what they light directly.
    """

    camera: Camera
    surfaces: tuple[Surface, ...]
    lights: tuple[Light, ...]
    exterior_ior: float = 1.0
    max_depth: int = 8
